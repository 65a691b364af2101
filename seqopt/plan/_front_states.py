"""What Pareto sets are of: the states of a schedule, of one build order or of all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Engine
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph._explore import Explorer, Key, Visited
from seqopt.graph.graph import Graph
from seqopt.graph.orders import MOST_PARTS, AllOrders, OrderStates
from seqopt.graph.paths import distances, fewest_moves, keep_best, reached
from seqopt.graph.states._visits import explore, steps_of, steps_with, with_held
from seqopt.graph.states.states import States
from seqopt.plan.judge._infeasible import confirmed
from seqopt.plan.judge._orders import finds_better_order
from seqopt.plan.judge.schedules import plan_values
from seqopt.problem.problem import Measure
from seqopt.scene.scene import Order
from seqopt.sequence.rules import Ending
from seqopt.sequence.steps import Step
from seqopt.work._workers import free_memory

DIGITS = 9  # after the first
EDGE = 1e-9  # of a rounding step: how far above a multiple a value still counts as it


class StateFront:
    """The schedule of a problem whose goals are all to be small at once.

    ``problem``: its goals are responses, margins of stability, and of a free schedule steps and
    regrips; ``rounding``: what numbers are rounded up to multiples of, by name, SI units; none by
    default. Raises `ProblemError` if the goals are others, or a rounding is no positive number.
    """

    def __init__(self, problem: States, rounding: Mapping[str, float] | None = None) -> None:
        self._problem = problem
        for goal in problem.goals:
            if goal.measure not in (Measure.PEAK, Measure.STEPS, Measure.REGRIPS):
                raise ProblemError(
                    f"pareto: {goal} adds up along a plan; give responses, steps and regrips"
                )
        self._round, self._rounding = _rounding_steps(self.names, rounding), rounding

    def __repr__(self) -> str:
        return f"<StateFront of {self._problem}>"

    def anew(self) -> StateFront:
        """Return the same problem with nothing known of it, for its judge."""
        return StateFront(replace(self._problem), self._rounding)

    @property
    def names(self) -> tuple[str, ...]:
        """The goals."""
        return tuple(map(str, self._problem.goals))

    def _explored(self) -> Explorer:
        """Return all states that are allowed; raise `InfeasibleError` if no build ends."""
        found = explore(self._problem)
        if not found.whole:
            raise confirmed(self._problem, "the search")
        return found

    @cached_property
    def _visited(self) -> Visited:
        found = self._explored()
        found.refine()
        graph, states = found.graph()
        amounts = graph.amounts.copy()
        peaks = [k for k, peak in enumerate(graph.peaks) if peak]
        amounts[:, peaks] = _rounded_up(amounts[:, peaks], self._round[peaks])
        return Visited(replace(graph, amounts=amounts), states)

    @cached_property
    def _counted(self) -> list[int]:
        """Which goals count moves: bounds on them hold along a path, not state by state."""
        measures = [goal.measure for goal in self._problem.goals]
        return [k for k, measure in enumerate(measures) if measure is not Measure.PEAK]

    def best_below(self, bounds: Floats) -> tuple[Floats, object] | None:
        """Return a plan that none beats among those below bounds.

        ``bounds`` (k,). Results: ``point`` (k,); ``plan``: None for both where there is no plan.
        """
        below = self._below(bounds)
        if not below.ends[reached(below)].any():
            return None
        graph = self._fewest(below, bounds) if len(self._counted) > 1 else below
        point = np.zeros(len(bounds))
        for k in sorted(range(len(bounds)), key=lambda k: k not in self._counted):
            if graph is None:
                return None
            graph, point[k] = keep_best(graph, k)
            if not point[k] < bounds[k]:
                return None
        assert graph is not None
        return point, self._plan(self._visited.of(fewest_moves(graph)))

    def _plan(self, found: Sequence[tuple[int, Key, Ints]]) -> object:
        """Return the plan of level, part and state (c,) of its states."""
        return tuple((level, *state.tolist()) for level, _, state in found)

    def _below(self, bounds: Floats) -> Graph:
        """Return the moves to states whose values are all below bounds."""
        graph = self._visited.graph
        return graph.only(np.asarray((graph.amounts < self._peaks(bounds)).all(axis=1)))

    def _fewest(self, graph: Graph, bounds: Floats) -> Graph | None:
        """Return the paths with as many grips held at the end as those with the fewest moves."""
        steps, regrips = self._of(Measure.STEPS), self._of(Measure.REGRIPS)
        found = []
        for held in range(self._problem.space.robots + 1):
            part = with_held(self._problem, graph, self._held == held)
            least = distances(part, part.amounts[:, regrips], back=True)[:1]
            count = steps_with(self._problem, least, np.array([held]))
            if least[0] < bounds[regrips] and count[0] < bounds[steps]:
                found.append((count[0], least[0], part))
        return min(found, key=lambda each: each[:2])[2] if found else None

    def _of(self, measure: Measure) -> int:
        return next(k for k in self._counted if self._problem.goals[k].measure is measure)

    def _peaks(self, bounds: Floats) -> Floats:
        out = bounds.copy()
        out[self._counted] = np.inf
        return out

    def is_empty_below(self, bounds: Floats) -> bool:
        """Return whether there is no plan below bounds, by distances from the empty site.

        ``bounds`` (k,).
        """
        graph = self._below(bounds)
        if not self._counted:
            return not graph.ends[reached(graph)].any()
        if [self._problem.goals[k].measure for k in self._counted] == [Measure.STEPS]:
            steps = distances(graph, np.ones(len(graph.source)))
            return not steps[graph.ends].min(initial=np.inf) < bounds[self._counted[0]]
        regrips = graph.amounts[:, self._of(Measure.REGRIPS)]
        least = distances(graph, 1.0 + graph.states * regrips)
        least[np.isfinite(least)] //= graph.states
        last = np.flatnonzero(graph.ends)
        if self._problem.free_rules.how_it_ends is not Ending.HELD:
            last = np.unique(graph.source[graph.ends[graph.target]])
        found, held = least[last], self._held[last]
        room = found < bounds[self._of(Measure.REGRIPS)]
        if len(self._counted) > 1:
            room &= steps_with(self._problem, found, held) < bounds[self._of(Measure.STEPS)]
        return not room.any()

    @cached_property
    def _held(self) -> Ints:
        """How many grips every state holds."""
        grips = [self._problem.space.grips(rows) for _, _, rows in self._visited.states]
        return np.concatenate(grips)

    def steps(self, plan: object) -> tuple[Step, ...]:
        """Return the checked steps of a plan.

        ``plan``: its states.
        """
        return steps_of(self._problem.space, plan)  # type: ignore[arg-type]

    def values(self, plan: object, claimed: Floats) -> Floats:
        """Return the goals' values of a plan, from the responses of its steps.

        ``claimed`` (k,): the values with which margins of stability are compared. Result (k,).
        """
        found = plan_values(self._of_plan(plan), self.steps(plan), claimed.tolist())
        return _rounded_up(np.array(found), self._round)

    def engine(self, plan: object) -> Engine:
        """Return what computes the responses of a plan."""
        return self._of_plan(plan).engine

    def _of_plan(self, plan: object) -> States:
        """Return the states of the order of a plan."""
        return self._problem


_Ordered = tuple[Order, tuple[tuple[int, ...], ...]]  # an order, and states in its places


class OrderFront(StateFront):
    """The same where the build order is free too: a plan is an order, and states."""

    def __init__(self, orders: AllOrders, rounding: Mapping[str, float] | None = None) -> None:
        super().__init__(orders.states, rounding)
        self._orders = orders

    @cached_property
    def _space(self) -> OrderStates:
        return OrderStates(self._orders, MOST_PARTS, every_goal=True)

    @cached_property
    def _known(self) -> dict[Order, States]:
        return {}

    def anew(self) -> OrderFront:
        """Return the same problem with nothing known of it, for its judge."""
        states = replace(self._orders.states)
        return OrderFront(replace(self._orders, states=states), self._rounding)

    def _explored(self) -> Explorer:
        found = Explorer(self._space, tell=_require_memory)
        if found.rise():
            return found
        if finds_better_order(self._orders, np.inf) is False:
            raise InfeasibleError("pareto: no order of the bricks has a plan; relax a limit")
        raise SolverError("pareto: the search found no plan in any order, and that is not proven")

    def _plan(self, found: Sequence[tuple[int, Key, Ints]]) -> _Ordered:
        order, states = self._space.path(found)
        rows = zip(found, states, strict=True)
        return order, tuple((level, *state.tolist()) for (level, *_), state in rows)

    def steps(self, plan: object) -> tuple[Step, ...]:
        """Return the checked steps of a plan, bricks counted in its own order."""
        return steps_of(self._of_plan(plan).space, plan[1])  # type: ignore[index]

    def _of_plan(self, plan: object) -> States:
        order = tuple(plan[0])  # type: ignore[index]
        if order not in self._known:
            self._known[order] = self._orders.at(order)
        return self._known[order]


def _require_memory(found: Explorer) -> None:
    """Raise an error if the states of all orders, twice while they grow, do not fit."""
    if found.nbytes > free_memory():
        raise ProblemError("pareto: the states of all orders do not fit the memory; give an order")


def _rounding_steps(names: Sequence[str], rounding: Mapping[str, float] | None) -> Floats:
    """Return what every number is rounded up to multiples of; zero where it is not.

    Result (k,). Raises `ProblemError` if a name is none of these, or a step is no positive number.
    """
    for name, step in (rounding or {}).items():
        if name not in names or not 0 < step < np.inf:
            known = ", ".join(names)
            raise ProblemError(f"round {name}={step:g}: give a positive step for one of {known}")
    return np.array([(rounding or {}).get(name, 0.0) for name in names])


def _rounded_up(values: Floats, steps: Floats) -> Floats:
    """Return values rounded up to multiples of steps, others rounded to ten digits.

    What differs by less than ten digits is the same: no plan is better by an error of rounding.

    ``values`` (..., k); ``steps`` (k,): zero where no step is given. Result (..., k).
    """
    safe = np.where(steps > 0, steps, 1.0)
    size = np.abs(np.where((values != 0) & np.isfinite(values), values, 1.0))
    digit = 10.0 ** (np.floor(np.log10(size)) - DIGITS)
    plain = np.where(np.isfinite(values), np.round(values / digit) * digit, values)
    return np.where(steps > 0, np.ceil(values / safe - EDGE) * safe, plain)
