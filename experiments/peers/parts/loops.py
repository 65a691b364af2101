"""Plain SciPy loops: one factorization per grip set, with rigid bricks or stiff bars.

The stiffness matrix of a brick count is kept. For every grip set the rows and columns that the
grips hold are replaced by those of the identity and the matrix is factored anew by LAPACK's banded
Cholesky, the fastest that was tried; all that is asked for is a sparse product with the solution.

A rigid brick has six unknowns at its first inner node. If its second is held the unknowns are
moved there; if both are, they are turned so that only the turn about the line between is free.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from experiments.peers.parts.chain import CONTRAST, Answer, Chain, chain_of
from seqopt.arrays import Floats, Ints, skew
from seqopt.engines.interface import Want
from seqopt.network._mechanics import build_statics
from seqopt.network.network import GROUND, Network


@dataclass(frozen=True)
class Kept:
    """What is computed once per brick count; n unknowns."""

    chain: Chain
    rigid: bool
    matrix: Floats  # (n, n)
    load: Floats  # (n,)
    edge: sparse.csr_array  # (E, n), as the next two for unit displacements
    displacement: sparse.csr_array  # (3N, n)
    support: sparse.csr_array  # (6A, n)
    edge_of_load: sparse.csr_array  # (E, 6b) for unit forces on inner nodes; rigid bricks only
    dead: Floats  # (6b,) weight on the inner nodes


def gap_rows(chain: Chain, place: Ints, position: Floats) -> Floats:
    """Return the deformations of all joints for unit motions of the frame nodes, (s, 6, n)."""
    out = np.zeros((len(chain.joints), 6, 6 * len(position)))
    for s, pair in enumerate(chain.joints):
        for node, sign in zip(pair, (-1.0, 1.0), strict=True):
            if node != GROUND:
                at = place[node]
                block = out[s, :, 6 * at : 6 * at + 6]
                block += sign * np.eye(6)
                block[:3, 3:] -= sign * skew(chain.point[s] - position[at])
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


def kept(network: Network, bricks: int, *, rigid: bool, factor: float = 1.0) -> Kept:
    """Return what a loop keeps; ``factor`` falsifies the joints' stiffness, for a control."""
    chain = chain_of(network, bricks)
    nodes = len(chain.position)
    place = np.arange(nodes) // 2 if rigid else np.arange(nodes)
    position = chain.position[::2] if rigid else chain.position
    gap = gap_rows(chain, place, position)
    diagonal = factor * np.repeat(chain.stiffness, 3)
    matrix = np.einsum("sik,i,sil->kl", gap, diagonal, gap, optimize=True)
    force = -diagonal[:, None] * gap  # on the second body
    node = np.eye(12 * bricks)
    edge = chain.half @ force[:, :3].reshape(-1, matrix.shape[0])
    onto = np.zeros((edge.shape[0], 6 * bricks))
    if rigid:
        maps = build_statics(network)
        shifts = [_shift(chain, brick) for brick in range(bricks)]
        node = linalg.block_diag(*(np.vstack([np.eye(6), shift]) for shift in shifts))
        spread = np.zeros((len(network.springs.since), 3, matrix.shape[0]))
        spread[chain.springs] = force[:, :3]
        edge = maps.edge_of_spring[: len(onto)] @ spread.reshape(-1, matrix.shape[0])
        onto = maps.edge_of_load[: len(onto), : 6 * bricks].toarray()
    else:
        bars, stiffness, along = bar_rows(chain)
        matrix += np.einsum("bik,bij,bjl->kl", bars, stiffness, bars, optimize=True)
        edge[chain.inner] = along
    base = force[chain.support]
    base[:, 3:] += skew(chain.point[chain.support] - chain.anchor[chain.support]) @ base[:, :3]
    return Kept(
        chain=chain,
        rigid=rigid,
        matrix=matrix,
        load=node.reshape(nodes, 6, -1)[:, :3].reshape(-1, node.shape[1]).T @ chain.load.ravel(),
        edge=sparse.csr_array(edge),
        displacement=sparse.csr_array(chain.motion @ node),
        support=sparse.csr_array(base.reshape(-1, matrix.shape[0])),
        edge_of_load=sparse.csr_array(onto),
        dead=chain.load.ravel(),
    )


