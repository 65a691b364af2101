"""Whether the steps of a build stand, and by how much: as a table too.

What proves one step is tried on the next. Every answer of a solver is a claim: forces hold a step
by `seqopt.stability.limit_analysis.violation` alone, and a motion makes it fall by `bound` alone.
What is left open is solved as a cone program.
"""

from __future__ import annotations

import pickle
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from enum import Enum
from functools import lru_cache, partial
from itertools import chain, groupby, islice
from operator import attrgetter
from typing import Any

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly, PartialAssemblies
from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.errors import ProblemError, SceneError, SceneWarning, did_you_mean
from seqopt.network.network import GROUND, Network, network_of
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import _find_overlapping
from seqopt.sequence.steps import Grips, Step, require_steps
from seqopt.stability._interior_point import approach
from seqopt.stability.assessment import Stability, _failure, _verdict_of, assess, bonded
from seqopt.stability.limit_analysis import (
    DIRECTIONS,
    EXACT,
    Answer,
    Case,
    Claim,
    Compile,
    Proven,
    Prover,
    bound,
    compile_equilibrium,
    violation,
)
from seqopt.stability.verdict import ASSESSED, Verdict
from seqopt.work import Tell, _one_thread, map_ordered, with_progress, worker_pool

_TIGHT = 0.01 * EXACT  # largest violation of forces that are believed without a cone program
_CLEAR = 10 * EXACT  # least bound of a motion that is
_KEPT = 128  # answers that are tried on steps with more grips
_NEAR = 0.7  # share of all blocks up to which those near what fell take less than all
_MOVES = 1e-2  # of the largest motion, over which a block falls
Parts = Callable[[int, Grips], Assembly]
"""Gives partial structures with their grips, as `PartialAssemblies`."""
_CHUNKS = 3  # for every worker, of neighboring steps, which are proven by one another
_LARGE = 50  # bricks from which on steps are proven one by one, by the grips they have in common
_Find = Callable[[PartialAssemblies, Sequence[Step]], Iterator[Stability]]
_FREE = np.full(DIRECTIONS, np.inf)  # of the empty site, where a take-down ends
_NOTHING = Stability(Verdict.STANDS, "nothing stands", 0.0, 0.0, _FREE, np.pi / 2, grip=0.0)
_unpickled = lru_cache(maxsize=1)(pickle.loads)  # what a worker is sent, the same for all chunks
_TILT = "tilt_survived_deg"
_MARGINS = (
    ("bond_needed_Pa", "bond", "needs {} kPa at most", 1e-3),
    ("friction_needed", "friction", "needs {} at most", 1.0),
    (_TILT, "tilt", "survives {}° at least", 1.0),
    ("largest_grip_force_N", "grip force", "needs {} N at most", 1.0),
)  # in `stability_table`


class Way(Enum):
    """How a verdict was proven."""

    FORCES = "forces"
    EARLIER_FORCES = "earlier forces"
    MOTION = "motion"
    EARLIER_MOTION = "earlier motion"
    CONES = "cone program"


def judged(assembly: Assembly, case: Case, answer: Answer) -> Proven | None:
    """Return what an answer proves by itself: that z is zero, or positive; None if neither."""
    if answer.value <= _TIGHT and violation(assembly, case, answer) <= _TIGHT:
        return Proven(0.0, 0.0, 0.0, answer)
    proven = bound(assembly, case, answer) if answer.motion.any() else 0.0
    return Proven(proven, proven, np.nan, answer) if proven > _CLEAR else None


def _of_grips(force: Mapping[int, Floats], held: Sequence[int]) -> Floats:
    """Return the forces of grips (G, 3) by the nodes that they hold, zero at others."""
    return np.array([force.get(node, np.zeros(3)) for node in held]).reshape(-1, 3)


