"""The fast engine: exactly rigid bricks, one flexibility that grows with the build.

With the flexibility ``G`` of the inner nodes and their displacements ``d`` under the weight, grips
at the nodes ``S`` exert the forces ``λ`` that hold them still, ``G[S, S] λ = -d[S]``; every
response is then the sum of the responses to the weight and to ``λ``. Where these nearly cancel
(grips far out on a long chain and close together, or beyond a joint that is nearly loose), so that
more than the accepted error may be left, and where something is loose, grip sets are corrected by
the residuals of wrenches and motions side by side (`seqopt.engines.rigid._refinement`).

Brick counts are best asked in ascending order: what all of them share grows in place.
"""

from __future__ import annotations

from contextlib import suppress
from functools import cached_property
from importlib.util import find_spec
from math import prod
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seqopt._registry import Later
from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import (
    FLAGS,
    RIGID,
    SHAPES,
    Fields,
    GripCompliance,
    NamedEngine,
    Want,
    _failing_in_a_line,
    grip_columns,
    keep_wanted,
    read_compliance,
    require_finite,
)
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._operator import (
    ComplianceOperator,
    OperatorBuilder,
    are_few,
    grip_forces,
    nearly_rigid,
    pairs_of,
    share_pairs,
    well_conditioned,
)
from seqopt.errors import SolverError
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.work import _one_thread

if TYPE_CHECKING:
    from seqopt.engines.rigid._extremes import GrownExtremes
    from seqopt.engines.rigid._frontal import FrontalSystem
    from seqopt.engines.rigid._refinement import Refinement

_EXTREMES = Later("seqopt.engines.rigid._extremes")  # with numba alone
_FRONTAL = Later("seqopt.engines.rigid._frontal")  # of large scenes alone
_REFINEMENT = Later("seqopt.engines.rigid._refinement")  # few sets need any
_MIXED = Later("seqopt.engines.rigid._mixed")  # with these alone

_CHUNK = 4096  # grip sets per pass: keeps the work arrays in the processor's cache
ACCURACY = 1e-9  # largest error of fields over the largest of each
_UNSEEN = 100 * np.finfo(float).eps  # largest error met, over what is read off the equations
_CANCEL = 10.0  # what the grips undo over what is left, where pivots do not
_LARGE, _EACH = 150, 75  # bricks, in all and for every set, from which on blocks are sooner
_KEPT = 32e6  # bytes of operators that may stay when another is made
_SCREEN = 1e-6  # largest error, as `ACCURACY`, of what is only to be compared
_EVEN = 5e-5  # softest over stiffest joint from which on pivots bound the error
COMPILES = find_spec("numba") is not None  # whether loops can be compiled


