"""Pareto sets of choices, states or orders: non-dominated plans, and their proof."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import pandas as pd

from seqopt.arrays import Floats, Terse
from seqopt.engines.interface import Engine
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph._spaces import explore
from seqopt.graph.formulation import Formulation, Solution, as_formulation
from seqopt.graph.graph import Graph, distances, fewest_moves, keep_best, reached
from seqopt.graph.space import Explorer, Space, Visited
from seqopt.graph.states import States
from seqopt.judge._schedules import _recomputed, ordered
from seqopt.judge.certificate import TOLERANCE
from seqopt.plan._answers import called, readable, with_numbers
from seqopt.plan._infeasible import confirmed
from seqopt.plan.solve import best_within, graph_of, leaves
from seqopt.problem.amounts import REGRIPS, STEPS
from seqopt.problem.problem import Problem
from seqopt.responses._grip_sets import Moved
from seqopt.responses.table import OUTSIDE
from seqopt.scene.scene import Order
from seqopt.sequence.steps import Step, StepKind
from seqopt.work import INTERRUPT, Clock, Tell, _free_memory, with_progress

DIGITS = 9  # after the first
EDGE = 1e-9  # of a rounding step: how far above a multiple a value still counts as it


def _rounded_up(values: Floats, steps: Floats) -> Floats:
    """Round values (..., k) up to multiples of steps (k,), or to ten digits where a step is 0.

    Values that agree to ten digits become equal: no plan dominates by a rounding error.
    """
    safe = np.where(steps > 0, steps, 1.0)
    size = np.abs(np.where((values != 0) & np.isfinite(values), values, 1.0))
    digit = 10.0 ** (np.floor(np.log10(size)) - DIGITS)
    plain = np.where(np.isfinite(values), np.round(values / digit) * digit, values)
    return np.where(steps > 0, np.ceil(values / safe - EDGE) * safe, plain)


class FrontProblem:
    """A multi-objective problem: the input of formulations of Pareto sets.

    ``problem``: its goals are responses, margins of stability, and of a free schedule steps or
    regrips; ``rounding``: steps to whose multiples values are rounded up, by goal, SI units; none
    by default. Raises `ProblemError` for other goals, or a step that is no positive number.
    """

    def __init__(self, problem: States, rounding: Mapping[str, float] | None = None) -> None:
        self._problem = problem
        adds_up = [goal for goal in problem.goals if not goal.is_peak]
        others = [goal for goal in adds_up if goal not in (STEPS, REGRIPS)]
        if wrong := [*others, *adds_up[1:]]:
            raise ProblemError(
                f"pareto: {wrong[0]} adds up along a plan; give responses, and steps or regrips"
            )
        for name, step in (rounding or {}).items():
            if name not in self.names or not 0 < step < np.inf:
                raise ProblemError(
                    f"round {name}={step:g}: give a positive step for one of "
                    f"{', '.join(self.names)}"
                )
        self._round = np.array([(rounding or {}).get(name, 0.0) for name in self.names])
        self._rounding, self._known = rounding, dict[Order, States]()
        peaks = [goal.is_peak for goal in problem.goals]
        self._counted = None if all(peaks) else peaks.index(False)  # adds up: it constrains paths

    def __repr__(self) -> str:
        return f"<FrontProblem of {self._problem}>"

    @property
    def names(self) -> tuple[str, ...]:
        """The goals."""
        return tuple(map(str, self._problem.goals))

    @cached_property
    def _explored(self) -> tuple[Visited, Space]:
        """All feasible states, and their space; raises `InfeasibleError` if no build ends."""

        def tell(found: Explorer) -> None:
            if found.nbytes > _free_memory():
                less = "give an order, or rules with fewer states"
                raise ProblemError(f"pareto: the states do not fit the memory; {less}")

        found = explore(self._problem, tell=tell, exact=True)
        if not found.whole:
            raise confirmed(self._problem, "the search")
        found.refine()
        graph, states = found.graph()
        peaks, amounts = np.array(graph.peaks), graph.amounts.copy()
        amounts[:, peaks] = _rounded_up(amounts[:, peaks], self._round[peaks])
        return Visited(replace(graph, amounts=amounts), states), found.space

    def best_below(self, bounds: Floats) -> Solution | None:
        """Return a non-dominated plan with values below bounds (k,), SI units, if there is any."""
        graph, (visited, space) = self._below(bounds), self._explored
        if not graph.ends[reached(graph)].any():
            return None
        point = np.zeros(len(bounds))
        for k in sorted(range(len(bounds)), key=lambda k: k != self._counted):
            graph, point[k] = keep_best(graph, k)
            if not point[k] < bounds[k]:
                return None
        order, states = space.path(visited.of(fewest_moves(graph)))
        values = tuple(point.tolist())
        return Solution(states, values, values, order=order)

    def _below(self, bounds: Floats) -> Graph:
        """Return the subgraph of the moves to states whose peaks are all below bounds."""
        graph = self._explored[0].graph
        return graph.only(((graph.amounts < bounds) | ~np.array(graph.peaks)).all(axis=1))

    def is_empty_below(self, bounds: Floats) -> bool:
        """Return whether no plan is below bounds (k,), by distances from the empty site."""
        graph = self._below(bounds)
        if self._counted is None:
            return not graph.ends[reached(graph)].any()
        least = distances(graph, graph.amounts[:, self._counted])[graph.ends]
        return not least.min(initial=np.inf) < bounds[self._counted]

    def steps(self, plan: Solution) -> tuple[Step, ...]:
        """Return the checked steps of a plan."""
        return self._of_plan(plan).space.steps(plan.states)

    def values(self, plan: Solution) -> Floats:
        """Return the goals' values (k,) of a plan, from its responses, rounded; SI units."""
        return self._judged(plan)[0]

    def _judged(self, plan: Solution) -> tuple[Floats, Moved]:
        """Return these values, and the largest displacement, over the linear range."""
        problem, steps = self._of_plan(plan), self.steps(plan)
        found, moved = _recomputed(problem, steps, plan.objective, ())
        return _rounded_up(np.array(found), self._round), moved

    def engine(self, plan: Solution) -> Engine:
        """Return the engine of a plan, for the scene in its build order."""
        return self._of_plan(plan).engine

    def _of_plan(self, plan: Solution) -> States:
        if plan.order not in self._known:
            self._known[plan.order] = ordered(self._problem, plan.order)
        return self._known[plan.order]