class VerdictChain:
    """Proves of one partial structure after the other whether it stands with a mortar.

    Where not the cone program proves a case, z says no more than whether it is zero.
    """

    def __init__(
        self, parts: Parts, mortar: Mortar, compiled: Compile = compile_equilibrium
    ) -> None:
        self._parts, self._mortar, self._compile = parts, mortar, compiled
        self._motion: Floats | None = None
        self._stood = False  # the last one, by forces
        self._kept: list[tuple[Floats, dict[int, Floats]]] = []  # of as many corners

    def __call__(self, bricks: int, grips: Grips) -> tuple[Assembly, Proven, Way]:
        """Return a partial structure, its case proven, and how."""
        assembly, held = self._parts(bricks, grips), [n for n in grips if n is not None]
        held += [-1 - i for i in range(len(assembly.payload) - len(held))]  # props
        case = bonded(assembly, self._mortar)
        with _one_thread():
            tries = chain(self._known(assembly, held), self._sought(assembly, case, held))
            each = ((judged(assembly, case, answer), way) for answer, way in tries)
            known = next(((proven, way) for proven, way in each if proven is not None), None)
        proven, way = known or (Prover(assembly, self._compile)(case), Way.CONES)
        if way is Way.FORCES and proven.bound > 0:
            way = Way.MOTION
        self._learn(assembly, proven, held)
        return assembly, proven, way

    def _known(self, assembly: Assembly, held: Sequence[int]) -> Iterator[tuple[Answer, Way]]:
        """Yield earlier forces and motions as claims about a structure, the latest kind first."""
        still, force = np.zeros((len(assembly.centroid), 6)), assembly.scales[0]
        falls, holds = list[tuple[Answer, Way]](), list[tuple[Answer, Way]]()
        if self._motion is not None:  # later blocks rest
            motion, none = still.copy(), (np.zeros((len(assembly.corner), 3)),)
            blocks = min(len(motion), len(self._motion))
            motion[:blocks] = self._motion[:blocks] * np.repeat([1, assembly.scales[1]], 3)
            claim = Answer(Claim.SOLVED, 1.0, *none, np.zeros((len(held), 3)), motion)
            falls.append((claim, Way.EARLIER_MOTION))
        for corner, grip in self._kept:  # with fewer grips: one more bears nothing
            if len(corner) == len(assembly.corner) and grip.keys() <= set(held):
                borne = _of_grips(grip, held) / force
                claim = Answer(Claim.SOLVED, 0.0, corner / force, borne, still)
                holds.append((claim, Way.EARLIER_FORCES))
        yield from [*holds, *falls] if self._stood else [*falls, *holds]

    def _sought(
        self, assembly: Assembly, case: Case, held: Sequence[int]
    ) -> Iterator[tuple[Answer, Way]]:
        """Yield forces and motions sought for this case: first near what fell last, then in all.

        The search in all begins with the forces that held the last structure that stood.
        """
        if self._motion is not None and not self._stood:
            size = np.abs(self._motion).max(axis=1)
            falls = np.ones(len(assembly.centroid), dtype=bool)  # new ones as well
            falls[: len(size)] = size[: len(falls)] > _MOVES * size.max()
            between = assembly.bodies[(assembly.bodies != GROUND).all(axis=1)]
            near = falls.copy()  # and those that touch them
            near[between[falls[between].any(axis=1)].ravel()] = True
            tries = approach(assembly, case, near) if near.mean() <= _NEAR else ()
            for answer in islice(tries, 1, None):
                if answer.value <= _TIGHT:
                    break  # others may fall
                yield answer, Way.FORCES
        last, corners = np.zeros((len(assembly.corner) + len(held), 3)), len(assembly.corner)
        for corner, grip in self._kept[-1:]:
            last[: min(corners, len(corner))] = corner[:corners] / assembly.scales[0]
            last[corners:] = _of_grips(grip, held) / assembly.scales[0]
        yield from ((answer, Way.FORCES) for answer in approach(assembly, case, None, last))

    def _learn(self, assembly: Assembly, proven: Proven, held: Sequence[int]) -> None:
        (force, length), answer = assembly.scales, proven.answer
        self._stood = proven.held <= EXACT
        if self._stood:
            corner = force * answer.contact_force
            grips = dict(zip(held, force * answer.grip_force, strict=True))
            same = [each for each in self._kept if len(each[0]) == len(corner)]
            self._kept = [*same, (corner, grips)][-_KEPT:]
        if proven.bound > EXACT and np.isfinite(answer.motion).all():
            self._motion = answer.motion / np.repeat([1.0, length], 3)


