"""The acts of a graph in time as arrays of an archive: written, and read after checks."""

from __future__ import annotations

import numpy as np

from seqopt.arms._archives import Archive
from seqopt.arrays import Ints
from seqopt.graph.graph import Graph
from seqopt.scene._checks import short
from seqopt.times._graph import NOW, TimedGraph

STORED = {
    f"timed_{name}": name
    for name in (
        *("free", "alike", "kinds", "move", "column", "origin"),
        *("prepares", "acts", "work", "longest"),
    )
}
"""Arrays of an archive, by name, and what they are of a `TimedGraph`."""


def read_acts(archive: Archive, graph: Graph, levels: Ints) -> TimedGraph:
    """Return who may act on the arcs of a graph, and for how long; ``levels`` (n,) of its nodes.

    Raises `FileError` or `ValueError` for arrays that do not fit it or each other.
    """
    kinds, move = (archive.array(f"timed_{name}", "iu", (None,)) for name in ("kinds", "move"))
    nodes, arcs, c, k = len(levels), len(graph.source), len(kinds), int(kinds.max(initial=-1)) + 1
    shapes = {"prepares": (arcs,), "acts": (arcs,), "work": (arcs, 1 + k), "longest": (c,)}
    seconds = {n: archive.numbers(f"timed_{n}", shape, 0.0) for n, shape in shapes.items()}
    if {*kinds.tolist()} != {*range(k)} or not k:
        raise ValueError(f"kinds of robots are {short(kinds.tolist())}; count them from 0")
    if not np.array_equal(np.unique(move), np.arange(arcs)) or (np.diff(move) < 0).any():
        raise ValueError("timed_move: give the arcs of acts in order, every arc at least once")
    return TimedGraph(
        graph=graph,
        levels=levels,
        kinds=kinds.astype(np.int64),
        move=move.astype(np.int64),
        column=archive.indices("timed_column", (len(move),), -1, c),
        origin=archive.indices("timed_origin", (len(move), c), NOW, c),
        free=archive.array("timed_free", "b", (nodes, c)),
        alike=archive.array("timed_alike", "b", (nodes, max(c - 1, 0))),
        **seconds,
    )
