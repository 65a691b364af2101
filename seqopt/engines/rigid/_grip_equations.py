"""The equations of many grip sets at once: which forces hold the grips still.

Two grips may share a brick: between them along it, rigid ones leave a force undetermined, which
`share_pairs` gives to the node that it reaches. The compliance of compliant grips is added to the
equations; where two that are nearly rigid share a brick, digits are lost (`nearly_rigid`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines._grip_compliance import RIGID, GripCompliance
from seqopt.engines.rigid._operator import ComplianceOperator, Doubts


class Pairs(NamedTuple):
    """Two grips on one brick.

    ``sets``, ``first``, ``second``, ``brick`` (p,): the grip set, which two of its grips, and the
    brick; ``axis`` (p, 3): unit vectors from the first grip to the second.
    """

    sets: Ints
    first: Ints
    second: Ints
    brick: Ints
    axis: Floats

    def within(self, start: int, end: int) -> Pairs:
        """Return those of some sets, counted from the first of these."""
        found = self.only((self.sets >= start) & (self.sets < end))
        return found._replace(sets=found.sets - start)

    def only(self, which: Bools) -> Pairs:
        """Select pairs."""
        sets, first, second, brick, axis = self
        return Pairs(sets[which], first[which], second[which], brick[which], axis[which])

    def rigid(self, compliance: GripCompliance, sets: int, grips: int) -> Bools:
        """Return which pairs (p,) have two rigid grips, in so many sets."""
        yields = compliance.compliant(sets, grips)
        return np.asarray(~yields[self.sets, self.first] & ~yields[self.sets, self.second])


def pairs_of(across: Floats, columns: Ints) -> Pairs:
    """Return all pairs of grips of the sets that share a brick.

    ``across`` (2b, 3): unit vectors from each inner node to the other of its brick.
    """
    couples = np.array(np.triu_indices(columns.shape[1], 1))
    one, other = columns.T.take(couples, axis=0)
    same = one ^ 1 == other  # the two nodes of a brick
    if not np.count_nonzero(same):
        none = np.empty(0, dtype=np.int64)
        return Pairs(none, none, none, none, np.empty((0, 3)))
    couple, sets = same.nonzero()
    node, (first, second) = one[same], couples.take(couple, axis=1)
    return Pairs(sets, first, second, node // 2, across.take(node, axis=0))


def as_rows(each: Floats) -> Floats:
    """Return numbers of grips (S, r, w) as rows (k, S) of unknowns, loose motions left out."""
    return np.ascontiguousarray(each.reshape(len(each), each.shape[1] * each.shape[2]).T)


def solve_positive(system: Floats, negative: int = 0, scale: float = 1.0) -> tuple[Floats, Floats]:
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


class GripForces(NamedTuple):
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
    compliance: GripCompliance = RIGID,
) -> GripForces:
    """Return the forces of grips, by which their nodes stay, or go as far as they are compliant.

    Two rigid grips on one rigid brick leave the force between them along the brick undetermined:
    `share_pairs` says how they share it.

    ``index`` (S, k): the loads at the grips, from `ComplianceOperator.load_index`; ``pairs``: of
    the sets, if they are known; ``compliance``: of the sets.
    """
    pairs = pairs_of(operator.across, columns) if pairs is None else pairs
    rows = np.ascontiguousarray(index.T)
    off = None
    if compliance.moved is not None:  # rotations are none
        off = as_rows(np.pad(-compliance.moved, ((0, 0), (0, 0), (0, operator.moments))))
    dead = operator.dead_displacement.take(rows)
    force, pivot = undone(operator, pairs, rows, dead, compliance, off)
    return GripForces(force.T, pivot)


def well_conditioned(
    doubts: Doubts,
    index: Ints,
    found: GripForces,
    most: float,
    operator: ComplianceOperator | None = None,
    compliance: GripCompliance = RIGID,
) -> Bools:
    """Return which sets' forces (S,) rounding of one part in one changes by no more than ``most``.

    Over the largest force of each. A displacement is known to a share of all that adds up in it;
    with ``|G_ij| ≤ √(G_ii G_jj)`` that is read off the diagonal. Over its pivot, which must be
    positive, it is the force that it leaves undetermined. ``operator``: of compliant grips.
    """
    size = np.abs(found.force.T)
    root, own, scale = doubts.shares.take(np.ascontiguousarray(index.T), axis=1)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        own += (root * size).sum(axis=0)
        own *= scale
        if operator is not None and not compliance.rigid:
            flexibility, nodes = root / scale, len(own) - operator.loose
            given, softer = np.zeros_like(own), np.zeros_like(own)
            if compliance.moved is not None:
                far = np.pad(np.abs(compliance.moved), ((0, 0), (0, 0), (0, operator.moments)))
                given[:nodes] += as_rows(far)
            if compliance.matrix is not None:
                parts = np.abs(compliance.transmitted)
                yielded = np.einsum("srij,srj->sri", parts, operator.by_grip(size.T))
                given[:nodes] += as_rows(yielded)
                softer[:nodes] = as_rows(np.diagonal(parts, axis1=2, axis2=3))
            own = (own * flexibility + given) / (flexibility + softer)
        own /= found.pivot
        error = own.max(axis=0, initial=0.0) / size.max(axis=0, initial=np.finfo(float).tiny)
    return np.asarray((error <= most) & (found.lowest > 0))


def share_pairs(
    operator: ComplianceOperator, index: Ints, force: Floats, carried: Floats, pairs: Pairs
) -> None:
    """Let each of two grips on one brick take the force at its own node.

    Then the inner edge between them carries nothing: the limit of a stiff bar with both ends held.
    Nothing else in the structure changes.

    ``force`` (S, k), ``carried`` (S, E), (S, 0): of grips and edges, changed in place, N; where
    there are none of edges, they are computed. Others: as of `grip_forces`.
    """
    if not len(pairs.sets):
        return
    sets, edges = pairs.sets, operator.maps.inner[0][pairs.brick]
    if carried.shape[1]:
        between = carried[sets, edges]
        carried[sets, edges] = 0.0
    else:
        found = operator.answers(["edge_force"], index[sets], force[sets])
        between = found["edge_force"][np.arange(len(sets)), edges]
    shift, nodes = between[:, None] * pairs.axis, operator.by_grip(force)[..., :3]
    nodes[sets, pairs.first] += shift
    nodes[sets, pairs.second] -= shift


def undone(
    operator: ComplianceOperator,
    pairs: Pairs,
    rows: Ints,
    dead: Floats,
    compliance: GripCompliance,
    off: Floats | None,
) -> tuple[Floats, Floats]:
    """Return forces at loads (k, S) that undo displacements (k, S), and scaled pivots (k, S).

    ``dead`` (k, S): m; of loose motions, the force that pulls at them, N; ``off`` (n, S): by how
    much grips already let their nodes move, where they bear something.
    """
    count, sets = rows.shape
    size = len(operator.flexibility)
    system = np.empty((count + 1, count, sets))
    entries = rows[:, None] * size + rows
    operator.flexibility.take(entries, out=system[:count], mode="clip")  # others copy once more
    np.negative(dead, out=system[-1])
    scale = 1 / operator.softness if operator.loose else 1.0
    nodes = count - operator.loose
    if compliance.matrix is not None:
        _add_compliance(system, compliance.matrix)
        pairs = pairs.only(pairs.rigid(compliance, sets, nodes // operator.width))
    if off is not None:
        system[-1, : len(off)] -= off
    brace(system[:nodes, :nodes], pairs, operator.width)
    return solve_positive(system, operator.loose, scale)


def brace(matrices: Floats, pairs: Pairs, width: int) -> None:
    """Give the force between two grips on one brick a flexibility, so that there is one answer.

    ``matrices`` (n, n, S): the sets' equations, changed in place; ``width``: unknowns of a grip.
    """
    if not len(pairs.sets):
        return
    grips, sets = len(matrices) // width, matrices.shape[2]
    blocks = matrices.reshape(grips, width, grips, width, sets)[:, :3, :, :3]
    trace = np.einsum("ririt->t", blocks)[pairs.sets]
    block = (trace[:, None] * pairs.axis)[:, :, None] * pairs.axis[:, None]
    first = np.array([pairs.first, pairs.second, pairs.second])
    second = np.array([pairs.first, pairs.second, pairs.first])
    blocks[first, :, second, :, pairs.sets] += np.array([block, block, -block])


_CLOSE = 1e-4  # flexibility of two grips on one brick, over its own, below which digits are lost


def nearly_rigid(
    operator: ComplianceOperator, index: Ints, pairs: Pairs, compliance: GripCompliance
) -> Bools:
    """Return which sets (S,) hold a brick by two compliant grips so stiff that digits are lost.

    They share what acts along the brick by their stiffness. ``index`` (S, k): loads at the grips.
    """
    out = np.zeros(len(index), dtype=bool)
    if compliance.matrix is None or not len(pairs.sets):
        return out
    each, width = compliance.matrix, operator.width
    own = (each[pairs.sets, pairs.first] + each[pairs.sets, pairs.second])[:, :3, :3]
    along = np.einsum("pi,pij,pj->p", pairs.axis, own, pairs.axis)
    rows = index[pairs.sets[:, None], width * pairs.second[:, None] + np.arange(3)]
    brick = operator.flexibility.diagonal()[rows].mean(axis=1)
    close = (along < _CLOSE * brick) & ~pairs.rigid(compliance, *each.shape[:2])
    out[pairs.sets[close]] = True
    return out


def _add_compliance(system: Floats, matrix: Floats) -> None:
    """Add to equations, in place, the compliance (S, r, w, w) of every grip.

    Moments to which it is infinite are none.
    """
    grips, ways = matrix.shape[1:3]
    for grip in range(grips):
        first = ways * grip
        for a, b in zip(*np.tril_indices(ways), strict=True):
            own = matrix[:, grip, a, b]
            if own.any():
                system[first + a, first + b] += own
        if ways > 3 and (free := np.flatnonzero(np.isinf(matrix[:, grip, 5, 5]))).size:
            for row in range(first + 3, first + 6):
                system[row][:, free] = 0.0
                system[:, row, free] = 0.0
                system[row, row, free] = 1.0
