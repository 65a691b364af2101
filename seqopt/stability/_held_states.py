"""Brackets of z for any grip sets of a partial structure, solved where no known proof decides.

Forces that hold a structure hold it with more grips, larger payloads, or without a grip that they
leave idle. A motion in which it falls makes it fall with any grips whose payloads can take up less
work than the loads do in it: with all, if none of their nodes moves. Neither asks a solver.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import _applied_rows, _prop_grips, bare_assembly
from seqopt.errors import plugins
from seqopt.network.network import Network
from seqopt.stability.limit_analysis import (
    CAP,
    LARGEST_FORCE,
    ROUNDING,
    Answer,
    Case,
    Sense,
    contact_work,
    is_finite,
    violation,
)

Enough = Callable[[Answer], bool]
"""Says whether an answer proves what is asked, or the program must be refined."""

HeldProgram = Callable[[Floats, Enough], Answer]
"""A case of one assembly, solved for the payloads (N) of all its grips; none for one not held.

Where no forces exist, the answer claims that, has no value and a motion that says why.
"""

CompileHeld = Callable[[Assembly, Case], HeldProgram]
"""Makes the program of an assembly, whose grips are all that may ever be held, and a case."""


def compile_held(assembly: Assembly, case: Case) -> HeldProgram:
    """Return the registered linear program (entry points ``seqopt.limit_analysis``)."""
    compiled: CompileHeld = plugins("seqopt.limit_analysis")["lp"].load()
    return compiled(assembly, case)


_TIGHT = 1e-8  # largest violation of forces that prove, over the force scale and max(1, z)
_IDLE = 1e-10  # a grip's force treated as zero, over the force scale


class _FallingMotion(NamedTuple):
    """A motion of the blocks, and what counts for any grips.

    ``work``, ``growth``: of the loads, less what contacts take up, and its growth with z;
    ``closing``: by which contacts close, weighted by the largest corner force; ``speed`` (G + 1,):
    of every node, and of none.
    """

    work: float
    growth: float
    closing: float
    speed: Floats


class _Known:
    """What is proven of one structure, with all grips that may ever be held, and case."""

    def __init__(self, assembly: Assembly, case: Case) -> None:
        self._assembly, self._case = assembly, case
        # z of forces in equilibrium, and what every grip exerts (G,), over the force scale
        self._forces: list[tuple[float, Floats]] = []
        self._motions: list[_FallingMotion] = []

    def bracket(self, places: Ints, payload: Floats) -> Floats:
        """Return between which values z is proven to lie.

        ``places`` (S, r): grips of the assembly that are held, from 0; as many as it has for none.
        ``payload`` (S, r): of those that hold them, N; zero for none. Result (S, 2): the least z
        that suffices is no smaller and no larger; of a largest z, the one proven to be survived
        (less than none, if nothing is) and the one that is not exceeded.
        """
        nothing = (0.0, np.inf) if self._case.sense is Sense.SMALLEST else (-np.inf, CAP)
        return self.tightened(np.tile(nothing, (len(places), 1)), places, payload)

    def learn(self, answer: Answer, held: Floats) -> _Known:
        """Keep what an answer proves by itself; a solver's claim is not believed. Return itself.

        A motion that proves nothing with these grips proves no more with fewer.

        ``held`` (G,): payload of every grip for which it was found, N; zero for one not held.
        """
        assembly, case, motion = self._assembly, self._case, answer.motion
        size = np.abs(motion).max(initial=0.0)
        if motion.shape == (len(assembly.centroid), 6) and 0 < size < np.inf:
            flat = np.ldexp(motion, -np.frexp(size)[1]).ravel()
            ((low, _), (high, _)), opening = contact_work(assembly, case, flat, (0.0, 1.0))
            by_load, by_growth = (float(load @ flat) for load in case.loads(assembly))
            work, growth = by_load - low, by_growth - (high - low)
            if work > ROUNDING if case.sense is Sense.SMALLEST else growth > 0:
                closing = LARGEST_FORCE * float(np.maximum(-opening, 0).sum())
                speed = np.linalg.norm((assembly.grip_map.T @ flat).reshape(-1, 3), axis=1)
                self._motions.append(_FallingMotion(work, growth, closing, np.append(speed, 0.0)))
        if is_finite(assembly, answer):  # forces hold by the assembly's own data
            needed, value = np.linalg.norm(answer.grip_force, axis=1), max(answer.value, 0.0)
            needed[needed <= _IDLE] = 0.0
            grip = np.where(needed[:, None] > 0, answer.grip_force, 0.0)
            clean = replace(answer, value=value, grip_force=grip)
            tight = violation(assembly, case, clean, held) <= _TIGHT * max(1.0, value)
            if tight and not grip[held <= 0].any():
                self._forces.append((value, needed))
        return self

    def tightened(self, bracket: Floats, places: Ints, payload: Floats) -> Floats:
        """Return brackets (S, 2) no wider than others, by what is known here; see `bracket`."""
        out, smallest = bracket.copy(), self._case.sense is Sense.SMALLEST
        forced, moved = out[:, int(smallest)], out[:, int(not smallest)]
        of_forces, of_motion = (np.minimum, np.maximum) if smallest else (np.maximum, np.minimum)
        own, common = self._case.payload
        for value, needed in self._forces:
            most = own * payload / self._assembly.scales[0] + value * common * (payload > 0)
            holds = np.ones(len(places), dtype=bool)  # the grips can exert these forces
            for grip in np.flatnonzero(needed).tolist():
                enough = most >= needed[grip] - _TIGHT * max(1.0, value)
                holds &= ((places == grip) & (payload > 0) & enough).any(axis=1)
            forced[holds] = of_forces(forced[holds], value)
        for motion in self._motions:
            of_motion(moved, self._proven_by(motion, places, payload), out=moved)
        return out

    def _proven_by(self, motion: _FallingMotion, places: Ints, payload: Floats) -> Floats:
        """Return the value of z that a motion proves for every row."""
        own, common = self._case.payload
        force = self._assembly.scales[0]
        loads, more = self._case.amounts(self._assembly)
        speed = motion.speed[places]
        work = motion.work - own * (payload * speed).sum(axis=1) / force
        work -= motion.closing * (loads + payload.sum(axis=1)) / force
        growth = motion.growth - common * (speed * (payload > 0)).sum(axis=1)
        growth -= motion.closing * more / force
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(work / growth)
        if self._case.sense is Sense.SMALLEST:
            value = np.where(growth < 0, np.minimum(ratio, CAP), CAP)
            return np.where(work > ROUNDING, value, 0.0)
        value = np.where(work > 0, 0.0, np.minimum(ratio, CAP))
        return np.where(growth > 0, value, CAP)


_Settled = Callable[[Floats], Bools]
"""Says which brackets (S, 2) are narrow enough."""


def node_assembly(network: Network, bricks: int, *, held: bool = True) -> Assembly:
    """Return a partial structure with a grip without payload at every inner node.

    ``held``: whether a robot holds any of these, so that props hold.
    """
    bare = bare_assembly(network, bricks)
    nodes, props = network.inner[:bricks].ravel(), _prop_grips(network, bricks, held=held)
    line = np.zeros((len(nodes) if props.line.any() else 0, 3))
    if len(line):
        numbers = network.scene.placed_nodes
        line[[numbers.index(node) for node in props.nodes]] = props.line
    return replace(
        bare,
        applied=_applied_rows(network, bricks, props),
        grip_line=line,
        grip_block=np.repeat(np.arange(bricks), 2),
        grip_position=network.node_position[nodes],
        payload=np.zeros(len(nodes)),
    )


class HeldStates:
    """One question about one structure, asked of any number of grip sets.

    ``assembly``: its grips are all that may ever be held; ``case``: what is bracketed; ``easier``:
    what a program is asked before that, as forces for a z of zero; ``earlier``: answers to other
    cases of the same assembly, with the payloads they were found for; what they prove here for a z
    of zero is known, and new ones join them; ``known``: what is proven so far; ``solved``: how many
    times the program was called.
    """

    def __init__(
        self,
        assembly: Assembly,
        case: Case,
        compiled: CompileHeld,
        easier: Case | None = None,
        earlier: list[tuple[Answer, Floats]] | None = None,
    ) -> None:
        self.assembly, self._case, self._compile = assembly, case, compiled
        self._asked = [case] if easier is None else [easier, case]
        self._programs: list[HeldProgram] = []
        self.known = _Known(assembly, case)
        self._tried: set[tuple[bytes, float]] = set()
        self.solved = 0
        self._answers = earlier
        for answer, held in earlier or ():
            self.known.learn(replace(answer, value=0.0), held)

    def bracket(
        self, places: Ints, payload: Floats, settled: _Settled, wanted: float = 0.0
    ) -> Floats:
        """Return proven brackets of z, as narrow as needed where the solver's answers allow it.

        ``settled``: says which are narrow enough; ``wanted``: a number for it: what is left open
        for one is asked again for another. The others, and the result: as of
        `seqopt.stability._held_states._Known.bracket`.
        """
        out = self.known.bracket(places, payload)
        open_ = ~settled(out)
        for row in np.argsort((payload > 0).sum(axis=1), kind="stable").tolist():
            if not open_[row]:
                continue
            held = np.zeros(len(self.assembly.payload) + 1)  # payload of every grip, and of none
            np.maximum.at(held, places[row], payload[row])
            key, rows = (held[:-1].tobytes(), wanted), np.flatnonzero(open_)
            if key not in self._tried:
                self._tried.add(key)
                new = self._solve(held[:-1], settled)
                out[rows] = new.tightened(out[rows], places[rows], payload[rows])
                open_[rows] = ~settled(out[rows])
            open_[row] = False
        return out

    def _solve(self, held: Floats, settled: _Settled) -> _Known:
        """Return what answers prove for those grips."""
        places, payload = np.flatnonzero(held)[None], held[held > 0][None]
        alone = partial(_Known, self.assembly, self._case)
        new = alone()

        def enough(answer: Answer) -> bool:
            return bool(settled(alone().learn(answer, held).bracket(places, payload))[0])

        for i in range(len(self._asked)):
            if i == len(self._programs):
                self._programs.append(self._compile(self.assembly, self._asked[i]))
            self.solved += 1
            answer = self._programs[i](held, enough)
            if self._answers is not None:
                self._answers.append((answer, held))
            self.known.learn(answer, held)
            if settled(new.learn(answer, held).bracket(places, payload))[0]:
                break
        return new
