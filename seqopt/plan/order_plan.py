"""The plan of the best build order: found, checked and summarized."""

from __future__ import annotations

import operator
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isfinite
from typing import Any

import numpy as np
import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph.orders.orders import AllOrders, OrderSelection
from seqopt.plan.build import ShownBuild
from seqopt.plan.calling.guard import called, readable, text
from seqopt.plan.calling.schedule_formulation import (
    Finds,
    ScheduleFormulation,
    find_schedule_formulation,
)
from seqopt.plan.free_plan import FreePlan, solve_free
from seqopt.plan.judge.orders import finds_better_order
from seqopt.plan.judge.schedules import TOLERANCE
from seqopt.responses.resources import HERE, Resources
from seqopt.scene.orders import Order, in_order
from seqopt.sequence.steps import Step
from seqopt.work.progress import Tell

ENDED = ("time", "interrupt")  # searches that were told to end: nothing more is computed


@dataclass(frozen=True, repr=False)
class OrderPlan(ShownBuild):
    """A build order, its best plan, and a bound on all other orders.

    ``problem``: what was solved; ``selection``: what the formulation claims; ``plan``: the best of
    this order, with its own certificate; ``seconds``: by stage, s: ``order``, those of the plan,
    ``order_proof``; ``proven``: whether it is proven that no order stays below the bound; else it
    is claimed.
    """

    problem: AllOrders
    selection: OrderSelection
    plan: FreePlan
    seconds: Mapping[str, float]
    proven: bool = False

    def __repr__(self) -> str:
        return f"OrderPlan({self.problem.scene.name!r}, {self.worth})"

    @property
    def engine(self) -> Engine:
        """What computes the responses, of the scene in this order."""
        return self.plan.engine

    @property
    def steps(self) -> tuple[Step, ...]:
        """The steps of the plan."""
        return self.plan.steps

    @property
    def title(self) -> str:
        """The name of the plan where it is shown next to others."""
        return "best order"

    @property
    def worth(self) -> str:
        """The value of the plan, and what is proven about it, in words."""
        return f"{self.problem.free.goals[0]} {self.selection.objective:.6g}, {self.status}"

    def responses(self) -> pd.DataFrame:
        """Return the responses of every step.

        Result: as of `seqopt.analyze`.
        """
        return self.plan.responses()

    def table(self) -> pd.DataFrame:
        """Return what was chosen: every grip.

        Result: as of `grips`.
        """
        return self.grips()

    @property
    def order(self) -> Order:
        """Names of the bricks as they are placed."""
        return self.selection.order

    @property
    def gap(self) -> float:
        """What the bound leaves open, over the value."""
        value = self.selection.objective
        return max(0.0, value - self.selection.bound) / max(abs(value), TOLERANCE)

    @property
    def status(self) -> str:
        """``optimal`` where it is proven that no order is better, or ``claimed optimal``.

        Else ``heuristic``: there is a bound alone.
        """
        if self.gap > TOLERANCE:
            return "heuristic"
        return "optimal" if self.proven else "claimed optimal"

    @property
    def bound_said(self) -> str:
        """What no order stays below, and whether that is proven, in words."""
        if not isfinite(self.selection.bound):
            return "others are not looked at yet"
        claimed = "" if self.proven else " (claimed, not proven)"
        return f"no order below {self.selection.bound:.6g}{claimed}"

    def summary(self) -> dict[str, object]:
        """Return a summary, ready for JSON.

        Result: that of the plan, and ``order``, ``orders`` (among which), ``order_status``,
        ``order_bound`` (on the first aim, of any order), ``order_bound_proven`` (else it is
        claimed), ``order_evaluated`` and ``order_stopped``.
        """
        return {
            **self.plan.summary(),
            "order": [*self.order],
            "orders": self.problem.among.value,
            "order_status": self.status,
            "order_bound": self.selection.bound if self.selection.bound > -float("inf") else None,
            "order_bound_proven": self.proven,
            "order_evaluated": self.selection.evaluated,
            "order_stopped": self.selection.stopped,
            "seconds": dict(self.seconds),
        }


