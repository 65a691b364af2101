"""The equations of many grip sets at once: which forces hold the grips still."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines._hands import Hands
from seqopt.engines.rigid._operator import ComplianceOperator, Doubts
from seqopt.engines.rigid._pairs import (
    Pairs,
    _as_rows,
    _brace,
    _by_grip,
    _count_grips,
    _soften,
    pairs_of,
)

_MANY = 256  # sets from which on more calls of NumPy that gather less take less
_FEW = 12  # systems up to which one call of LAPACK for each takes less than one for all


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
    if size and system.shape[2] <= _FEW and not negative:
        found = _solve_few(system)
        if found is not None:
            return found
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


def _solve_few(system: Floats) -> tuple[Floats, Floats] | None:
    """Return the same of a few systems by LAPACK, one by one; None if one is not definite."""
    size = system.shape[1]
    answer, pivot = np.empty(system.shape[1:]), np.empty(system.shape[1:])
    for s in range(system.shape[2]):
        matrix = system[:size, :, s]
        factor, unknown, failed = lapack.dposv(matrix, system[size, :, s], lower=1)
        if failed:
            return None
        answer[:, s] = unknown
        pivot[:, s] = factor.diagonal() ** 2 / matrix.diagonal()
    return answer, pivot


class _GripForces(NamedTuple):
    """The forces of the grips of sets, and how well they are determined."""

    force: Floats  # (S, k); N
    pivot: Floats  # (k, S); the scaled pivots of the equations

    @property
    def lowest(self) -> Floats:
        """The smallest pivot of each set, (S,): one where there are no grips."""
        return np.asarray(np.minimum.reduce(self.pivot, axis=0, initial=1.0))


def grip_forces(
    operator: ComplianceOperator,
    columns: Ints,
    index: Ints,
    pairs: Pairs | None = None,
    hands: Hands | None = None,
) -> _GripForces:
    """Return the forces with which grips hold their nodes still, or where their hands let them be.

    Two rigid grips on one rigid brick leave the force between them along the brick undetermined:
    `share_pairs` says how they share it.

    ``index`` (S, k): the loads at the grips, from `ComplianceOperator.load_index`; ``pairs``: of
    the sets, if they are known; ``hands``: in the operator's directions.
    """
    pairs = pairs_of(operator, columns) if pairs is None else pairs
    rows = np.ascontiguousarray(index.T)
    asked = _Asked(operator, pairs, rows, hands)
    off = None if hands is None or hands.moved is None else _in_rows(operator, -hands.moved)
    force, pivot = _solved(asked, operator.dead_displacement.take(rows), off)
    return _GripForces(force.T, pivot)


def trusted(
    operator: ComplianceOperator | Doubts,
    index: Ints,
    found: _GripForces,
    most: float,
    hands: Hands | None = None,
) -> Bools:
    """Return which sets' forces (S,) rounding changes little enough.

    ``operator``: or, without hands, its doubts alone; ``most``: largest of `_doubts` that is
    accepted; ``hands``: as of `grip_forces`.
    """
    doubts = operator.doubts if isinstance(operator, ComplianceOperator) else operator
    lowest, least = found.lowest, np.inf
    if hands is None or hands.moved is None:  # else forces may undo what the weight does
        own = 0.0 if hands is None else 2.0  # of what hands give, that forces undo as well
        least = len(found.pivot) * doubts.worst + own
    out = np.asarray(most * lowest >= least)
    if np.count_nonzero(out) == len(out):
        return out
    rest = slice(None) if len(out) <= _MANY else np.flatnonzero(~out & (lowest > 0))
    part = _GripForces(found.force[rest], found.pivot[:, rest])
    own_hands = None if hands is None else hands.of(rest)
    sure = _doubts(operator, index[rest], part, own_hands) <= most
    out[rest] |= sure & (lowest[rest] > 0)
    return out


def _doubts(
    operator: ComplianceOperator | Doubts,
    index: Ints,
    found: _GripForces,
    hands: Hands | None = None,
) -> Floats:
    """Return the error (S,) of forces for rounding of one part in one, over the largest of each.

    A displacement is known to a share of all that adds up in it; with ``|G_ij| ≤ √(G_ii G_jj)``
    that is read off the diagonal. Over its pivot, which must be positive, it is the force that it
    leaves undetermined.
    """
    size = np.abs(found.force.T)
    doubts = operator.doubts if isinstance(operator, ComplianceOperator) else operator
    root, own, scale = doubts.shares.take(np.ascontiguousarray(index.T), axis=1)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        own += (root * size).sum(axis=0)
        own *= scale
        if isinstance(operator, ComplianceOperator) and hands is not None:
            own = _with_hands(operator, own, size, root / scale, hands)
        own /= found.pivot
        most = size.max(axis=0, initial=np.finfo(float).tiny)
        return np.asarray(own.max(axis=0, initial=0.0) / most)


def _with_hands(
    operator: ComplianceOperator, own: Floats, size: Floats, flexibility: Floats, hands: Hands
) -> Floats:
    """Return errors of forces (k, S), as of `_doubts`, that hands add to and give way to.

    ``size`` (k, S): of the forces, N; ``flexibility`` (k, S): the diagonal, m/N.
    """
    given, softer = np.zeros_like(own), np.zeros_like(own)
    nodes, grips = len(own) - operator.loose, _count_grips(operator, len(own))
    if hands.moved is not None:
        moved = _in_rows(operator, np.abs(hands.moved))
        given[: len(moved)] += moved
    if hands.give is not None:
        parts = np.abs(hands.each_give(own.shape[1], grips))
        bears = _by_grip(operator, size.T, grips)
        given[:nodes] += _as_rows(operator, np.einsum("srij,srj->sri", parts, bears))
        softer[:nodes] = _as_rows(operator, np.diagonal(parts, axis1=2, axis2=3))
    return np.asarray((own * flexibility + given) / (flexibility + softer))


def _in_rows(operator: ComplianceOperator, moved: Floats) -> Floats:
    """Return what hands move (S, r, d) as rows of all unknowns (k, S), loose motions left out."""
    rows = _as_rows(operator, moved)
    return np.pad(rows, ((0, moved.shape[1] * operator.moments), (0, 0)))


def still_forces(
    operator: ComplianceOperator,
    columns: Ints,
    index: Ints,
    moved: Floats,
    hands: Hands | None = None,
    off: Floats | None = None,
) -> Floats:
    """Return the forces (S, k) with which grips undo given displacements of their nodes.

    ``moved`` (S, k): m; of loose motions, the force that pulls at them, N; ``hands``: how they
    give way; ``off`` (S, r, w): how far they are from where they should be, m, what they give
    counted. Between two rigid grips on one brick there is no force.
    """
    pairs, rows = pairs_of(operator, columns), np.ascontiguousarray(index.T)
    apart = None if off is None else _as_rows(operator, off)
    asked = _Asked(operator, pairs, rows, hands)
    return _solved(asked, np.ascontiguousarray(moved.T), apart)[0].T


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
    own = _count_grips(operator, force.shape[1]) * operator.directions
    nodes = force[:, :own].reshape(len(force), -1, pairs.axis.shape[1])
    nodes[sets, pairs.first] += shift
    nodes[sets, pairs.second] -= shift


class _Asked(NamedTuple):
    """Grip sets whose forces are to be found."""

    operator: ComplianceOperator
    pairs: Pairs
    rows: Ints  # (k, S); loads at the grips
    hands: Hands | None  # in the operator's directions


def _solved(asked: _Asked, dead: Floats, off: Floats | None = None) -> tuple[Floats, Floats]:
    """Return forces at loads (k, S) that undo displacements (k, S), and scaled pivots (k, S).

    ``off`` (n, S): by how much hands already let their nodes move, where they bear something.
    """
    operator, pairs, rows, hands = asked
    count, sets = rows.shape
    size = len(operator.flexibility)
    system = np.empty((count + 1, count, sets))
    step = operator.directions if sets > _MANY else max(count, 1)
    for i in range(0, count, step):  # what is above the diagonal is not read
        mine = slice(i, min(i + step, count))
        entries = rows[mine, None] * size + rows[: mine.stop]
        part = system[mine, : mine.stop]
        operator.flexibility.take(entries, out=part, mode="clip")  # others copy once more
    np.negative(dead, out=system[-1])
    scale = 1 / operator.softness if operator.loose else 1.0
    if hands is not None and hands.give is not None:
        spread = _soften(system, operator, pairs, hands, off)
        force, pivot = _solve_positive(system, operator.loose, scale)
        return spread(force, pivot)
    if off is not None:
        system[-1, : len(off)] -= off
    if len(pairs.sets):
        nodes = _count_grips(operator, count) * operator.directions
        _brace(system[:nodes, :nodes], pairs)
    return _solve_positive(system, operator.loose, scale)
