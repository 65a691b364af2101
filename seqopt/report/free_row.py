"""The free schedule as a row of the comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from seqopt.engines.interface import Engine
from seqopt.errors import SeqoptError
from seqopt.placement.criteria import RankSum, WorstRatio
from seqopt.placement.free_plan import FreePlan
from seqopt.placement.free_problem import pose_free
from seqopt.placement.requirements import Criterion
from seqopt.placement.solving import solve
from seqopt.sequence.free_rules import FREE, FreeRules
from seqopt.work.progress import Tell

PATIENCE = 10.0  # s, after which the best plan so far is the row


def free_criterion(criterion: Criterion, rows: Sequence[Mapping[str, float]]) -> Criterion:
    """Return the criterion of a comparison, or what takes the place of ranks in a free schedule.

    Parameters
    ----------
    criterion : Criterion
        With which the other rows are compared.
    rows : sequence of mapping of str to float
        Largest responses of the sequences without a choice, as of `comparison.largest`.

    Returns
    -------
    Criterion
        Of ranks, which states do not have: the worst ratio to the least of these rows, so that
        below 1 the free schedule is better than all of them in everything.
    """
    if not isinstance(criterion, RankSum):
        return criterion
    names = {"F_largest": "F_rob", "M_sup": "M_sup", "T_max": "T_max", "D_max": "D_max"}
    units = {"D_max": 1e-6}  # m of 1e-3 mm
    least = {
        name: units.get(name, 1.0) * min(row[shown] for row in rows) or 1.0
        for name, shown in names.items()
    }
    return WorstRatio("worst-ratio-to-rows", tuple(least.items()))


def free_plan(
    engine: Engine,
    criterion: Criterion,
    robots: Sequence[str],
    progress: Tell = lambda _: None,
) -> tuple[FreePlan | None, str]:
    """Return the free schedule with the smallest worst step, and of these the shortest.

    Parameters
    ----------
    engine : Engine
    criterion : Criterion
        From `free_criterion`.
    robots : sequence of str
        Names of those that take part; all by default.
    progress : callable, optional
        Told how far it is.

    Returns
    -------
    plan : FreePlan or None
    why_not : str
        Why there is none.
    """
    try:
        rules = FreeRules(robots=tuple(robots))
        problem = pose_free(engine, rules, criterion, "minmax,steps")
        plan = solve(problem, "schedule_search", time_limit=PATIENCE, progress=progress)
        return plan, ""
    except SeqoptError as error:
        return None, f"{FREE}: {error}"


def free_row(plan: FreePlan) -> dict[str, object]:
    """Return what a free schedule is worth, for a row of the comparison.

    Returns
    -------
    dict of str to object
        As rows of `seqopt.report.comparison.Comparison.table`; the objective is its worst step.
    """
    bound, value = plan.selection.bound[0], plan.selection.objective[0]
    return {
        "problem": FREE,
        "objective": value,
        "gap": (value - bound) / (abs(value) or 1.0),  # without weight all responses are zero
        "models": plan.problem.models,
        "seconds": sum(plan.seconds.values()),
        "solve_seconds": plan.seconds["solve"],
    }
