"""The fast engine: exactly rigid bricks, one compliance operator per brick count.

With the flexibility ``G`` of the inner nodes and their displacements ``d`` under the weight, grips
at the nodes ``S`` exert the forces ``λ`` that hold them still, ``G[S, S] λ = -d[S]``; every
response is then the sum of the response to the weight and to ``λ``.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from seqopt.batch_solve import solve_positive
from seqopt.errors import SolverError
from seqopt.fields import Fields, Want, grip_columns
from seqopt.network import Floats, Ints, Network
from seqopt.operator import Operator, OperatorBuilder
from seqopt.rigid import solve_rigid
from seqopt.tree import grow_tree

CHUNK = 2048  # grip sets per pass: keeps the work arrays in the processor's cache


class ComplianceEngine:
    """Answers any batch of grip sets on any partial structure of a scene."""

    def __init__(self, network: Network) -> None:
        self._network = network
        tree = grow_tree(network)
        self._builder = None if tree is None else OperatorBuilder(network, tree)
        self._operators: dict[int, Operator] = {}

    @property
    def network(self) -> Network:
        """The network whose nodes and edges the fields follow."""
        return self._network

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.TABLE) -> Fields:
        """Return the fields of the first ``bricks`` bricks; see `seqopt.fields.Engine`."""
        columns = grip_columns(self._network, bricks, grips)
        if self._builder is None:
            return solve_rigid(self._network, bricks, columns)
        if bricks not in self._operators:
            self._operators[bricks] = self._builder.operator(bricks)
        return solve_batch(self._operators[bricks], columns, want)


def solve_batch(operator: Operator, columns: Ints, want: Want = Want.TABLE) -> Fields:
    """Return the fields of grip sets (S, r), given as places in ``network.inner.ravel()``."""
    sets, held = columns.shape
    size = len(operator.flexibility)
    asked = (
        (operator.edge_force, Want.EDGES),
        (operator.displacement, Want.DISPLACEMENTS),
        (operator.support, Want.SUPPORT),
        (operator.joint_wrench, Want.JOINTS),
        (operator.brick_twist, Want.BRICKS),
    )
    maps = [rows[:, : rows.shape[1] if want & flag else 0] for rows, flag in asked]
    out = [np.empty((sets, rows.shape[1])) for rows in maps]
    forces = np.empty((sets, held, 3))
    for start in range(0, sets, CHUNK):
        part = slice(start, min(start + CHUNK, sets))
        index = (3 * columns[part, :, None] + np.arange(3)).reshape(part.stop - start, 3 * held)
        force = grip_forces(operator, columns[part], index)
        load = np.zeros((len(index), size + 1))
        load[np.arange(len(index))[:, None], index] = force
        load[:, -1] = 1.0
        for rows, result in zip(maps, out, strict=True):
            np.matmul(load, rows, out=result[part])
        forces[part] = force.reshape(len(index), held, 3)
    edge_force, displacement, support, joint, twist = out
    return Fields(
        edge_force,
        displacement.reshape(sets, displacement.shape[1] // 3, 3),
        forces,
        support,
        joint.reshape(sets, joint.shape[1] // 6, 6),
        twist.reshape(sets, twist.shape[1] // 6, 6),
    )


def grip_forces(operator: Operator, columns: Ints, index: Ints) -> Floats:
    """Return the grips' forces (S, 3r) that hold still the degrees of freedom ``index`` (S, 3r).

    Two grips on one rigid brick leave the force between them along the brick undetermined. Each
    takes what reaches its own node, so that the inner edge between them carries nothing: the limit
    of a stiff bar with both ends held.

    Raises
    ------
    SolverError
        If a system of equations is not positive definite within rounding.
    """
    size = len(operator.flexibility)
    held = np.ascontiguousarray(index.T)
    matrix = operator.flexibility.take(held[:, None] * size + held)
    pairs = list(_pairs(operator, columns))
    for sets, _, free in pairs:
        scale = np.trace(matrix[:, :, sets])
        matrix[:, :, sets] += scale * free.T[:, None] * free.T
    force = solve_positive(matrix, -operator.dead_displacement.take(held)).T
    if not np.isfinite(force).all():
        raise SolverError(
            f"{operator.bricks} bricks: grips too close for double precision on so flexible a "
            "structure; drop one of them"
        )
    for sets, brick, free in pairs:
        edge = operator.inner_edge[brick]
        share = operator.edge_force[index[sets], edge[:, None]]
        carried = operator.edge_force[-1, edge] + np.einsum("sk,sk->s", force[sets], share)
        force[sets] -= (carried / np.einsum("sk,sk->s", free, share))[:, None] * free
    return force


def _pairs(operator: Operator, columns: Ints) -> Iterator[tuple[Ints, Ints, Floats]]:
    """Yield sets with two grips on one brick, that brick, and the free pair of forces (len, 3r)."""
    for i, j in combinations(range(columns.shape[1]), 2):
        sets = np.flatnonzero(columns[:, i] // 2 == columns[:, j] // 2)
        if len(sets):
            brick = columns[sets, i] // 2
            free = np.zeros((len(sets), columns.shape[1], 3))
            free[:, i], free[:, j] = operator.axis[brick], -operator.axis[brick]
            yield sets, brick, free.reshape(len(sets), -1)
