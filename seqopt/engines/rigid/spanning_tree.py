"""The spanning tree of springs that a build order grows, and the wrenches in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.engines.basis import SPACE, Basis
from seqopt.network.network import GROUND, Network


@dataclass(frozen=True, eq=False, repr=False)
class SpanningTree(FrozenValue):
    """A tree in which every brick hangs on one spring; arrays run over the first bricks placed.

    Attributes
    ----------
    spring : (B,) int
        The spring that each brick hangs on.
    parent : (B,) int
        The brick at the spring's other end, or `GROUND`.
    on_path : (B, B) bool
        Whether the row's brick lies between the column's brick and the ground, itself included.
    closures : (C,) int
        Springs among these bricks outside the tree, in the order in which they begin to act.
    """

    spring: Ints
    parent: Ints
    on_path: Bools
    closures: Ints


def grow_tree(network: Network) -> SpanningTree:
    """Return the tree that hangs every brick, when placed, on the spring nearest to the ground.

    It ends before the brick with which a spring without stiffness in some direction begins to act,
    or that is placed without a spring to what stands: from there on a structure may have no
    compliance of its own.

    Parameters
    ----------
    network : Network

    Returns
    -------
    SpanningTree
        Of as many bricks as are tied in every direction when placed; maybe none.
    """
    springs = network.springs
    count = _count_tied(network)
    spring, parent = np.empty((2, count), dtype=np.int64)
    depth = np.zeros(count + 1, dtype=np.int64)  # the ground, index -1, comes last
    on_path = np.eye(count, dtype=bool)
    for b in range(count):
        mine = np.flatnonzero((springs.bodies[:, 1] == b) & (springs.since == b + 1))
        best = mine[np.argmin(depth[springs.bodies[mine, 0]])]
        spring[b], parent[b] = best, springs.bodies[best, 0]
        depth[b] = depth[parent[b]] + 1
        if parent[b] != GROUND:
            on_path[:, b] |= on_path[:, parent[b]]
    return SpanningTree(spring, parent, on_path, np.setdiff1d(springs.acting(count), spring))


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


def node_wrenches(network: Network, tree: SpanningTree, basis: Basis = SPACE) -> Floats:
    """Return the wrenches that unit forces at the inner nodes send through the tree.

    The wrench through a brick's spring is the sum of the loads beyond it, taken about the spring.

    Parameters
    ----------
    network : Network
    tree : SpanningTree
    basis : Basis, optional
        d directions of forces, k of wrenches; all of space by default.

    Returns
    -------
    (B, k, 2B, d) float
        1 and m.
    """
    at = network.springs.position[tree.spring]
    owner = np.repeat(np.arange(len(at)), 2)
    inner = network.inner[: len(at)].ravel()
    out = _unit_wrenches(network.node_position[inner], at, basis)
    out *= tree.on_path[:, None, owner, None]
    return out


def closure_wrenches(network: Network, tree: SpanningTree, basis: Basis = SPACE) -> Floats:
    """Return the wrenches that unit wrenches of the closures send through the tree.

    A closure's wrench acts on its second body, and against its first.

    Parameters
    ----------
    network : Network
    tree : SpanningTree
    basis : Basis, optional
        k directions; all of space by default.

    Returns
    -------
    (B, k, C, k) float
        1 and m.
    """
    springs = network.springs
    at, point = springs.position[tree.spring], springs.position[tree.closures]
    path = np.hstack([tree.on_path, np.zeros((len(at), 1), bool)]).astype(float)  # ground: no path
    first, second = springs.bodies[tree.closures].T
    forces, size = len(basis.force), len(basis.wrench)
    out = np.zeros((len(at), size, len(point), size))
    out[..., :forces] = _unit_wrenches(point, at, basis)
    out[:, forces:, :, forces:] = np.eye(size - forces)[:, None, :]
    out *= (path[:, second] - path[:, first])[:, None, :, None]
    return out


def twists(network: Network, tree: SpanningTree, strain: Floats, basis: Basis = SPACE) -> Floats:
    """Return the bricks' twists for deformations of the tree's springs.

    Parameters
    ----------
    network : Network
    tree : SpanningTree
    strain : (B, k, K) float
        Of K cases: translation and rotation of every spring's second body against its first.
    basis : Basis, optional
        k directions; all of space by default.

    Returns
    -------
    (B, k, K) float
        At the centroids.
    """
    centroid, at = network.centroid[: len(tree.spring)], network.springs.position[tree.spring]
    shift = len(basis.force)
    out = strain.copy()
    out[:, :shift] += _carried(basis, centroid - at) @ strain[:, shift:]
    for b in np.flatnonzero(tree.parent != GROUND):
        parent = tree.parent[b]
        out[b] += out[parent]
        out[b, :shift] += _carried(basis, centroid[b] - centroid[parent]) @ out[parent, shift:]
    return out


def _carried(basis: Basis, arms: Floats) -> Floats:
    """Return the translations (..., d, m) at the ends of arms (..., 3) that unit rotations make."""
    return np.asarray(basis.levers(arms).swapaxes(-1, -2))


def _unit_wrenches(points: Floats, at: Floats, basis: Basis) -> Floats:
    """Return the wrenches about ``at`` (P, 3) of unit forces at ``points`` (M, 3), (P, k, M, d)."""
    forces = len(basis.force)
    out = np.empty((len(at), len(basis.wrench), len(points), forces))
    out[:, :forces] = np.eye(forces)[:, None, :]
    out[:, forces:] = basis.levers(points - at[:, None, :]).transpose(0, 2, 1, 3)
    return out
