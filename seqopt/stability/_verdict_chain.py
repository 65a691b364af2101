"""Whether the steps of a build stand, one after the other: what proves one is tried on the next.

Every answer of a solver is a claim: forces hold a step by
`seqopt.stability.limit_analysis.violation` alone, and a motion makes it fall by `bound` alone. What
is left open is solved as a cone program.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from itertools import chain, islice

import numpy as np

from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly
from seqopt.contact.mortar import Mortar
from seqopt.network.network import GROUND
from seqopt.sequence.steps import Grips
from seqopt.stability._interior_point import approach
from seqopt.stability._prover import Proven, Prover
from seqopt.stability.assessment import bonded
from seqopt.stability.limit_analysis import (
    EXACT,
    Answer,
    Case,
    Claim,
    Compile,
    bound,
    compile_equilibrium,
    violation,
)
from seqopt.work._workers import one_thread

_TIGHT = 0.01 * EXACT  # largest violation of forces that are believed without a cone program
_CLEAR = 10 * EXACT  # least bound of a motion that is
_KEPT = 8  # answers that are tried on steps with more grips
_NEAR = 0.7  # share of all blocks up to which those near what fell take less than all
_MOVES = 1e-2  # of the largest motion, over which a block falls


class Way(Enum):
    """How a verdict was proven."""

    FORCES = "forces"
    EARLIER_FORCES = "earlier forces"
    MOTION = "motion"
    EARLIER_MOTION = "earlier motion"
    CONES = "cone program"


Parts = Callable[[int, Grips], Assembly]
"""Gives partial structures with their grips, as `PartialAssemblies`."""


def judged(assembly: Assembly, case: Case, answer: Answer) -> Proven | None:
    """Return what an answer proves by itself: that z is zero, or positive; None if neither.

    Forces are looked at if the answer says that they need none.
    """
    if answer.value <= _TIGHT and violation(assembly, case, answer) <= _TIGHT:
        return Proven(0.0, 0.0, 0.0, answer)
    proven = bound(assembly, case, answer) if answer.motion.any() else 0.0
    return Proven(proven, proven, np.nan, answer) if proven > _CLEAR else None


class VerdictChain:
    """Proves of one partial structure after the other whether it stands with a mortar.

    Forces and a motion are cached in N, m and rad. Where not the cone program proves a case, z
    is only as good as the answer to whether it is zero.
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
        with one_thread():
            tries = chain(self._known(assembly, held), self._sought(assembly, case))
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
                borne = np.array([grip.get(node, np.zeros(3)) for node in held]).reshape(-1, 3)
                claim = Answer(Claim.SOLVED, 0.0, corner / force, borne / force, still)
                holds.append((claim, Way.EARLIER_FORCES))
        yield from [*holds, *falls] if self._stood else [*falls, *holds]

    def _sought(self, assembly: Assembly, case: Case) -> Iterator[tuple[Answer, Way]]:
        """Yield forces and motions sought for this case: first near what fell last, then in all."""
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
        yield from ((answer, Way.FORCES) for answer in approach(assembly, case))

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
