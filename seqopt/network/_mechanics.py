"""Rigid-body kinematics and equilibrium: motions and forces of nodes, springs, edges and supports.

A twist is the translation of a body's reference point (a brick's centroid) and its rotation, m and
rad. Under small twists every motion is linear in them, so each of these maps is a matrix.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, Ints, skew
from seqopt.network.network import GROUND, Network, PartKind


def point_motion(arm: Floats) -> Floats:
    """Return the displacements (..., 3, 6) of points for unit twists of their body.

    ``arm`` (..., 3): from its reference point, m. The transpose takes forces to wrenches.
    """
    return np.concatenate([np.broadcast_to(np.eye(3), (*arm.shape, 3)), -skew(arm)], axis=-1)


def node_motion(network: Network, bricks: int) -> sparse.csr_array:
    """Return the displacements (3n, 6b) of nodes for unit twists of the bricks that stand.

    An inner node follows its brick. A joint node lies between two equal springs in series and moves
    by the mean of what it would on either side; one whose spring does not act yet follows the brick
    that is there.
    """
    springs = network.springs
    kind = network.node_kind[: network.count_nodes(bricks)]
    inner = np.flatnonzero(kind == PartKind.INNER.value)
    joint = np.flatnonzero(kind == PartKind.JOINT.value)
    spring = network.node_spring[joint]
    bodies = springs.bodies[spring]
    row, side = np.nonzero((bodies != GROUND) & (bodies < bricks))
    node = np.concatenate([inner, joint[row]])
    brick = np.concatenate([network.node_brick[inner], bodies[row, side]])
    share = np.where(springs.since[spring[row]] <= bricks, 0.5, 1.0)
    block = point_motion(network.node_position[node] - network.centroid[brick])
    block[len(inner) :] *= share[:, None, None]
    return spread(node, brick, block, (len(kind), bricks))


def deformation(
    bodies: Ints, at: Floats, center: Floats, axes: Floats | None = None
) -> sparse.csr_array:
    """Return the twists (6s, 6n) of second bodies against first ones for unit twists of all.

    ``bodies`` (s, 2): `GROUND` does not move. ``at`` (s, 3): where each twist is taken; ``center``
    (n, 3): reference points of bodies, m; ``axes`` (s, 3, 3): rows, by default the scene's.
    """
    spring, side = np.nonzero(bodies != GROUND)
    body = bodies[spring, side]
    block = np.tile(np.eye(6), (len(spring), 1, 1))
    block[:, :3] = point_motion(at[spring] - center[body])
    block *= np.where(side, 1.0, -1.0)[:, None, None]
    if axes is not None:
        turn = np.zeros((len(axes), 6, 6))
        turn[:, :3, :3] = turn[:, 3:, 3:] = axes
        block = turn[spring] @ block
    return spread(spring, body, block, (len(bodies), len(center)))


def spring_stiffness(network: Network, which: Ints) -> Floats:
    """Return the stiffness (s, 6, 6) of springs (s,) in the scene's axes, N/m and N m/rad."""
    springs = network.springs
    stiffness, axes = np.zeros((len(which), 6, 6)), springs.axes[which]
    parts = springs.translational_stiffness, springs.rotational_stiffness
    for own, part in zip((slice(3), slice(3, 6)), parts, strict=True):
        stiffness[:, own, own] = axes.transpose(0, 2, 1) * part[which][:, None] @ axes
    return stiffness


def spread(row: Ints, column: Ints, block: Floats, shape: tuple[int, int]) -> sparse.csr_array:
    """Return the sparse matrix of blocks (m, p, q) at block rows and columns (m,)."""
    down, across = block.shape[1:]
    rows = np.broadcast_to(down * row[:, None, None] + np.arange(down)[:, None], block.shape)
    columns = np.broadcast_to(across * column[:, None, None] + np.arange(across), block.shape)
    entries = (block.ravel(), (rows.ravel(), columns.ravel()))
    return sparse.csr_array(entries, shape=(down * shape[0], across * shape[1]))


@dataclass(frozen=True, eq=False, repr=False)
class Statics(FrozenValue):
    """Linear maps from forces to edge and support forces, for the whole scene."""

    edge_of_spring: sparse.csr_array
    """(E, 3S): axial edge forces for unit forces that springs exert on their second bodies."""
    edge_of_load: sparse.csr_array
    """(E, 6B): the same for unit forces on the inner nodes, in the order of `Network.inner`."""
    support_of_spring: Floats
    """(G, 6, 6): force and moment at the fixed point of every ground end, in the scene's order, for
    the wrench its spring exerts on its second body."""


def build_statics(network: Network) -> Statics:
    """Return the equilibrium maps of a network.

    A half-edge or a stub carries its spring's force along its own axis. An inner edge carries
    along its axis what reaches its second node: the load there and the half-edges that end there.
    """
    axis, kind, spring = network.edge_axis, network.edge_kind, network.edge_spring
    springs = network.springs
    inner = np.flatnonzero(kind == PartKind.INNER.value)
    outer = np.flatnonzero(kind != PartKind.INNER.value)
    half = kind[outer] == PartKind.JOINT.value
    brick = network.edge_brick[outer]
    sign = np.where(half & (springs.bodies[spring[outer], 0] == brick), -1.0, 1.0)[:, None]
    inner_edge = np.empty(len(network.inner), dtype=np.int64)
    inner_edge[network.edge_brick[inner]] = inner
    arrives = half & (network.edge_nodes[outer, 0] == network.inner[brick, 1])
    through = inner_edge[brick[arrives]]
    rows = np.concatenate([outer, through])
    columns = np.concatenate([spring[outer], spring[outer[arrives]]])
    values = np.vstack([sign * axis[outer], sign[arrives] * axis[through]])
    second, support = 2 * network.edge_brick[inner] + 1, springs.support
    moment = np.tile(np.eye(6), (len(support), 1, 1))
    moment[:, 3:, :3] = skew(springs.position[support] - springs.anchor[support])
    of_spring = spread(rows, columns, values[:, None], (len(axis), len(springs.since)))
    of_load = spread(inner, second, axis[inner][:, None], (len(axis), network.inner.size))
    return Statics(of_spring, of_load, moment)