def assess_steps(
    network: Network | Scene,
    steps: Sequence[Step],
    mortar: Mortar | str,
    margins: Collection[str] = (),
    progress: Tell | None = None,
    workers: int | Executor = 1,
) -> tuple[Stability, ...]:
    """Return whether every step stands, and the margins that are asked for.

    Parameters
    ----------
    network, steps, mortar, margins, progress, workers
        As of `seqopt.assess`: a network or scene, and steps that need not follow each other. Any
        executor may share the steps, which the caller ends.

    Returns
    -------
    tuple of Stability

    Raises
    ------
    SceneError, ProblemError
        If bricks that share a joint do not touch, there is no such margin, or cannot be so many
        workers.
    """
    network, steps, asked = network_of(network), require_steps(steps), find_margins(margins)
    if "overlaps" not in network.derived:
        network.derived["overlaps"] = found = [*_find_overlapping(network.scene)]
        for line in found:
            said = f"scene {network.scene.name}: {line}: no verdict sees it"
            warnings.warn(said, SceneWarning, stacklevel=2)
    if not (hasattr(workers, "submit") or (isinstance(workers, int) and workers > 0)):
        raise ProblemError(f"workers is {workers!r}; give a whole number from 1, or an executor")
    shared = (None, workers) if isinstance(workers, int) else (workers, 1)
    each = each_stability(network, steps, find_mortar(mortar), asked, shared=shared)
    told = with_progress("assessing steps", steps, progress)
    return tuple(result for result, _ in zip(each, told, strict=True))


def stability_table(steps: Sequence[Step], results: Sequence[Stability]) -> pd.DataFrame:
    """Return one row per step; an empty cell is a number that is not proven, or not asked for.

    Parameters
    ----------
    steps : sequence of Step
    results : sequence of Stability
        Of the steps.

    Returns
    -------
    pandas.DataFrame
        ``step``, ``type``, ``bricks``, ``verdict``, ``proof``, ``bond_needed_Pa``,
        ``friction_needed``, ``tilt_survived_deg``, ``largest_grip_force_N``, ``first_brick``,
        ``first_joint`` and ``jammed``, as in `seqopt.stability.assessment.Stability`;
        ``almost_solved``, ``stalled`` and ``unproven`` count cases.
    """
    each = zip(steps, results, strict=True)
    return pd.DataFrame([stability_row(step, result) for step, result in each])


def parts_of(built: Network | PartialAssemblies, steps: Sequence[Step]) -> PartialAssemblies:
    """Return the partial structures of steps, those given or cut from as large a whole."""
    most = max((step.bricks for step in steps), default=1) or 1
    return PartialAssemblies(built, most) if isinstance(built, Network) else built


def each_verdict(
    built: Network | PartialAssemblies,
    steps: Sequence[Step],
    mortar: Mortar,
    compiled: Compile = compile_equilibrium,
) -> Iterator[Stability]:
    """Yield the verdict of every step as soon as it is found, without margins, mostly unsolved.

    What is found for one is tried on those that follow, so steps of a build are asked best in their
    order. ``compiled``: makes the programs where that proves nothing.
    """
    prove = VerdictChain(parts_of(built, steps), mortar, compiled)
    found: dict[tuple[int, Grips], Stability] = {}
    for bricks, same in groupby(steps, attrgetter("bricks")):
        group = [*same]
        each = (set(held) for held in zip(*(step.grips for step in group), strict=True))
        common = tuple(held.pop() if len(held) == 1 else None for held in each)
        if bricks > _LARGE and common != group[0].grips:
            prove(bricks, common)  # a trial: forces that hold it hold all of these
        for step in group:
            key = bricks, step.grips
            if not bricks:
                found[key] = _NOTHING
            elif key not in found:
                assembly, proven, way = prove(*key)
                verdict, motion = _verdict_of(proven), np.zeros((len(assembly.centroid), 6))
                unproven = int(verdict is Verdict.UNDECIDED)
                if verdict is Verdict.FALLS:
                    motion = proven.answer.motion
                failure = _failure(assembly, motion)
                found[key] = Stability(verdict, way.value, unproven=unproven, **failure)
            yield found[key]


def step_verdicts(network: Network, steps: Sequence[Step], mortar: Mortar) -> tuple[Verdict, ...]:
    """Return the verdict of every step; of equal partial structures it is asked once."""
    return tuple(found.verdict for found in each_verdict(network, steps, mortar))


