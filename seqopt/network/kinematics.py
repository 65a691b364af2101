"""Rigid-body kinematics of the network: how its nodes follow the bricks."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, Ints, skew
from seqopt.network.network import GROUND, Network, PartKind


def node_motion(network: Network, bricks: int) -> sparse.csr_array:
    """Return the displacements of the nodes for unit twists of the bricks, (3N, 6b).

    A twist is the translation of a brick's centroid and its rotation. An inner node follows its
    brick. A joint node lies between two equal springs in series and moves by the mean of what it
    would on either side; one whose spring does not act yet follows the brick that is there.
    """
    node, brick, share = _followers(network, bricks)
    arm = network.node_position[node] - centroids(network)[brick]
    block = np.concatenate([np.broadcast_to(np.eye(3), (len(node), 3, 3)), -skew(arm)], axis=2)
    rows = np.broadcast_to(3 * node[:, None, None] + np.arange(3)[:, None], block.shape)
    columns = np.broadcast_to(6 * brick[:, None, None] + np.arange(6), block.shape)
    values = share[:, None, None] * block
    shape = (3 * network.count_nodes(bricks), 6 * bricks)
    return sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def centroids(network: Network) -> Floats:
    """Return the bricks' centroids in build order, (B, 3), m."""
    return np.asarray(network.node_position[network.inner].mean(axis=1))


def _followers(network: Network, bricks: int) -> tuple[Ints, Ints, Floats]:
    """Return which node follows which brick by which share."""
    springs = network.springs
    kind = network.node_kind[: network.count_nodes(bricks)]
    inner, joint = np.flatnonzero(kind == PartKind.INNER), np.flatnonzero(kind == PartKind.JOINT)
    spring = network.node_spring[joint]
    bodies = springs.bodies[spring]
    acts = springs.since[spring] <= bricks
    there = (bodies != GROUND) & (bodies < bricks)
    share = np.where(acts[:, None], 0.5, 1.0) * there
    row, side = np.nonzero(there)
    node = np.concatenate([inner, joint[row]])
    brick = np.concatenate([network.node_brick[inner], bodies[row, side]])
    return node, brick, np.concatenate([np.ones(len(inner)), share[row, side]])


def spring_maps(network: Network, bricks: int) -> tuple[Ints, Floats, Floats]:
    """Return the acting springs, their deformations for unit twists and their stiffnesses.

    Shapes (s,), (s, 6, 6b), (s, 6, 6): global axes, second body relative to first.
    """
    springs = network.springs
    acting = np.flatnonzero(springs.since <= bricks)
    center = centroids(network)
    gap = np.zeros((len(acting), 6, 6 * bricks))
    stiffness = np.zeros((len(acting), 6, 6))
    for row, s in enumerate(acting):
        for body, sign in zip(springs.bodies[s], (-1.0, 1.0), strict=True):
            if body != GROUND:
                block = gap[row, :, 6 * body : 6 * body + 6]
                block += sign * np.eye(6)
                block[:3, 3:] -= sign * skew(springs.position[s] - center[body])
        axes = springs.axes[s]
        stiffness[row, :3, :3] = axes.T * springs.translational_stiffness[s] @ axes
        stiffness[row, 3:, 3:] = axes.T * springs.rotational_stiffness[s] @ axes
    return acting, gap, stiffness
