r"""A beam of given width between the cascade and the exact optimum: a heuristic.

Of a graph whose costs are known, move by move it extends the ``width`` best beginnings of paths by
every move and, for each state that these reach, keeps the cheapest way to it:

.. math::

   B_k = \text{the } w \text{ states } j \text{ with the least } \;
   s_k(j) = \min_{i \in B_{k-1}} \left[ s_{k-1}(i) + c_k(j) + d_k(i, j) \right] .

With a width of all candidates it is dynamic programming and exact. The greedy choice that ranks
the shared step among the candidates of one move, as the cascade does, is kept beside it: the beam
never does worse. Moves after which as many moves are left as before are passed over.

Of the states of a free schedule it computes few responses: brick count by brick count it keeps the
``width`` states :math:`s` of least value :math:`v` that those kept before lead to by placing a
brick and letting go,

.. math::

   B_k = \text{the } w \text{ states } s \text{ next to } B_{k-1} \cup B_k
   \text{ with the least } \; v(s),

and returns the best path among them, goal by goal. Regrips are left out, but if no plan is found
without them: then all states are looked at. The value is that of the first goal; if that is about
moves and not about states, the states that come first are kept.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from formulations._search import (
    StopError,
    Watching,
    after_margins,
    best_standing,
    narrow,
    plan_by_then,
)
from formulations.cascade import _charged
from formulations.on_graph import Choice, best_total, greedy, on_graph, onward, shortest
from seqopt.errors import ProblemError
from seqopt.graph._spaces import build_space
from seqopt.graph.formulation import FormulationKind, Solution, Watch
from seqopt.graph.graph import Graph, moves_out, path_values
from seqopt.graph.space import Explorer
from seqopt.graph.states import States
from seqopt.problem.problem import Aim


def choose(graph: Graph, watch: Watch, *, width: int = 5) -> Choice:
    """Return the better one of the path of the beam and that of the cascade.

    ``width``: how many beginnings are kept, from 1; else a `ProblemError`.
    """
    _require_width(width)
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


def _of_states(problem: States, watch: Watch, tell: Watching, *, width: int = 5) -> Solution:
    """Return a plan through the few states of a beam; only margins of stability have a bound."""
    _require_width(width)
    if problem.totals:
        plan = best_total(problem, shortest, watch, tell, width)
        return replace(plan, bound=(-np.inf,))

    def search(rest: States) -> Solution:
        try:
            found = narrow(rest, width, tell, every=True)
            if found is None:
                every = Explorer(build_space(rest), tell=tell)
                if not every.rise():
                    raise every.without_plan("no plan is allowed")
                found = best_standing(every, rest.budgets)
        except StopError as stop:
            return plan_by_then(None, stop)
        return replace(found, bound=(-np.inf,) * len(found.bound))

    return after_margins(problem, search, tell)


def _require_width(width: int) -> None:
    if width < 1:
        raise ProblemError(f"beam: width is {width}; give a whole number from 1")


BEAM = on_graph(
    "beam",
    "a beam between cascade and exact",
    choose,
    FormulationKind.HEURISTIC,
    aim=Aim.SUM,
    alone=True,
)
PATH_BEAM = on_graph(
    "path_beam",
    "a beam over the states of every brick count",
    partial(choose, width=50),
    FormulationKind.HEURISTIC,
    alone=True,
    search=_of_states,
)
