"""Pareto sets: all plans that no other plan beats in everything, their proof, and picking one."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
import pandas as pd

from seqopt.arrays import Floats, FrozenValue, Terse
from seqopt.engines.interface import Engine
from seqopt.errors import InfeasibleError, ProblemError, SolverError, did_you_mean
from seqopt.graph.orders import AllOrders
from seqopt.plan._front_states import OrderFront, StateFront
from seqopt.plan.calling._guard import called, readable, text
from seqopt.plan.calling.formulation import Formulation, On, as_formulation
from seqopt.plan.solving import graph_of, states_of
from seqopt.problem.problem import Problem
from seqopt.sequence.steps import Step, StepKind
from seqopt.work.progress import Tell, with_progress

TOLERANCE = 1e-6  # of a value: how far a point may be from what the engine says of its plan


class FrontProblem(Protocol):
    """What a formulation of Pareto sets is given."""

    @property
    def names(self) -> tuple[str, ...]:
        """The numbers that are to be small."""

    def anew(self) -> FrontProblem:
        """Return the same problem with nothing known of it, for its judge.

        Returns
        -------
        FrontProblem
        """

    def best_below(self, bounds: Floats) -> tuple[Floats, object] | None:
        """Return a plan below bounds that no other such plan beats in everything.

        Parameters
        ----------
        bounds : (k,) float
            Every number must be less.

        Returns
        -------
        point : (k,) float
            Its numbers, SI units.
        plan : object
            What `steps` takes.
        """

    def is_empty_below(self, bounds: Floats) -> bool:
        """Return whether there is no plan below bounds, found by another route.

        Parameters
        ----------
        bounds : (k,) float

        Returns
        -------
        bool
        """

    def steps(self, plan: object) -> tuple[Step, ...]:
        """Return the checked steps of a plan.

        Parameters
        ----------
        plan : object
            From `best_below`.

        Returns
        -------
        tuple of Step
        """

    def engine(self, plan: object) -> Engine:
        """Return what computes the responses of a plan, of the scene in its build order.

        Parameters
        ----------
        plan : object
            From `best_below`.

        Returns
        -------
        Engine
        """

    def values(self, plan: object, claimed: Floats) -> Floats:
        """Return the numbers of a plan, from the responses of its steps.

        Parameters
        ----------
        plan : object
            From `best_below`.
        claimed : (k,) float
            The values with which margins of stability are compared.

        Returns
        -------
        (k,) float
            SI units, rounded as the problem's are.
        """


@dataclass(frozen=True, eq=False, repr=False)
class FrontSelection(FrozenValue):
    """The points of a Pareto set, and what its formulation claims of them.

    ``points`` (n, k): SI units; ``plans``: one for every point; ``stopped``: why the search ended
    before the set was complete; empty if it did not.
    """

    points: Floats
    plans: tuple[object, ...]
    stopped: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Front(Terse):
    """A Pareto set whose points are checked.

    ``table``: a row per point, by the first number: the numbers that are to be small, SI units,
    then ``steps`` and ``regrips`` of its plan where they are none of these; ``steps``: the plan of
    every row; ``engines``: what computes its responses, of the scene in its build order;
    ``complete``: whether it was proven that no further point exists; ``seconds``: by stage, s:
    solve, verify.
    """

    table: pd.DataFrame
    steps: tuple[tuple[Step, ...], ...]
    engines: tuple[Engine, ...]
    complete: bool
    seconds: Mapping[str, float]

    def __repr__(self) -> str:
        whole = "complete" if self.complete else "not complete"
        return f"<Front: {len(self.table)} plans, {whole}; {', '.join(self.table.columns)}>"


def find_front(
    problem: Problem | FrontProblem,
    formulation: Formulation | str = "pareto_zones",
    *,
    rounding: Mapping[str, float] | None = None,
    seconds: float = np.inf,
    progress: Tell = lambda _: None,
) -> Front:
    """Return the Pareto set of a problem, its points recomputed and its completeness judged.

    ``problem``: whose goals are all to be small at once; ``rounding``: what numbers are rounded up
    to multiples of, by name, SI units, which thins the set; of a problem that is posed.
    ``seconds``: after which the points found are returned; ``progress``: told how far it is, in a
    few words or as a `seqopt.work.Stage`. Raises `InfeasibleError` if no plan is allowed;
    `SolverError` if a plan is not worth what is claimed, or the set lacks a point.
    """
    start = time.perf_counter()
    formulation = as_formulation(formulation, On.FRONTS)
    if isinstance(problem, Problem):
        problem = _posed(problem, rounding)
    twin, name = problem.anew(), formulation.name  # which no formulation can reach
    solve = partial(formulation.solve, problem, seconds=seconds, progress=progress)
    found = _found(name, (problem, twin), solve)
    solved, problem = time.perf_counter(), twin
    points = found.points[order := np.lexsort(found.points.T[::-1])]
    with readable(name):
        chosen = [found.plans[i] for i in order]
        plans = tuple(map(problem.steps, chosen))
    for point, plan in zip(points, chosen, strict=True):
        values = problem.values(plan, point)
        if not (np.abs(values - point) <= TOLERANCE * np.abs(point)).all():
            raise SolverError(
                f"the values of a plan are {values.tolist()}, not {point.tolist()} as claimed"
            )
    _require_apart(points)
    if not found.stopped:
        _require_complete(problem, points, progress)
    spent = {"solve": solved - start, "verify": time.perf_counter() - solved}
    engines = tuple(map(problem.engine, chosen))
    return Front(_table(problem, points, plans), plans, engines, not found.stopped, spent)


def _posed(problem: Problem, rounding: Mapping[str, float] | None) -> FrontProblem:
    """Return the states whose paths are plans, in one build order or in all."""
    found = graph_of(problem)
    if isinstance(found, AllOrders):
        if found.down is not None:
            raise ProblemError("a Pareto set of take-downs is of one order; give an order")
        return OrderFront(found, rounding)
    return StateFront(states_of(problem), rounding)


def _found(
    name: str, problems: tuple[FrontProblem, FrontProblem], solve: Callable[[], object]
) -> FrontSelection:
    """Return what a formulation says; an error that no plan is allowed, once that is proven."""
    twin = problems[1]
    try:
        found = called(name, lambda: problems, FrontSelection, solve)
    except InfeasibleError:
        found = FrontSelection(np.zeros((0, len(twin.names))), ())
    found = _with_numbers(name, found, twin.names)
    if len(found.points) or found.stopped:
        return found
    if not twin.is_empty_below(np.full(len(twin.names), np.inf)):
        raise SolverError(f"formulation {name} found no plan, and some are allowed")
    raise InfeasibleError("pareto: no plan is within the limits; relax one")


def _with_numbers(name: str, found: FrontSelection, names: Sequence[str]) -> FrontSelection:
    """Return a selection with numbers where numbers belong."""
    with readable(name):
        points = np.array(found.points, dtype=float).reshape(-1, len(names))
        if not np.isfinite(points).all() or len(points) != len(found.plans):
            raise ValueError(f"{len(points)} points, {len(found.plans)} plans, or one is no number")
        return FrontSelection(points, tuple(found.plans), text(found.stopped))


def _require_apart(points: Floats) -> None:
    for i, point in enumerate(points):
        others = np.delete(points, i, axis=0)
        if (others <= point).all(axis=1).any():
            raise SolverError(f"the point {point.tolist()} is dominated by another one")


def _require_complete(problem: FrontProblem, points: Floats, progress: Tell) -> None:
    """Raise an error if a plan exists that no point dominates: bounds are searched again."""
    bounds = upper_bounds(points)
    for bound in with_progress("proving that no plan is missing", bounds, progress):
        if not problem.is_empty_below(bound):
            raise SolverError(f"the set lacks a point below {bound.tolist()}")


def upper_bounds(points: Floats) -> Floats:
    """Return the corners below which lies all that no point dominates.

    Points are taken by their last number, ascending; up to the next one only those before it
    count, so that the corners are those of sets with one number less.

    ``points`` (n, k). Result (m, k).
    """
    if points.shape[1] == 1:
        return np.array([[points.min(initial=np.inf)]])
    levels = np.unique(points[:, -1])
    out = []
    for low, high in zip([-np.inf, *levels], [*levels, np.inf], strict=True):
        before = points[points[:, -1] <= low, :-1]
        if not len(before):
            corners = np.full((1, points.shape[1] - 1), np.inf)
        else:
            corners = upper_bounds(before)
        out.append(np.column_stack([corners, np.full(len(corners), high)]))
    found = np.unique(np.concatenate(out), axis=0)
    kept: list[Floats] = []
    for corner in found[::-1]:
        if not kept or not (np.array(kept) >= corner).all(axis=1).any():
            kept.append(corner)
    return np.array(kept)


def _table(problem: FrontProblem, points: Floats, plans: Sequence[Sequence[Step]]) -> pd.DataFrame:
    table = pd.DataFrame(points, columns=[*problem.names])
    counts = {
        "steps": [len(steps) for steps in plans],
        "regrips": [sum(s.kind is StepKind.REPOSITION for s in steps) for steps in plans],
    }
    for name, column in counts.items():
        if name not in table:
            table[name] = column
    return table


def pick(table: pd.DataFrame, least: str, under: Mapping[str, float] | None = None) -> int:
    """Return the row of a Pareto set with the least of one number among those below bounds.

    ``table``: of a `Front`; ``least``: a column; ``under``: what columns must stay below, SI units.
    Result: its place, from 0; of several the first. Raises `ProblemError` if there is no such
    column, or no row is below all bounds.
    """
    under = dict(under or {})
    for name in (least, *under):
        if name not in table:
            known = [*map(str, table.columns)]
            why = f"the set has no such column{did_you_mean(name, known)}"
            raise ProblemError(f"pick {name}: {why}; give one of {', '.join(known)}")
    rows = np.ones(len(table), dtype=bool)
    for name, bound in under.items():
        rows &= table[name].to_numpy(float) < bound
    if not rows.any():
        closest = ", ".join(f"{name} from {table[name].min():.6g}" for name in under)
        raise ProblemError(
            f"pick {least}: no plan of the set is below all bounds; it has {closest}"
        )
    values = np.where(rows, table[least].to_numpy(float), np.inf)
    return int(values.argmin())
