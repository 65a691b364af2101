r"""Exhaustive rank search: every combination of the next moves, the first one committed.

At move :math:`k`, with the choices before it committed, it enumerates all combinations of the
next :math:`h` moves,

.. math::

   \min_{o_k, \dots, o_{k+h-1}} \; \sum_{l=k}^{k+h-1} c_l(o_l) + d_k(o_{k-1}, o_k)
   + \sum_{l=k+1}^{k+h-1} d_l(o_{l-1}, o_l),

and commits :math:`o_k`. The step shared with the committed choice is ranked among the candidates
of move :math:`k` alone. With ``horizon=1`` this is the search of a single move of Bruun et al.
(equation 1), every candidate analyzed in every step of its window, ranked per criterion, least sum
wins, and chooses as ``cascade`` does; without proof it is that. With the whole build as horizon it
is brute force and exact; tests hold the other formulations against it on small builds. The work
grows with the product of the candidates' numbers. Moves after which as many moves are left as
before are passed over.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from formulations.on_graph import Choice, on_graph, onward
from seqopt.arrays import Floats, Ints
from seqopt.errors import ProblemError
from seqopt.graph.formulation import FormulationKind, Watch
from seqopt.graph.graph import Graph, moves_out
from seqopt.problem.problem import Aim

MOST = 20_000_000  # combinations in one enumeration


class _Ways(NamedTuple):
    """Combinations of moves: costs (n,), last states, and all states (n, h)."""

    cost: Floats
    states: Ints


def choose(graph: Graph, watch: Watch, *, horizon: int = 2) -> Choice:
    """Return the path of committed moves.

    ``horizon``: how many moves are enumerated at once, from 1. Raises `ProblemError` if it is below
    1, or combinations are more than `MOST`.
    """
    if horizon < 1:
        raise ProblemError(f"rank_search: horizon is {horizon}; give a whole number from 1")
    graph = onward(graph)
    path: list[int] = []
    stopped = False
    while not graph.ends[path[-1] if path else 0]:
        stopped = stopped or watch.over  # from then on it looks at one move at a time
        ways = _enumerate(graph, path[-1] if path else 0, 1 if stopped else horizon)
        best = ways.states[int(np.argmin(ways.cost))]
        whole = graph.ends[best[-1]]  # nothing is left to be decided after these
        path += best.tolist() if whole else best[:1].tolist()
    return Choice(tuple(path), stopped=stopped)


def _enumerate(graph: Graph, state: int, horizon: int) -> _Ways:
    """Return all combinations of the next moves from a state; those that end are kept as they are.

    The first move is charged by ranks among the moves from the state.
    """
    moves = np.arange(len(graph.source))[graph.moves_from(state)]
    alone = graph.amounts[moves, 0] if graph.alone is None else graph.alone[moves].sum(axis=1)
    ways = _Ways(alone, graph.target[moves][:, None].astype(np.int64))
    out = np.bincount(graph.source, minlength=graph.states)
    for _ in range(horizon - 1):
        if graph.ends[ways.states[:, -1]].all():
            break
        count = int(out[ways.states[:, -1]].sum())
        if count > MOST:
            raise ProblemError(
                f"rank_search: {count:.2g} combinations of {ways.states.shape[1] + 1} moves; "
                f"lower the horizon (at most {MOST:.0e} are enumerated)"
            )
        row, moves = moves_out(graph, ways.states[:, -1])
        more = graph.amounts[moves, 0]
        cost = np.maximum(ways.cost[row], more) if graph.peaks[0] else ways.cost[row] + more
        states = np.column_stack([ways.states[row], graph.target[moves]])
        ways = _Ways(cost, states)
    return ways


FORMULATION = on_graph(
    "rank_search",
    "exhaustive search of the next moves",
    choose,
    FormulationKind.HEURISTIC,
    aim=Aim.SUM,
    alone=True,
    windowed=(("horizon", 1),),
)
