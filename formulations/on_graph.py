"""What formulations of paths share: a graph goes in, a path and its lower bounds come out.

A formulation is a function from a `seqopt.graph.graph.Graph` to a `formulations.choice.Choice`: a
path and its lower bounds. The graph is that of the open grips of a schedule, of the states of a
free schedule, of all orders, or of an instance; see `on_graph`. One of your own needs this import
alone:

>>> from formulations.on_graph import (
...     Aim, Choice, FormulationKind, Graph, Watch, on_graph, onward, path_values,
... )
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from formulations.choice import Choice, Choose, onward
from formulations.states._search import (
    after_margins,
    best_total,
    cheapest_by,
    chosen,
    least_total,
    watched,
)
from seqopt.arrays import Terse
from seqopt.errors import InfeasibleError, ProblemError, TimeUpError
from seqopt.graph.formulation import Formulation, FormulationKind, Solution, Watch, formulations
from seqopt.graph.graph import Graph
from seqopt.graph.instance import TAIL, Instance, _Target, _target_sums
from seqopt.graph.paths import path_values, tied
from seqopt.graph.states.states import States
from seqopt.problem.problem import WORST_TOTAL, Aim, cvar
from seqopt.work.progress import Tell


def path_of_instance(instance: Instance, choose: Choose, watch: Watch) -> Solution:
    """Return the chosen path of an instance; its states are the numbers of nodes."""
    graph, goal = instance.asked, instance.goals[0]
    if goal.kind == TAIL:
        found = _least_tail(graph, goal, choose, watch)
    else:
        found = choose(graph, watch)
        if not found.path and not found.stopped:
            raise InfeasibleError("no path leads to an end")
    if not found.path:
        raise TimeUpError("no path was found yet; give more")
    values = path_values(graph, found.path)[: graph.goals]
    if goal.kind == TAIL:
        values = (_target_sums(goal, np.array(values)),)
    bounds = (*found.bounds, *[-np.inf] * (len(values) - len(found.bounds)))
    states = tuple((node,) for node in found.path)
    early = ("interrupt" if watch.interrupted else "time") * found.stopped
    watch.tell(values[0], min(values[0], bounds[0]))  # the trace ends with what is claimed
    told = (found.prices, early)
    return Solution(
        states,
        values,
        tuple(v if v < b <= tied(v) else b for v, b in zip(values, bounds, strict=True)),
        (),
        *told,
        trace=watch.trace,
        compile_seconds=found.compile_seconds,
    )


def _least_tail(graph: Graph, goal: _Target, choose: Choose, watch: Watch) -> Choice:
    """Return the path of least worst or tail total over scenarios, with their weights."""
    aim = WORST_TOTAL  # the tail of which one scenario may have all the weight
    if goal.most < 1.0:
        aim = cvar(max(0.0, 1.0 - 1.0 / (goal.most * len(goal.columns))))
    found = least_total(graph, aim, cheapest_by(choose, watch), watch)
    return Choice(found.path, (found.bound,), watch.over, (tuple(found.weights.tolist()),))


@dataclass(frozen=True, repr=False)
class OnGraph(Terse):
    """The ``solve`` of a formulation that chooses a path through a graph."""

    name: str
    choose: Choose = field(repr=False)
    takes_budgets: bool
    search: Callable[..., Solution] | None = field(default=None, repr=False)
    alone: bool = False

    @property
    def __signature__(self) -> inspect.Signature:
        """The problem, the options of what it chooses by, and its own."""
        problem, *own = [*inspect.signature(type(self).__call__).parameters.values()][1:-1]
        return inspect.Signature([problem, *self._own_options().values(), *own])

    def _own_options(self) -> dict[str, inspect.Parameter]:
        """Return the options of what it chooses by, by name."""
        found = inspect.signature(self.choose).parameters
        return {n: p for n, p in found.items() if p.kind is inspect.Parameter.KEYWORD_ONLY}

    def __call__(
        self,
        problem: States | Instance,
        *,
        watch: Watch | None = None,
        seconds: float = np.inf,
        max_memory: float = np.inf,
        progress: Tell = lambda _: None,
        **options: Any,
    ) -> Solution:
        """Return the plan of the chosen path, or the incumbent at the limit of time or memory.

        Raises a `ProblemError` if there are budgets that it does not take.
        """
        watch = watch or Watch(seconds)
        watch.memory = min(watch.memory, max_memory)

        def choose(graph: Graph, watch: Watch) -> Choice:
            return self.choose(graph, watch, **options)

        if isinstance(problem, Instance):
            if problem.caps and not self.takes_budgets:
                raise ProblemError(f"formulation {self.name}: it takes no caps; take labels")
            return path_of_instance(problem, choose, watch)
        tell = watched(problem, watch, progress)
        if self.search is not None:
            own = {name: p.default for name, p in self._own_options().items()} | options
            return self.search(problem, watch, tell, **own)
        if problem.budgets and not self.takes_budgets:
            able = [name for name, each in formulations("goals").items() if each.takes_budgets]
            budget = problem.names[len(problem.aims)]
            raise ProblemError(
                f"{self.name}: the budget {budget!r} couples all moves; use {' or '.join(able)}"
            )
        if problem.totals:
            return best_total(problem, choose, watch, tell)

        def search(rest: States) -> Solution:
            return chosen(rest, choose, watch, tell, alone=self.alone)

        return after_margins(problem, search, tell)


__all__ = [
    "Aim",
    "Choice",
    "FormulationKind",
    "Graph",
    "Watch",
    "on_graph",
    "onward",
    "path_values",
]
PATHS = ("goals", "tail", "order", "instance")  # what a path through a graph answers


def on_graph(  # noqa: PLR0913  # the fields of a formulation
    name: str,
    summary: str,
    choose: Choose,
    kind: FormulationKind = FormulationKind.EXACT,
    *,
    aim: Aim | None = None,
    takes_budgets: bool = False,
    windowed: tuple[tuple[str, int | str], ...] | None = None,
    answers: tuple[str, ...] = PATHS,
    alone: bool = False,
    search: Callable[..., Solution] | None = None,
) -> Formulation:
    """Return the formulation that chooses a path through a graph.

    Parameters
    ----------
    name, summary : str
        What it is called, and what it does in a few words.
    choose : callable
        Returns a `Choice` of a `Graph` whose moves are all on paths from the start to an end; stops
        when a `Watch` says so; its options are keyword arguments with defaults. Of states whose
        first goal is a peak, the graph has those below that of a first plan, by a narrow search.
    kind : FormulationKind, optional
        What it promises.
    aim, takes_budgets, windowed, answers, alone : optional
        As of `seqopt.graph.formulation.Formulation`.
    search : callable, optional
        Chooses from states that it explores itself; takes them, a `Watch`, a callback of explorers
        and the same options.

    Returns
    -------
    Formulation
    """
    solve = OnGraph(name, choose, takes_budgets, search, alone)
    return Formulation(name, summary, kind, aim, solve, takes_budgets, windowed, answers, alone)
