"""The fast engine: exactly rigid bricks, one compliance operator per brick count.

With the flexibility ``G`` of the inner nodes and their displacements ``d`` under the weight, grips
at the nodes ``S`` exert the forces ``λ`` that hold them still, ``G[S, S] λ = -d[S]``; every
response is then the sum of the responses to the weight and to ``λ``. Where these nearly cancel
(grips far out on a long chain and close together, or beyond a joint that is nearly loose) the grip
set is solved again with wrenches and motions side by side (`seqopt.engines.rigid.mixed`).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from seqopt.arrays import Floats, Ints
from seqopt.engines.basis import SPACE, Basis
from seqopt.engines.interface import Fields, Want, grip_columns
from seqopt.engines.rigid.ldlt import solve_positive
from seqopt.engines.rigid.mechanism import require_resistance
from seqopt.engines.rigid.mixed import solve_mixed
from seqopt.engines.rigid.operator import ComplianceOperator, OperatorBuilder
from seqopt.engines.rigid.spanning_tree import grow_tree
from seqopt.network.network import Network

CHUNK = 2048  # grip sets per pass: keeps the work arrays in the processor's cache
TRUSTED = 1e-5  # smallest scaled pivot of the grips' equations that keeps errors below about 1e-9
EVEN = 5e-5  # softest over stiffest joint from which on pivots tell the whole error
CANCEL = 10.0  # what the grips undo over what is left, where pivots do not


class ComplianceEngine:
    """Answers any batch of grip sets on any partial structure of a scene.

    Parameters
    ----------
    network : Network
    basis : Basis, optional
        The directions in which bricks are loaded and move; `seqopt.engines.planar` has fewer than all.
    """

    def __init__(self, network: Network, basis: Basis = SPACE) -> None:
        self._network = network
        self._basis = basis
        tree = grow_tree(network)
        self._builder = None if tree is None else OperatorBuilder(network, tree, basis)
        self._operators: dict[int, ComplianceOperator] = {}
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
        """Return the fields of the first ``bricks`` bricks; see `seqopt.engines.interface.Engine`."""
        columns = grip_columns(self._network, bricks, grips)
        if self._builder is None:
            for row in columns:
                require_resistance(self._network, bricks, row)
            return solve_mixed(self._network, bricks, columns)
        if bricks not in self._operators:
            self._operators[bricks] = self._builder.operator(bricks)
        operator = self._operators[bricks]
        fields, trusted = solve_batch(operator, columns, want, even=self._even)
        if self._basis is not SPACE:
            fields = replace(fields, grip_force=fields.grip_force @ self._basis.force)
        again = np.flatnonzero(~trusted)
        if len(again):
            _replace(fields, again, solve_mixed(self._network, bricks, columns[again]))
        return fields


def _replace(fields: Fields, sets: Ints, better: Fields) -> None:
    """Write the better answers of some grip sets over those that were asked for."""
    for name in Fields.__dataclass_fields__:
        old = getattr(fields, name)
        if old.shape[1]:
            old[sets] = getattr(better, name)


def solve_batch(
    operator: ComplianceOperator, columns: Ints, want: Want = Want.TABLE, *, even: bool = True
) -> tuple[Fields, np.ndarray]:
    """Return the fields of grip sets (S, r) and which of them are accurate, (S,) bool.

    Grip sets are given as places in ``network.inner.ravel()``. Where the joints are not ``even``,
    pivots do not tell the whole error.
    """
    sets, held = columns.shape
    index = load_index(operator, columns)
    force = np.empty(index.shape)
    trusted = np.empty(sets, dtype=bool)
    for start in range(0, sets, CHUNK):
        part = slice(start, start + CHUNK)
        force[part], pivot = grip_forces(operator, columns[part], index[part])
        trusted[part] = pivot >= TRUSTED
    force[~trusted] = 0.0
    if not even:
        trusted &= ~cancels(operator, index, force)
    asked = (
        (operator.edge_force, Want.EDGES),
        (operator.displacement, Want.DISPLACEMENTS),
        (operator.support, Want.SUPPORT),
        (operator.joint_wrench, Want.JOINTS),
        (operator.brick_twist, Want.BRICKS),
    )
    load = _loads(index, force, len(operator.flexibility))
    edge_force, displacement, support, joint, twist = (
        load @ rows if want & flag else np.empty((sets, 0)) for rows, flag in asked
    )
    grip_force = force.reshape(sets, held, directions(operator))  # loads act along x, y and z
    fields = Fields(
        edge_force,
        displacement.reshape(sets, displacement.shape[1] // 3, 3),
        grip_force,
        support,
        joint.reshape(sets, joint.shape[1] // 6, 6),
        twist.reshape(sets, twist.shape[1] // 6, 6),
    )
    return fields, trusted


def directions(operator: ComplianceOperator) -> int:
    """Return in how many directions a node is loaded and held."""
    return len(operator.flexibility) // (2 * operator.bricks)


def load_index(operator: ComplianceOperator, columns: Ints) -> Ints:
    """Return the rows of the operator (S, rd) that are the ``d`` loads at every grip (S, r)."""
    count = directions(operator)
    rows = count * columns[:, :, None] + np.arange(count)
    return np.asarray(rows.reshape(len(columns), count * columns.shape[1]))


def _loads(index: Ints, force: Floats, size: int) -> sparse.csr_array:
    """Return forces (S, k) at the rows ``index``, and the weight, as a matrix (S, size + 1).

    A few entries of hundreds: multiplying only these takes half the time of a dense product.
    """
    sets, count = index.shape
    place = np.full((sets, count + 1), size, dtype=np.int32)
    place[:, :-1] = index
    value = np.ones((sets, count + 1))
    value[:, :-1] = force
    first = np.arange(0, place.size + 1, count + 1, dtype=np.int32)
    return sparse.csr_array((value.ravel(), place.ravel(), first), shape=(sets, size + 1))


def cancels(operator: ComplianceOperator, index: Ints, force: Floats) -> np.ndarray:
    """Return whether motions cancel at the grips of sets under their forces (S, k) at ``index``."""
    out = np.zeros(len(index), dtype=bool)
    motion = operator.displacement
    for row, rows in enumerate(index if index.size else ()):
        parts = np.abs(operator.flexibility[np.ix_(rows, rows)]) @ np.abs(force[row])
        parts += np.abs(operator.dead_displacement[rows])
        left = np.abs(motion[-1] + force[row] @ motion[rows]).max()
        out[row] = parts.max() > CANCEL * left
    return out


def grip_forces(operator: ComplianceOperator, columns: Ints, index: Ints) -> tuple[Floats, Floats]:
    """Return the grips' forces (S, k) that hold still the degrees of freedom ``index`` (S, k).

    The second array (S,) is the smallest scaled pivot of their equations: rounding over it bounds
    the error.

    Two grips on one rigid brick leave the force between them along the brick undetermined. Each
    takes what reaches its own node, so that the inner edge between them carries nothing: the limit
    of a stiff bar with both ends held.
    """
    sets, count = index.shape
    size = len(operator.flexibility)
    held = np.ascontiguousarray(index.T)
    system = np.empty((count + 1, count, sets))
    operator.flexibility.take(
        held[:, None] * size + held,
        out=system[:-1],
        mode="clip",  # other modes copy once more
    )
    np.negative(operator.dead_displacement.take(held), out=system[-1])
    pairs = _pairs(operator, columns)
    if len(pairs.sets):
        _brace(system, pairs)
    answer, pivot = solve_positive(system)
    force = np.ascontiguousarray(answer.T)
    if len(pairs.sets):
        _release(operator, index, force, pairs)
    return force, pivot


class Pairs(NamedTuple):
    """Two grips on one brick: the set, their places in it, the brick, its axis (len, d)."""

    sets: Ints
    first: Ints
    second: Ints
    brick: Ints
    axis: Floats


def _pairs(operator: ComplianceOperator, columns: Ints) -> Pairs:
    """Return all pairs of grips of the sets (S, r) that share a brick."""
    places = np.array([*combinations(range(columns.shape[1]), 2)], dtype=np.int64).reshape(-1, 2)
    bricks = columns.T // 2
    hits = np.flatnonzero(bricks[places[:, 0]] == bricks[places[:, 1]])
    pair, sets = np.divmod(hits, max(len(columns), 1))
    brick = bricks[places[pair, 0], sets]
    return Pairs(sets, places[pair, 0], places[pair, 1], brick, operator.axis[brick])


def _brace(system: Floats, pairs: Pairs) -> None:
    """Give the force between two grips on one brick a flexibility, so that there is one answer."""
    count, sets = system.shape[1:]
    width = pairs.axis.shape[1]
    blocks = system[:-1].reshape(count // width, width, count // width, width, sets)
    every = np.arange(count)[:, None]
    scaled = system[every, every, pairs.sets].sum(axis=0)[:, None] * pairs.axis
    block = scaled[:, :, None] * pairs.axis[:, None]
    rows = np.array([pairs.first, pairs.second, pairs.second])
    columns = np.array([pairs.first, pairs.second, pairs.first])
    blocks[rows, :, columns, :, pairs.sets] += np.array([block, block, -block])


def _release(operator: ComplianceOperator, index: Ints, force: Floats, pairs: Pairs) -> None:
    """Shift the forces (S, k) of the pairs until their inner edges carry nothing."""
    edge = operator.inner_edge[pairs.brick]
    share = operator.edge_force[index[pairs.sets], edge[:, None]]
    carried = operator.edge_force[-1, edge] + np.einsum("sk,sk->s", force[pairs.sets], share)
    width = pairs.axis.shape[1]
    share = share.reshape(len(edge), -1, width)
    every = np.arange(len(edge))
    between = share[every, pairs.first] - share[every, pairs.second]
    shift = (carried / np.einsum("sk,sk->s", between, pairs.axis))[:, None] * pairs.axis
    nodes = force.reshape(len(force), -1, width)
    nodes[pairs.sets, [pairs.first, pairs.second]] += np.array([-shift, shift])