def solve_order(
    problem: AllOrders,
    formulation: ScheduleFormulation | str = "order_search",
    *,
    proof: bool = True,
    progress: Tell | None = None,
    resources: Resources = HERE,
    **options: Any,
) -> OrderPlan:
    """Return the best order, or a good one with a bound, and its best plan.

    The plan is computed again for this one order and judged by its own certificate.

    ``proof``: False leaves out the proofs that the order has no better plan, and that no order is
    better; ``progress``: told in a few words how far it is; ``resources``: who tries orders; what
    is found does not depend on it; ``**options``: of the formulation. Raises `InfeasibleError`,
    `ProblemError` if no order has a plan; there is no such formulation or option; `SolverError` if
    the order is none that was asked for or not worth what is claimed, or another is better.
    """
    found = find_schedule_formulation(formulation, Finds.ORDER)
    found.require_options(options)
    means, start = replace(resources, progress=progress or resources.progress), time.perf_counter()
    twin = replace(problem, free=replace(problem.free))  # which no formulation can reach
    ends = start + float(options.get("seconds", inf))
    solve = partial(found.solve, problem, resources=means, **options)
    selection = _selected(found, (problem, twin), ends, solve)
    seconds = {"order": time.perf_counter() - start}
    plan = _planned(found.name, twin, selection, proof=proof)
    start = time.perf_counter()
    proven = proof and _proven(found.name, twin, selection, ends)
    seconds |= {**plan.seconds, "order_proof": time.perf_counter() - start}
    return OrderPlan(twin, selection, plan, seconds, proven)


def _planned(name: str, problem: AllOrders, selection: OrderSelection, *, proof: bool) -> FreePlan:
    """Return the best plan of an order, which must be worth what is claimed."""
    _require_allowed(name, problem, selection.order)
    plan = solve_free(problem.at(selection.order), "schedule_search", proof=proof)
    _require_worth(name, plan.selection.objective[0], selection)
    return plan


def _selected(
    found: ScheduleFormulation,
    problems: tuple[AllOrders, AllOrders],
    end: float,
    solve: Callable[[], object],
) -> OrderSelection:
    """Return what a formulation says, with numbers where numbers belong; or why there is none."""
    asked, problem = problems
    try:
        said = called(found.name, lambda: (asked, problem), OrderSelection, solve)
    except InfeasibleError as error:
        some = finds_better_order(problem, np.inf, end=end)
        if some:
            raise SolverError(
                f"formulation {found.name} says that no order has a plan, and some have"
            ) from None
        if some is False:
            raise
        raise InfeasibleError(f"claimed by {found.name}, and not proven: {error}") from None
    return _with_numbers(found.name, said)


def _proven(name: str, problem: AllOrders, selection: OrderSelection, end: float) -> bool:
    """Return whether a bound on all orders is proven; raise an error if one is below it."""
    if selection.stopped in ENDED or not isfinite(selection.bound):
        return False
    bound = min(selection.bound, selection.objective)
    better = finds_better_order(problem, bound, end=end)
    if better:
        raise SolverError(
            f"{name}: {selection.bound:.9g} is promised as a bound on all orders; one has a plan "
            "with less"
        )
    return better is False


def _with_numbers(name: str, found: OrderSelection) -> OrderSelection:
    """Return a selection with numbers where numbers belong."""
    with readable(name):
        order = tuple(operator.index(brick) for brick in found.order)
        objective, bound = float(found.objective), float(found.bound)
        evaluated = operator.index(found.evaluated)
        return OrderSelection(order, objective, bound, evaluated, text(found.stopped))


def _require_allowed(name: str, problem: AllOrders, order: Order) -> None:
    """Raise an error if an order does not name every brick once, or is none of those asked for."""
    in_order(problem.scene, order)
    if not problem.allows(order):
        raise SolverError(f"{name}: its order places a brick that nothing ties")


def _require_worth(name: str, value: float, selection: OrderSelection) -> None:
    """Raise an error if an order is not worth what is claimed, or less than its bound."""
    claimed, bound = selection.objective, selection.bound
    most = TOLERANCE * max(abs(value), abs(claimed))
    if not (abs(value - claimed) <= most and bound <= value + most):  # NaN is no bound
        raise SolverError(
            f"{name}: the value of the order is {value:.9g}; claimed are {claimed:.9g} and "
            f"a bound of {bound:.9g}"
        )
