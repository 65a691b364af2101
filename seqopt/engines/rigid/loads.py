"""Forces at the nodes of bricks, as loads of an operator and in the inner edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, Ints
from seqopt.engines.basis import Basis
from seqopt.network.network import Network

GATHERED = 2**16  # numbers up to which gathering rows takes less than making a sparse matrix


@dataclass(frozen=True)
class Loads:
    """Forces at the loads of an operator, and the weight: few of hundreds, for each of S sets.

    Attributes
    ----------
    index : (S, k + 1) int
        Rows of the operator that are loaded, the weight's last.
    share : (S, k + 1) float
        By how much, N; of the weight, which part.
    count : int
        How many rows there are, the weight's among them.
    """

    index: Ints
    share: Floats
    count: int

    def sum(self, rows: Floats) -> Floats:
        """Return the sums of what the loads mean.

        Parameters
        ----------
        rows : (count, Q) float

        Returns
        -------
        (S, Q) float
        """
        if self.index.size * rows.shape[1] <= GATHERED:  # in the order of the sparse product
            return np.asarray(np.einsum("sk,skq->sq", self.share, rows[self.index]))
        return np.asarray(self.matrix @ rows)

    @cached_property
    def matrix(self) -> sparse.csr_array:
        """All shares, (S, count): with many sets half the time of a dense product."""
        first = np.arange(0, self.index.size + 1, self.index.shape[1], dtype=np.int32)
        entries = self.share.ravel(), self.index.ravel(), first
        return sparse.csr_array(entries, shape=(len(self.index), self.count))


def loads_of(index: Ints, force: Floats, count: int, weight: float = 1.0) -> Loads:
    """Return forces at the loads of an operator beside the weight.

    Parameters
    ----------
    index : (S, k) int
        Rows of the operator that are loaded.
    force : (S, k) float
        By how much, N.
    count : int
        How many rows there are, the weight's among them, which comes last.
    weight : float, optional
        Share of the weight.
    """
    sets, loads = index.shape
    rows = np.full((sets, loads + 1), count - 1, dtype=np.int32)
    rows[:, :-1] = index
    share = np.full((sets, loads + 1), weight)
    share[:, :-1] = force
    return Loads(rows, share, count)


def inner_edges(network: Network, bricks: int) -> tuple[Ints, Floats, Floats]:
    """Return the inner edges of bricks, and what weighs on their second nodes.

    Parameters
    ----------
    network : Network
    bricks : int
        How many stand.

    Returns
    -------
    edge : (b,) int
    axis : (b, 3) float
        Unit vectors to the second nodes.
    weight : (b,) float
        There, along the edge, N.
    """
    edge = np.flatnonzero(network.edge_spring[: network.count_edges(bricks)] < 0)
    axis = network.edge_axis[edge]
    return edge, axis, np.einsum("bi,bi->b", axis, network.inner_weight[1 : 2 * bricks : 2])


def inner_motions(network: Network, basis: Basis) -> Floats:
    """Return the displacements of the inner nodes of bricks for their unit twists.

    Parameters
    ----------
    network : Network
    basis : Basis
        d directions of forces, k of twists.

    Returns
    -------
    (n, 2d, k) float
    """
    count, forces = len(network.inner), len(basis.force)
    arms = network.node_position[network.inner] - network.centroid[:count, None]
    out = np.zeros((count, 2, forces, len(basis.wrench)))
    out[..., :forces] = np.eye(forces)
    out[..., forces:] = basis.levers(arms).swapaxes(-1, -2)
    return out.reshape(count, 2 * forces, len(basis.wrench))
