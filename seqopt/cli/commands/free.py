"""Schedules by states on the command line: ``--schedule free``, ``--aim`` and ``--stands``."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from typing import Any

from seqopt.cli.commands.order import SEARCH, optimize_order
from seqopt.cli.commands.robust import asked_aim, asked_scenarios
from seqopt.cli.saying.answer import Answer
from seqopt.cli.saying.free_files import free_files
from seqopt.cli.saying.outputs import require_out, write_outputs, written_to
from seqopt.cli.status import Status
from seqopt.cli.words.asked import (
    asked_engine,
    asked_scene,
    exceeded,
    idle_notes,
    posed_notes,
    strictly,
)
from seqopt.cli.words.criteria import parse_criterion
from seqopt.cli.words.facts import scene_facts
from seqopt.cli.words.means import parse_resources, parse_size
from seqopt.cli.words.posing import asked_schedule
from seqopt.cli.words.rules import parse_rules, parse_standing
from seqopt.cli.words.values import parse_limits, parse_numbers, parse_robots, parse_time_limit
from seqopt.errors import ProblemError, StepError
from seqopt.graph.scenarios.aims import RobustAim
from seqopt.graph.scenarios.scenarios import robust
from seqopt.graph.states.states import States, within
from seqopt.network.build import build_network
from seqopt.plan.calling.schedule_formulation import find_schedule_formulation
from seqopt.plan.free_plan import FreePlan
from seqopt.plan.judge.schedules import plan_values
from seqopt.plan.solving import solve
from seqopt.problem.budgets import parse_caps
from seqopt.scene.orders import in_order
from seqopt.scene.scenarios import Scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.free_rules import FREE, FreeRules, with_robots
from seqopt.sequence.schedule import Schedule
from seqopt.workflow import DEFAULTS, posed_free


def optimize_free(options: argparse.Namespace) -> Answer:
    """Choose every step of a free schedule, and write the plan.

    ``options``: of the command ``optimize``.
    """
    _require_free(options)
    sought, options.order = (
        options.order == SEARCH,
        None if options.order == SEARCH else options.order,
    )
    aim = None if options.robust is None else asked_aim(options, ())
    scene, problem = asked_free(options)
    unseen = None
    if aim is not None:
        known, unseen = asked_scenarios(options, scene)
        problem = robust(problem, known, aim)
    if sought:
        judged = None if unseen is None else partial(_out_of_sample, aim, unseen)
        return optimize_order(options, problem, judged)
    formulation = find_schedule_formulation(options.formulation or DEFAULTS[FREE].formulation)
    numbers = parse_numbers("--option", options.option, formulation.options)
    require_out(options)
    whole = {name: type(formulation.options[name])(value) for name, value in numbers.items()}
    limit = parse_time_limit(options.time_limit)
    if options.max_memory is not None:
        whole["max_memory"] = parse_size(options.max_memory)
    how: dict[str, Any] = {"proof": not options.no_proof, "lazy": options.lazy, **whole}
    plan = solve(problem, formulation, time_limit=limit, progress=options.tell, **how)
    table, report = plan.responses(), plan.summary()
    if unseen is not None:
        report |= _out_of_sample(aim, unseen, plan)
    said = f"{', '.join(map(str, problem.goals))}; {plan.status}"
    written = write_outputs(options, lambda: free_files(plan, report, plan.title, said))
    stopped = plan.selection.stopped == "interrupt"
    over = () if stopped else exceeded(scene, table)
    answer = Answer(
        facts={"scene": scene_facts(scene), "summary": report, "plan": table},
        text="\n".join([_said(plan, options), *(f"payload exceeded: {each}" for each in over)]),
        written=written,
        notes=(*posed_notes(problem), *idle_notes(scene, plan.steps)),
        status=Status.INTERRUPTED if stopped else Status.DONE,
    )
    return strictly(answer, options, over, plan.departures)


def _out_of_sample(aim: RobustAim | None, unseen: Scenarios, plan: FreePlan) -> dict[str, object]:
    """Return the worst values of a plan in scenarios that it was not chosen by."""
    order = plan.problem.network.scene.build_order
    scenes = [in_order(scene, order) for scene in unseen.scenes]
    judged = robust(replace(plan.problem, scenarios=(), limits=()), scenes, "worst-peak")
    judged = replace(judged, standing=None, settled=())
    goals = tuple(goal for goal in judged.goals if not goal.of_margins)
    values = plan_values(replace(judged, goals=goals), plan.steps) if goals else ()
    worst = {str(goal): value for goal, value in zip(goals, values, strict=True)}
    return {"robust": str(aim), "unseen": {**unseen.settings, "worst": worst}}


def _said(plan: FreePlan, options: argparse.Namespace) -> str:
    """Return what a plan is worth, in a line."""
    return (
        f"{plan.formulation.name} ({plan.formulation.kind.value}): {plan.worth}; "
        f"{len(plan.steps)} steps, {plan.regrips} regrips, {plan.problem.models} models; "
        f"{written_to(options.out)}"
    )


def require_loop(options: argparse.Namespace) -> None:
    """Raise an error if options that only the free schedule has are given without it.

    ``options``: of the command ``optimize``. Raises `ProblemError`, naming the option.
    """
    for name in ("rule", "tilt", "friction"):
        if getattr(options, name):
            also = "" if name == "rule" else " --stands MORTAR, or"
            raise ProblemError(f"--{name}: it needs more; give{also} --schedule {FREE}")


def _require_free(options: argparse.Namespace) -> None:
    """Raise an error if options that the free schedule does not have are given with it."""
    free = options.schedule == FREE
    unknown: tuple[str, ...] = ("ranked", "among", *(() if free else ("rule",)))
    given = [name for name in unknown if getattr(options, name)]
    if given:
        raise ProblemError(
            f"--{given[0].replace('_', '-')}: "
            + ("the free schedule has no such" if free else "aims and --stands have no such")
            + "; leave it out"
        )


def asked_free(options: argparse.Namespace) -> tuple[Scene, States]:
    """Return the scene with its robots, and the problem of its free schedule.

    ``options``: of the command ``optimize`` or ``pareto``.
    """
    scene = asked_scene(options)
    names = parse_robots(options.robots)
    if options.robots.isdecimal():
        scene, names = with_robots(scene, int(options.robots)), ()
    free = options.schedule == FREE
    if not free and (options.rule or options.robots.isdecimal()):
        raise StepError(f"--schedule {options.schedule}: rules and a count of robots go with free")
    rules: FreeRules | Schedule = parse_rules(options.rule, names if free else ())
    if free and getattr(options, "candidates", None):
        rules = replace(rules, candidates=options.candidates)
    criterion = None
    if options.criteria is not None:
        criterion = parse_criterion(options.criteria, options.crown)
    engine = asked_engine(options, build_network(scene))
    if not free:
        rules = asked_schedule(options, engine.network)
    limits, stands = parse_limits(options.limit, scene), parse_standing(options)
    problem = posed_free(engine, criterion, options.aim, rules=rules, limits=limits, stands=stands)
    if options.command == "optimize":
        problem = replace(problem, resources=parse_resources(options))
    caps = parse_caps(getattr(options, "budget", ()))
    return scene, within(problem, caps) if caps else problem
