"""What formulations of states do with an instance: its graph is given, and nothing is computed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from formulations.states._search import _cheapest, path_values
from formulations.states._totals import least_total
from seqopt.errors import InfeasibleError, TimeUpError
from seqopt.graph._budgets import within_budgets
from seqopt.graph.graph import Graph
from seqopt.graph.instances.instance import TAIL, Instance, _Target
from seqopt.plan.calling._guard import StatePath
from seqopt.plan.calling.formulation import Watch
from seqopt.problem.problem import WORST_TOTAL, RobustAim, cvar

_Choose = Callable[[Graph, Watch], tuple[tuple[int, ...], tuple[float, ...], bool]]


def path_of_instance(instance: Instance, choose: _Choose, watch: Watch) -> StatePath:
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
