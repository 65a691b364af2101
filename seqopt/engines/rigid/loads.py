"""Forces at the nodes of bricks, as loads of an operator and in the inner edges."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, Ints
from seqopt.engines.basis import Basis
from seqopt.network.network import Network


def load_matrix(index: Ints, force: Floats, size: int, weight: float = 1.0) -> sparse.csr_array:
    """Return forces at the loads of an operator, and the weight, as rows of a matrix.

    A few entries of hundreds: multiplying only these takes half the time of a dense product.

    Parameters
    ----------
    index : (S, k) int
        Rows of the operator that are loaded.
    force : (S, k) float
        By how much, N.
    size : int
        How many rows there are before that of the weight.
    weight : float, optional
        Share of the weight.

    Returns
    -------
    (S, size + 1) sparse
    """
    sets, count = index.shape
    column = np.full((sets, count + 1), size, dtype=np.int32)
    column[:, :-1] = index
    value = np.full((sets, count + 1), weight)
    value[:, :-1] = force
    first = np.arange(0, column.size + 1, count + 1, dtype=np.int32)
    return sparse.csr_array((value.ravel(), column.ravel(), first), shape=(sets, size + 1))


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
