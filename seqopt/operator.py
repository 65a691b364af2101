"""The compliance operator: how one partial structure answers forces at its inner nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from seqopt.kinematics import centroids, node_motion
from seqopt.network import Floats, Network
from seqopt.statics import statics
from seqopt.tree import Tree, closure_wrenches, compliances, node_wrenches, twists


@dataclass(frozen=True)
class Operator:
    """Responses of the first ``bricks`` bricks; rows of all arrays but the first are loads.

    Row ``3m + i`` is a unit force in direction ``i`` at the ``m``-th inner node (`Network.inner`);
    one more row at the end of the response arrays is the weight of the bricks.

    Attributes
    ----------
    bricks : int
    flexibility : (6b, 6b) float
        Displacements of the inner nodes, m/N.
    dead_displacement : (6b,) float
        Displacements of the inner nodes under the weight with no grip, m.
    edge_force : (6b + 1, E) float
    displacement : (6b + 1, 3N) float
    support : (6b + 1, 6) float
        Force and moment at the first ground end.
    joint_wrench : (6b + 1, 6S) float
    brick_twist : (6b + 1, 6b) float
    axis : (b, 3) float
        Unit vectors along the inner edges.
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
    inner_edge: np.ndarray


class OperatorBuilder:
    """Makes the operator of any brick count from arrays computed once for the whole scene.

    Adding a brick with a free end only borders these arrays, so a smaller count is a slice of
    them; the springs that close loops enter as unknown wrenches, six each.
    """

    def __init__(self, network: Network, tree: Tree) -> None:
        self.network, self.tree = network, tree
        self.statics = statics(network)
        count = len(tree.spring)
        loads = node_wrenches(network, tree).reshape(count, 6, -1)
        closing = closure_wrenches(network, tree).reshape(count, 6, -1)
        self.wrench = np.concatenate([loads, closing], axis=2)
        self.strain = compliances(network, tree.spring) @ self.wrench
        self.twist = twists(network, tree, self.strain, centroids(network))

    def operator(self, bricks: int) -> Operator:
        """Return the operator of the first ``bricks`` bricks."""
        network, size = self.network, 6 * bricks
        closing, wrench, twist = self._closed(bricks)
        weight = np.repeat(0.5 * network.weight[:bricks], 2, axis=0).ravel()
        force = np.zeros((len(network.springs.since), 6, size))
        force[self.tree.spring[:bricks]] = -wrench
        force[self.tree.closures[: len(closing)]] = closing
        edges = network.count_edges(bricks)
        edge_force = self.statics.edge_of_spring[:edges] @ force[:, :3].reshape(-1, size)
        edge_force += self.statics.edge_of_load[:edges, :size].toarray()
        displacement = node_motion(network, bricks) @ twist.reshape(size, size)
        support = self.statics.support_of_spring @ force[network.springs.support]
        inner = (3 * network.inner[:bricks].ravel()[:, None] + np.arange(3)).ravel()
        flexibility = displacement[inner]
        inner_edge = np.flatnonzero(network.edge_spring[:edges] < 0)
        return Operator(
            bricks=bricks,
            flexibility=flexibility,
            dead_displacement=flexibility @ weight,
            edge_force=_with_weight(edge_force, weight),
            displacement=_with_weight(displacement, weight),
            support=_with_weight(support, weight),
            joint_wrench=_with_weight(force.reshape(-1, size), weight),
            brick_twist=_with_weight(twist.reshape(size, size), weight),
            axis=network.edge_axis[inner_edge],
            inner_edge=inner_edge,
        )

    def _closed(self, bricks: int) -> tuple[Floats, Floats, Floats]:
        """Return wrenches of closures (c, 6, 6b) and tree, and twists (b, 6, 6b), of unit loads."""
        springs, closures = self.network.springs, self.tree.closures
        size, first = 6 * bricks, 6 * len(self.tree.spring)
        active = int(np.searchsorted(springs.since[closures], bricks, side="right"))
        wrench, twist = self.wrench[:bricks, :, :size], self.twist[:bricks, :, :size]
        if not active:
            return np.zeros((0, 6, size)), wrench, twist
        columns = slice(first, first + 6 * active)
        strain = self.strain[:bricks, :, columns].reshape(size, -1)
        through = self.wrench[:bricks, :, columns].reshape(size, -1)
        own = linalg.block_diag(*compliances(self.network, closures[:active]))
        factors = linalg.lu_factor(strain.T @ through + own)
        unknown = -linalg.lu_solve(factors, strain.T @ wrench.reshape(size, size))
        # what a loop leaves open, summed along it: its small difference survives rounding
        strains = self.strain[:bricks, :, :size].reshape(size, size) + strain @ unknown
        unknown -= linalg.lu_solve(factors, through.T @ strains + own @ unknown)
        return (
            unknown.reshape(active, 6, size),
            wrench + self.wrench[:bricks, :, columns] @ unknown,
            twist + self.twist[:bricks, :, columns] @ unknown,
        )


def _with_weight(rows: Floats, weight: Floats) -> Floats:
    """Return responses (Q, 6b) to unit loads transposed, with the response to the weight below."""
    return np.vstack([rows.T, rows @ weight])
