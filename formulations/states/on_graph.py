"""What formulations of states share: the graph of states, and plans from its paths.

A formulation over the graph is a function from a `seqopt.graph.Graph` to a `Choice`: a path, and
what no path stays below; see `on_graph`. Of an instance the graph is given: nothing is computed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from formulations.states._search import (
    _cheapest,
    after_margins,
    best_order,
    best_total,
    chosen,
    path_values,
    watched,
)
from formulations.states._totals import least_total
from seqopt.arrays import Terse
from seqopt.errors import InfeasibleError, ProblemError, TimeUpError
from seqopt.graph._budgets import within_budgets
from seqopt.graph.formulation import Formulation, FormulationKind, On, Watch
from seqopt.graph.graph import Graph
from seqopt.graph.instances.instance import TAIL, Instance, _Target
from seqopt.graph.orders import AllOrders, OrderSelection
from seqopt.graph.solution import StatePath
from seqopt.graph.states.states import States
from seqopt.problem.problem import WORST_TOTAL, RobustAim, cvar
from seqopt.responses.resources import HERE, Resources
from seqopt.work.progress import Tell

_Choose = Callable[[Graph, Watch], tuple[tuple[int, ...], tuple[float, ...], bool]]


def _path_of_instance(instance: Instance, choose: _Choose, watch: Watch) -> StatePath:
    """Return the path that is chosen, its states the numbers of nodes; within caps by prices."""
    graph, goal = instance.graph, instance.goals[0]
    if instance.caps:
        best = within_budgets(graph, [cap.most for cap in instance.caps])
        goals = len(instance.goals)
        states = tuple((node,) for node in best.path)
        return StatePath(states, best.values[:goals], best.bounds[:goals], (), best.prices)
    if goal.kind == TAIL:
        found = least_total(graph, _aim(goal), _cheapest(choose, watch), watch)
        states = tuple((node,) for node in found.path)
        weights = (tuple(found.weights.tolist()),)
        early = "time" * watch.over
        return StatePath(states, (found.value,), (found.bound,), (), weights, early)
    path, known, early_ = choose(graph, watch)
    if not path:
        if not early_:
            raise InfeasibleError("no path leads to an end")
        raise TimeUpError("no path was found yet; give more")
    values = path_values(graph, path)
    bounds = (*known, *[-np.inf] * len(values))
    bound = tuple(map(min, values, bounds))
    return StatePath(tuple((node,) for node in path), values, bound, stopped="time" * early_)


def _aim(goal: _Target) -> RobustAim:
    """Return what is made of totals; one weight of all is that of the worst."""
    count = len(goal.columns)
    return WORST_TOTAL if goal.most >= 1.0 else cvar(max(0.0, 1.0 - 1.0 / (goal.most * count)))


class Choice(NamedTuple):
    """A path through a graph, its start left out and empty where none was found in time.

    ``bounds``: what no path stays below in the first goals, those before each being at their
    values; ``stopped``: whether time was over before all was found.
    """

    path: tuple[int, ...]
    bounds: tuple[float, ...] = ()
    stopped: bool = False


@dataclass(frozen=True, repr=False)
class _OnGraph(Terse):
    """The ``solve`` of a formulation that chooses a path through the graph of states."""

    name: str
    choose: Callable[[Graph, Watch], Choice] = field(repr=False)

    def __call__(
        self,
        problem: States | AllOrders | Instance,
        *,
        seconds: float = np.inf,
        max_memory: float = np.inf,
        progress: Tell = lambda _: None,
        resources: Resources = HERE,
    ) -> StatePath | OrderSelection:
        """Return the plan of the chosen path; where time or memory ends early, a first plan.

        Raises a `ProblemError` if there are budgets.
        """
        watch, told = Watch(seconds), resources.progress or progress
        if isinstance(problem, Instance):
            return self._of_instance(problem, watch)
        states = problem.states if isinstance(problem, AllOrders) else problem
        if states.budgets:
            able = "schedule_search or path_beam" if problem is states else "order_search"
            raise ProblemError(f"formulation {self.name}: it takes no budgets; take {able}")
        tell = watched(states, watch, max_memory, told)
        if isinstance(problem, AllOrders):
            return best_order(problem, self.choose, watch, tell)
        if problem.totals:
            return best_total(problem, self.choose, watch, tell)
        return after_margins(problem, lambda rest: chosen(rest, self.choose, watch, tell), tell)

    def _of_instance(self, instance: Instance, watch: Watch) -> StatePath:
        if instance.caps:
            raise ProblemError(f"formulation {self.name}: it takes no caps; take schedule_search")
        return _path_of_instance(instance, self.choose, watch)


def on_graph(
    name: str,
    summary: str,
    choose: Callable[[Graph, Watch], Choice],
    kind: FormulationKind = FormulationKind.EXACT,
) -> Formulation:
    """Return the formulation of states that chooses a path through the graph of states.

    ``choose``: returns a `Choice` of a graph whose moves are all on paths from the start to an end;
    stops when a `Watch` says so. If its first goal is a peak, the graph has the states below that
    of a first plan, by a narrow search.
    """
    solve = _OnGraph(name, choose)
    return Formulation(name, summary, kind, None, solve, on=On.STATES, also=(On.ORDERS, On.GRAPHS))
