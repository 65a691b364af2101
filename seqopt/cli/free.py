"""Commands of the free schedule and of Pareto sets."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from seqopt.cli.asked import asked_engine, asked_scene, scene_file
from seqopt.cli.criteria import parse_criterion
from seqopt.cli.free_files import free_files
from seqopt.cli.means import parse_size
from seqopt.cli.order import SEARCH, optimize_order
from seqopt.cli.outputs import require_matplotlib, write_outputs
from seqopt.cli.rules import parse_rules, parse_standing
from seqopt.cli.status import Status
from seqopt.cli.terminal import complain, progress, say
from seqopt.cli.values import parse_limits, parse_numbers, parse_robots, parse_time_limit
from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError, StepError
from seqopt.files import csv_text, require_folder
from seqopt.network.build import build_network
from seqopt.placement.criteria import WORST_OVER_METHODS
from seqopt.placement.formulation import formulation_names
from seqopt.placement.free_front import FreeFront
from seqopt.placement.free_problem import FreeProblem, pose_free
from seqopt.placement.front import Front, FrontProblem, find_front, pick
from seqopt.placement.loop_front import LoopFront
from seqopt.placement.promises import overloads
from seqopt.placement.requirements import Criterion
from seqopt.placement.schedule_formulation import find_schedule_formulation
from seqopt.placement.solving import solve
from seqopt.report.fronts import shown_table, worst_of
from seqopt.report.methods import method_tables
from seqopt.report.plan_pages import PAGE, front_page
from seqopt.responses.table import analyze
from seqopt.scene.scene import Scene
from seqopt.sequence.free_rules import FREE, with_robots
from seqopt.sequence.schedule_file import find_schedule
from seqopt.sequence.steps import Step, idle_robots


def optimize_free(options: argparse.Namespace) -> Status:
    """Choose every step of a free schedule, and write the plan.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command ``optimize``.

    Returns
    -------
    Status
    """
    _require_free(options)
    if options.order == SEARCH:
        options.order = None
        return optimize_order(options, _posed(options, options.aim or "minmax")[1])
    formulation = find_schedule_formulation(options.formulation or "schedule_search")
    numbers = parse_numbers("--option", options.option, formulation.options)
    scene, problem = _posed(options, options.aim or "minmax")
    require_folder(options.out)
    whole = {name: type(formulation.options[name])(value) for name, value in numbers.items()}
    limit = parse_time_limit(options.time_limit)
    if options.max_memory is not None:
        whole["max_memory"] = parse_size(options.max_memory)
    how: dict[str, Any] = {"proof": not options.no_proof, "lazy": options.lazy, **whole}
    plan = solve(problem, formulation, time_limit=limit, progress=progress, **how)
    table = plan.responses()
    said = f"{', '.join(map(str, problem.goals))}; {plan.status}"
    files = free_files(plan, plan.summary(), "free schedule", said)
    write_outputs(options, files | scene_file(scene))
    values = ", ".join(f"{name} {value:.6g}" for name, value in plan.objective.items())
    say(
        f"{formulation.name} ({formulation.kind.value}): {values}, {plan.status}; "
        f"{len(plan.steps)} steps, {plan.regrips} regrips, {problem.sets.solved} models; "
        f"written to {options.out}"
    )
    if idle := idle_robots(scene, plan.steps):
        complain(f"robots: {', '.join(idle)} never grip{'s' * (len(idle) == 1)}")
    if plan.selection.stopped == "interrupt":
        return Status.INTERRUPTED
    over = [str(excess) for excess in overloads(scene, table)]
    for excess in over:
        say(f"payload exceeded: {excess}")
    return Status.DOES_NOT_HOLD if options.strict and over else Status.DONE


def pareto(options: argparse.Namespace) -> Status:
    """Find all plans that no other beats in every response, and write them.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command ``pareto``.

    Returns
    -------
    Status
    """
    require_matplotlib(options.out)
    require_folder(options.out)
    scene, free = _posed(options, options.aim)
    rounding = parse_numbers("--round", options.round, dict.fromkeys(map(str, free.goals)))
    problem: FrontProblem = FreeFront(free, rounding)
    if options.schedule != FREE:
        problem = _loop(options, free, rounding)
    front = find_front(problem, seconds=float(options.seconds), progress=progress)
    methods = _methods(free.engine)
    files = _front_files(front, free.engine, methods)
    said = f"{len(front.steps)} points, {'complete' if front.complete else 'not complete'}"
    if options.pick:
        chosen = pick(front.table, options.pick, _under(options.under, methods))
        files["pick.csv"] = csv_text(analyze(free.engine, front.steps[chosen]))
        values = shown_table(front.table).iloc[chosen]
        row = ", ".join(f"{name} {value:.6g}" for name, value in values.items())
        said += f"; picked row {chosen + 1}: {row}"
    write_outputs(options, files | scene_file(scene))
    say(f"{said}; written to {options.out}")
    return Status.DONE


def require_loop(options: argparse.Namespace) -> None:
    """Raise an error if options that only the free schedule has are given without it.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command ``optimize``.

    Raises
    ------
    ProblemError
        Naming the option, or the formulation that is missing.
    """
    free = ("aim", "rule", "stands", "tilt", "friction")
    for name, given in ((f"--{word}", getattr(options, word)) for word in free):
        if given:
            raise ProblemError(f"{name}: only the free schedule has it; give --schedule {FREE}")
    if options.formulation is None:
        known = ", ".join(formulation_names())
        raise ProblemError(f"--formulation: it is missing; give one of {known}")


def _require_free(options: argparse.Namespace) -> None:
    """Raise an error if options that the free schedule does not have are given with it."""
    unknown = ("budget", "candidates", "cache", "ranked", "among")
    given = [name for name in unknown if getattr(options, name)]
    given += ["workers"] if options.workers != "1" and options.order != SEARCH else []
    if given:
        raise ProblemError(
            f"--{given[0].replace('_', '-')}: the free schedule has no such; leave it out"
        )


def _posed(options: argparse.Namespace, aim: str) -> tuple[Scene, FreeProblem]:
    """Return the scene with its robots, and the problem of its free schedule."""
    scene = asked_scene(options)
    names = parse_robots(options.robots)
    if options.robots.isdecimal():
        scene, names = with_robots(scene, int(options.robots)), ()
    if options.schedule != FREE and (options.rule or options.robots.isdecimal()):
        raise StepError(f"--schedule {options.schedule}: rules and a count of robots go with free")
    rules = parse_rules(options.rule, names if options.schedule == FREE else ())
    criterion: Criterion = WORST_OVER_METHODS
    if options.criteria is not None:
        criterion = parse_criterion(options.criteria, options.crown)
    engine = asked_engine(options, build_network(scene))
    limits = parse_limits(options.limit, scene)
    return scene, pose_free(engine, rules, criterion, aim, limits, parse_standing(options))


def _loop(
    options: argparse.Namespace, free: FreeProblem, rounding: Mapping[str, float]
) -> FrontProblem:
    names = [goal.response for goal in free.goals]
    if not all(names):
        raise ProblemError(f"--aim {options.aim}: a schedule of given steps has responses only")
    robots = parse_robots(options.robots)
    schedule = find_schedule(free.network, options.schedule, robots)
    return LoopFront(free.engine, schedule, names, free.limits, rounding)


def _methods(engine: Engine) -> dict[str, pd.DataFrame]:
    try:
        return method_tables(engine)[0]
    except StepError:
        return {}


def _front_files(
    front: Front, engine: Engine, methods: Mapping[str, pd.DataFrame]
) -> dict[str, bytes | str]:
    """Return table, plans, chart and summary of a Pareto set by file name."""
    from seqopt.report.fronts import front_figure  # noqa: PLC0415  # matplotlib is an extra
    from seqopt.report.style import picture_files  # noqa: PLC0415

    known: dict[tuple[Step, ...], pd.DataFrame] = {}
    plans = []
    for number, steps in enumerate(front.steps, start=1):
        table = known.setdefault(steps, analyze(engine, steps))
        plans.append(table.assign(point=number))
    summary = {
        "points": len(front.steps),
        "complete": front.complete,
        "seconds": dict(front.seconds),
    }
    numbered = shown_table(front.table)
    numbered.insert(0, "point", range(1, len(numbered) + 1))
    return {
        PAGE: front_page(engine, shown_table(front.table), [known[steps] for steps in front.steps]),
        "pareto.csv": csv_text(numbered),
        "plans.csv": csv_text(pd.concat(plans, ignore_index=True)),
        **picture_files("pareto", front_figure(front, methods)),
        "summary.json": json.dumps(summary, indent=2) + "\n",
    }


def _under(texts: Sequence[str], methods: Mapping[str, pd.DataFrame]) -> dict[str, float]:
    """Return bounds from words: RESPONSE=VALUE, or the name of a method to beat."""
    out: dict[str, float] = {}
    for text in texts:
        bounds = worst_of(methods[text]) if text in methods else parse_numbers("--under", [text])
        for name, value in bounds.items():
            out[name] = min(value, out.get(name, value))
    return out
