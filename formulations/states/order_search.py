r"""The order in which bricks are placed, by all sets of bricks, or where these are many by trying.

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

Where there are more than ``most`` pairs it goes on as a *heuristic*: from the best of a few orders
it moves single bricks and runs of them to other places, as long as some schedule of the new order
has a smaller worst step. The sets that were looked at leave a lower bound, and so does the whole
structure, with which every order ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from formulations.states._search import best_order, exact_best, shortest, watched
from formulations.states._totals import StopError
from seqopt.errors import NothingFoundError, ProblemError, TimeUpError
from seqopt.graph._explore import Explorer, Visited
from seqopt.graph.formulation import Formulation, FormulationKind, Watch
from seqopt.graph.orders import (
    AllOrders,
    OrderSelection,
    OrderStates,
    TooManySetsError,
    Trial,
    order_value,
    trying,
    whole_bound,
)
from seqopt.graph.paths import keep_best, lexicographic, reached
from seqopt.responses.resources import HERE, Resources
from seqopt.scene.scene import ORDERS, Order
from seqopt.work._workers import hire, map_ordered
from seqopt.work.progress import Stage

FAR_BELOW = 4.0  # the best order known, over the first threshold
GROWTH = 1.1  # of the threshold
BETTER = 1e-9  # share by which an order must be better


@dataclass
class _Search:
    """What was found so far."""

    problem: AllOrders
    watch: Watch
    resources: Resources
    order: Order = ()
    value: float = np.inf
    bound: float = -np.inf
    evaluated: int = 0
    tries: int = 0  # of orders beside the best, and how many are left
    left: int = 0

    def tell(self, what: object) -> None:
        """Say how far it is; end the search in time."""
        if self.resources.progress is not None:
            self.resources.progress(what)
        if self.watch.over:
            raise StopError("time")

    def try_order(self, order: Order) -> None:
        """Keep an order if it is allowed, and better than the best so far."""
        if self.problem.allows(order):
            self.take(order, order_value(self.problem, self.trial(order)))

    def trial(self, order: Order) -> Trial:
        """Return an order to be tried against the best so far; end the search in time."""
        best = f", the best {self.value:.6g}" if self.order else ""
        said: object = f"{self.evaluated} orders{best}"
        if self.tries:
            said = Stage("orders beside the best", 1 - self.left / self.tries)
        self.tell(said)
        return Trial(order, self.value * (1 - BETTER) if np.isfinite(self.value) else np.inf)

    def take(self, order: Order, value: float) -> bool:
        """Return whether an order that was tried is better than the best so far, and keep it."""
        self.evaluated += 1
        self.left -= 1
        better = value < self.value
        if better:
            self.order, self.value = order, value
        return better


def solve(
    problem: AllOrders,
    *,
    most: int = 5000,
    tries: int = 200,
    seed: int = 0,
    seconds: float = np.inf,
    resources: Resources = HERE,
) -> OrderSelection:
    """Return the best order, or a good one and a bound.

    ``most``: pairs of a set of bricks and a newest one, up to which all orders are looked at;
    ``tries``: how many orders are tried where there are more; ``seed``: in which turn; ``seconds``:
    after which the best order found is returned; ``resources``: what is found does not depend on
    them. Raises `InfeasibleError`, `ProblemError`, `TimeUpError` if no order has a plan; a number
    is none, or no plan was found by the end of the search.
    """
    if most < 0 or tries < 0:
        raise ProblemError(f"options most={most}, tries={tries}: give whole numbers from 0 on")
    search = _Search(problem, Watch(seconds), resources)
    states = problem.states
    if states.totals or states.budgets or states.goals[0].margins:
        tell = watched(states, search.watch, np.inf, resources.progress or (lambda _: None))
        return best_order(problem, shortest, search.watch, tell)
    try:
        why = _run(search, most, tries, np.random.default_rng(seed))
    except StopError:
        if not search.order:
            raise TimeUpError("no order with a plan was found yet; give more") from None
        why = "time"
    except KeyboardInterrupt:
        if not search.order:
            raise
        why = "interrupt"
    if not search.order:
        raise NothingFoundError("options most, tries: no order was found with a plan; give more")
    bound = min(search.bound, search.value)
    return OrderSelection(search.order, search.value, bound, search.evaluated, why)


def _run(search: _Search, most: int, tries: int, rng: np.random.Generator) -> str:
    """Search all orders, or try some; return why not all were looked at."""
    scene = search.problem.scene
    own, *named = dict.fromkeys([scene.build_order, *(make(scene) for make in ORDERS.values())])
    search.try_order(own)
    search.bound = whole_bound(search.problem)
    if search.bound >= search.value * (1 - BETTER) or _all_orders(search, most):
        return ""
    for order in named:
        search.try_order(order)
    _neighbors(search, tries, rng)
    return "size"


def _all_orders(search: _Search, most: int) -> bool:
    """Return whether all orders were looked at below a rising threshold; then the best is known."""
    space = OrderStates(search.problem, most)
    ceiling, threshold = search.value, -np.inf
    if not space.peaks[0]:  # no state is too dear
        ceiling = threshold = np.finfo(float).max
    elif np.isfinite(ceiling):
        threshold = max(ceiling / FAR_BELOW, search.bound)
    found = Explorer(
        space, tell=lambda it: search.tell(Stage("all orders", it.level / space.levels))
    )
    try:
        while not found.rise(threshold):
            search.bound = max(search.bound, min(found.excluded, ceiling))
            if found.excluded == np.inf or threshold >= ceiling:
                break
            threshold = max(found.excluded, min(ceiling, threshold * GROWTH))
    except TooManySetsError:
        return False
    finally:
        search.evaluated = max(search.evaluated, len(space.parts) - 1)
    if found.whole:
        visited, best = exact_best(found)
        if best.values[0] < search.value * (1 - BETTER):
            search.value = best.values[0]
            search.order = search.problem.order_of(visited.of(_first_ending(visited)))
    elif not search.order:
        raise found.without_plan(
            "no order of the bricks has a plan; extend a reach, loosen a rule or raise a limit"
        )
    search.bound = search.value
    return True


def _first_ending(visited: Visited) -> tuple[int, ...]:
    """Return the best path that ends with the first brick: many orders are equally good."""
    graph, states = visited
    kept = keep_best(graph, 0)[0]
    ends = graph.ends & reached(kept)
    number = np.repeat([part[1] for _, part, _ in states], [len(rows) for _, _, rows in states])
    return lexicographic(replace(kept, ends=ends & (number == number[ends].min()))).path


def _neighbors(search: _Search, tries: int, rng: np.random.Generator) -> None:
    """Try orders beside the best, until none of them is better or all tries are made."""
    if not search.order:
        return
    search.tries = search.left = tries
    better = True
    with hire(search.resources.executor, search.resources.workers) as crew:
        work = trying(search.problem, elsewhere=crew is not None)
        while better and search.left > 0:
            orders = [*islice(_beside(search.order, search.problem, rng), search.left)]
            trials = map(search.trial, orders)
            with closing(map_ordered(work, trials, crew)) as found:  # ends at the first better one
                better = any(map(search.take, orders, found))


def _beside(order: Order, problem: AllOrders, rng: np.random.Generator) -> Iterator[Order]:
    """Yield allowed orders in which one brick, or two or three in a row, stand elsewhere."""
    count = len(order)
    runs = [(a, size) for size in (1, 2, 3) for a in range(count - size + 1)]
    moves = [(a, size, to) for a, size in runs for to in range(count - size + 1) if to != a]
    for i in rng.permutation(len(moves)).tolist():
        start, size, to = moves[i]
        run, rest = order[start : start + size], order[:start] + order[start + size :]
        changed = rest[:to] + run + rest[to:]
        if problem.allows(changed):
            yield changed


FORMULATION = Formulation(
    "order_search",
    "the order in which bricks are placed, by all sets of bricks or by trying",
    FormulationKind.EXACT,
    None,
    solve,
    answers=("order",),
)
