"""Solve a problem by any formulation; the answer is checked and becomes a plan."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from seqopt.errors import ProblemError
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.orders import AllOrders
from seqopt.graph.scenarios import ScenarioLayers
from seqopt.graph.states.states import States
from seqopt.plan.calling.formulation import Formulation, On, as_formulation
from seqopt.plan.calling.watch import Run
from seqopt.plan.layers import solve_layers
from seqopt.plan.plan import Plan
from seqopt.plan.posing import AIMS, graph_of, natural, usual
from seqopt.plan.states import solve_orders, solve_states
from seqopt.problem.goals import Aim
from seqopt.problem.problem import Problem
from seqopt.sequence.free_rules import FreeRules

SOLVE: dict[On, Callable[[Any, Formulation, Run], Plan]] = {
    On.LAYERS: solve_layers,
    On.SCENARIOS: solve_layers,
    On.STATES: solve_states,
    On.ORDERS: solve_orders,
}


def solve(
    problem: Problem | PlacementProblem | States | AllOrders,
    formulation: Formulation | str | None = None,
    *,
    proof: bool = True,
    lazy: bool = False,
    time_limit: float = math.inf,
    progress: Callable[[Any], object] | None = None,
    **options: Any,
) -> Plan:
    """Solve a problem by a formulation and check the answer from the problem's own data.

    Parameters
    ----------
    problem : Problem or PlacementProblem
        From `seqopt.pose`; or a graph of choices, as a `seqopt.graph.layers.interface.CostProblem`.
    formulation : Formulation or str, optional
        Or a name in `seqopt.formulations`; by default the fastest exact one that there is for it.
    proof : bool, optional
        False: no gap is known; ``cascade`` or ``rank_search`` solve only models that they need.
    lazy : bool, optional
        Solve only the models that the proof needs, as is always done where states are chosen.
    time_limit : float, optional
        Seconds of choosing after which it returns its best choice and a bound, as at an interrupt;
        without proof of all it does: an error names the moves that were chosen by then.
    progress : callable, optional
        Called with every better choice and bound as it is found, or with a few words.
    **options
        Options of the formulation.

    Returns
    -------
    Plan

    Raises
    ------
    InfeasibleError, ProblemError, SolverError
        If no choice is allowed, the arguments do not fit together, or a solver or claim fails.

    Examples
    --------
    >>> import seqopt
    >>> problem = seqopt.optimize("arch25").problem
    >>> seqopt.solve(problem, "overlap_lp").status
    <Status.OPTIMAL: 'optimal'>
    """
    return _solved(problem, formulation, Run(time_limit, progress, proof, lazy, options))


def _solved(problem: Any, formulation: Formulation | str | None, run: Run) -> Plan:
    """Return the plan of a problem, or of a graph of choices that is given."""
    if not isinstance(problem, Problem):
        found = _of_graph(problem, formulation)
        on = On.ORDERS if isinstance(problem, AllOrders) else found.on
        return SOLVE[on](problem, found, run)
    found = as_formulation(formulation or usual(problem), *_able(problem))
    on = natural(problem) if natural(problem) in found.also else found.on
    _require_goal(problem, found)
    return replace(SOLVE[on](graph_of(problem, on), found, run), problem=problem)


def _able(problem: Problem) -> tuple[On, ...]:
    """Return what formulations of a problem may be for, the usual one first."""
    first = natural(problem)
    if first is On.LAYERS:
        return (On.LAYERS, On.STATES)
    chosen_from_candidates = not isinstance(problem.moves, FreeRules) and len(problem.goals) <= 1
    return (first, On.LAYERS) if first is On.STATES and chosen_from_candidates else (first,)


def _require_goal(problem: Problem, formulation: Formulation) -> None:
    """Raise an error if a formulation of candidates minimizes something else than is asked."""
    if formulation.aim is not None and problem.goals not in ((), (AIMS[formulation.aim],)):
        asked = ", ".join(map(str, problem.goals))
        raise ProblemError(
            f"aim {asked}: {formulation.name} minimizes the {formulation.aim.value} of costs; "
            "take another formulation"
        )


def _of_graph(problem: object, formulation: Formulation | str | None) -> Formulation:
    """Return the formulation of a graph of choices that is given."""
    if isinstance(problem, States):
        return as_formulation(formulation or "schedule_search", On.STATES)
    if isinstance(problem, AllOrders):
        return as_formulation(formulation or "order_search", On.ORDERS)
    if isinstance(problem, ScenarioLayers):
        peak = problem.aim.aim is Aim.PEAK
        usual_one, on = ("minimax", On.LAYERS) if peak else ("scenario_search", On.SCENARIOS)
        return as_formulation(formulation or usual_one, on)
    known = getattr(problem, "budgets", None)
    return as_formulation(formulation or ("labels" if known else "overlap_dp"), On.LAYERS)
