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

Goals after the first are those of the best path, over all orders too. The search is that of
`schedule_search`, from the best plan in the scene's own order. Where there are more than ``most``
pairs it goes on as a *heuristic*: from the best of a few orders it moves single bricks and runs of
them to other places, as long as some schedule of the new order has a smaller worst step. The sets
that were looked at leave a lower bound, and so does the whole structure, which all orders pass.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import islice

import numpy as np

from formulations.states._search import (
    Options,
    ThresholdSearch,
    Watching,
    first_threshold,
    plan_by_then,
    search_states,
    threshold_search,
    unproven,
    watched,
)
from formulations.states._totals import StopError
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError
from seqopt.graph._orders import (
    OrderRules,
    TooManySetsError,
    Trial,
    order_rules,
    order_value,
    trying,
)
from seqopt.graph.formulation import Formulation, FormulationKind, Solution, Watch, find_formulation
from seqopt.graph.states.states import States
from seqopt.scene.scene import ORDERS, Order
from seqopt.work._workers import hire, map_ordered
from seqopt.work.progress import Stage, Tell

BETTER = 1e-9  # share by which an order must be better
HOW = Options(width=50, growth=1.1, dear=False)


def solve(
    problem: States,
    *,
    most: int = 5000,
    tries: int = 200,
    seed: int = 0,
    seconds: float = np.inf,
    max_memory: float = np.inf,
    progress: Tell = lambda _: None,
) -> Solution:
    """Return the best plan in any order, or one in a good order and a bound.

    ``most``: pairs of a set of bricks and a newest one, up to which all orders are looked at;
    ``tries``: how many orders are tried where there are more; ``seed``: in which turn; ``seconds``,
    ``max_memory`` (bytes): after which, or above which, the best plan found is returned. Raises
    `InfeasibleError`, `ProblemError`, `TimeUpError` if no order has a plan; a number is none, or no
    plan was found by the end of the search.
    """
    if most < 0 or tries < 0:
        raise ProblemError(f"options most={most}, tries={tries}: give whole numbers from 0 on")
    first = problem.goals[0]
    if not first.is_peak or first.margins or problem.budgets:
        limits = {"seconds": seconds, "max_memory": max_memory, "progress": progress}
        found: Solution = find_formulation("schedule_search").solve(problem, **limits)
        return found
    watch = Watch(seconds)
    search = threshold_search(problem, HOW, watched(problem, watch, max_memory, progress), most)
    own = problem.network.scene.build_order
    try:
        if order_rules(problem).allows(own):
            quiet = watched(problem, watch, max_memory, lambda _: None)
            search.incumbent = _plan_in(problem, own, quiet)
        if search.is_best and search.incumbent:
            return search.incumbent
        return search.best(first_threshold(problem, HOW))
    except TooManySetsError:
        tried = _Tried(problem, watch, progress, search.incumbent)
        return tried.best(search, tries, np.random.default_rng(seed))
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


class _Tried:
    """Orders that are tried one by one: the best so far, the value of its plan, and how many."""

    def __init__(
        self, problem: States, watch: Watch, progress: Tell, first: Solution | None
    ) -> None:
        self._problem, self._watch, self._progress = problem, watch, progress
        self._rules = order_rules(problem)
        self.order: Order = first.order if first else ()
        self.value = first.objective[0] if first else np.inf
        self.count = self._tries = self._left = 0

    def best(self, search: ThresholdSearch, tries: int, rng: np.random.Generator) -> Solution:
        """Return the plan of the best order that is found, and what the search proved before."""
        scene, why = self._problem.network.scene, "size"
        try:
            for order in dict.fromkeys(make(scene) for make in ORDERS.values()):
                if self._rules.allows(order):
                    self._take(order, order_value(self._problem, self._trial(order)))
            self._neighbors(tries, rng)
        except (StopError, KeyboardInterrupt) as stop:
            why = str(stop) or "interrupt"
            if not self.order:
                plan_by_then(None, stop)  # says so
        if not self.order:
            raise NothingFoundError(
                "options most, tries: no order was found with a plan; give more"
            )
        found = search.incumbent
        if found is None or found.order != self.order:
            found = _plan_in(self._problem, self.order, lambda _: None)
        assert found is not None  # as it has a value
        value = found.objective[0]
        bound = min(search.bound, value)
        bounds = (bound, *[-np.inf] * (len(found.objective) - 1))
        closed = len(bounds) == 1 and bound >= value * (1 - BETTER)
        sets, models = search.wide.space.effort
        effort = max(self.count, sets), models + found.effort[1]
        return replace(found, bound=bounds, stopped="" if closed else why, effort=effort)

    def _trial(self, order: Order) -> Trial:
        """Return an order to be tried against the best so far; end the search in time."""
        best = f", the best {self.value:.6g}" if self.order else ""
        said: object = f"{self.count} orders{best}"
        if self._tries:
            said = Stage("orders beside the best", 1 - self._left / self._tries)
        self._progress(said)
        if self._watch.over:
            raise StopError("time")
        return Trial(order, self.value * (1 - BETTER) if np.isfinite(self.value) else np.inf)

    def _take(self, order: Order, value: float) -> bool:
        """Return whether an order that was tried is better than the best so far, and keep it."""
        self.count += 1
        self._left -= 1
        better = value < self.value
        if better:
            self.order, self.value = order, value
        return better

    def _neighbors(self, tries: int, rng: np.random.Generator) -> None:
        """Try orders beside the best, until none of them is better or all tries are made."""
        self._tries = self._left = tries
        better, means = bool(self.order), self._problem.resources
        with hire(means.executor, means.workers) as crew:
            work = trying(self._problem, elsewhere=crew is not None)
            while better and self._left > 0:
                orders = [*islice(_beside(self.order, self._rules, rng), self._left)]
                trials = map(self._trial, orders)
                with closing(map_ordered(work, trials, crew)) as found:  # ends at the first better
                    better = any(map(self._take, orders, found))


def _beside(order: Order, rules: OrderRules, rng: np.random.Generator) -> Iterator[Order]:
    """Yield allowed orders in which one brick, or two or three in a row, stand elsewhere."""
    count = len(order)
    runs = [(a, size) for size in (1, 2, 3) for a in range(count - size + 1)]
    moves = [(a, size, to) for a, size in runs for to in range(count - size + 1) if to != a]
    for i in rng.permutation(len(moves)).tolist():
        start, size, to = moves[i]
        run, rest = order[start : start + size], order[:start] + order[start + size :]
        changed = rest[:to] + run + rest[to:]
        if rules.allows(changed):
            yield changed


FORMULATION = Formulation(
    "order_search",
    "the order in which bricks are placed, by all sets of bricks or by trying",
    FormulationKind.EXACT,
    None,
    solve,
    answers=("order",),
)
