"""The compliance operator: how one partial structure answers forces at its inner nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.basis import SPACE, Basis
from seqopt.engines.rigid.spanning_tree import (
    SpanningTree,
    closure_wrenches,
    compliances,
    node_wrenches,
    twists,
)
from seqopt.network.kinematics import node_motion
from seqopt.network.network import Network
from seqopt.network.statics import build_statics


@dataclass(frozen=True, eq=False, repr=False)
class ComplianceOperator(FrozenValue):
    """Responses of the first ``bricks`` bricks; rows of all arrays but the first are loads.

    Row ``dm + i`` is a unit force in direction ``i`` of d at the ``m``-th inner node
    (`Network.inner`), l = 2db loads in all: d = 3 in space, 2 in a plane. One more row at the end
    of the response arrays is the weight of the bricks.

    Attributes
    ----------
    bricks : int
    flexibility : (l, l) float
        Displacements of the inner nodes, m/N.
    dead_displacement : (l,) float
        Displacements of the inner nodes under the weight with no grip, m.
    edge_force : (l + 1, E) float
    displacement : (l + 1, 3N) float
    support : (l + 1, 6G) float
        Force and moment at every ground end of the scene; zero where it does not act.
    joint_wrench : (l + 1, 6S) float
    brick_twist : (l + 1, 6b) float
    axis : (b, d) float
        Unit vectors along the inner edges, in the directions of the loads.
    inner_edge : (b,) int
        The inner edge of each brick.
    """

    bricks: int
    flexibility: Floats
    dead_displacement: Floats
    edge_force: Floats
    displacement: Floats
    support: Floats
    joint_wrench: Floats
    brick_twist: Floats
    axis: Floats
    inner_edge: Ints

    @property
    def directions(self) -> int:
        """In how many directions a node is loaded and held, d."""
        return len(self.flexibility) // (2 * self.bricks)

    def load_index(self, columns: Ints) -> Ints:
        """Return which loads act at every grip.

        Parameters
        ----------
        columns : (S, r) int
            Grips as indices into ``network.inner.ravel()``.

        Returns
        -------
        (S, rd) int
            Rows of the operator.
        """
        rows = self.directions * columns[:, :, None] + np.arange(self.directions)
        return np.asarray(rows.reshape(len(columns), self.directions * columns.shape[1]))


class OperatorBuilder:
    """Makes the operator of any brick count from arrays computed once for the whole scene.

    Adding a brick with a free end only borders these arrays, so a smaller count is a slice of
    them; the springs that close loops enter as unknown wrenches.

    Parameters
    ----------
    network : Network
    tree : SpanningTree
        On which the bricks hang.
    basis : Basis, optional
        The directions in which bricks are loaded and move; all by default.
    """

    def __init__(self, network: Network, tree: SpanningTree, basis: Basis = SPACE) -> None:
        self.network, self.tree, self.basis = network, tree, basis
        self.statics = build_statics(network)
        count, size = len(tree.spring), len(basis.wrench)
        turned = sparse.kron(sparse.eye_array(2 * count), basis.force.T, format="csr")
        self.edge_of_load = self.statics.edge_of_load @ turned
        loads = node_wrenches(network, tree, basis).reshape(count, size, -1)
        closing = closure_wrenches(network, tree, basis).reshape(count, size, -1)
        self.wrench = np.concatenate([loads, closing], axis=2)
        self.strain = compliances(network, tree.spring, basis) @ self.wrench
        self.twist = twists(network, tree, self.strain, basis)

    def operator(self, bricks: int) -> ComplianceOperator:
        """Return the operator of a partial structure.

        Parameters
        ----------
        bricks : int
            How many bricks stand.

        Returns
        -------
        ComplianceOperator
        """
        network, basis = self.network, self.basis
        loads = len(basis.force) * 2 * bricks
        closing, wrench, twist = self._closed(bricks)
        weight = (network.inner_weight[: 2 * bricks] @ basis.force.T).ravel()
        carried = np.zeros((len(network.springs.since), len(basis.wrench), loads))
        carried[self.tree.spring[:bricks]] = -wrench
        carried[self.tree.closures[: len(closing)]] = closing
        force, motion = basis.embedded(carried), basis.embedded(twist)
        edges = network.count_edges(bricks)
        edge_force = self.statics.edge_of_spring[:edges] @ force[:, :3].reshape(-1, loads)
        edge_force += self.edge_of_load[:edges, :loads].toarray()
        displacement = node_motion(network, bricks) @ motion.reshape(-1, loads)
        supports = zip(self.statics.support_of_spring, network.springs.support, strict=True)
        inner = displacement.reshape(-1, 3, loads)[network.inner[:bricks].ravel()]
        flexibility = (basis.force @ inner).reshape(loads, loads)
        inner_edge = np.flatnonzero(network.edge_spring[:edges] < 0)
        return ComplianceOperator(
            bricks=bricks,
            flexibility=flexibility,
            dead_displacement=flexibility @ weight,
            edge_force=_with_weight(edge_force, weight),
            displacement=_with_weight(displacement, weight),
            support=np.hstack([_with_weight(at_end @ force[s], weight) for at_end, s in supports]),
            joint_wrench=_with_weight(force.reshape(-1, loads), weight),
            brick_twist=_with_weight(motion.reshape(-1, loads), weight),
            axis=network.edge_axis[inner_edge] @ basis.force.T,
            inner_edge=inner_edge,
        )

    def _closed(self, bricks: int) -> tuple[Floats, Floats, Floats]:
        """Return wrenches of closures (c, k, l) and tree, and twists (b, k, l), of l unit loads."""
        springs, closures = self.network.springs, self.tree.closures
        each, every = len(self.basis.wrench), 2 * len(self.basis.force)
        loads, first = every * bricks, every * len(self.tree.spring)
        active = int(np.searchsorted(springs.since[closures], bricks, side="right"))
        wrench, twist = self.wrench[:bricks, :, :loads], self.twist[:bricks, :, :loads]
        if not active:
            return np.zeros((0, each, loads)), wrench, twist
        columns = slice(first, first + each * active)
        strain = self.strain[:bricks, :, columns].reshape(each * bricks, -1)
        through = self.wrench[:bricks, :, columns].reshape(each * bricks, -1)
        own = linalg.block_diag(*compliances(self.network, closures[:active], self.basis))
        factors = linalg.lu_factor(strain.T @ through + own)
        unknown = -linalg.lu_solve(factors, strain.T @ wrench.reshape(-1, loads))
        # what a loop leaves open, summed along it: its small difference survives rounding
        strains = self.strain[:bricks, :, :loads].reshape(-1, loads) + strain @ unknown
        unknown -= linalg.lu_solve(factors, through.T @ strains + own @ unknown)
        return (
            unknown.reshape(active, each, loads),
            wrench + self.wrench[:bricks, :, columns] @ unknown,
            twist + self.twist[:bricks, :, columns] @ unknown,
        )


def _with_weight(rows: Floats, weight: Floats) -> Floats:
    """Return responses (Q, l) to unit loads transposed, with the response to the weight below.

    The responses to one load lie side by side in memory: products with few loads read whole rows.
    """
    out = np.empty((rows.shape[1] + 1, rows.shape[0]))
    out[:-1], out[-1] = rows.T, rows @ weight
    return out
