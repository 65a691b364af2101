"""One partial structure as bars and joints, and the peers that are asked for its answers.

Frame packages know no rigid bricks, so bricks are stiff bars. Joints of one isotropic stiffness
``k`` in translation and ``c`` in rotation are elastic beams, exactly: an Euler-Bernoulli beam of
length ``sqrt(12 c / k)`` about the joint, with ``EA/L = k`` and ``EI/L = GJ/L = c``, has just
these.

`Loop` is what one would write with SciPy: the stiffness matrix of a brick count is kept. For every
grip set the rows and columns that the grips hold are replaced by those of the identity and the
matrix is factored anew by LAPACK's banded Cholesky, the fastest that was tried; all that is asked
for is a sparse product with the solution.

`OpenSees` is the fastest of the frame packages that were tried. A model is kept for one brick count
and only its pins are swapped. Half-edges are rigid offsets of the joints' beams, which leaves two
nodes a brick. Its license restricts redistribution: it is installed by hand.
"""

import ctypes
import importlib
import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy import linalg, sparse

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


@dataclass(frozen=True)
class Kept:
    """What is computed once per brick count; n unknowns."""

    chain: Chain
    matrix: Floats  # (n, n)
    load: Floats  # (n,)
    edge: sparse.csr_array  # (E, n), as the next for unit displacements
    support: sparse.csr_array  # (6A, n)


def gap_rows(chain: Chain) -> Floats:
    """Return the deformations of all joints for unit motions of the inner nodes, (s, 6, n)."""
    out = np.zeros((len(chain.joints), 6, 6 * len(chain.position)))
    for s, pair in enumerate(chain.joints):
        for node, sign in zip(pair, (-1.0, 1.0), strict=True):
            if node != GROUND:
                block = out[s, :, 6 * node : 6 * node + 6]
                block += sign * np.eye(6)
                block[:3, 3:] -= sign * skew(chain.point[s] - chain.position[node])
    return out


def bar_rows(chain: Chain) -> tuple[Floats, Floats, Floats]:
    """Return deformations at mid-length (b, 6, 12b), their stiffnesses, and stretches (b, 12b).

    A beam with GJ = EI is a spring at its middle: EA/L along it, 12 EI/L³ across, EI/L in turning.
    """
    size = 6 * len(chain.position)
    gap = np.zeros((chain.bricks, 6, size))
    stiffness = np.zeros((chain.bricks, 6, 6))
    along = np.zeros((chain.bricks, size))
    stretch, turn = CONTRAST * chain.stiffness
    for b in range(chain.bricks):
        half = 0.5 * (chain.position[2 * b + 1] - chain.position[2 * b])
        axis = half / np.linalg.norm(half)
        for node, sign in ((2 * b, -1.0), (2 * b + 1, 1.0)):
            block = gap[b, :, 6 * node : 6 * node + 6]
            block += sign * np.eye(6)
            block[:3, 3:] += skew(half)
        across = 3 * turn / float(half @ half)
        stiffness[b, :3, :3] = across * np.eye(3) + (stretch - across) * np.outer(axis, axis)
        stiffness[b, 3:, 3:] = turn * np.eye(3)
        along[b] = stretch * axis @ gap[b, :3]
        along[b, 6 * 2 * b + 3 : 6 * 2 * b + 6] = along[b, 12 * b + 9 : 12 * b + 12] = 0.0
    return gap, stiffness, along


def kept(network: Network, bricks: int, factor: float = 1.0) -> Kept:
    """Return what a loop keeps; ``factor`` falsifies the joints' stiffness, for a control."""
    chain = chain_of(network, bricks)
    gap = gap_rows(chain)
    diagonal = factor * np.repeat(chain.stiffness, 3)
    matrix = np.einsum("sik,i,sil->kl", gap, diagonal, gap, optimize=True)
    force = -diagonal[:, None] * gap  # on the second body
    bars, stiffness, along = bar_rows(chain)
    matrix += np.einsum("bik,bij,bjl->kl", bars, stiffness, bars, optimize=True)
    edge = chain.half @ force[:, :3].reshape(-1, matrix.shape[0])
    edge[chain.inner] = along
    base = force[chain.support]
    base[:, 3:] += skew(chain.point[chain.support] - chain.anchor[chain.support]) @ base[:, :3]
    return Kept(
        chain=chain,
        matrix=matrix,
        load=np.hstack([chain.load, np.zeros_like(chain.load)]).ravel(),
        edge=sparse.csr_array(edge),
        support=sparse.csr_array(base.reshape(-1, matrix.shape[0])),
    )


