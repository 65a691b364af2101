"""One partial structure as bars and joints: what the peers are shown, and what they answer.

Frame packages know no rigid bricks, so bricks are stiff bars. Joints of one isotropic stiffness
``k`` in translation and ``c`` in rotation are elastic beams, exactly: an Euler-Bernoulli beam of
length ``sqrt(12 c / k)`` about the joint, with ``EA/L = k`` and ``EI/L = GJ/L = c``, has just
these.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy import sparse

from seqopt.arrays import Bools, Floats, Ints, skew
from seqopt.engines.interface import Want
from seqopt.network.network import GROUND, Network, PartKind

CONTRAST = 1e6  # bar over joint stiffness, where frames without corrections err least: bending and
# rounding are each some 2e-5 of the fields here, at 1e5 and 1e7 ten and four times as much


class Answer(NamedTuple):
    """Fields of one model, as in `seqopt.engines.interface.Fields`; what is not asked is empty."""

    edge_force: Floats
    displacement: Floats
    grip_force: Floats
    support: Floats


class Peer(Protocol):
    """A model of one brick count that is asked for one grip set after the other."""

    def solve(self, grips: Ints, want: Want) -> Answer:
        """Return what is wanted with these places of ``network.inner.ravel()`` held."""


@dataclass(frozen=True)
class Chain:
    """A partial structure as bars and joints between the inner nodes of its bricks."""

    bricks: int
    position: Floats  # (2b, 3) of the inner nodes, m
    load: Floats  # (2b, 3) weight that these carry, N
    springs: Ints  # (s,) that act
    joints: Ints  # (s, 2) inner nodes they join, `GROUND` first for a ground end
    point: Floats  # (s, 3) position of the joints
    anchor: Floats  # (s, 3) fixed point of a ground end
    across: Floats  # (s, 3) a direction off the arch's plane
    stiffness: Floats  # (2,) of every joint, in translation and in rotation
    motion: sparse.csr_array  # (3N, 12b) displacements of all nodes for those of the inner ones
    half: sparse.csr_array  # (E, 3s) forces of half-edges for the joints' on their second bodies
    inner: Ints  # (b,) edges along the bricks
    acts: Bools  # (G,) which of the scene's ground ends act
    support: Ints  # (A,) joints at those that do

    @property
    def length(self) -> float:
        """Length of the beam that stands for a joint, m."""
        return float(np.sqrt(12 * self.stiffness[1] / self.stiffness[0]))

    @property
    def ends(self) -> Floats:
        """Ends of the joints' beams, (s, 2, 3), m."""
        reach = 0.5 * self.length * self.across
        return np.stack([self.point - reach, self.point + reach], axis=1)

    def answer(
        self, state: Floats, force: Floats, bars: Floats, held: Floats, base: Floats
    ) -> Answer:
        """Return the answer from displacements (2b, 6), forces of joints and bars, reactions.

        Those at the fixed points, (A, 6), are of the ground ends that act.
        """
        edge = self.half @ force.ravel() if force.size else np.zeros(0)
        edge[self.inner[: len(bars)]] = bars
        moved = (self.motion @ state.ravel()).reshape(-1, 3) if state.size else np.zeros((0, 3))
        support = np.zeros((len(self.acts), 6))
        support[self.acts] = base
        return Answer(edge, moved, held, support)


def chain_of(network: Network, bricks: int) -> Chain:
    """Return a partial structure whose joints are all of one isotropic stiffness."""
    springs = network.springs
    acting = np.flatnonzero(springs.since <= bricks)
    kinds = np.stack([springs.translational_stiffness, springs.rotational_stiffness], axis=1)
    if np.ptp(kinds, axis=(0, 2)).any():
        raise ValueError("joints differ in stiffness: a single beam does not stand for one")
    place = {int(node): i for i, node in enumerate(network.inner.ravel())}
    joints = np.full((len(acting), 2), GROUND)
    row = {int(s): i for i, s in enumerate(acting)}
    half = np.zeros((network.count_edges(bricks), len(acting), 3))
    for edge in range(len(half)):
        spring, kind = int(network.edge_spring[edge]), network.edge_kind[edge]
        if kind == PartKind.INNER or spring not in row:
            continue
        first = network.edge_brick[edge] == springs.bodies[spring, 0]
        if kind == PartKind.JOINT:
            joints[row[spring], 0 if first else 1] = place[int(network.edge_nodes[edge, 0])]
        sign = -1.0 if first and kind == PartKind.JOINT else 1.0
        half[edge, row[spring]] = sign * network.edge_axis[edge]
    return Chain(
        bricks=bricks,
        position=network.node_position[network.inner[:bricks].ravel()],
        load=np.repeat(0.5 * network.weight[:bricks], 2, axis=0),
        springs=acting,
        joints=joints,
        point=springs.position[acting],
        anchor=springs.anchor[acting],
        across=springs.axes[acting, 1],
        stiffness=kinds[0, :, 0],
        motion=_motion(network, bricks),
        half=sparse.csr_array(half.reshape(len(half), -1)),
        inner=np.flatnonzero(network.edge_spring[: len(half)] < 0),
        acts=np.isin(springs.support, acting),
        support=np.array([row[s] for s in springs.support.tolist() if s in row], dtype=np.int64),
    )


def _motion(network: Network, bricks: int) -> sparse.csr_array:
    """Return the displacements of all nodes; a joint node moves by the mean of its two sides."""
    out = np.zeros((3 * network.count_nodes(bricks), 12 * bricks))
    place = {int(node): i for i, node in enumerate(network.inner.ravel())}
    for node, i in place.items():
        if i < 2 * bricks:
            out[3 * node : 3 * node + 3, 6 * i : 6 * i + 3] = np.eye(3)
    for edge in range(network.count_edges(bricks)):
        if network.edge_kind[edge] != PartKind.JOINT:
            continue
        near, far = (int(n) for n in network.edge_nodes[edge])
        share = 0.5 if network.springs.since[network.edge_spring[edge]] <= bricks else 1.0
        arm = network.node_position[far] - network.node_position[near]
        block = out[3 * far : 3 * far + 3, 6 * place[near] : 6 * place[near] + 6]
        block += share * np.hstack([np.eye(3), -skew(arm)])
    return sparse.csr_array(out)
