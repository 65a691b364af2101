r"""A beam of given width between the cascade and the exact optimum.

Move by move it extends the ``width`` best beginnings of paths by every move and, for each state
that these reach, keeps the cheapest way to it:

.. math::

   B_k = \text{the } w \text{ states } j \text{ with the least } \;
   s_k(j) = \min_{i \in B_{k-1}} \left[ s_{k-1}(i) + c_k(j) + d_k(i, j) \right] .

With a width of all candidates it is dynamic programming and exact. The greedy choice that ranks
the shared step among the candidates of one move, as the cascade does, is kept beside it: the beam
never does worse. Moves after which as many moves are left as before are passed over.
"""

from __future__ import annotations

import numpy as np

from formulations.cascade import _charged, greedy
from formulations.choice import Choice, onward
from formulations.on_graph import on_graph
from seqopt.errors import ProblemError
from seqopt.graph.formulation import FormulationKind, Watch
from seqopt.graph.graph import Graph
from seqopt.graph.paths import moves_out, path_values
from seqopt.problem.problem import Aim


def choose(graph: Graph, watch: Watch, *, width: int = 5) -> Choice:
    """Return the better one of the path of the beam and that of the cascade.

    ``width``: how many beginnings are kept, from 1; else a `ProblemError`.
    """
    if width < 1:
        raise ProblemError(f"beam: width is {width}; give a whole number from 1")
    graph = onward(graph)
    found = [_beam(graph, width, watch), greedy(graph, _charged(graph, "later"))]
    met = [path for path in found if path]
    best = min(met, key=lambda path: path_values(graph, path)[0])
    return Choice(best, stopped=len(met) < len(found))


def _beam(graph: Graph, width: int, watch: Watch) -> tuple[int, ...]:
    """Return the best path of the beam; empty if time is over."""
    states, spent = np.zeros(1, dtype=np.int64), np.zeros(1)
    paths: list[tuple[int, ...]] = [()]
    best, path = np.inf, tuple[int, ...]()
    while len(states):
        if watch.over:
            return ()
        row, moves = moves_out(graph, states)
        more = graph.amounts[moves, 0]
        through = np.maximum(spent[row], more) if graph.peaks[0] else spent[row] + more
        order = np.lexsort((through, graph.target[moves]))
        first = np.r_[True, np.diff(graph.target[moves][order]) > 0]
        kept = order[first]  # the cheapest way to each state
        kept = kept[np.argsort(through[kept], kind="stable")][:width]
        paths = [(*paths[row[n]], int(graph.target[moves[n]])) for n in kept]
        states, spent = graph.target[moves[kept]].astype(np.int64), through[kept]
        at_end = graph.ends[states]
        for n in np.flatnonzero(at_end & (spent < best))[:1]:  # they are sorted
            best, path = float(spent[n]), paths[n]
        paths = [way for way, ended in zip(paths, at_end, strict=True) if not ended]
        states, spent = states[~at_end], spent[~at_end]
    return path


FORMULATION = on_graph(
    "beam",
    "a beam between cascade and exact",
    choose,
    FormulationKind.HEURISTIC,
    aim=Aim.SUM,
    alone=True,
)
