"""The spanning tree of springs that a build order grows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.basis import SPACE, Basis
from seqopt.network.network import Network


@dataclass(frozen=True, eq=False, repr=False)
class SpanningTree(FrozenValue):
    """A tree in which every brick hangs on one spring; arrays run over the first bricks placed.

    Attributes
    ----------
    spring : (B,) int
        The spring that each brick hangs on.
    parent : (B,) int
        The brick at the spring's other end, or `GROUND`.
    """

    spring: Ints
    parent: Ints


def grow_tree(network: Network) -> SpanningTree:
    """Return the tree that hangs every brick, when placed, on the spring nearest to the ground.

    It ends before the brick with which a spring without stiffness in some direction begins to act,
    or that is placed without a spring to what stands: from there on a structure may have no
    compliance of its own.

    Returns
    -------
    SpanningTree
        Of as many bricks as are tied in every direction when placed; maybe none.
    """
    springs = network.springs
    count = _count_tied(network)
    spring, parent = np.empty((2, count), dtype=np.int64)
    depth = np.zeros(count + 1, dtype=np.int64)  # the ground, index -1, comes last
    for b in range(count):
        mine = np.flatnonzero((springs.bodies[:, 1] == b) & (springs.since == b + 1))
        best = mine[np.argmin(depth[springs.bodies[mine, 0]])]
        spring[b], parent[b] = best, springs.bodies[best, 0]
        depth[b] = depth[parent[b]] + 1
    return SpanningTree(spring, parent)


def _count_tied(network: Network) -> int:
    """Return how many bricks stand when the first is placed without a tie in every direction."""
    springs = network.springs
    slack = springs.since[(springs.stiffness <= 0).any(axis=1)]
    hung = springs.bodies[springs.since == springs.bodies[:, 1] + 1, 1]
    bare = np.setdiff1d(np.arange(len(network.inner)), hung)
    return int(min([len(network.inner), *bare, *(slack - 1)]))


def compliances(network: Network, which: Ints, basis: Basis = SPACE) -> Floats:
    """Return the compliances of springs.

    Parameters
    ----------
    network : Network
    which : (s,) int
        Springs of the network.
    basis : Basis, optional
        k directions; all of space by default.

    Returns
    -------
    (s, k, k) float
        m/N and rad/(N m).
    """
    springs = network.springs
    axes = springs.axes[which]
    count = len(basis.force)
    out = np.zeros((len(which), *2 * basis.wrench.shape[:1]))
    for block, directions, stiffness in (
        (slice(0, count), basis.force, springs.translational_stiffness[which]),
        (slice(count, None), basis.moment, springs.rotational_stiffness[which]),
    ):
        own = axes @ directions.T
        out[:, block, block] = own.transpose(0, 2, 1) / stiffness[:, None, :] @ own
    return out
