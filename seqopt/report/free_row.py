"""The free schedule as a row of the comparison."""

from __future__ import annotations

from collections.abc import Sequence

from seqopt.engines.interface import Engine
from seqopt.errors import SeqoptError
from seqopt.placement.criteria import WORST_OVER_METHODS
from seqopt.placement.free_plan import FreePlan
from seqopt.placement.free_problem import pose_free
from seqopt.placement.solving import solve
from seqopt.sequence.free_rules import FREE, FreeRules
from seqopt.work.progress import Tell

PATIENCE = 10.0  # s, after which the best plan so far is the row


def free_plan(
    engine: Engine, robots: Sequence[str], progress: Tell = lambda _: None
) -> tuple[FreePlan | None, str]:
    """Return the free schedule with the smallest worst step, and of these the shortest.

    Parameters
    ----------
    engine : Engine
    robots : sequence of str
        Names of those that take part; all by default.
    progress : callable, optional
        Told how far it is.

    Returns
    -------
    plan : FreePlan or None
        Over what the scene's fixed methods reach.
    why_not : str
        Why there is none.
    """
    try:
        rules = FreeRules(robots=tuple(robots))
        problem = pose_free(engine, rules, WORST_OVER_METHODS, "minmax,steps")
        plan = solve(problem, "schedule_search", time_limit=PATIENCE, progress=progress)
        return plan, ""
    except SeqoptError as error:
        return None, f"{FREE}: {error}"


def free_row(plan: FreePlan) -> dict[str, object]:
    """Return what a free schedule is worth, for a row of the comparison.

    Parameters
    ----------
    plan : FreePlan

    Returns
    -------
    dict of str to object
        As rows of `seqopt.report.comparison.Comparison.table`; the objective is the worst ratio.
    """
    bound, value = plan.selection.bound[0], plan.selection.objective[0]
    return {
        "problem": FREE,
        "objective": value,
        "gap": (value - bound) / (abs(value) or 1.0),  # without weight all responses are zero
        "models": plan.problem.sets.solved,
        "seconds": sum(plan.seconds.values()),
        "solve_seconds": plan.seconds["solve"],
    }
