"""What a formulation of paths returns, and the moves of a graph that lead on."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from seqopt.graph.graph import Graph
from seqopt.graph.paths import distances


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
