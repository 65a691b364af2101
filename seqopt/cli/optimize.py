"""The command ``optimize``: choose every open grip of a build."""

from __future__ import annotations

import argparse
import time

from seqopt.cli.asked import payloads_hold, say_idle, say_levels
from seqopt.cli.free import optimize_free, require_loop
from seqopt.cli.outputs import plan_files, worth, write_outputs
from seqopt.cli.posing import asked_problem
from seqopt.cli.robust import optimize_robust, require_no_scenarios
from seqopt.cli.status import Status
from seqopt.cli.terminal import complain, progress, say, tell
from seqopt.cli.values import parse_options, parse_time_limit
from seqopt.placement.formulation import End, find_formulation
from seqopt.placement.solving import solve
from seqopt.report.plan_pages import PAGE, plan_page
from seqopt.sequence.free_rules import FREE
from seqopt.sequence.schedule import Schedule
from seqopt.study.published import paper_models


def optimize(options: argparse.Namespace) -> Status:
    """Choose every open grip of a build, and write the plan.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command ``optimize``.

    Returns
    -------
    Status
    """
    if options.robust is not None:
        return optimize_robust(options)
    require_no_scenarios(options)
    if options.schedule == FREE:
        return optimize_free(options)
    require_loop(options)
    formulation = find_formulation(options.formulation)
    chosen = parse_options(formulation, options.option)
    limit = parse_time_limit(options.time_limit)
    how = {"proof": not options.no_proof, "lazy": options.lazy}
    start = time.perf_counter()
    problem = asked_problem(options)
    assemble = time.perf_counter() - start
    plan = solve(problem, formulation, **how, time_limit=limit, progress=tell, **chosen)
    progress("")
    say_levels(problem.engine)
    report = plan.summary() | {
        "models_paper_count": _paper_count(problem.schedule),
        "seconds": {"assemble": assemble, **plan.seconds},
    }
    table = plan.responses()
    scene = problem.schedule.scene
    page = plan_page(problem.engine, formulation.name, table, worth(plan))
    write_outputs(options, plan_files(plan, scene, report) | {PAGE: page})
    say(
        f"{formulation.name} ({formulation.kind.value}): {worth(plan)}, "
        f"{plan.models} models; written to {options.out}"
    )
    for excess in plan.overloads:
        say(f"payload exceeded: {excess}")
    say_idle(scene, plan.steps)
    if plan.selection.end is End.INTERRUPTED:
        complain("seqopt: interrupted; the plan is the best that was met")
        return Status.INTERRUPTED
    return payloads_hold(options, scene, table)


def _paper_count(schedule: Schedule) -> dict[str, int] | None:
    """Return how many models the paper counts for the loop of three robots; none for others."""
    if schedule.method != "three-robot":
        return None
    return dict(zip(("cascading", "overlap"), paper_models(schedule), strict=True))
