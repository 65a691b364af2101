"""The command ``optimize``: choose every open grip of a build."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from dataclasses import replace

from seqopt.cli.commands.free import optimize_free, require_loop
from seqopt.cli.commands.robust import optimize_robust, require_no_scenarios
from seqopt.cli.saying.answer import Answer
from seqopt.cli.saying.outputs import plan_files, worth, write_outputs, written_to
from seqopt.cli.status import Status
from seqopt.cli.words import optimize_arguments
from seqopt.cli.words.asked import exceeded, idle_notes, posed_notes, strictly
from seqopt.cli.words.facts import scene_facts
from seqopt.cli.words.posing import asked_problem
from seqopt.cli.words.values import parse_options, parse_time_limit
from seqopt.graph.layers.layers import Layers
from seqopt.plan.calling.formulation import End, find_formulation
from seqopt.plan.plan import Plan
from seqopt.plan.solving import solve
from seqopt.report.pages import PAGE, plan_page
from seqopt.sequence.free_rules import FREE
from seqopt.sequence.schedule import Schedule
from seqopt.study.published import paper_models
from seqopt.work.progress import within
from seqopt.workflow import DEFAULTS

DESCRIPTION = (
    "Choose where robots hold, over all steps of a sequence, by one formulation; or, with "
    "--schedule free, choose every step. The answer is checked from the problem's own data, and "
    "plan, selection, responses, summary and a page for the browser are written."
)
USAGE = (
    "[SCENE] [--formulation NAME] [--out DIR] [other options]",
    "[SCENE] --schedule free [--out DIR] [other options]",
    "[SCENE] --robust AIM [--out DIR] [other options]",
)
EXAMPLES = (
    "seqopt optimize arch25 --out best",
    "seqopt optimize arch25 --schedule free --out free",
    "seqopt optimize wall:columns=6,courses=4 --schedule free --out wall",
    "seqopt optimize my.json --formulation minimax --limit payload --out mine",
    "seqopt optimize arch25 --robust worst-peak --out robust",
)
INTERRUPTED = "seqopt: interrupted; the plan is the best that was met"
add_arguments = optimize_arguments.add_arguments


def run(options: argparse.Namespace) -> Answer:
    """Choose every open grip of a build, and write the plan.

    ``options``: of the command ``optimize``.
    """
    if options.robust is None:
        require_no_scenarios(options)
    if options.schedule == FREE or options.aim or options.stands:
        return optimize_free(options)
    if options.robust is not None:
        return optimize_robust(options)
    require_loop(options)
    formulation = find_formulation(
        options.formulation or DEFAULTS["any other"].chosen_by(options.budget)
    )
    chosen = parse_options(formulation, options.option)
    limit = parse_time_limit(options.time_limit)
    how = {"proof": not options.no_proof, "lazy": options.lazy}
    start = time.perf_counter()
    problem = asked_problem(options)
    assemble = time.perf_counter() - start
    tell = within(options.tell, limit)
    plan = solve(problem, formulation, **how, time_limit=limit, progress=tell, **chosen)
    report = plan.summary() | {
        "models_paper_count": _paper_count(problem.schedule),
        "seconds": {"assemble": assemble, **plan.seconds},
    }
    written = write_outputs(options, lambda: _files(plan, report))
    return replace(_answer(options, problem, plan, report), written=written)


def _files(plan: Plan, report: Mapping[str, object]) -> dict[str, bytes | str]:
    """Return what is written, by file name."""
    page = plan_page(plan.engine, plan.formulation.name, plan.responses(), worth(plan))
    return plan_files(plan, plan.engine.network.scene, report) | {PAGE: page}


def _answer(
    options: argparse.Namespace, problem: Layers, plan: Plan, report: Mapping[str, object]
) -> Answer:
    """Return what a plan is worth, once it is written."""
    table, scene = plan.responses(), problem.schedule.scene
    over = exceeded(scene, table)
    said = (
        f"{plan.formulation.name} ({plan.formulation.kind.value}): {worth(plan)}, "
        f"{plan.models} models; {written_to(options.out)}"
    )
    stopped = plan.selection.end is End.INTERRUPTED
    answer = Answer(
        facts={"scene": scene_facts(scene), "summary": report, "plan": table},
        text="\n".join([said, *(f"payload exceeded: {excess}" for excess in over)]),
        notes=(*posed_notes(problem), *idle_notes(scene, plan.steps)),
        failures=(INTERRUPTED,) if stopped else (),
        status=Status.INTERRUPTED if stopped else Status.DONE,
    )
    return strictly(answer, options, over, plan.departures)


def _paper_count(schedule: Schedule) -> dict[str, int] | None:
    """Return how many models the paper counts for the loop of three robots; none for others."""
    if schedule.method != "three-robot":
        return None
    return dict(zip(("cascading", "overlap"), paper_models(schedule), strict=True))