class _FastSolution:
    """What an operator alone says about grip sets.

    ``even``: whether the joints are about equally stiff: where not, pivots do not bound the error;
    ``accuracy``: as of the engine; ``well_conditioned`` (S,): which sets meet it.
    """

    def __init__(
        self,
        operator: ComplianceOperator,
        columns: Ints,
        compliance: GripCompliance = RIGID,
        *,
        even: bool,
        accuracy: float,
    ) -> None:
        sets, index = len(columns), operator.load_index(columns)
        pairs = pairs_of(operator.across, columns)
        force, good = np.empty(index.shape), np.empty(sets, dtype=bool)
        for start in range(0, sets, _CHUNK):
            part = slice(start, start + _CHUNK)
            mine = pairs.only((pairs.sets >= start) & (pairs.sets < start + _CHUNK))
            mine = mine._replace(sets=mine.sets - start)
            own, most = compliance.select(part), accuracy / _UNSEEN
            found = grip_forces(operator, columns[part], index[part], mine, own)
            force[part] = found.force
            doubts = operator.doubts
            good[part] = well_conditioned(doubts, index[part], found, most, operator, own)
            good[part] &= ~nearly_rigid(operator, index[part], mine, own)
        if np.count_nonzero(good) < sets:
            force[~good] = 0.0
        if not compliance.rigid and len(pairs.sets):
            pairs = pairs.only(pairs.rigid(compliance, *columns.shape))
        if not even:
            good &= ~_cancels(operator, index, force)
        self.operator, self.columns, self.index, self.force = operator, columns, index, force
        self.pairs, self.lever, self.well_conditioned = pairs, compliance.lever, good

    def fields(self, want: Want) -> dict[str, Floats]:
        """Return the fields of all sets by name."""
        operator, columns = self.operator, self.columns
        force = self.force.copy() if len(self.pairs.sets) else self.force
        known = operator.answers([n for n in SHAPES if want & FLAGS[n]], self.index, force)
        none, found = np.empty((len(columns), 0)), dict[str, Floats]()
        for name, shape in SHAPES.items():
            flat = known.get(name, none)
            found[name] = flat.reshape(len(flat), flat.shape[1] // prod(shape), *shape)
        share_pairs(operator, self.index, force, found["edge_force"], self.pairs)
        borne = operator.by_grip(force)
        found["grip_force"] = borne[..., :3]
        found["grip_moment"] = np.zeros((*columns.shape, 3))
        if operator.moments:
            found["grip_moment"] = self.lever * borne[..., 3:]
        return found


def _cancels(operator: ComplianceOperator, index: Ints, force: Floats) -> Bools:
    """Return whether motions cancel at the grips of sets (S,), by forces (S, k) at rows (S, k)."""
    out = np.zeros(len(index), dtype=bool)
    if not index.size:
        return out
    size, dead = np.abs(operator.flexibility), operator.dead_displacement
    for start in range(0, len(index), _CHUNK):
        rows, pull = index[start : start + _CHUNK], force[start : start + _CHUNK]
        held = rows[:, :, None], rows[:, None]
        parts = np.einsum("sij,sj->si", size[held], np.abs(pull)) + np.abs(dead[rows])
        left = np.abs(operator.answers(["displacement"], rows, pull)["displacement"]).max(axis=1)
        out[start : start + _CHUNK] = parts.max(axis=1) > _CANCEL * left
    return out


class Extremes(NamedTuple):
    """Extremes of the fields of S grip sets.

    ``least``, ``most`` (S,): force of any edge, N; ``shift`` (S,): displacement of any node, m;
    ``moment`` (S,): at any ground end, N m; ``force`` (S, r): of every grip, N. What was not asked
    for means nothing.
    """

    least: Floats
    most: Floats
    shift: Floats
    moment: Floats
    force: Floats


def _extremes_in(fields: Fields, want: Want) -> Extremes:
    """Return the extremes of fields that are there."""
    sets = len(fields.grip_force)
    found = np.zeros((4, sets))
    if want & Want.EDGES:
        found[:2] = fields.edge_force.min(axis=1), fields.edge_force.max(axis=1)
    if want & Want.DISPLACEMENTS:
        found[2] = _squared(fields.displacement).max(axis=1)
    if want & Want.SUPPORT:
        found[3] = _squared(fields.support[..., 3:]).max(axis=1)
    np.sqrt(found[2:], out=found[2:])
    size = np.sqrt(_squared(fields.grip_force))
    return Extremes(found[0], found[1], found[2], found[3], size)


def _squared(vectors: Floats) -> Floats:
    """Return the squares of lengths (S, n) of vectors (S, n, 3), of which NumPy takes thrice."""
    return np.asarray(np.einsum("snk,snk->sn", vectors, vectors))


class ComplianceEngine(NamedEngine):
    """Computes any batch of grip sets on any partial structure of a scene.

    ``accuracy``: largest error of fields, over the largest entry of each, that is accepted; with
    `Want.SCREEN`, `_SCREEN` if that is larger. Sets that may err more are corrected.
    """

    def __init__(self, network: Network | Scene, accuracy: float = ACCURACY) -> None:
        super().__init__(network)
        self._accuracy = accuracy
        self._tree = grow_tree(self.network)
        self._kept: dict[int, ComplianceOperator] = {}  # the one that was asked last comes last
        self._refinement: Refinement | None = None  # of the brick count that was corrected last
        self._grown: GrownExtremes | None = None  # what answers few grip sets of large structures

    @_failing_in_a_line()
    def solve(
        self,
        bricks: int,
        grips: ArrayLike,
        want: Want = Want.RESPONSES,
        moved: ArrayLike | None = None,
    ) -> Fields:
        """Return the fields of a partial structure for grip sets (S, r)."""
        columns = grip_columns(self.network, bricks, grips)
        compliance = read_compliance(self.network, columns, grips, moved)
        found = self._found(bricks, columns, compliance, want)
        return require_finite(found, bricks, grips)

    def _found(self, bricks: int, columns: Ints, compliance: GripCompliance, want: Want) -> Fields:
        """Return the fields of grip sets, corrected where the operator is not accurate enough."""
        size = len(self.network.inner)
        self.answered += len(columns)
        begun = "_builder" in vars(self) and self._builder.growth.reaches(bricks)
        if size >= max(_LARGE, _EACH * len(columns)) and not begun:
            with suppress(SolverError):  # of what blocks of the stiffness do not answer
                last = _SCREEN if want & Want.SCREEN else _MIXED.LAST_CORRECTION
                answer = self._frontal.solve(bricks, columns, compliance, last)
                return keep_wanted(answer, want)
        fast: _FastSolution | None = None
        if bricks <= len(self._tree.spring):
            operator, even = self._operator(bricks, columns), bricks <= self._uniform
            accuracy = self._accepted(want)
            fast = _FastSolution(operator, columns, compliance, even=even, accuracy=accuracy)
        sure = 0 if fast is None else np.count_nonzero(fast.well_conditioned)
        if fast is None or (len(columns) and not sure):
            return self._refined(bricks, columns, compliance, want)
        found = fast.fields(want)
        if sure < len(columns):
            wrong = ~fast.well_conditioned
            rest = compliance.select(wrong)
            better = self._refined(bricks, columns[wrong], rest, want)
            for name, values in found.items():
                values[wrong] = getattr(better, name)
        return Fields(**found)

    @_failing_in_a_line()
    def _extremes(
        self, bricks: int, grips: ArrayLike, want: Want, *, compiled: bool = False
    ) -> Extremes:
        """Return the extremes of the fields that are wanted, for grip sets (S, r).

        ``compiled``: by compiled loops, where numba is there and sets are few beside the nodes.
        """
        columns, numbers = grip_columns(self.network, bricks, grips), np.asarray(grips)
        compliance = read_compliance(self.network, columns, numbers, None)
        compiled |= self._grown is not None  # they are loaded already
        if not (compiled and compliance.rigid and COMPILES):
            fields = self._found(bricks, columns, compliance, want)
            return _extremes_in(require_finite(fields, bricks, numbers), want)
        apart = np.ones(len(columns), dtype=bool)  # what fields are computed of
        found, size = np.empty((4, len(columns))), np.empty(columns.shape)
        large = bricks <= min(self._uniform, len(self._tree.spring))
        large = large and not are_few(3 * bricks, len(columns))
        moves = large and (self.network.springs.movement.any() or self._builder.moments)
        if large and not moves and self._builder.growth.bricks <= bricks:
            if self._grown is None:
                self._grown = _EXTREMES.GrownExtremes(self._builder)
            self._grown.reach(bricks)
            found, size, apart = self._grown.solve(columns, want, self._accepted(want) / _UNSEEN)
            self.answered += int(np.count_nonzero(~apart))
        if np.count_nonzero(apart):
            fields = self._found(bricks, columns[apart], RIGID, want)
            rest = _extremes_in(require_finite(fields, bricks, numbers[apart]), want)
            found[:, apart], size[apart] = rest[:4], rest.force
        return Extremes(found[0], found[1], found[2], found[3], size)

    def _accepted(self, want: Want) -> float:
        """Return the largest error of fields that is accepted, over the largest entry of each."""
        return max(_SCREEN, self._accuracy) if want & Want.SCREEN else self._accuracy

    def _operator(self, bricks: int, columns: Ints) -> ComplianceOperator:
        """Return an operator that answers grip sets: one that is kept, or else a new one."""
        known = self._kept.pop(bricks, None)
        if known is None or (known.place.take(columns // 2) < 0).any():  # it bears no loads there
            held = np.union1d(columns // 2, np.arange(0) if known is None else known.held)
            if 2 * len(held) >= bricks:
                held = np.arange(bricks)
            taken = sum(each.nbytes for each in self._kept.values())
            while taken > _KEPT:  # those that were not asked for longest go
                taken -= self._kept.pop(next(iter(self._kept))).nbytes
            with _one_thread():
                known = self._builder.operator(bricks, held)
        self._kept[bricks] = known
        return known

    @cached_property
    def _uniform(self) -> int:
        """Up to how many bricks all joints that act are about equally stiff."""
        springs = self.network.springs
        order = np.argsort(springs.since, kind="stable")
        even = np.ones(len(order), dtype=bool)
        for stiffness in (springs.translational_stiffness, springs.rotational_stiffness):
            low = np.minimum.accumulate(stiffness[order].min(axis=1))
            even &= low >= _EVEN * np.maximum.accumulate(stiffness[order].max(axis=1))
        every = len(self.network.inner)
        return every if even.all() else int(springs.since[order][even.argmin()]) - 1

    @cached_property
    def _builder(self) -> OperatorBuilder:
        """Made when the first operator is: a scene that is loose from the start has none."""
        return OperatorBuilder(self.network, self._tree)

    @cached_property
    def _frontal(self) -> FrontalSystem:
        found: FrontalSystem = _FRONTAL.FrontalSystem(self.network)
        return found

    def _refined(
        self, bricks: int, columns: Ints, compliance: GripCompliance, want: Want
    ) -> Fields:
        """Return the fields of grip sets for which the operator is not accurate enough."""
        self.corrected += len(columns)
        tied = bricks <= len(self._tree.spring)  # the tree that operators grow on reaches them all
        operator = self._operator(bricks, columns) if tied else None
        with _one_thread():
            if self._refinement is None or self._refinement.bricks != bricks:
                self._refinement = _REFINEMENT.Refinement(self.network, bricks, tied=tied)
            last = _SCREEN if want & Want.SCREEN else _MIXED.LAST_CORRECTION
            answer = self._refinement.solve(columns, operator, last, compliance)
        return keep_wanted(answer, want)