class Loop:
    """A kept matrix, factored anew for every grip set."""

    def __init__(self, parts: Kept) -> None:
        self.parts = parts
        size = len(parts.matrix)
        blocks = np.abs(parts.matrix).reshape(size // 6, 6, size // 6, 6).max(axis=(1, 3)) > 0
        row, column = np.nonzero(np.kron(blocks, np.ones((6, 6))))
        self.width = int((row - column).max())
        lower = row >= column
        self.band = (row[lower] - column[lower], column[lower])
        self.take = (row[lower], column[lower])

    def solve(self, grips: Ints, want: Want) -> Answer:
        """See `Peer.solve`."""
        parts, chain = self.parts, self.parts.chain
        fixed = (6 * grips[:, None] + np.arange(3)).ravel()
        matrix, load = parts.matrix.copy(), parts.load.copy()
        matrix[fixed], matrix[:, fixed], matrix[fixed, fixed], load[fixed] = 0.0, 0.0, 1.0, 0.0
        band = np.zeros((self.width + 1, len(load)))
        band[self.band] = matrix[self.take]
        options = {"overwrite_ab": True, "overwrite_b": True, "check_finite": False}
        state = np.asarray(linalg.solveh_banded(band, load, lower=True, **options))
        force = np.asarray(parts.matrix[fixed] @ state - parts.load[fixed]).reshape(-1, 3)
        edge = parts.edge @ state if want & Want.EDGES else NOTHING
        moved = chain.motion @ state if want & Want.DISPLACEMENTS else NOTHING
        support = np.zeros((len(chain.acts), 6))
        support[chain.acts] = (parts.support @ state).reshape(-1, 6)
        return Answer(edge, moved.reshape(-1, 3), force, support)


LOOP = "SciPy bars, banded"
NOTHING: Floats = np.zeros(0)
LIBRARIES = ("libquadmath.so.0", "libgfortran.so.4", "libblas.so.3", "liblapack.so.3")


class OpenSees:
    """Two nodes a brick, banded Cholesky, single-point constraints swapped."""

    def __init__(self, chain: Chain) -> None:
        self.chain, self.held = chain, np.zeros(0, dtype=np.int64)
        self.ops = ops = open_sees()
        ops.wipe()
        ops.model("basic", "-ndm", 3, "-ndf", 6)
        count = len(chain.position)
        for i, x in enumerate(chain.position.tolist()):
            ops.node(i + 1, *x)
        self.bars = range(1, chain.bricks + 1)
        self.joints = range(chain.bricks + 1, chain.bricks + 1 + len(chain.joints))
        for tag in self.bars:
            span = chain.position[2 * tag - 1] - chain.position[2 * tag - 2]
            ops.geomTransf("Linear", tag, *_aside(span))
            self._beam(tag, 2 * tag - 1, 2 * tag, CONTRAST, float(np.linalg.norm(span)))
        for tag, (i, j), s in zip(self.joints, chain.joints, range(len(chain.joints)), strict=True):
            first = i + 1 if i != GROUND else count + 1 + s
            start = chain.position[i] if i != GROUND else chain.anchor[s]
            if i == GROUND:
                ops.node(int(first), *start.tolist())
                ops.fix(int(first), *[1] * 6)
            offsets = (chain.ends[s] - np.stack([start, chain.position[j]])).ravel().tolist()
            ops.geomTransf("Linear", tag, *_aside(chain.across[s]), "-jntOffset", *offsets)
            self._beam(tag, int(first), int(j) + 1, 1.0, chain.length)
        self.bases = (count + 1 + chain.support).tolist()
        ops.timeSeries("Constant", 1)
        ops.pattern("Plain", 1, 1)
        for i, force in enumerate(self.chain.load.tolist()):
            ops.load(i + 1, *force, 0.0, 0.0, 0.0)
        ops.constraints("Plain")
        ops.numberer("Plain")
        ops.system("BandSPD")
        ops.algorithm("Linear")
        ops.integrator("LoadControl", 1.0)
        ops.analysis("Static", "-noWarnings")

    def _beam(self, tag: int, first: int, second: int, factor: float, length: float) -> None:
        axial, turn = (factor * length * self.chain.stiffness).tolist()
        ends = (first, second)
        self.ops.element("elasticBeamColumn", tag, *ends, axial, 1.0, 1.0, turn, turn, turn, tag)

    def solve(self, grips: Ints, want: Want) -> Answer:
        """See `Peer.solve`."""
        ops, chain = self.ops, self.chain
        for node in self.held.tolist():
            for axis in (1, 2, 3):
                ops.remove("sp", node, axis)
        self.held = grips + 1
        ops.reset()
        for node in self.held.tolist():
            ops.fix(node, 1, 1, 1, 0, 0, 0)
        if ops.analyze(1):
            raise ArithmeticError("OpenSees: analysis failed")
        ops.reactions()
        held = np.array([ops.nodeReaction(n)[:3] for n in self.held.tolist()]).reshape(-1, 3)
        base = np.array([ops.nodeReaction(node) for node in self.bases])
        force = bars = state = NOTHING
        if want & Want.EDGES:
            force = -np.array([ops.eleForce(tag)[6:9] for tag in self.joints])
            bars = np.array([ops.basicForce(tag)[0] for tag in self.bars])
        if want & Want.DISPLACEMENTS:
            state = np.array([ops.nodeDisp(n + 1) for n in range(len(chain.position))])
        return chain.answer(state, force, bars, held, base)


def open_sees() -> Any:
    """Return OpenSees after loading the libraries that its wheel brings but does not find."""
    found = importlib.util.find_spec("openseespylinux")
    if found is not None and found.origin is not None:
        for name in LIBRARIES:
            path = Path(found.origin).parent / "lib" / name
            if path.exists():
                ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    return importlib.import_module("openseespy.opensees")


def _aside(direction: Floats) -> list[float]:
    """Return a direction well off the given one."""
    axis = int(np.abs(direction).argmin())
    return [float(i == axis) for i in range(3)]
