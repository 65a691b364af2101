"""The operators of all brick counts, from what grows with the build."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.basis import SPACE, Basis
from seqopt.engines.rigid.growth import Growth
from seqopt.engines.rigid.loads import inner_edges, inner_motions
from seqopt.engines.rigid.operator import ComplianceOperator
from seqopt.engines.rigid.response_maps import ResponseMaps, scene_maps
from seqopt.engines.rigid.spanning_tree import SpanningTree
from seqopt.network.network import Network


class OperatorBuilder:
    """Makes the operator of any brick count of a tree from what grows with it.

    Parameters
    ----------
    network : Network
    tree : SpanningTree
        On which the bricks hang.
    basis : Basis, optional
        The directions in which bricks are loaded and move; all by default.
    """

    def __init__(self, network: Network, tree: SpanningTree, basis: Basis = SPACE) -> None:
        self.network, self.basis = network, basis
        self.growth = Growth(network, tree, basis)
        self._maps = scene_maps(network, basis)
        self._nodes = inner_motions(network, basis)

    def operator(self, bricks: int, held: Ints | None = None) -> ComplianceOperator:
        """Return the operator of a partial structure.

        Parameters
        ----------
        bricks : int
            How many bricks stand, at most as many as the tree has.
        held : (h,) int, optional
            The bricks at whose nodes loads act, ascending; all by default.
        """
        self.growth.reach(bricks)
        held = np.arange(bricks) if held is None else held
        which = slice(bricks) if len(held) == bricks else held
        nodes = self._nodes[which]
        twist, wrench = self._rows(bricks, which, nodes)
        moved = _at_nodes(twist.reshape(len(twist), bricks, nodes.shape[2])[:, which], nodes)
        inner_edge, axis, at_second = inner_edges(self.network, bricks)
        return ComplianceOperator(
            held=held,
            flexibility=moved[:-1],
            dead_displacement=moved[-1],
            twist=twist,
            wrench=wrench,
            maps=ResponseMaps(self._maps, bricks),
            at_second=at_second,
            axis=axis @ self.basis.force.T,
            inner_edge=inner_edge,
            loss=np.repeat(self.growth.loss[held], nodes.shape[1]),
        )

    def _rows(self, bricks: int, which: Ints | slice, nodes: Floats) -> tuple[Floats, Floats]:
        """Return the twists and wrenches under unit loads at nodes, and under the weight."""
        k, loads = nodes.shape[2], nodes.shape[0] * nodes.shape[1]
        springs = int(np.searchsorted(self.network.springs.since, bricks, side="right"))
        out = []
        for answers, width in ((self.growth.twist, k * bricks), (self.growth.wrench, k * springs)):
            by_brick = answers[1 : 1 + k * bricks, :width].reshape(bricks, k, width)
            rows = np.empty((loads + 1, width))
            np.matmul(nodes, by_brick[which], out=rows[:-1].reshape(*nodes.shape[:2], width))
            rows[-1] = answers[0, :width]
            out.append(rows)
        return out[0], out[1]


def _at_nodes(twist: Floats, nodes: Floats) -> Floats:
    """Return the displacements (L, 2dh) of nodes for rows of twists (L, h, k)."""
    out = np.empty((len(twist), *nodes.shape[:2]))
    np.matmul(twist.transpose(1, 0, 2), nodes.swapaxes(1, 2), out=out.transpose(1, 0, 2))
    return out.reshape(len(twist), nodes.shape[0] * nodes.shape[1])
