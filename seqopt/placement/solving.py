"""Solve a placement problem by any formulation; the answer is checked and becomes a plan."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, overload

import numpy as np

from seqopt.errors import ProblemError
from seqopt.placement.certificate import judge
from seqopt.placement.formulation import (
    Formulation,
    Reads,
    Selection,
    as_formulation,
    formulations,
    select,
)
from seqopt.placement.free_plan import FreePlan, solve_free
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.interface import Handed, PlacementProblem
from seqopt.placement.plan import Plan
from seqopt.placement.problem import Problem
from seqopt.placement.promises import require_possible
from seqopt.placement.schedule_formulation import ScheduleFormulation
from seqopt.placement.window_search import search_windows


@overload
def solve(
    problem: PlacementProblem, formulation: Formulation | str, *, proof: bool = True, **options: Any
) -> Plan: ...


@overload
def solve(
    problem: FreeProblem,
    formulation: ScheduleFormulation | str,
    *,
    proof: bool = True,
    **options: Any,
) -> FreePlan: ...


def solve(
    problem: PlacementProblem | FreeProblem,
    formulation: Formulation | ScheduleFormulation | str,
    *,
    proof: bool = True,
    **options: Any,
) -> Plan | FreePlan:
    """Solve a problem by a formulation and check the answer from the problem's own data.

    Parameters
    ----------
    problem : PlacementProblem or FreeProblem
        From `seqopt.pose`, a `seqopt.placement.CostProblem`, or of the free schedule, from
        `seqopt.placement.free_problem.pose_free`.
    formulation : Formulation, ScheduleFormulation or str
        One of `seqopt.formulations`, or its name; ``schedule_search`` for the free schedule.
    proof : bool, optional
        False lets a formulation that looks at one window after the other solve only the models that
        it meets; how far its choice is from the optimum then stays unknown.
    **options
        Of the formulation.

    Returns
    -------
    Plan or FreePlan

    Raises
    ------
    InfeasibleError
        If no choice is allowed.
    ProblemError
        If the formulation is not for such a problem, or does not know an option.
    SolverError
        If a solver fails, or the answer is not what its formulation claims.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> engine = seqopt.make_engine("compliance", network)
    >>> schedule = seqopt.three_robot_loop(network)
    >>> problem = seqopt.pose(engine, schedule, seqopt.CRITERIA["equations-2-3"])
    >>> seqopt.solve(problem, "cascade").certificate.gap > 0.009
    True
    """
    if isinstance(problem, FreeProblem):
        return solve_free(problem, formulation, proof=proof, **options)
    return _solve_choices(problem, formulation, proof, options)


def _solve_choices(
    problem: PlacementProblem,
    formulation: Formulation | ScheduleFormulation | str,
    proof: bool,  # noqa: FBT001  # as it was given by name
    options: Mapping[str, Any],
) -> Plan:
    """Return the plan of a problem that chooses candidates of moves."""
    if isinstance(formulation, ScheduleFormulation):
        raise ProblemError(f"{formulation.name} is for free schedules; pose one with pose_free")
    formulation = as_formulation(formulation)
    if not isinstance(getattr(problem, "budgets", None), tuple):
        raise ProblemError(
            f"a {type(problem).__name__} is no problem; give one that seqopt.pose made"
        )
    require_fit(problem, formulation, options)
    if isinstance(problem, Problem):
        require_possible(problem)
    return (_solve_all if proof else _solve_windows)(problem, formulation, options)


def require_fit(
    problem: PlacementProblem, formulation: Formulation | str, options: Mapping[str, object]
) -> None:
    """Raise an error unless a formulation is for such a problem and has such options.

    Parameters
    ----------
    problem : PlacementProblem
    formulation : Formulation
    options : mapping of str to object

    Raises
    ------
    ProblemError
        If the problem has budgets that the formulation does not take, or an option is not its own.
    """
    formulation = as_formulation(formulation)
    if problem.budgets and not formulation.takes_budgets:
        able = [name for name, other in formulations().items() if other.takes_budgets]
        raise ProblemError(
            f"{formulation.name}: the budget {problem.budgets[0].name!r} couples all moves; "
            f"use {' or '.join(able)}"
        )
    for name in options:
        if name not in formulation.options:
            known = ", ".join(formulation.options) or "no options"
            raise ProblemError(f"option {name}: {formulation.name} has {known}")


def _solve_all(
    problem: PlacementProblem, formulation: Formulation, options: Mapping[str, Any]
) -> Plan:
    """Return the certified plan of a formulation that is given the costs of all choices."""
    seconds: dict[str, float] = {}
    stages = problem.seconds(formulation.aim)  # computes the costs: solving is timed alone
    with _timed(seconds, "solve"):
        selection = select(formulation, Handed(problem), **options)  # the judge has the originals
    seconds["compile"] = selection.compile_seconds
    seconds["solve"] -= selection.compile_seconds
    with _timed(seconds, "verify"):
        certificate = judge(problem, selection, formulation)
        steps = problem.steps(selection.choice)
    order = {stage: seconds[stage] for stage in ("compile", "solve", "verify")}
    return Plan(problem, formulation, selection, certificate, steps, {**stages, **order})


def _solve_windows(
    problem: PlacementProblem, formulation: Formulation, options: Mapping[str, Any]
) -> Plan:
    """Return the plan of a search that solves only the models it meets."""
    if formulation.reads is not Reads.WINDOW or options:
        able = [name for name, other in formulations().items() if other.reads is Reads.WINDOW]
        asked = " ".join(
            [formulation.name, *(f"{name}={value}" for name, value in options.items())]
        )
        raise ProblemError(
            f"{asked} looks beyond the window of a move and needs all models: "
            f"use {' or '.join(able)} without options, or ask for the proof"
        )
    if not isinstance(problem, Problem):
        raise ProblemError("the costs of all choices are given; ask for the proof, it is free")
    seconds: dict[str, float] = {}
    with _timed(seconds, "search"):
        found = search_windows(problem)
    respond = sum(part.evaluation.seconds for part in (found.alone, *found.shared))
    with _timed(seconds, "verify"):
        steps = problem.steps(found.choice)
    stages = {"respond": respond, "rank": seconds["search"] - respond, "verify": seconds["verify"]}
    return Plan(problem, formulation, Selection(found.choice, np.nan), None, steps, stages, found)


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start
