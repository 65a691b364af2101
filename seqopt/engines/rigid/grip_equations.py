"""The equations of many grip sets at once: which forces hold the grips still."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.rigid.ldlt import solve_positive
from seqopt.engines.rigid.operator import ComplianceOperator


def grip_forces(operator: ComplianceOperator, columns: Ints, index: Ints) -> tuple[Floats, Floats]:
    """Return the forces with which grips hold their nodes still.

    Two grips on one rigid brick leave the force between them along the brick undetermined. Each
    takes what reaches its own node, so that the inner edge between them carries nothing: the limit
    of a stiff bar with both ends held.

    Parameters
    ----------
    operator : ComplianceOperator
    columns : (S, r) int
        Grips as indices into ``network.inner.ravel()``.
    index : (S, k) int
        The loads at the grips, from `ComplianceOperator.load_index`.

    Returns
    -------
    force : (S, k) float
        N.
    pivot : (S,) float
        The smallest scaled pivot of the equations: rounding over it bounds the error.
    """
    dead = operator.dead_displacement.take(np.ascontiguousarray(index.T))
    force, pivot, pairs = _solved(operator, columns, index, dead)
    if len(pairs.sets):
        _release(operator, index, force, pairs)
    return force, pivot


def still_forces(operator: ComplianceOperator, columns: Ints, index: Ints, moved: Floats) -> Floats:
    """Return the forces with which grips undo given displacements of their nodes.

    Parameters
    ----------
    operator : ComplianceOperator
    columns, index : (S, r), (S, k) int
        As of `grip_forces`.
    moved : (S, k) float
        m; of loose motions, the force that pulls at them, N.

    Returns
    -------
    (S, k) float
        N; between two grips on one brick, none.
    """
    return _solved(operator, columns, index, np.ascontiguousarray(moved.T))[0]


def _solved(
    operator: ComplianceOperator, columns: Ints, index: Ints, dead: Floats
) -> tuple[Floats, Floats, _Pairs]:
    """Return forces (S, k) that undo displacements (k, S), smallest pivots, and pairs of grips."""
    sets, count = index.shape
    size = len(operator.flexibility)
    rows = np.ascontiguousarray(index.T)
    system = np.empty((count + 1, count, sets))
    operator.flexibility.take(
        rows[:, None] * size + rows,
        out=system[:-1],
        mode="clip",  # other modes copy once more
    )
    np.negative(dead, out=system[-1])
    pairs = _pairs(operator, columns)
    if len(pairs.sets):
        nodes = count - operator.loose
        _brace(system[:nodes, :nodes], pairs)
    scale = 1 / operator.softness if operator.loose else 1.0
    answer, pivot = solve_positive(system, operator.loose, scale)
    return np.ascontiguousarray(answer.T), pivot, pairs


class _Pairs(NamedTuple):
    """Two grips on one brick: the set, which of its grips, the brick, its axis (len, d)."""

    sets: Ints
    first: Ints
    second: Ints
    brick: Ints
    axis: Floats


def _pairs(operator: ComplianceOperator, columns: Ints) -> _Pairs:
    """Return all pairs of grips of the sets (S, r) that share a brick."""
    couples = np.array([*combinations(range(columns.shape[1]), 2)], dtype=np.int64).reshape(-1, 2)
    bricks = columns.T // 2
    hits = np.flatnonzero(bricks[couples[:, 0]] == bricks[couples[:, 1]])
    pair, sets = np.divmod(hits, max(len(columns), 1))
    brick = bricks[couples[pair, 0], sets]
    return _Pairs(sets, couples[pair, 0], couples[pair, 1], brick, operator.axis[brick])


def _brace(system: Floats, pairs: _Pairs) -> None:
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


def _release(operator: ComplianceOperator, index: Ints, force: Floats, pairs: _Pairs) -> None:
    """Shift the forces (S, k) of the pairs until their inner edges carry nothing."""
    edge = operator.inner_edge[pairs.brick]
    share = operator.edge_force[index[pairs.sets], edge[:, None]]
    carried = operator.edge_force[-1, edge] + np.einsum("sk,sk->s", force[pairs.sets], share)
    width = pairs.axis.shape[1]
    nodes = force[:, : force.shape[1] - operator.loose].reshape(len(force), -1, width)
    share = share[:, : nodes.shape[1] * width].reshape(len(edge), -1, width)
    every = np.arange(len(edge))
    between = share[every, pairs.first] - share[every, pairs.second]
    shift = (carried / np.einsum("sk,sk->s", between, pairs.axis))[:, None] * pairs.axis
    nodes[pairs.sets, [pairs.first, pairs.second]] += np.array([-shift, shift])
