"""Stretches of the cantilever method: where it holds, where it turns, and where it degenerates."""

from __future__ import annotations

import numpy as np

from seqopt.network.network import Network, PartKind
from seqopt.sequence.support import acting_bodies


def lies_along(network: Network) -> frozenset[int]:
    """Return the bricks that lie along the structure: joints meet both of their inner nodes.

    Returns
    -------
    frozenset of int
        Names of the bricks.
    """
    half = network.edge_kind == PartKind.JOINT.value
    touched = np.zeros(len(network.node_kind), dtype=bool)
    touched[network.edge_nodes[half, 0]] = True
    placed = network.scene.placed
    along = np.flatnonzero(touched[network.inner].all(axis=1))
    return frozenset(placed[i].name for i in along.tolist())


def begins_elsewhere(network: Network) -> frozenset[int]:
    """Return the bricks with which the cantilever method turns to another part of the structure.

    A stretch is a brick that is held while others are placed, and these others. A brick begins
    elsewhere if no joint ties it to the stretch that is being built; so does the first one.

    Returns
    -------
    frozenset of int
        Names of the bricks.
    """
    placed = network.scene.placed
    along, stretch, out = lies_along(network), set[int](), set[int]()
    tied: list[set[int]] = [set() for _ in placed]
    for first, second in acting_bodies(network, len(placed)).tolist():
        tied[second].add(first)
    for k, brick in enumerate(placed):
        if not tied[k] & stretch:
            out.add(brick.name)
        if brick.name in along | out:
            stretch = set()
        stretch.add(k)
    return frozenset(out)


def degeneration(network: Network, method: str) -> str:
    """Return why a method becomes another one on a structure, or nothing.

    Parameters
    ----------
    network : Network
    method : str
        A key of `seqopt.sequence.two_robots.METHODS`.

    Returns
    -------
    str
        A sentence; empty if the method is what its name says.

    Examples
    --------
    >>> import seqopt
    >>> shape = seqopt.ArchShape(pitch=(1.2, 0.4, -0.4, -1.2), pattern="V")
    >>> degeneration(seqopt.build_network(seqopt.arch_scene(shape)), "cantilever")
    'every brick lies along the structure: it is the sequential method here'
    """
    between = [brick.name for brick in network.scene.placed[1:-1]]  # after the last all let go
    if method != "cantilever":
        return ""
    if not between:
        return "no bricks lie between the first and the last: it is the sequential method here"
    along, elsewhere = lies_along(network), begins_elsewhere(network)
    if along.issuperset(between):
        return "every brick lies along the structure: it is the sequential method here"
    if along | elsewhere >= {*between}:
        return (
            "no brick extends one that is held: each begins elsewhere or lies along; "
            "it is the sequential method here"
        )
    if not (along | elsewhere) & {*between}:
        first = network.scene.placed[0].name
        return f"no brick lies along the structure: brick {first} is held until the end"
    return ""