def _shift(chain: Chain, brick: int) -> Floats:
    """Return the motion of a brick's second inner node for that of its first."""
    out = np.eye(6)
    out[:3, 3:] = -skew(chain.position[2 * brick + 1] - chain.position[2 * brick])
    return out


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
        parts = self.parts
        turns = self._turns(grips) if parts.rigid else []
        held = set(grips.tolist())
        fixed = (6 * np.unique(self._at(grips))[:, None] + np.arange(3)).ravel()
        pairs = [b for b, _ in turns if {2 * b, 2 * b + 1} <= held]
        fixed = np.array([*fixed, *(6 * b + i for b in pairs for i in (4, 5))])
        matrix, load = parts.matrix.copy(), parts.load.copy()
        for brick, turn in turns:
            part = slice(6 * brick, 6 * brick + 6)
            near = slice(max(0, 6 * brick - self.width), 6 * brick + 6 + self.width)
            matrix[part, near] = turn.T @ matrix[part, near]
            matrix[near, part] = matrix[near, part] @ turn
            load[part] = turn.T @ load[part]
        matrix[fixed], matrix[:, fixed], matrix[fixed, fixed], load[fixed] = 0.0, 0.0, 1.0, 0.0
        band = np.zeros((self.width + 1, len(load)))
        band[self.band] = matrix[self.take]
        options = {"overwrite_ab": True, "overwrite_b": True, "check_finite": False}
        state = np.asarray(linalg.solveh_banded(band, load, lower=True, **options))
        for brick, turn in turns:
            state[6 * brick : 6 * brick + 6] = turn @ state[6 * brick : 6 * brick + 6]
        force = self._reactions(grips, state)
        edge = self._edges(grips, state, force) if want & Want.EDGES else np.zeros(0)
        moved = parts.displacement @ state if want & Want.DISPLACEMENTS else np.zeros(0)
        support = np.zeros((len(parts.chain.acts), 6))
        support[parts.chain.acts] = (parts.support @ state).reshape(-1, 6)
        return Answer(edge, moved.reshape(-1, 3), force, support)

    def _turns(self, grips: Ints) -> list[tuple[int, Floats]]:
        """Return bricks whose unknowns change, and the motions of the first node for unit ones."""
        chain, held, out = self.parts.chain, set(grips.tolist()), []
        for brick in sorted({g // 2 for g in held if g % 2}):
            turn = np.linalg.inv(_shift(chain, brick))
            if 2 * brick in held:
                span = np.diff(chain.position[2 * brick : 2 * brick + 2], axis=0)
                turn = np.eye(6)
                turn[3:, 3:] = np.linalg.svd(span)[2].T  # about the line first
            out.append((brick, turn))
        return out

    def _at(self, grips: Ints) -> Ints:
        """Return which six unknowns each grip holds some of."""
        return grips // 2 if self.parts.rigid else grips

    def _reactions(self, grips: Ints, state: Floats) -> Floats:
        """Return the grips' forces; two on one brick each take what reaches their own node."""
        parts = self.parts
        rows = (6 * self._at(grips)[:, None] + np.arange(3)).ravel()
        force = np.asarray(parts.matrix[rows] @ state - parts.load[rows]).reshape(-1, 3)
        for g in (g for g in grips.tolist() if parts.rigid and g % 2 and g - 1 in grips):
            self._split(grips, g, state, force)
        return force

    def _split(self, grips: Ints, second: int, state: Floats, force: Floats) -> None:
        """Share what two grips on one brick exert between them."""
        parts, brick = self.parts, second // 2
        rows = slice(6 * brick, 6 * brick + 6)
        total = parts.matrix[rows] @ state - parts.load[rows]
        span = parts.chain.position[second] - parts.chain.position[second - 1]
        axis = span / np.linalg.norm(span)
        mine = np.cross(total[3:], span) / (span @ span)
        reach = parts.edge[[parts.chain.inner[brick]]] @ state + axis @ parts.chain.load[second]
        mine = mine - float(reach[0]) * axis
        force[list(grips).index(second)] = mine
        force[list(grips).index(second - 1)] = total[:3] - mine

    def _edges(self, grips: Ints, state: Floats, force: Floats) -> Floats:
        parts = self.parts
        edge = parts.edge @ state
        if parts.rigid:
            load = parts.dead.copy()
            load[(3 * grips[:, None] + np.arange(3)).ravel()] += force.ravel()
            edge += parts.edge_of_load @ load
        return np.asarray(edge)


LOOPS = ["SciPy bars, banded", "SciPy bricks, banded"]


def loop(network: Network, bricks: int, name: str, factor: float = 1.0) -> Loop:
    return Loop(kept(network, bricks, rigid="bricks" in name, factor=factor))
