"""How formulations are called: what fits together, and what they return read as a selection."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from numbers import Real
from typing import Any

import numpy as np

from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.scenarios import ScenarioLayers, largest_of
from seqopt.interrupts import answered
from seqopt.plan.calling.formulation import (
    WATCH,
    End,
    Formulation,
    Selection,
    as_formulation,
    formulations,
)
from seqopt.plan.calling.guard import called, readable
from seqopt.plan.calling.watch import Finding, Watch
from seqopt.plan.judge.certificate import least_sum
from seqopt.plan.judge.infeasible import refusal
from seqopt.problem.goals import Aim
from seqopt.scene.checks import short


def require_fit(
    problem: PlacementProblem, formulation: Formulation | str, options: Mapping[str, object]
) -> None:
    """Raise an error unless a formulation can solve a problem and has the given options.

    Raises `ProblemError` if the problem has budgets that the formulation does not take, or an
    option is not its own.
    """
    formulation = as_formulation(formulation)
    if problem.budgets and not formulation.takes_budgets:
        able = [name for name, other in formulations(formulation.on).items() if other.takes_budgets]
        raise ProblemError(
            f"{formulation.name}: the budget {problem.budgets[0].name!r} couples all moves; "
            f"use {' or '.join(able)}"
        )
    for name in options:
        if name not in formulation.options:
            known = ", ".join(formulation.options) or "no options"
            raise ProblemError(f"option {name}: {formulation.name} has {known}")


def require_time(formulation: Formulation, time_limit: float) -> None:
    """Raise an error unless a time limit is one, and the formulation can keep it.

    ``time_limit``: s. Raises `ProblemError` if it is no time, or the formulation takes none.
    """
    if not isinstance(time_limit, Real) or not time_limit >= 0:
        raise ProblemError(f"time_limit is {short(time_limit)}; give seconds from 0")
    if np.isfinite(time_limit) and not formulation.watched:
        raise ProblemError(f"{formulation.name} takes no time limit; leave it out")


def require_proof(proof: object) -> None:
    """Raise an error where a lazy search is to leave out the proof, which is all it is for.

    Raises `ProblemError`.
    """
    if not proof:
        raise ProblemError("a lazy search proves what it finds; leave out lazy, or ask for a proof")


def select(
    formulation: Formulation, problem: PlacementProblem, watch: Watch | None = None, **options: Any
) -> Selection:
    """Return the selection of a formulation, with numbers where numbers belong.

    ``watch``: handed to the formulation if it takes one; the trace is read from it. An interrupt is
    then told to it, so that the formulation ends with the best choice so far. ``**options``: of the
    formulation. Result: claimed, not proven. Raises `ProblemError`, `SolverError` as the
    formulation does; a `SolverError` also if it raises anything else, or returns something that is
    no selection; `KeyboardInterrupt` if it was interrupted and no choice was at hand.
    """
    watch = watch or Watch()
    ends = answered(watch.interrupt) if formulation.watched else nullcontext()
    with ends, _infeasible_confirmed(problem, formulation):
        return _with_numbers(formulation, _called(formulation, problem, watch, options), watch)


def _called(
    formulation: Formulation, problem: PlacementProblem, watch: Watch, options: dict[str, Any]
) -> Selection:
    """Return what a formulation returns, if that is a selection."""
    told = {WATCH: watch} if formulation.watched else {}
    try:
        return called(
            formulation.name,
            lambda: (_costs(formulation, problem), problem.budgets),
            Selection,
            lambda: formulation.solve(problem, **told, **options),
        )
    except SolverError as error:
        if watch.interrupted:
            raise KeyboardInterrupt(str(error)) from error
        raise


def _costs(formulation: Formulation, problem: PlacementProblem) -> tuple[LayeredCosts, ...]:
    """Return the costs that a formulation is given, of every scenario if totals over them count."""
    if formulation.aim is not None:
        return (formulation.aim.costs(problem),)
    assert isinstance(problem, ScenarioLayers)  # what is for states has no such costs
    return problem.layered(Aim.SUM)


def _with_numbers(formulation: Formulation, found: Selection, watch: Watch) -> Selection:
    """Return a selection with numbers where numbers belong, or raise a `SolverError`."""
    with readable(formulation.name):
        seconds = float(found.compile_seconds)
        if not 0 <= seconds < np.inf:
            raise ValueError(f"compile_seconds is {seconds}")
        trace = _traced(watch, float(found.objective), float(found.bound))
        return Selection(
            choice=tuple(operator.index(index) for index in found.choice),
            objective=float(found.objective),
            bound=float(found.bound),
            prices={str(name): float(price) for name, price in found.prices.items()},
            compile_seconds=seconds,
            end=End.INTERRUPTED if watch.interrupted else End(found.end),
            trace=trace,
        )


def _traced(watch: Watch, objective: float, bound: float) -> tuple[Finding, ...]:
    """Return what was told, ending with what is claimed."""
    watch.tell(objective, bound)
    return watch.trace


@contextmanager
def _infeasible_confirmed(problem: PlacementProblem, formulation: Formulation) -> Iterator[None]:
    """Say why there is no choice where a formulation says that there is none, if that is so."""
    try:
        yield
    except InfeasibleError as error:
        every = _costs(formulation, problem)
        costs = every[0] if formulation.aim is not None else largest_of(every)
        if not np.isfinite(least_sum(costs)):
            costs.continuable()  # names the move
        if problem.budgets:
            raise refusal(problem, formulation.name) from None
        raise SolverError(
            f"formulation {formulation.name} says that no choice is allowed, and some are: {error}"
        ) from None