def find_margins(asked: Collection[str] | str) -> tuple[str, ...]:
    """Return margins by their names, as of `assess_steps`; text has commas between them."""
    names = tuple(asked.split(",")) if isinstance(asked, str) else tuple(asked)
    for name in names:
        if name not in (*ASSESSED, "all"):
            hint = did_you_mean(str(name), ASSESSED)
            raise SceneError(f"margin {name!r}{hint}: give all, or some of {', '.join(ASSESSED)}")
    return ASSESSED if "all" in names else names


def each_stability(
    built: Network | PartialAssemblies,
    steps: Sequence[Step],
    mortar: Mortar,
    margins: tuple[str, ...] = (),
    shared: tuple[Executor | None, int] = (None, 1),
) -> Iterator[Stability]:
    """Yield what `assess_steps` returns, as soon as it is found.

    ``shared``: executor and workers.
    """
    find = partial(_each, mortar=mortar, margins=margins)
    parts = parts_of(built, steps)
    with worker_pool(*shared) as pool:
        if pool is None:
            yield from find(parts, steps)
            return
        size = -(-len(steps) // (_CHUNKS * pool.workers)) or 1
        chunks = [tuple(steps[i : i + size]) for i in range(0, len(steps), size)]
        for found in map_ordered(partial(_in_worker, pickle.dumps(parts), find), chunks, pool):
            yield from found


def _in_worker(parts: bytes, find: _Find, steps: Sequence[Step]) -> tuple[Stability, ...]:
    return tuple(find(_unpickled(parts), steps))


def _each(
    parts: PartialAssemblies, steps: Sequence[Step], mortar: Mortar, margins: tuple[str, ...]
) -> Iterator[Stability]:
    """Yield the verdicts of steps, with margins if any are asked for."""
    up = parts.network.scene.up
    for step, found in zip(steps, each_verdict(parts, steps, mortar), strict=True):
        if not margins or not step.bricks:
            yield found
            continue
        whole = assess(parts(step.bricks, step.grips), mortar, up, margins=margins)
        yield replace(whole, verdict=found.verdict, proof=found.proof)


def stability_row(step: Step, result: Stability) -> dict[str, object]:
    """Return the row of a step in `stability_table`."""
    return {
        "step": step.number,
        "type": step.kind.value,
        "bricks": step.bricks,
        "verdict": result.verdict.value,
        "proof": result.proof,
        "bond_needed_Pa": result.bond,
        "friction_needed": result.friction,
        "tilt_survived_deg": float(np.degrees(result.tilt)),
        "largest_grip_force_N": result.grip,
        "first_brick": result.first_block,
        "first_joint": result.first_contact,
        "jammed": result.jammed,
        "almost_solved": result.claims.get(Claim.ALMOST, 0),
        "stalled": result.claims.get(Claim.STALLED, 0),
        "unproven": result.unproven,
    }


def format_rows(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return in a line how many steps stand, fall and are undecided, and what proved it.

    ``rows``: as of `stability_row`.
    """
    found, proofs = (Counter(row[name] for row in rows) for name in ("verdict", "proof"))
    each = zip(Verdict, ("stand", "do not stand", "are undecided"), strict=True)
    said = ", ".join(f"{found[verdict.value]} {word}" for verdict, word in each)
    jammed = sum(bool(row["jammed"]) for row in rows)
    said += f" ({jammed} only jammed: do not trust these)" if jammed else ""
    by = ", ".join(f"{count} by {proof}" for proof, count in proofs.most_common())
    unproven = sum(row["unproven"] for row in rows)
    ends = f"; {unproven} cases unproven" if unproven else ""
    for column, name, words, scale in _MARGINS:  # of the worst step
        values = np.array([row[column] for row in rows], dtype=float)
        if np.isnan(values).all():
            continue
        worst = int(np.nanargmin(values) if column == _TILT else np.nanargmax(values))
        value = words.format(f"{values[worst] * scale:.4g}")
        value = value if np.isfinite(values[worst]) else "no value is enough"
        if column == _TILT and found[Verdict.FALLS.value]:  # others survive none
            value = f"steps that stand {value.replace('survives', 'survive')}"
        lacks = int(np.isnan(values).sum()) - (column == _TILT) * found[Verdict.FALLS.value]
        more = f", not known of {lacks} steps" * (lacks > 0)
        ends += f"; {name}: {value} (step {rows[worst]['step']}{more})"
    return f"{len(rows)} steps: {said}; proven {by}{ends}"
