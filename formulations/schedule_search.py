r"""The states of a build by threshold and reachability, one goal after the other: exact.

A state is how many bricks stand and which node each robot holds; a plan is a path from the empty
site to an end of the build, each of its moves a step. Goals :math:`g_1, g_2, \dots` are minimized
in their order,

.. math::

   \operatorname{lex\,min}_{s_1, \dots, s_N} \; \bigl( g_1(s_1, \dots, s_N), \;
   g_2(s_1, \dots, s_N), \; \dots \bigr),
   \qquad
   g(s_1, \dots, s_N) = \max_i v(s_i)
   \quad\text{or}\quad
   g(s_1, \dots, s_N) = \sum_i c(s_{i-1}, s_i),

with :math:`v` the value of a state and :math:`c` the cost of a step. A narrow search without
regrips, which keeps the best states of every brick count, gives an incumbent. It is the best if it
takes no more than what all plans have in common: the finished structure at their end, and as many
steps as bricks and robots call for. If not, let its first goal be :math:`z`. The set

.. math::

   R(t) = \{ s : \text{a path from the start to } s \text{ has } v < t \text{ throughout} \}

grows with a rising threshold :math:`t`. While :math:`R(t)` has no end, the least :math:`v` next to
it is a lower bound. Where it has one there is a better incumbent, which a *dive* finds early: it
visits the states of :math:`R(t)` with the most bricks first, few at a time. From then on
thresholds lie between bound and incumbent, at the latter once it is close. When :math:`R(z)` has no
end, the states next to it are a cut: :math:`z` is the least worst value, and no response was
computed beyond that cut but for the dives. Later goals need the states that take :math:`z` too;
among these every goal is a shortest path, and what is on none is left out before the next. Where
the next one is the number of steps, :math:`k(s)` to a state and at least :math:`h(s)` from there
on, only states with :math:`k(s) + h(s) \le K` are visited, with :math:`K` rising from its lower
bound until they reach an end (A*, Hart, Nilsson and Raphael, 1968).

Responses have six digits until these do not decide. Where states must stand or be good in
scenarios, which is expensive, a first plan is sought without that, and kept only if it is then the
best; what the best plan of the first scenario takes in all is then where the threshold starts.
Whether states stand is asked only of those on the best path; where one falls, the next best path is
sought without it (Dellin and Srinivasa, A unifying formalism for shortest path problems with
expensive edge evaluations via lazy best-first search over paths with edge selectors, 2016). A
margin of stability comes first: the best one with which states still connect both ends is found by
halving an interval, and all further states must have it.
"""

from __future__ import annotations

from formulations._search import Options, Watching, after_margins, search_states
from formulations.on_graph import Choice, best_total, on_graph, shortest, within_caps
from seqopt.errors import ProblemError
from seqopt.graph.formulation import Solution, Watch
from seqopt.graph.graph import Graph
from seqopt.graph.states import States


def choose(graph: Graph, watch: Watch, *, width: int = 50, growth: float = 1.1) -> Choice:
    """Return the best path of a graph that is there.

    ``width``: from how many new states of a brick count the narrow search goes on; ``growth``: of
    the threshold from one search to the next, over itself. Raises `ProblemError` if an option is
    none.
    """
    _require_options(width, growth)
    return within_caps(graph, watch)


def _of_states(
    problem: States, watch: Watch, tell: Watching, *, width: int, growth: float
) -> Solution:
    """Return the best path through states; where expensive, a first plan only without limits."""
    _require_options(width, growth)
    if problem.totals:
        return best_total(problem, shortest, watch, tell)
    expensive = bool(problem.demands or problem.each) and not watch.is_limited
    options = Options(width, growth, expensive)
    return after_margins(problem, lambda rest: search_states(rest, options, tell), tell)


def _require_options(width: int, growth: float) -> None:
    if width < 1 or not growth > 1:
        raise ProblemError(
            f"options width={width}, growth={growth:g}: give a whole number from 1 on, and a "
            "number above 1"
        )


FORMULATION = on_graph(
    "schedule_search",
    "threshold and reachability among the states of a build",
    choose,
    takes_budgets=True,
    search=_of_states,
)
