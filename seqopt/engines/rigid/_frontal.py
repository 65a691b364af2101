r"""Rigid bricks on springs for large structures: blocks eliminated as the build leaves them behind.

The stiffness :math:`K = B^T C B` grows with the build. Of a brick that all of its springs and loads
act on nothing changes any more: it is eliminated. What still changes, the *front* :math:`R`, keeps
the Schur complement of all that was eliminated, a block :math:`E` of bricks at a time,

.. math:: S_{RR} \leftarrow S_{RR} - S_{RE} W, \qquad W = S_{EE}^{-1} S_{ER}, \qquad
   z_E = S_{EE}^{-1} f_E, \qquad f_R \leftarrow f_R - W^T f_E .

Grips border the front; with rows :math:`H` of what they forbid, those on eliminated bricks as well,

.. math:: S u_R - H_R^T \lambda = f_R, \qquad H_R u_R + D \lambda = o, \qquad
   u_E = z_E + S_{EE}^{-1} H_E^T \lambda - W u_R ,

so that a grip set takes one solution of the front and one pass over the blocks. Time and memory of
the growth are those of the bricks times the square of the front. The front of a course by course
built vault is a course, and has no more bricks when the vault is longer.

Answers are corrected by the residuals of wrenches and motions side by side, as are those of
`seqopt.engines.rigid._refinement`, until the next correction, by how much the last one shrank,
would change them no more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Fields, GripCompliance, _join_sets, no_sets
from seqopt.engines.rigid._mixed import (
    Solution,
    Ungripped,
    are_small,
    borne,
    held_rows,
    respond,
    sizes,
    ungripped_system,
    unscaled,
)
from seqopt.engines.rigid._operator import ResponseMaps, scene_maps
from seqopt.errors import SolverError
from seqopt.network.network import Network
from seqopt.work import _one_thread

AT_ONCE = 12  # bricks that are eliminated together: blocks large enough for matrix products
_SHRINKING = 1e-4  # largest correction from which on the next ones are foreseen
MOST = 6  # corrections, after which an answer is given up
_MARGIN = 10.0  # times more than the last correction shrank that the next one may be
TINY = np.finfo(float).tiny


class _Block(NamedTuple):
    """Eliminated motions (e,), those of the front then (f,), and what connects them."""

    own: Ints
    front: Ints
    factor: Floats  # (e, e): of the stiffness, by Cholesky
    carried: Floats  # (e, f): how own motions follow the front's, W
    answer: Floats  # (e,): to the loads, z


class _Border(NamedTuple):
    """A front with grips: what they forbid of blocks and how these follow, and the factors."""

    passed: tuple[tuple[Floats, Floats] | None, ...]  # (c, e) and (e, c), of every block
    factor: Floats
    pivots: Ints


class FrontalFactor:
    """The scaled stiffness of a growing structure, factored brick by brick in build order.

    ``whole``: of the whole structure, whose units it keeps; ``at_once``: bricks of a block.
    """

    def __init__(self, whole: Ungripped, at_once: int) -> None:
        self.whole, self._at_once, springs = whole, at_once, whole.network.springs
        load, since, _ = whole.network.loads
        last = np.zeros(whole.bricks, dtype=np.int64)  # the brick count that changes a brick last
        for side in springs.bodies.T:
            np.maximum.at(last, side[side >= 0], springs.since[side >= 0])
        np.maximum.at(last, load, since)
        self._last = last
        self._restart()

    def _restart(self) -> None:
        self.bricks, self.blocks = 0, list[_Block]()
        self.front = np.zeros(0, dtype=np.int64)  # motions of bricks that may still change
        self.matrix, self.load = np.zeros((0, 0)), np.zeros(0)

    def reach(self, bricks: int) -> None:
        """Let a number of bricks stand; fewer than before are begun anew."""
        if bricks < self.bricks:
            self._restart()
        while self.bricks < bricks:
            self._add()
            done = self._last[self.front[::6] // 6] <= self.bricks
            if done.sum() >= self._at_once and not done.all():
                self._eliminate(np.repeat(done, 6))

    def _add(self) -> None:
        """Add a brick, its weight, and the springs and loads that act from it on."""
        whole, new = self.whole, self.bricks
        network, self.bricks = whole.network, new + 1
        self.front = np.append(self.front, 6 * new + np.arange(6))
        self.matrix, self.load = np.pad(self.matrix, (0, 6)), np.pad(self.load, (0, 6))
        first, end = np.searchsorted(network.springs.since, [self.bricks, self.bricks + 1])
        rows, gap = slice(6 * first, 6 * end), whole.deformation
        start, stiffness = gap.indptr[6 * first : 6 * end + 1], whole.stiffness[rows]
        touched, column = np.unique(gap.indices[start[0] : start[-1]], return_inverse=True)
        at = np.searchsorted(self.front, touched)
        each = np.zeros((len(stiffness), len(touched)))  # to cut the sparse matrix takes longer
        each[np.arange(len(each)).repeat(np.diff(start)), column] = gap.data[start[0] : start[-1]]
        self.matrix[np.ix_(at, at)] += each.T @ (stiffness[:, None] * each)
        self.load[at] += each.T @ (whole.moved[rows] * np.maximum(1.0, stiffness))
        self.load[-6:] += whole.weight[6 * new : 6 * new + 6]
        applied = network.applied(self.bricks, new).ravel()
        loaded = np.flatnonzero(applied)
        pull = applied[loaded] * whole.twist_unit[loaded] / whole.unit
        self.load[np.searchsorted(self.front, loaded)] += pull

    def _eliminate(self, done: Bools) -> None:
        inside, rest = np.ix_(done, done), np.ix_(done, ~done)
        try:
            factor = np.asfortranarray(np.linalg.cholesky(self.matrix[inside]))
        except np.linalg.LinAlgError as error:
            self._restart()
            raise SolverError("a block of the stiffness is not positive definite") from error
        carried, answer = _solved(factor, self.matrix[rest]), _solved(factor, self.load[done])
        self.blocks.append(_Block(self.front[done], self.front[~done], factor, carried, answer))
        self.load = self.load[~done] - carried.T @ self.load[done]
        self.matrix = self.matrix[np.ix_(~done, ~done)] - self.matrix[rest].T @ carried
        self.front = self.front[~done]

    def border(self, rows: Floats, corner: Floats) -> _Border:
        """Return the front bordered by grips, factored; raises `LinAlgError` if it is singular."""
        rows, corner, passed = rows.copy(), corner.copy(), list[tuple[Floats, Floats] | None]()
        for own, front, factor, carried, _ in self.blocks:
            here = rows[:, own]
            if not here.any():
                passed.append(None)
                continue
            by_grips = _solved(factor, here.T)
            corner += here @ by_grips
            rows[:, front] -= here @ carried
            passed.append((here, by_grips))
        here = rows[:, self.front]
        matrix = np.block([[self.matrix, -here.T], [here, corner]])
        factor, pivots, singular = linalg.lapack.dgetrf(matrix)
        if singular:
            raise np.linalg.LinAlgError("the front is singular")
        return _Border(tuple(passed), factor, pivots)

    def solve(self, border: _Border, load: Floats | None, off: Floats) -> tuple[Floats, Floats]:
        """Return motions (6b,) and multipliers (c,) under a load (6b,), or under all that acts.

        ``off`` (c,): how far grips hold their nodes from where they are without a load.
        """
        right, off, answers = None if load is None else load.copy(), off.copy(), list[Floats]()
        for (own, front, factor, carried, answer), held in zip(
            self.blocks, border.passed, strict=True
        ):
            if right is not None:
                answers.append(_solved(factor, right[own]))
                right[front] -= carried.T @ right[own]
            else:
                answers.append(answer)
            if held is not None:
                off -= held[0] @ answers[-1]
        pull = self.load if right is None else right[self.front]
        whole = linalg.lapack.dgetrs(border.factor, border.pivots, np.append(pull, off))[0]
        motion, forces = np.zeros(6 * self.bricks), whole[len(pull) :]
        motion[self.front] = whole[: len(pull)]
        back = [*zip(self.blocks, border.passed, answers, strict=True)]
        for (own, front, _, carried, _), held, answer in reversed(back):
            motion[own] = answer - carried @ motion[front]
            if held is not None:
                motion[own] += held[1] @ forces
        return motion, forces


def _solved(factor: Floats, right: Floats) -> Floats:
    """Return the solution of a factored block; SciPy's checks take longer."""
    return np.asarray(linalg.lapack.dpotrs(factor, right, lower=1)[0])


