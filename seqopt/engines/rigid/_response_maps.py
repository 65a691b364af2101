"""Which responses the twists of bricks, the wrenches of springs and the forces at nodes mean."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, Ints, frozen
from seqopt.engines.interface import SHAPES, _counts_of_fields
from seqopt.network._mechanics import build_statics, node_motion
from seqopt.network.network import Network

AT_ONCE = 2**18  # numbers mapped at a time: they stay in the processor's cache


@dataclass(frozen=True, eq=False, repr=False)
class SceneMaps(FrozenValue):
    """What twists and wrenches of all bricks and springs of a scene mean, once all springs act.

    ``edge`` (E, 6S): what edges carry of wrenches. ``motion`` (3N, 6B): how twists move nodes.
    ``since`` (m,): of the entries of ``motion``, from which brick count on they hold; before, where
    its spring does not act yet, a joint node follows the brick that is there alone. ``support`` (G,
    6, 6): force and moment at every ground end for the wrench of its spring.
    """

    network: Network
    edge: sparse.csr_array
    motion: sparse.csr_array
    since: Ints
    support: Floats


def scene_maps(network: Network) -> SceneMaps:
    """Return the maps of a scene."""
    statics, springs = build_statics(network), network.springs
    every = sparse.eye_array(len(springs.since))
    motion = node_motion(network, len(network.inner))
    edge = sparse.csr_array(statics.edge_of_spring @ sparse.kron(every, np.eye(3, 6)))
    of_node = np.where(network.node_spring >= 0, springs.since[network.node_spring], 0)
    since = np.repeat(np.repeat(of_node, 3), np.diff(motion.indptr))
    return SceneMaps(network, edge, motion, since, statics.support_of_spring.transpose(0, 2, 1))


@dataclass(frozen=True, eq=False, repr=False)
class ResponseMaps(FrozenValue):
    """What twists (.., 6b) and wrenches (.., 6s) of the first b bricks and s springs mean."""

    scene: SceneMaps
    bricks: int  # how many stand

    @cached_property
    def ground(self) -> Floats:
        """How nodes move with the ground alone, (3n,), m."""
        return frozen(self.scene.network.ground_motion(self.bricks).ravel())

    @cached_property
    def edge(self) -> sparse.csr_array:
        """What edges carry of wrenches, (E, 6s)."""
        network = self.scene.network
        acting = int(np.searchsorted(network.springs.since, self.bricks, side="right"))
        return frozen(self.scene.edge[: network.count_edges(self.bricks), : 6 * acting])

    @cached_property
    def motion(self) -> sparse.csr_array:
        """How twists move nodes, (3n, 6b)."""
        every = self.scene.motion
        moved = every.data * np.where(self.scene.since > self.bricks, 2.0, 1.0)
        alone = sparse.csr_array((moved, every.indices, every.indptr), shape=every.shape)
        nodes = self.scene.network.count_nodes(self.bricks)
        return frozen(alone[: 3 * nodes, : 6 * self.bricks])

    def count(self, name: str) -> int:
        """Return how many numbers a field has."""
        return _counts_of_fields(self.scene.network, self.bricks)[name] * prod(SHAPES[name])

    def apply(self, name: str, states: Floats, out: Floats | None = None) -> Floats:
        """Return a field of states, edge forces without those of loads on the inner edges.

        ``states`` (S, n): wrenches; of displacements and brick twists, twists. ``out`` (S, Q):
        where to put it.
        """
        out = np.empty((len(states), self.count(name))) if out is None else out
        if name == "support":
            for g, spring in enumerate(self.scene.network.springs.support.tolist()):
                mine = states[:, 6 * spring : 6 * spring + 6]
                there = mine.shape[1] > 0  # else it does not act
                out[:, 6 * g : 6 * g + 6] = mine @ self.scene.support[g] if there else 0.0
        elif name in ("joint_wrench", "brick_twist"):
            out[:, states.shape[1] :] = 0.0
            out[:, : states.shape[1]] = states
        else:
            maps = self.edge if name == "edge_force" else self.motion
            step = max(16, AT_ONCE // max(1, *maps.shape))
            for start in range(0, len(states), step):
                part = slice(start, start + step)
                out[part] = (maps @ states[part].T).T
        return out


def loads_of(index: Ints, force: Floats, count: int, weight: float = 1.0) -> sparse.csr_array:
    """Return forces (S, k) at loads (S, k) beside a share of the weight, the last of the rows.

    Result (S, count): times the rows of a response map, the sums of sets.
    """
    sets, loads = index.shape
    rows, share = np.empty((sets, loads + 1), dtype=np.int32), np.empty((sets, loads + 1))
    rows[:, :-1], share[:, :-1] = index, force
    rows[:, -1], share[:, -1] = count - 1, weight
    first = np.arange(0, rows.size + 1, loads + 1, dtype=np.int32)
    return sparse.csr_array((share.ravel(), rows.ravel(), first), shape=(sets, count))


def inner_edges(network: Network, bricks: int) -> tuple[Ints, Floats, Floats]:
    """Return the inner edges of bricks, and the weight on their second nodes.

    Results: ``edge`` (b,); ``axis`` (b, 3): unit vectors to the second nodes; ``weight`` (b,):
    there, with that of loads, along the edge, N.
    """
    edge = np.flatnonzero(network.edge_spring[: network.count_edges(bricks)] < 0)
    axis = network.edge_axis[edge]
    return edge, axis, np.einsum("bi,bi->b", axis, network.inner_load(bricks)[1::2])
