"""Rigid-body kinematics of the network: how its nodes follow the bricks."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from seqopt.network import GROUND, Floats, Ints, Kind, Network
from seqopt.statics import skew


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
    inner, joint = np.flatnonzero(kind == Kind.INNER), np.flatnonzero(kind == Kind.JOINT)
    spring = network.node_spring[joint]
    bodies = springs.bodies[spring]
    acts = springs.since[spring] <= bricks
    there = (bodies != GROUND) & (bodies < bricks)
    share = np.where(acts[:, None], 0.5, 1.0) * there
    row, side = np.nonzero(there)
    node = np.concatenate([inner, joint[row]])
    brick = np.concatenate([network.node_brick[inner], bodies[row, side]])
    return node, brick, np.concatenate([np.ones(len(inner)), share[row, side]])