class FrontalSystem:
    """Answers few grip sets of large structures, best by ascending brick counts."""

    def __init__(self, network: Network, at_once: int = AT_ONCE) -> None:
        self._network, self._maps = network, scene_maps(network)
        self._factor = FrontalFactor(ungripped_system(network, len(network.inner)), at_once)
        self._last: tuple[Ungripped, sparse.csr_array] | None = None  # of the last brick count

    def solve(
        self, bricks: int, columns: Ints, compliance: GripCompliance, largest: float
    ) -> Fields:
        """Return all fields of grip sets (S, r).

        ``largest``: correction of a set after which it needs no other. Raises `SolverError` where
        only grips or something soft hold a part: blocks do not tell that from rounding.
        """
        network = self._network
        if self._last is None or self._last[0].bricks != bricks:
            parts = ungripped_system(network, bricks)
            self._last = parts, ResponseMaps(self._maps, bricks).motion
        parts, motion = self._last
        answers = [no_sets(network, bricks, columns.shape[1])]
        with _one_thread():
            self._factor.reach(bricks)
            for i, held in enumerate(columns):
                own = compliance.select(slice(i, i + 1))
                solution = _solve_one(parts, self._factor, held, own, largest)
                answers.append(respond(network, motion, held[None], solution))
        return _join_sets(answers)


