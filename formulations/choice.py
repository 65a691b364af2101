"""What a formulation of paths returns, and the paths that take no search or that are shortest."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph
from seqopt.graph.paths import distances, lexicographic, moves_along, tied


class Choice(NamedTuple):
    """A path through a graph, its start left out and empty where none was found in time.

    ``bounds``: lexicographic lower bounds of the first goals, those before each being at their
    values; ``stopped``: whether time was over before all was found; ``prices``: by goal, the
    multipliers of caps and of the sums before it that prove its bound; ``compile_seconds``: what
    writing a program down took.
    """

    path: tuple[int, ...]
    bounds: tuple[float, ...] = ()
    stopped: bool = False
    prices: tuple[tuple[float, ...], ...] = ()
    compile_seconds: float = 0.0


Choose = Callable[..., Choice]
"""Takes a graph whose moves are all on paths from the start to an end, a `Watch` and options."""


def onward(graph: Graph) -> Graph:
    """Return the graph of moves after which fewer moves are left to an end."""
    left = distances(graph, np.ones(len(graph.source)), back=True)
    return graph.only(left[graph.target] < left[graph.source])


def greedy(graph: Graph, charged: Floats) -> tuple[int, ...]:
    """Return the path that always takes the move which is charged least, (m,), the first of ties.

    ``graph``: every move leads on to an end.
    """
    state, path = 0, list[int]()
    while not graph.ends[state]:
        moves = graph.moves_from(state)
        state = int(graph.target[moves][np.argmin(charged[moves])])
        path.append(state)
    return tuple(path)


def at_hand(graph: Graph, *ways: tuple[int, ...]) -> tuple[int, ...]:
    """Return the first path within the caps: of some, what is cheapest now, what is least capped.

    Empty if none of these is within all caps.
    """
    ahead, every = onward(graph), np.ones(graph.states, dtype=bool)
    ways += (greedy(ahead, ahead.amounts[:, 0]),)
    ways += tuple(
        lexicographic(graph.bare(c, every)).path for c in range(graph.goals, len(graph.peaks))
    )
    for path in ways:
        taken = graph.amounts[moves_along(graph, path)][:, graph.goals :].sum(axis=0)
        if (taken <= np.array([tied(cap) for cap in graph.caps])).all():
            return path
    return ()


def shortest(graph: Graph, watch: Watch) -> Choice:
    """Return the path that is best goal after goal; one that is at hand where time is over."""
    if watch.over:
        return Choice(at_hand(graph), stopped=True)
    return Choice(*lexicographic(graph))
