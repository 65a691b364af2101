"""The fast engine: exactly rigid bricks, one compliance operator per brick count.

With the flexibility ``G`` of the inner nodes and their displacements ``d`` under the weight, grips
at the nodes ``S`` exert the forces ``λ`` that hold them still, ``G[S, S] λ = -d[S]``; every
response is then the sum of the responses to the weight and to ``λ``. Where these nearly cancel
(grips far out on a long chain and close together, or beyond a joint that is nearly loose) the grip
set is solved again with wrenches and motions side by side (`seqopt.mixed`).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from seqopt.batch_solve import solve_positive
from seqopt.fields import Fields, Want, grip_columns
from seqopt.mixed import solve_mixed
from seqopt.network import Floats, Ints, Network
from seqopt.operator import Operator, OperatorBuilder
from seqopt.rigid import require_resistance
from seqopt.tree import grow_tree

CHUNK = 2048  # grip sets per pass: keeps the work arrays in the processor's cache
TRUSTED = 1e-5  # smallest scaled pivot of the grips' equations that keeps errors below about 1e-9
EVEN = 5e-5  # softest over stiffest joint from which on pivots tell the whole error
CANCEL = 10.0  # what the grips undo over what is left, where pivots do not


class ComplianceEngine:
    """Answers any batch of grip sets on any partial structure of a scene."""

    def __init__(self, network: Network) -> None:
        self._network = network
        tree = grow_tree(network)
        self._builder = None if tree is None else OperatorBuilder(network, tree)
        self._operators: dict[int, Operator] = {}
        springs = network.springs
        self._even = all(
            stiffness.min() >= EVEN * stiffness.max()
            for stiffness in (springs.translational_stiffness, springs.rotational_stiffness)
        )

    @property
    def network(self) -> Network:
        """The network whose nodes and edges the fields follow."""
        return self._network

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.TABLE) -> Fields:
        """Return the fields of the first ``bricks`` bricks; see `seqopt.fields.Engine`."""
        columns = grip_columns(self._network, bricks, grips)
        if self._builder is None:
            for row in columns:
                require_resistance(self._network, bricks, row)
            return solve_mixed(self._network, bricks, columns)
        if bricks not in self._operators:
            self._operators[bricks] = self._builder.operator(bricks)
        operator = self._operators[bricks]
        fields, trusted = solve_batch(operator, columns, want)
        if not self._even:
            trusted &= ~cancels(operator, columns, fields.grip_force)
        again = np.flatnonzero(~trusted)
        if len(again):
            _replace(fields, again, solve_mixed(self._network, bricks, columns[again]))
        return fields


def cancels(operator: Operator, columns: Ints, force: Floats) -> np.ndarray:
    """Return whether motions cancel at the grips of sets (S, r) under their forces (S, r, 3)."""
    out = np.zeros(len(columns), dtype=bool)
    motion = operator.displacement
    for row, grips in enumerate(columns if columns.size else ()):
        index = (3 * grips[:, None] + np.arange(3)).ravel()
        parts = np.abs(operator.flexibility[np.ix_(index, index)]) @ np.abs(force[row].ravel())
        parts += np.abs(operator.dead_displacement[index])
        left = np.abs(motion[-1] + force[row].ravel() @ motion[index]).max()
        out[row] = parts.max() > CANCEL * left
    return out


def _replace(fields: Fields, sets: Ints, better: Fields) -> None:
    """Write the better answers of some grip sets over those that were asked for."""
    for name in Fields.__dataclass_fields__:
        old = getattr(fields, name)
        if old.shape[1]:
            old[sets] = getattr(better, name)


def solve_batch(
    operator: Operator, columns: Ints, want: Want = Want.TABLE
) -> tuple[Fields, np.ndarray]:
    """Return the fields of grip sets (S, r) and which of them are accurate, (S,) bool.

    Grip sets are given as places in ``network.inner.ravel()``.
    """
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
    trusted = np.ones(sets, dtype=bool)
    for start in range(0, sets, CHUNK):
        part = slice(start, min(start + CHUNK, sets))
        index = (3 * columns[part, :, None] + np.arange(3)).reshape(part.stop - start, 3 * held)
        force, pivot = grip_forces(operator, columns[part], index)
        trusted[part] = pivot >= TRUSTED
        force[~trusted[part]] = 0.0
        load = np.zeros((len(index), size + 1))
        load[np.arange(len(index))[:, None], index] = force
        load[:, -1] = 1.0
        for rows, result in zip(maps, out, strict=True):
            np.matmul(load, rows, out=result[part])
        forces[part] = force.reshape(len(index), held, 3)
    edge_force, displacement, support, joint, twist = out
    fields = Fields(
        edge_force,
        displacement.reshape(sets, displacement.shape[1] // 3, 3),
        forces,
        support,
        joint.reshape(sets, joint.shape[1] // 6, 6),
        twist.reshape(sets, twist.shape[1] // 6, 6),
    )
    return fields, trusted


def grip_forces(operator: Operator, columns: Ints, index: Ints) -> tuple[Floats, Floats]:
    """Return the grips' forces (S, 3r) that hold still the degrees of freedom ``index`` (S, 3r).

    The second array (S,) is the smallest scaled pivot of their equations: rounding over it bounds
    the error.

    Two grips on one rigid brick leave the force between them along the brick undetermined. Each
    takes what reaches its own node, so that the inner edge between them carries nothing: the limit
    of a stiff bar with both ends held.
    """
    size = len(operator.flexibility)
    held = np.ascontiguousarray(index.T)
    matrix = operator.flexibility.take(held[:, None] * size + held)
    pairs = list(_pairs(operator, columns))
    for sets, _, free in pairs:
        scale = np.trace(matrix[:, :, sets])
        matrix[:, :, sets] += scale * free.T[:, None] * free.T
    answer, pivot = solve_positive(matrix, -operator.dead_displacement.take(held))
    force = answer.T
    for sets, brick, free in pairs:
        edge = operator.inner_edge[brick]
        share = operator.edge_force[index[sets], edge[:, None]]
        carried = operator.edge_force[-1, edge] + np.einsum("sk,sk->s", force[sets], share)
        force[sets] -= (carried / np.einsum("sk,sk->s", free, share))[:, None] * free
    return force, pivot


def _pairs(operator: Operator, columns: Ints) -> Iterator[tuple[Ints, Ints, Floats]]:
    """Yield sets with two grips on one brick, that brick, and the free pair of forces (len, 3r)."""
    for i, j in combinations(range(columns.shape[1]), 2):
        sets = np.flatnonzero(columns[:, i] // 2 == columns[:, j] // 2)
        if len(sets):
            brick = columns[sets, i] // 2
            free = np.zeros((len(sets), columns.shape[1], 3))
            free[:, i], free[:, j] = operator.axis[brick], -operator.axis[brick]
            yield sets, brick, free.reshape(len(sets), -1)
