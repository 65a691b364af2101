"""The command ``optimize``: choose every open grip of a build, or every step."""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from seqopt.cli.saying.answer import Answer
from seqopt.cli.saying.outputs import plan_files, write_outputs, written_to
from seqopt.cli.saying.terminal import wrapped
from seqopt.cli.status import Status
from seqopt.cli.words import optimize_arguments
from seqopt.cli.words.asked import exceeded, idle_notes, posed_notes, scene_facts, strictly
from seqopt.cli.words.posing import Asked, asked_problem
from seqopt.cli.words.values import parse_options, parse_size, parse_time_limit
from seqopt.errors import ProblemError
from seqopt.graph.states.states import States
from seqopt.plan.calling.formulation import End, Formulation, On, as_formulation
from seqopt.plan.out_of_sample import Trial, judge_unseen, worst_values
from seqopt.plan.plan import Plan
from seqopt.plan.solving import solve, usual
from seqopt.sequence.schedule import Schedule
from seqopt.study.published import paper_models
from seqopt.work.progress import within

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


@dataclass(frozen=True, eq=False)
class _Found:
    """A plan, what was asked, and how the plan does in scenarios that it was not chosen by."""

    asked: Asked
    plan: Plan
    assemble: float

    @cached_property
    def trial(self) -> Trial | None:
        """Beside other plans, where candidates were chosen over scenarios."""
        if self.asked.unseen is None or isinstance(self.plan.graph, States):
            return None
        return judge_unseen(self.plan, self.asked.unseen)

    @cached_property
    def report(self) -> dict[str, object]:
        """The summary, and what the command adds to it."""
        out = self.plan.summary() | {
            "seconds": {"assemble": self.assemble, **self.plan.seconds},
            "models_paper_count": _paper_count(self.plan),
        }
        known, unseen = self.asked.known, self.asked.unseen
        if known is None or unseen is None:
            return out
        out |= {"robust": str(self.asked.aim), "scenarios": known.settings}
        if self.trial is None:
            worst = worst_values(self.plan, unseen)
            return out | {"unseen": {**unseen.settings, "worst": worst}}
        return out | {"unseen": unseen.settings, "worth": self.trial.summary()}


def run(options: argparse.Namespace) -> Answer:
    """Choose every open grip of a build, or every step, and write the plan."""
    limit = parse_time_limit(options.time_limit)
    start = time.perf_counter()
    asked = asked_problem(options)
    formulation = as_formulation(options.formulation or usual(asked.problem))
    how = _how(options, formulation)
    assemble = time.perf_counter() - start
    tell = options.tell if formulation.on is On.STATES else within(options.tell, limit)
    plan = solve(asked.problem, formulation, time_limit=limit, progress=tell, **how)
    found = _Found(asked, plan, assemble)
    written = write_outputs(options, lambda: plan_files(plan, found.report, found.trial))
    return _answer(options, found, written)


def _how(options: argparse.Namespace, formulation: Formulation) -> dict[str, Any]:
    """Return how a formulation is to be run, its own options among it."""
    how: dict[str, Any] = parse_options(formulation, options.option)
    if options.max_memory is not None and formulation.on is On.ORDERS:
        raise ProblemError(
            "--max-memory: the search of orders has none; leave it out, or give --option most=N"
        )
    if options.max_memory is not None and "max_memory" in formulation.options:
        how["max_memory"] = parse_size(options.max_memory)
    return {"proof": not options.no_proof, "lazy": options.lazy, **how}


def _answer(options: argparse.Namespace, found: _Found, written: tuple[Any, ...]) -> Answer:
    """Return what a plan is worth, once it is written."""
    plan = found.plan
    table, scene = plan.responses(), plan.engine.network.scene
    stopped = plan.ended is End.INTERRUPTED
    over = () if stopped else exceeded(scene, table)
    lines = [f"{_said(found)}; {written_to(options.out)}"]
    facts: dict[str, object] = {"scene": scene_facts(scene), "summary": found.report}
    if plan.order is not None:
        order = plan.order.selection.order
        facts["order"] = order
        lines.append(wrapped(", ".join(map(str, order)), first="order: "))
    answer = Answer(
        facts={**facts, "plan": table},
        text="\n".join([*lines, *(f"payload exceeded: {excess}" for excess in over)]),
        written=written,
        notes=(*posed_notes(found.asked.problem), *idle_notes(scene, plan.steps)),
        failures=(INTERRUPTED,) if stopped else (),
        status=Status.INTERRUPTED if stopped else Status.DONE,
    )
    return strictly(answer, options, over, plan.departures)


def _said(found: _Found) -> str:
    """Return what a plan is worth, in a line."""
    plan = found.plan
    how = f"{plan.formulation.name} ({plan.formulation.kind.value})"
    if plan.order is not None:
        values = ", ".join(f"{name} {value:.6g}" for name, value in plan.objective.items())
        bound = plan.order.bound_said
        return f"{how}: {values}, {plan.status}, {bound}; {len(plan.steps)} steps"
    if found.trial is not None:
        unseen = found.trial.summary()["unseen"]
        return (
            f"{how}: {plan.worth} over {len(found.trial.known)} scenarios ({plan.title}); over "
            f"unseen ones {unseen['robust']:.6g}, the nominal plan {unseen['nominal']:.6g}"
        )
    counts = f"{plan.models} models"
    if isinstance(plan.graph, States):
        counts = f"{len(plan.steps)} steps, {plan.regrips} regrips, {counts}"
        return f"{how}: {plan.worth}; {counts}"
    return f"{how}: {plan.worth}, {counts}"


def _paper_count(plan: Plan) -> dict[str, int] | None:
    """Return how many models the paper counts for the loop of three robots; none for others."""
    if plan.method != "three-robot" or isinstance(plan.graph, States):
        return None
    schedule: Schedule = plan.layers.schedule
    return dict(zip(("cascading", "overlap"), paper_models(schedule), strict=True))
