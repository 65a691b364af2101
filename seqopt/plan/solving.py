"""Solve a placement problem by any formulation; the answer is checked and becomes a plan."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, overload

import numpy as np

from seqopt.errors import ProblemError
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.layers.layers import Layers
from seqopt.graph.states.states import States
from seqopt.plan.calling.fitting import require_fit, require_proof, require_time
from seqopt.plan.calling.formulation import (
    End,
    Formulation,
    Selection,
    as_formulation,
    formulations,
)
from seqopt.plan.calling.schedule_formulation import ScheduleFormulation
from seqopt.plan.calling.selecting import select
from seqopt.plan.calling.watch import Finding, Watch
from seqopt.plan.free_plan import FreePlan, solve_free
from seqopt.plan.judge.anew import require_anew
from seqopt.plan.judge.certificate import certify_partial, judge
from seqopt.plan.plan import Plan
from seqopt.plan.search.pair_search import search_pairs
from seqopt.plan.search.window_search import search_windows
from seqopt.problem.ranks import Among


@dataclass(frozen=True)
class _Run:
    """How long a formulation may take, who is told what it finds, and which models it is given."""

    time_limit: float
    progress: Callable[[Any], object] | None
    proof: bool
    lazy: bool


@overload
def solve(
    problem: PlacementProblem,
    formulation: Formulation | str,
    *,
    proof: bool = True,
    lazy: bool = False,
    time_limit: float = math.inf,
    progress: Callable[[Finding], object] | None = None,
    **options: Any,
) -> Plan: ...


@overload
def solve(
    problem: States,
    formulation: ScheduleFormulation | str,
    *,
    proof: bool = True,
    time_limit: float = math.inf,
    progress: Callable[[str], object] | None = None,
    **options: Any,
) -> FreePlan: ...


def solve(
    problem: PlacementProblem | States,
    formulation: Formulation | ScheduleFormulation | str,
    *,
    proof: bool = True,
    lazy: bool = False,
    time_limit: float = math.inf,
    progress: Callable[[Any], object] | None = None,
    **options: Any,
) -> Plan | FreePlan:
    """Solve a problem by a formulation and check the answer from the problem's own data.

    Parameters
    ----------
    problem : PlacementProblem or States
        From `seqopt.pose` or `seqopt.pose_free`, or a `seqopt.graph.layers.interface.CostProblem`.
    formulation : Formulation, ScheduleFormulation or str
        Or a name in `seqopt.formulations`; ``schedule_search`` for the free schedule.
    proof : bool, optional
        False: ``cascade`` or ``rank_search`` solve only models that they need; no gap is known.
    lazy : bool, optional
        Solve only the models that the proof needs, as is always done where states are chosen.
    time_limit : float, optional
        Seconds of choosing after which it returns its best choice and a bound, as at an interrupt;
        without proof, of all it does, and an error names the moves that were chosen by then.
    progress : callable, optional
        Called with every better choice and bound as it is found.
    **options
        Options of the formulation.

    Returns
    -------
    Plan or FreePlan

    Raises
    ------
    InfeasibleError, ProblemError, SolverError
        If no choice is allowed, the arguments do not fit together, or a solver or claim fails.

    Examples
    --------
    >>> import seqopt
    >>> seqopt.solve(seqopt.optimize("arch25").problem, "overlap_dp").certificate.gap
    0.0
    """
    run = _Run(time_limit, progress, proof, lazy)
    if isinstance(problem, States):
        return _solve_free(problem, formulation, run, options)
    found = _fitting(problem, formulation, time_limit, options)
    return _solve_loop(problem, found, run, options)


def _solve_loop(
    problem: PlacementProblem, formulation: Formulation, run: _Run, options: Mapping[str, Any]
) -> Plan:
    """Return the plan of a schedule with open grips."""
    if run.lazy:
        require_proof(run.proof)
        return _solve_lazily(problem, formulation, run, options)
    if run.proof:
        return _solve_all(problem, formulation, run, options)
    return _solve_windows(problem, formulation, run, options)


def _solve_free(
    problem: States,
    formulation: Formulation | ScheduleFormulation | str,
    run: _Run,
    options: dict[str, Any],
) -> FreePlan:
    """Return the plan of a free schedule."""
    options |= {} if run.progress is None else {"progress": run.progress}
    options |= {} if math.isinf(run.time_limit) else {"seconds": run.time_limit}
    if run.lazy:  # it is at any rate
        require_proof(run.proof)
    return solve_free(problem, formulation, proof=run.proof, **options)


def on_the_way(plan: Plan) -> Plan:
    """Return a plan, for whoever has more to do than to solve; an interrupt ends that too.

    Raises `KeyboardInterrupt` if its formulation was interrupted.
    """
    if plan.selection.end is End.INTERRUPTED:
        raise KeyboardInterrupt
    return plan


def _fitting(
    problem: PlacementProblem,
    formulation: Formulation | ScheduleFormulation | str,
    time_limit: float,
    options: Mapping[str, object],
) -> Formulation:
    """Return the formulation if it, the problem and the options go together."""
    if isinstance(formulation, ScheduleFormulation):
        raise ProblemError(f"{formulation.name} is for free schedules; pose one with build_states")
    found = as_formulation(formulation)
    if not isinstance(getattr(problem, "budgets", None), tuple):
        raise ProblemError(
            f"a {type(problem).__name__} is not a problem; give one that seqopt.pose made"
        )
    require_fit(problem, found, options)
    require_time(found, time_limit)
    if isinstance(problem, Layers):
        problem.require_possible()
    return found


def _solve_all(
    problem: PlacementProblem,
    formulation: Formulation,
    run: _Run,
    options: Mapping[str, Any],
) -> Plan:
    """Return the certified plan of a formulation that is given the costs of all choices."""
    seconds: dict[str, float] = {}
    stages = problem.seconds(formulation.aim)  # computes the costs: solving is timed alone
    with _timed(seconds, "solve"):
        selection = select(formulation, problem, Watch(run.time_limit, run.progress), **options)
    seconds["compile"] = selection.compile_seconds
    seconds["solve"] -= selection.compile_seconds
    with _timed(seconds, "verify"):
        certificate = judge(problem, selection, formulation)
        steps = problem.steps(selection.choice)
        if isinstance(problem, Layers):
            require_anew(problem, selection.choice)
    order = {stage: seconds[stage] for stage in ("compile", "solve", "verify")}
    return Plan(problem, formulation, selection, certificate, steps, {**stages, **order})


def _solve_windows(
    problem: PlacementProblem, formulation: Formulation, run: _Run, options: Mapping[str, Any]
) -> Plan:
    """Return the plan of a search that solves only the models it meets."""
    alone = formulation.window_options
    if alone is None or options not in ({}, alone):
        able = [n for n, other in formulations().items() if other.window_options is not None]
        asked = " ".join(
            [formulation.name, *(f"{name}={value}" for name, value in options.items())]
        )
        raise ProblemError(
            f"{asked} looks beyond the window of a move and needs all models: "
            f"use {' or '.join(able)} without options, or ask for the proof"
        )
    if not isinstance(problem, Layers):
        raise ProblemError("the costs of all choices are given; ask for the proof, it is free")
    if getattr(problem.criterion, "among", Among.ALL) is not Among.ALL:
        raise ProblemError(
            "ranks among possible candidates need all models: rank among all, or ask for the proof"
        )
    seconds: dict[str, float] = {}
    with _timed(seconds, "search"):
        found = search_windows(problem, Watch(run.time_limit))
    respond = sum(part.evaluation.seconds for part in (found.alone, *found.shared))
    with _timed(seconds, "verify"):
        steps = problem.steps(found.choice)
        require_anew(problem, found.choice, found.met)
    stages = {"respond": respond, "rank": seconds["search"] - respond, "verify": seconds["verify"]}
    return Plan(problem, formulation, Selection(found.choice, np.nan), None, steps, stages, found)


def _solve_lazily(
    problem: PlacementProblem, formulation: Formulation, run: _Run, options: Mapping[str, Any]
) -> Plan:
    """Return the certified plan of a search that solves only the models that the proof needs."""
    if not isinstance(problem, Layers):
        raise ProblemError("the costs of all choices are given; nothing is saved by a lazy search")
    if options:
        raise ProblemError(f"option {min(options)}: a lazy search has no options; leave it out")
    seconds: dict[str, float] = {}
    with _timed(seconds, "search"):
        found = search_pairs(problem, formulation, Watch(run.time_limit, run.progress))
    with _timed(seconds, "verify"):
        certificate = certify_partial(found.costs, found.selection, found.objective)
        steps = problem.steps(found.selection.choice)
        require_anew(problem, found.selection.choice, found.along.met)
    return Plan(
        problem,
        formulation,
        found.selection,
        certificate,
        steps,
        seconds,
        found.along,
        found.models,
    )


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start
