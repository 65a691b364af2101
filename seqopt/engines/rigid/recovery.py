"""From twists, wrenches and grip forces to the fields that an engine answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.interface import Fields
from seqopt.network.network import Network
from seqopt.network.statics import Statics


@dataclass(frozen=True, eq=False, repr=False)
class Solution(FrozenValue):
    """What determines all fields of one grip set.

    Attributes
    ----------
    twist : (6b,) float
        Of the bricks, m and rad.
    wrench : (S, 6) float
        Of every spring of the network on its second body, N and N m; zero where it does not act.
    force : (r, 3) float
        Of the grips, N; two on one brick may share theirs in any way.
    """

    twist: Floats
    wrench: Floats
    force: Floats


def respond(
    network: Network,
    statics: Statics,
    motion: Floats | sparse.csr_array,
    grips: Ints,
    solution: Solution,
) -> Fields:
    """Return the fields of one grip set.

    Parameters
    ----------
    network : Network
    statics : Statics
        Of the network.
    motion : (3n, 6b) float
        Displacements of the nodes for unit twists; see `seqopt.network.kinematics.node_motion`.
    grips : (r,) int
        Indices into ``network.inner.ravel()``.
    solution : Solution

    Returns
    -------
    Fields
        Of one set.
    """
    twist, wrench, force = solution.twist, solution.wrench, solution.force.copy()
    bricks = len(twist) // 6
    edges = network.count_edges(bricks)
    load = network.inner_weight[: 2 * bricks].copy()
    load[grips] += force
    carried = statics.edge_of_spring[:edges] @ wrench[:, :3].ravel()
    carried += statics.edge_of_load[:edges, : load.size] @ load.ravel()
    _split_pairs(network, grips, force, carried)
    return Fields(
        edge_force=carried[None],
        displacement=(motion @ twist).reshape(1, -1, 3),
        grip_force=force[None],
        support=_reactions(network, statics, wrench)[None],
        joint_wrench=wrench[None],
        brick_twist=twist.reshape(1, -1, 6),
    )


def _reactions(network: Network, statics: Statics, wrench: Floats) -> Floats:
    """Return force and moment (G, 6) of every ground end about its fixed point."""
    at_spring = wrench[network.springs.support]
    return np.array([a @ b for a, b in zip(statics.support_of_spring, at_spring, strict=True)])


def _split_pairs(network: Network, grips: Ints, force: Floats, carried: Floats) -> None:
    """Let each of two grips on one brick take what reaches its own node."""
    for brick in np.flatnonzero(np.bincount(grips // 2) == 2):
        edge = int(np.flatnonzero((network.edge_brick == brick) & (network.edge_spring < 0))[0])
        second = np.flatnonzero(grips == 2 * brick + 1)[0]
        first = np.flatnonzero(grips == 2 * brick)[0]
        force[second] -= carried[edge] * network.edge_axis[edge]
        force[first] += carried[edge] * network.edge_axis[edge]
        carried[edge] = 0.0