def _solve_one(
    parts: Ungripped,
    factor: FrontalFactor,
    columns: Ints,
    compliance: GripCompliance,
    largest: float,
) -> Solution:
    """Return how a partial structure answers to all that loads it while one set holds its nodes."""
    held, whole, gap = held_rows(parts, columns, compliance), factor.whole, parts.deformation
    joints, given, right = len(parts.stiffness), parts.moved / parts.row, None
    ratio = whole.twist_unit[: len(parts.twist_unit)] / parts.twist_unit  # between both scalings
    unit = parts.unit / whole.unit
    rows, corner, off = held.rows, held.corner, np.zeros(len(held.corner))
    if compliance.moved is not None:
        width = len(held.force) // max(1, len(columns))
        off = held.force.T @ np.pad(compliance.moved[0], ((0, 0), (0, width - 3))).ravel()
    state, forces = np.zeros(joints + len(parts.load)), np.zeros(len(off))
    left, before = off, np.inf
    try:
        border = factor.border(rows * ratio, corner / unit)
    except np.linalg.LinAlgError as error:
        raise SolverError(f"{parts.bricks} bricks: {error}") from error
    for count in range(1 + MOST):
        if count:
            missing = -parts.apply(state[None])[0]
            given = (missing[:joints] + parts.moved) / parts.row
            right = missing[joints:] + parts.load + rows.T @ forces + parts.borne @ given
            right *= ratio * unit
            left = off - rows @ state[joints:] - corner @ forces
        moved, more = factor.solve(border, right, left)
        change = np.append(given - parts.stiffness * (gap @ (moved * ratio)), moved * ratio)
        state, forces = state + change, forces + more / unit
        size, reached = sizes(parts, np.stack([change, state]))  # the next is as much smaller
        share, before = min(1.0, _MARGIN * np.max(size / np.maximum(before, TINY))), size
        if not count:
            continue
        small = are_small(parts, reached[None], size[None], _SHRINKING)[0]  # not shrunk by chance
        if small and are_small(parts, reached[None], share * size[None], largest)[0]:
            wrench, twist = unscaled(parts, state[None])
            force = held.force @ (forces * parts.unit)
            return Solution(twist, wrench, *borne(force[None], len(columns), compliance))
    raise SolverError(f"{parts.bricks} bricks: blocks of the stiffness keep too few digits")