@dataclass(frozen=True, eq=False, repr=False)
class Front(Terse):
    """A Pareto set whose points are checked.

    ``table``: a row per point, sorted by the first column: values of the goals, SI units, then
    ``steps`` and ``regrips`` of its plan if these are no goals; ``steps``: the plan of every row;
    ``engines``: its engine, for the scene in its build order; ``complete``: whether it is proven
    that no point is missing; ``seconds``: run times of solve and verify, s; ``moved``: largest
    displacements of plans, over the limit of the linear range, if computed; ``beyond``: why some
    exceed it, in words; ``stopped``: ``time`` or ``interrupt`` if the search ended early, else
    empty; ``problem``: the `Problem` that was asked.
    """

    table: pd.DataFrame
    steps: tuple[tuple[Step, ...], ...]
    engines: tuple[Engine, ...]
    complete: bool
    seconds: Mapping[str, float]
    moved: tuple[Moved, ...] = ()
    beyond: str = ""
    stopped: str = ""
    problem: Any = None

    def __repr__(self) -> str:
        whole = "complete" if self.complete else "not complete"
        outside = f"{OUTSIDE}: " * any(map(leaves, self.moved))
        plans = f"{len(self.table)} plan{'s' * (len(self.table) != 1)}"
        return f"<Front: {outside}{plans}, {whole}; {', '.join(map(str, self.table))}>"


def find_front(
    problem: Problem | FrontProblem,
    formulation: Formulation | str = "pareto_zones",
    *,
    rounding: Mapping[str, float] | None = None,
    seconds: float = np.inf,
    progress: Tell = lambda _: None,
    clock: Clock | None = None,
) -> Front:
    """Return the Pareto set of a problem, its points recomputed and its completeness judged.

    Its plans are within the linear range if any is, unless a limit on ``linear_range`` says so.

    ``problem``: its goals are minimized simultaneously; ``rounding``: steps to whose multiples
    values are rounded up, by goal, SI units, which thins the set; ``seconds``: limit of the search,
    which then returns the points found; ``clock``: of search and proof. Raises `InfeasibleError`,
    `SolverError` or `TimeUpError` if no plan is feasible; if values differ from those claimed, or a
    point is missing; if no plan is found in time.

    Examples
    --------
    >>> import seqopt
    >>> engine = seqopt.make_engine("compliance", seqopt.load_scene("wall:columns=2,courses=2"))
    >>> worst = seqopt.CRITERIA["worst-ratio"]
    >>> find_front(seqopt.pose(engine, seqopt.FreeRules(), worst, "F_largest,steps"))
    <Front: 1 plan, complete; F_largest, steps, regrips>
    """
    formulation = as_formulation(formulation, "front")
    if not isinstance(problem, Problem):
        return _front_of(problem, formulation, seconds, progress, clock or Clock())
    end, watch = time.perf_counter() + seconds, clock or Clock()

    def measured(asked: Problem) -> Front:
        with watch.needed("posing the problem"):
            states = graph_of(asked)
            posed = FrontProblem(states, rounding)
        left = max(0.0, end - time.perf_counter())
        front = _front_of(posed, formulation, left, progress, watch)
        return replace(front, problem=problem)

    def farthest(front: Front) -> Moved | None:  # all of its plans keep the range, or none can
        return max(front.moved, key=lambda each: each.share, default=None)

    return best_within(problem, measured, farthest, lambda front: replace(front, stopped=INTERRUPT))


