"""The equations of many grip sets at once: which forces hold the grips still."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, frozen
from seqopt.engines._hands import Hands
from seqopt.engines.rigid._operator import ComplianceOperator


def _solve_positive(system: Floats, negative: int = 0, scale: float = 1.0) -> tuple[Floats, Floats]:
    """Solve S positive definite systems of k unknowns in place, the batch along the last axis.

    Up to three times as fast as ``numpy.linalg.solve`` for a thousand 9 x 9 systems, which calls
    LAPACK once for each.

    ``system`` (k + 1, k, S): the matrices, of which only the lower triangles are read, and the
    loads as a last row. Overwritten; ``negative``: how many unknowns at the end are those of a
    saddle: what is left of their equations, when the others are eliminated, is negative definite;
    ``scale``: what their pivots are measured against. Results: ``answer`` (k, S): not finite where
    a matrix is not definite; ``pivot`` (k, S): pivots over their diagonal entries: small where
    equations nearly repeat those before them.
    """
    size = system.shape[1]
    every = np.arange(size)
    diagonal = np.abs(system[every, every])  # a negative pivot stays negative beside it
    diagonal[size - negative :] = -scale
    pivots = np.empty_like(diagonal)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for j in range(size):
            column = system[j:, j]
            if j:
                column -= np.einsum("ips,ps->is", system[j:, :j], system[j, :j] * pivots[:j])
            pivots[j] = column[0]
            column[1:] /= pivots[j]
        answer = system[size]
        for j in range(size - 1, 0, -1):
            answer[:j] -= system[j, :j] * answer[j]
        pivots /= diagonal
    return answer, pivots


class _GripForces(NamedTuple):
    """The forces of the grips of sets, and how well they are determined."""

    force: Floats  # (S, k); N
    pivot: Floats  # (k, S); the scaled pivots of the equations

    @property
    def lowest(self) -> Floats:
        """The smallest pivot of each set, (S,): one where there are no grips."""
        return np.asarray(self.pivot.min(axis=0, initial=1.0))


class Pairs(NamedTuple):
    """Two grips on one brick.

    ``sets``, ``first``, ``second``, ``brick`` (p,): the grip set, which two of its grips, and the
    brick; ``axis`` (p, d): unit vectors from the brick's first node to its second.
    """

    sets: Ints
    first: Ints
    second: Ints
    brick: Ints
    axis: Floats

    def within(self, start: int, end: int) -> Pairs:
        """Return those of some sets, counted from the first of these."""
        here = (self.sets >= start) & (self.sets < end)
        first, second, brick = self.first[here], self.second[here], self.brick[here]
        return Pairs(self.sets[here] - start, first, second, brick, self.axis[here])


def pairs_of(operator: ComplianceOperator, columns: Ints) -> Pairs:
    """Return all pairs of grips of the sets that share a brick."""
    first, second = _couples(columns.shape[1])
    bricks = columns.T // 2
    couple, sets = np.divmod(np.flatnonzero(bricks[first] == bricks[second]), len(columns))
    first, second = first[couple], second[couple]
    brick = bricks[first, sets]
    return Pairs(sets, first, second, brick, operator.axis[brick])


@cache
def _couples(grips: int) -> Ints:
    """Return all couples (2, c) of a number of grips."""
    return frozen(np.array([*combinations(range(grips), 2)], dtype=np.int64).reshape(-1, 2).T)


def grip_forces(
    operator: ComplianceOperator,
    columns: Ints,
    index: Ints,
    pairs: Pairs | None = None,
    hands: Hands | None = None,
) -> _GripForces:
    """Return the forces with which grips hold their nodes still, or where hands are.

    Two grips on one rigid brick leave the force between them along the brick undetermined:
    `share_pairs` says how they share it.

    ``index`` (S, k): the loads at the grips, from `ComplianceOperator.load_index`; ``pairs``: of
    the sets, if they are known; ``hands``: in the operator's directions.
    """
    pairs = pairs_of(operator, columns) if pairs is None else pairs
    rows = np.ascontiguousarray(index.T)
    dead = operator.dead_displacement.take(rows)
    if hands is not None:
        dead[: len(dead) - operator.loose] -= _in_rows(hands.moved)
    force, pivot = _solved(operator, pairs, rows, dead)
    return _GripForces(force.T, pivot)


def trusted(
    operator: ComplianceOperator,
    index: Ints,
    found: _GripForces,
    most: float,
    hands: Hands | None = None,
) -> Bools:
    """Return which sets' forces (S,) rounding changes little enough.

    ``most``: largest of `_doubts` that is accepted; ``hands``: as of `grip_forces`.
    """
    lowest = found.lowest
    out = np.zeros(len(lowest), dtype=bool)
    if hands is None:  # where hands move, forces may undo what the weight does
        out = np.asarray(most * lowest >= len(found.pivot) * operator.worst_doubt)
    rest = np.flatnonzero(~out & (lowest > 0))
    if rest.size:
        part = _GripForces(found.force[rest], found.pivot[:, rest])
        own = None if hands is None else hands.of(rest)
        out[rest] = _doubts(operator, index[rest], part, own) <= most
    return out


def _doubts(
    operator: ComplianceOperator, index: Ints, found: _GripForces, hands: Hands | None = None
) -> Floats:
    """Return the error (S,) of forces for rounding of one part in one, over the largest of each.

    A displacement is known to a share of all that adds up in it; with ``|G_ij| ≤ √(G_ii G_jj)``
    that is read off the diagonal. Over its pivot, which must be positive, it is the force that it
    leaves undetermined.
    """
    size = np.abs(found.force.T)
    root, own, scale = operator.shares.take(np.ascontiguousarray(index.T), axis=1)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        own += (root * size).sum(axis=0)
        if hands is not None:
            nodes = len(own) - operator.loose
            own[:nodes] += np.abs(_in_rows(hands.moved)) / root[:nodes]
        own *= scale
        own /= found.pivot
        most = size.max(axis=0, initial=np.finfo(float).tiny)
        return np.asarray(own.max(axis=0, initial=0.0) / most)


def _in_rows(moved: Floats) -> Floats:
    """Return what hands move (S, r, d) as rows (rd, S)."""
    return np.ascontiguousarray(moved.reshape(len(moved), moved.shape[1] * moved.shape[2]).T)


def still_forces(operator: ComplianceOperator, columns: Ints, index: Ints, moved: Floats) -> Floats:
    """Return the forces (S, k) with which grips undo given displacements of their nodes.

    ``moved`` (S, k): m; of loose motions, the force that pulls at them, N. Between two grips on one
    brick there is no force.
    """
    pairs, rows = pairs_of(operator, columns), np.ascontiguousarray(index.T)
    return _solved(operator, pairs, rows, np.ascontiguousarray(moved.T))[0].T


def share_pairs(
    operator: ComplianceOperator,
    columns: Ints,
    index: Ints,
    force: Floats,
    carried: Floats,
    pairs: Pairs | None = None,
) -> None:
    """Let each of two grips on one brick take what reaches its own node.

    Then the inner edge between them carries nothing: the limit of a stiff bar with both ends held.
    Nothing else in the structure changes.

    ``force`` (S, k), ``carried`` (S, E), (S, 0): of grips and edges, changed in place, N; where
    there are none of edges, they are computed. Others: as of `grip_forces`.
    """
    pairs = pairs_of(operator, columns) if pairs is None else pairs
    if not len(pairs.sets):
        return
    sets, edges = pairs.sets, operator.inner_edge[pairs.brick]
    if carried.shape[1]:
        between = carried[sets, edges]
        carried[sets, edges] = 0.0
    else:
        found = operator.answer("edge_force", index[sets], force[sets])
        between = found[np.arange(len(sets)), edges]
    shift = between[:, None] * pairs.axis
    shift[columns[sets, pairs.first] % 2 == 1] *= -1.0  # the axis leads to the second node
    own = force.shape[1] - operator.loose
    nodes = force[:, :own].reshape(len(force), -1, pairs.axis.shape[1])
    nodes[sets, pairs.first] += shift
    nodes[sets, pairs.second] -= shift


def _solved(
    operator: ComplianceOperator, pairs: Pairs, rows: Ints, dead: Floats
) -> tuple[Floats, Floats]:
    """Return forces at loads (k, S) that undo displacements (k, S), and scaled pivots (k, S)."""
    count, sets = rows.shape
    size = len(operator.flexibility)
    system = np.empty((count + 1, count, sets))
    for i in range(0, count, operator.directions):  # what is above the diagonal is not read
        mine = slice(i, min(i + operator.directions, count))
        entries = rows[mine, None] * size + rows[: mine.stop]
        part = system[mine, : mine.stop]
        operator.flexibility.take(entries, out=part, mode="clip")  # others copy once more
    np.negative(dead, out=system[-1])
    if len(pairs.sets):
        nodes = count - operator.loose
        _brace(system[:nodes, :nodes], pairs)
    scale = 1 / operator.softness if operator.loose else 1.0
    return _solve_positive(system, operator.loose, scale)


def _brace(system: Floats, pairs: Pairs) -> None:
    """Give the force between two grips on one brick a flexibility, so that there is one answer."""
    count, sets = system.shape[1:]
    width = pairs.axis.shape[1]
    blocks = system.reshape(count // width, width, count // width, width, sets)
    every = np.arange(count)[:, None]
    scaled = system[every, every, pairs.sets].sum(axis=0)[:, None] * pairs.axis
    block = scaled[:, :, None] * pairs.axis[:, None]
    rows = np.array([pairs.first, pairs.second, pairs.second])
    columns = np.array([pairs.first, pairs.second, pairs.first])
    blocks[rows, :, columns, :, pairs.sets] += np.array([block, block, -block])
