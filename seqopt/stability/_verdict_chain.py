"""Whether the steps of a build stand, one after the other: what proves one is tried on the next.

Every answer of a solver is a claim: forces hold a step by
`seqopt.stability.limit_analysis.violation` alone, and a motion makes it fall by `bound` alone. What
is left open is solved as a cone program.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from itertools import islice

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.assembly import Assembly
from seqopt.contact.mortar import Mortar
from seqopt.network.network import GROUND
from seqopt.sequence.steps import Grips
from seqopt.stability._interior_point import Changing, Sought, approach, approach_all
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
from seqopt.work._threads import one_thread

_TIGHT = 0.01 * EXACT  # largest violation of forces that are believed without a cone program
_CLEAR = 10 * EXACT  # least bound of a motion that is
_KEPT = 8  # answers that are tried on steps with more grips
_NEAR = 0.7  # share of all blocks up to which those near a change take less than all
_BESIDE = 2  # contacts from where something changes, within which all may
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


_State = tuple[int, Grips]
_Tried = tuple[Proven | None, Way]


def _first(tries: Iterator[_Tried]) -> tuple[Proven, Way] | None:
    """Return the first try that proves something."""
    return next(((proven, way) for proven, way in tries if proven is not None), None)


def _labeled(proven: Proven | None, way: Way) -> _Tried:
    """Return what is proven and how: in a way if by forces."""
    return proven, Way.MOTION if proven is not None and proven.bound > 0 else way


class VerdictChain:
    """Proves of one partial structure after the other whether it stands with a mortar.

    Forces and a motion are cached in N, m and rad. Where not the cone program proves a case, z
    is only as good as the answer to whether it is zero.
    What is sought is sought near what has changed first.
    """

    def __init__(
        self, parts: Parts, mortar: Mortar, compiled: Compile = compile_equilibrium
    ) -> None:
        self._parts, self._mortar, self._compile = parts, mortar, compiled
        self._corner_force: Floats | None = None
        self._motion: Floats | None = None
        self._stood = False  # the last one, by forces
        self._blocks = 0  # that stood
        self._bore = np.zeros(0, dtype=np.int64)  # blocks whose grips bore something then
        self._kept: list[tuple[Floats, dict[int, Floats]]] = []  # of as many corners
        self._found: dict[_State, Proven] = {}

    def __call__(
        self, bricks: int, grips: Grips, before: Callable[[], object] | None = None
    ) -> tuple[Assembly, Proven, Way]:
        """Return a partial structure, its case proven, and how.

        ``before``: called where nothing that was found proves it; it may find more.
        """
        assembly, held = self._parts(bricks, grips), [n for n in grips if n is not None]
        held += [-1 - i for i in range(len(assembly.payload) - len(held))]  # props
        case = bonded(assembly, self._mortar)
        with one_thread():
            known = _first(self._known((bricks, grips), assembly, case, held))
            if known is None and before is not None:
                before()
                known = _first(self._known((bricks, grips), assembly, case, held))
            known = known or _first(self._sought(assembly, case))
        proven, way = known or (Prover(assembly, self._compile)(case), Way.CONES)
        self._learn(assembly, proven, held)
        return assembly, proven, way

    def search(self, states: Sequence[_State]) -> None:
        """Prefetch proofs for several cases, solved as one batch."""
        assemblies = [self._parts(*state) for state in states]
        pairs = [(assembly, bonded(assembly, self._mortar)) for assembly in assemblies]
        sought = [Sought(*pair) for pair in pairs]
        done = np.zeros(len(states), dtype=bool)
        for answers in approach_all(sought, done):
            for number, answer in answers:
                proven = judged(*pairs[number], answer)
                if proven is not None:
                    self._found[states[number]], done[number] = proven, True

    def _known(
        self, state: _State, assembly: Assembly, case: Case, held: Sequence[int]
    ) -> Iterator[_Tried]:
        """Yield the prefetched proof, or those by earlier forces and motions, the latest first."""
        yield _labeled(self._found.pop(state, None), Way.FORCES)
        still, force = np.zeros((len(assembly.centroid), 6)), assembly.scales[0]
        falls, holds = list[Answer](), list[Answer]()
        if self._motion is not None:  # later blocks rest
            motion, none = (
                still.copy(),
                (np.zeros((len(assembly.corner), 3)), np.zeros((len(held), 3))),
            )
            blocks = min(len(motion), len(self._motion))
            motion[:blocks] = self._motion[:blocks] * np.repeat([1, assembly.scales[1]], 3)
            falls.append(Answer(Claim.SOLVED, 1.0, *none, motion))
        for corner, grip in self._kept:  # with fewer grips: one more bears nothing
            if len(corner) == len(assembly.corner) and grip.keys() <= set(held):
                borne = np.array([grip.get(node, np.zeros(3)) for node in held]).reshape(-1, 3)
                holds.append(Answer(Claim.SOLVED, 0.0, corner / force, borne / force, still))
        ways = [(falls, Way.EARLIER_MOTION), (holds, Way.EARLIER_FORCES)]
        for claims, way in reversed(ways) if self._stood else ways:
            for claim in claims:
                yield judged(assembly, case, claim), way

    def _sought(self, assembly: Assembly, case: Case) -> Iterator[_Tried]:
        """Yield proofs by forces and motions sought for this case, the cheapest search first."""
        part = self._bearing(assembly) if self._stood else self._falling(assembly)
        if part is not None and part.blocks.mean() <= _NEAR:
            yield from self._sought_near(Sought(assembly, case, part))
        for answer in approach(Sought(assembly, case)):
            yield _labeled(judged(assembly, case, answer), Way.FORCES)

    def _sought_near(self, sought: Sought) -> Iterator[_Tried]:
        """Yield proofs by candidate motions and forces near changes, or near what fell before."""
        way, case = Way.EARLIER_FORCES if self._stood else Way.FORCES, sought.case
        answers, bonded_ = approach(sought), case.tension[0] > 0 or case.cohesion[0] > 0
        # the first is near what was before: mostly enough with a bond, seldom without one
        for answer in islice(answers, 1) if bonded_ else islice(answers, 1, None):
            if not self._stood and answer.value <= _TIGHT:
                return  # others may fall
            yield _labeled(judged(sought.assembly, case, answer), way)
            if self._stood and answer.value <= _TIGHT:
                return  # it does not hold what is beside it

    def _bearing(self, assembly: Assembly) -> Changing | None:
        """Return the part near new blocks and grips, and along their paths to the ground."""
        blocks, corners = len(assembly.centroid), len(assembly.corner)
        if self._corner_force is None or self._blocks > blocks:
            return None
        new = np.arange(self._blocks, blocks)
        near = _around(assembly, np.concatenate([new, self._bore, assembly.grip_block]), _BESIDE)
        bodies = assembly.bodies[assembly.contact]
        changes = ((bodies == GROUND) | near[bodies]).all(axis=1)
        kept = np.zeros((corners, 3))
        kept[: len(self._corner_force)] = self._corner_force / assembly.scales[0]
        kept[changes] = 0.0
        return Changing(near, changes, np.ones(len(assembly.payload), dtype=bool), kept)

    def _falling(self, assembly: Assembly) -> Changing | None:
        """Return the blocks of the last motion and their neighbors; the rest is fixed."""
        if self._motion is None:
            return None
        blocks, size = len(assembly.centroid), np.abs(self._motion).max(axis=1)
        falls = np.ones(blocks, dtype=bool)  # as new ones do
        falls[: len(size)] = size[:blocks] > _MOVES * size.max()
        near = _neighbors(assembly, falls)
        bodies = assembly.bodies[assembly.contact]
        changes = ((bodies != GROUND) & near[bodies]).any(axis=1)
        return Changing(
            near, changes, near[assembly.grip_block], np.zeros((len(assembly.corner), 3))
        )

    def _learn(self, assembly: Assembly, proven: Proven, held: Sequence[int]) -> None:
        (force, length), answer = assembly.scales, proven.answer
        self._stood = proven.held <= EXACT
        if self._stood:
            self._corner_force = force * answer.contact_force
            self._blocks = len(assembly.centroid)
            self._bore = assembly.grip_block[answer.grip_force.any(axis=1)]
            grips = dict(zip(held, force * answer.grip_force, strict=True))
            same = [each for each in self._kept if len(each[0]) == len(self._corner_force)]
            self._kept = [*same, (self._corner_force, grips)][-_KEPT:]
        if proven.bound > EXACT and np.isfinite(answer.motion).all():
            self._motion = answer.motion / np.repeat([1.0, length], 3)


def _neighbors(assembly: Assembly, which: Bools) -> Bools:
    """Return some blocks (B,) and those that touch them."""
    between = assembly.bodies[(assembly.bodies != GROUND).all(axis=1)]
    out = which.copy()
    out[between[which[between].any(axis=1)].ravel()] = True
    return out


def _around(assembly: Assembly, blocks: Ints, steps: int) -> Bools:
    """Return blocks (B,), those on their shortest ways to the ground, and so many steps beside."""
    bodies, count = assembly.bodies, len(assembly.centroid)
    grounded = (bodies == GROUND).any(axis=1)
    if not grounded.any():
        return np.ones(count, dtype=bool)
    first, second = bodies[~grounded].T
    touching = sparse.csr_array((np.ones(len(first)), (first, second)), shape=(count, count))
    _, before, _ = dijkstra(
        touching,
        directed=False,
        indices=np.unique(bodies[grounded].max(axis=1)),
        unweighted=True,
        min_only=True,
        return_predecessors=True,
    )
    out = np.zeros(count, dtype=bool)
    for on_way in blocks.tolist():
        block = on_way
        while block >= 0 and not out[block]:
            out[block] = True
            block = int(before[block])
    for _ in range(steps):
        out = _neighbors(assembly, out)
    return out