def _front_of(
    problem: FrontProblem, formulation: Formulation, seconds: float, progress: Tell, clock: Clock
) -> Front:
    """Return the Pareto set of a problem, its points recomputed, with the proof of completeness."""
    start, name = time.perf_counter(), formulation.name
    limit = min(seconds, clock.left)
    own = FrontProblem(replace(problem._problem), problem._rounding)  # which it may change
    solve = partial(formulation.solve, own, seconds=limit, progress=progress)
    with clock.needed("finding a first plan"):
        found = _found(name, problem, solve)
    solved = time.perf_counter()
    chosen = sorted(found, key=lambda plan: plan.objective)
    points = np.array([plan.objective for plan in chosen])
    with readable(name):
        plans = tuple(map(problem.steps, chosen))
    judged = [problem._judged(plan) for plan in chosen]
    for i, (point, (values, _)) in enumerate(zip(points, judged, strict=True)):
        if not (np.abs(values - point) <= TOLERANCE * np.abs(point)).all():
            raise SolverError(
                f"the values of a plan are {values.tolist()}, not {point.tolist()} as claimed"
            )
        if (np.delete(points, i, axis=0) <= point).all(axis=1).any():
            raise SolverError(f"the point {point.tolist()} is dominated by another one")

    def complete() -> None:
        bounds = upper_bounds(points)
        for bound in with_progress("proving that no plan is missing", bounds, progress):
            if not problem.is_empty_below(bound):
                raise SolverError(f"the set lacks a point below {bound.tolist()}")

    stopped = clock.why(chosen[0].stopped) or clock.tried(complete)[1]
    spent = {"solve": solved - start, "verify": time.perf_counter() - solved}
    counts = {"steps": [len(steps) for steps in plans]}
    counts["regrips"] = [sum(s.kind is StepKind.REPOSITION for s in steps) for steps in plans]
    table = pd.DataFrame(points, columns=[*problem.names])
    table = table.assign(**{name: own for name, own in counts.items() if name not in table})
    engines = tuple(map(problem.engine, chosen))
    moved = tuple(moved for _, moved in judged)
    return Front(table, plans, engines, not stopped, spent, moved, stopped=stopped)


def _found(name: str, problem: FrontProblem, solve: Callable[[], object]) -> list[Solution]:
    """Return the plans of a formulation; raise `InfeasibleError` if infeasibility is proven."""
    try:
        plans = called(name, tuple, solve)
    except InfeasibleError:
        plans = ()
    with readable(name):
        found = [with_numbers(name, plan, len(problem.names)) for plan in plans]
        if not np.isfinite([plan.objective for plan in found]).all():
            raise ValueError("a value is no number")
    if found:
        return found
    if not problem.is_empty_below(np.full(len(problem.names), np.inf)):
        raise SolverError(f"formulation {name} found no plan, and some are allowed")
    raise InfeasibleError("pareto: no plan is within the limits; relax one")


def upper_bounds(points: Floats) -> Floats:
    """Return the local upper bounds (m, k) of the region that no point (n, k) dominates.

    Points are swept by their last value, ascending; between two such values only the points before
    count, which reduces the corners to those of sets with k - 1 values.
    """
    if points.shape[1] == 1:
        return np.array([[points.min(initial=np.inf)]])
    levels = np.unique(points[:, -1])
    out = []
    for low, high in zip([-np.inf, *levels], [*levels, np.inf], strict=True):
        before = points[points[:, -1] <= low, :-1]
        free = np.full((1, points.shape[1] - 1), np.inf)
        corners = upper_bounds(before) if len(before) else free
        out.append(np.column_stack([corners, np.full(len(corners), high)]))
    found = np.unique(np.concatenate(out), axis=0)
    kept: list[Floats] = []
    for corner in found[::-1]:
        if not kept or not (np.array(kept) >= corner).all(axis=1).any():
            kept.append(corner)
    return np.array(kept)
