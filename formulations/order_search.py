r"""The order in which bricks are placed, by all sets of bricks.

The value of an order :math:`\pi` is the least worst step of any schedule of it. Orders share what
they have in common: with the set :math:`S` of bricks standing and the newest :math:`b \in S` known,
neither the responses nor the moves depend on how the rest was placed. The best order is therefore a
bottleneck path

.. math::

   \min_{\pi} \; \min_{s_1, \dots, s_N} \; \max_i v(s_i),
   \qquad s_i = (S_i, b_i, \text{who holds which node}),

from the empty site to all bricks. A threshold rises, as for one order, until states below it
connect both; the least value is among these. An arch of :math:`n` bricks that is built
from its ends has some :math:`n^2` pairs :math:`(S, b)`, and any order of it is one of them.

Goals after the first are those of the best path, over all orders too. The search is that of
`schedule_search`, from the best plan in the scene's own order. Where there are more than ``most``
pairs it ends with that plan, and with the bound of the sets that were looked at and of the whole
structure, which all orders pass.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from formulations._search import (
    Options,
    StopError,
    Watching,
    first_threshold,
    plan_by_then,
    search_states,
    threshold_search,
    unproven,
    watched,
)
from formulations.on_graph import Choice, on_graph, shortest
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError
from seqopt.graph._spaces import TooManySetsError, order_rules
from seqopt.graph.formulation import Solution, Watch, find_formulation
from seqopt.graph.graph import Graph
from seqopt.graph.states import States
from seqopt.scene.scene import Order

HOW = Options(width=50, growth=1.1, expensive=False)


def choose(graph: Graph, watch: Watch, *, most: int = 5000) -> Choice:  # noqa: ARG001  # of orders
    """Return the best path of a graph that is there.

    ``most``: pairs of a set of bricks and a newest one, up to which all orders are looked at. What
    the search returns at a limit of time or memory is the best plan by then.
    """
    return shortest(graph, watch)


def _of_orders(problem: States, watch: Watch, tell: Watching, *, most: int) -> Solution:
    """Return the best plan in any order, or the best in the scene's own and a bound."""
    if most < 0:
        raise ProblemError(f"option most={most}: give a whole number from 0 on")
    first = problem.goals[0]
    if not first.is_peak or first.margins or problem.budgets:
        found: Solution = find_formulation("schedule_search").solve(problem, watch=watch)
        return found
    search = threshold_search(problem, HOW, tell, most)
    own = problem.network.scene.build_order
    try:
        if order_rules(problem).allows(own):
            quiet = watched(problem, watch, lambda _: None)
            search.incumbent = _plan_in(problem, own, quiet)
        if search.is_best and search.incumbent:
            return search.incumbent
        return search.best(first_threshold(problem, HOW))
    except TooManySetsError as error:
        if search.incumbent is None:
            raise NothingFoundError(f"the scene's own order has no plan; {error}") from None
        found = unproven(search.incumbent, search.wide, search.bound)
        bound = (found.bound[0], *[-np.inf] * (len(found.bound) - 1))
        return replace(found, bound=bound, stopped="size", effort=search.wide.space.effort)
    except (StopError, KeyboardInterrupt) as stop:
        return unproven(plan_by_then(search.incumbent, stop), search.wide, search.bound)


def _plan_in(problem: States, order: Order, tell: Watching) -> Solution | None:
    """Return the best plan in an order, or the best by the end of the search; None without any."""
    own = problem.at(order)
    try:
        found = search_states(own, HOW, tell)
    except (InfeasibleError, NothingFoundError):
        return None
    return replace(found, visited=(), order=order, effort=(1, own.models))


FORMULATION = on_graph(
    "order_search",
    "the order in which bricks are placed, by all sets of bricks",
    choose,
    answers=("order",),
    search=_of_orders,
)
