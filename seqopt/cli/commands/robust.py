"""The command ``optimize --robust``: choose grips that are good in many scenarios."""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Mapping, Sequence

import pandas as pd

from seqopt.cli.saying.answer import Answer
from seqopt.cli.saying.outputs import write_outputs, written_to
from seqopt.cli.words.asked import exceeded, idle_notes, level_notes, scene_file, strictly
from seqopt.cli.words.facts import scene_facts
from seqopt.cli.words.posing import asked_problem
from seqopt.cli.words.values import number_word, parse_time_limit, split_word
from seqopt.engines.registry import provenance
from seqopt.errors import ProblemError, did_you_mean
from seqopt.files import csv_text
from seqopt.graph.scenarios.aims import RobustAim, parse_robust
from seqopt.graph.scenarios.scenarios import robust
from seqopt.plan.out_of_sample import Trial, judge_unseen
from seqopt.plan.robust_plan import solve_robust
from seqopt.responses.table import analyze
from seqopt.scene.scenarios import MOST, Scenarios, scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import idle_robots
from seqopt.work.progress import within

ALONE = ("scenarios", "unseen", "seed", "vary")  # options that mean something with --robust alone
NOT_WITH = ("formulation", "option", "no_proof", "lazy", "budget", "aim", "rule")
COUNT = 30
SPREADS = ("stiffness", "density", "position")


def require_no_scenarios(options: argparse.Namespace) -> None:
    """Raise an error if options of scenarios are given without an aim over them.

    ``options``: of the command ``optimize``. Raises `ProblemError`, naming the option.
    """
    for name in ALONE:
        if getattr(options, name):
            raise ProblemError(
                f"--{name}: plans over scenarios alone have it; give --robust worst-peak, "
                "worst-total or as cvar=0.9"
            )


def optimize_robust(options: argparse.Namespace) -> Answer:
    """Choose every open grip of a build over scenarios, judge the plan on others, and write it.

    ``options``: of the command ``optimize``.
    """
    aim = asked_aim(options, NOT_WITH)
    limit = parse_time_limit(options.time_limit)
    _counts(options)
    start = time.perf_counter()
    problem = asked_problem(options)
    scene = problem.schedule.scene
    known, unseen = asked_scenarios(options, scene)
    count, other = len(known.scenes), len(unseen.scenes)
    assemble = time.perf_counter() - start
    plan = solve_robust(
        robust(problem, known, aim), time_limit=limit, progress=within(options.tell, limit)
    )
    trial = judge_unseen(plan, unseen)
    table = analyze(problem.engine, plan.steps)
    report = _report(trial, known, unseen)
    report["seconds"] = {"assemble": assemble, **plan.seconds}
    written = write_outputs(options, lambda: _files(trial, table, report))
    worth = trial.summary()["unseen"]
    said = (
        f"{aim}: {plan.objective:.6g} over {count} scenarios, gap {100 * plan.gap:.3g} %; over "
        f"{other} unseen {worth['robust']:.6g}, the nominal plan {worth['nominal']:.6g}; "
        f"{f'written to {options.out}' if written else written_to(None)}"
    )
    answer = Answer(
        facts={"scene": scene_facts(scene), "summary": report, "plan": table},
        text=said,
        written=written,
        notes=(*level_notes(problem.engine), *idle_notes(scene, plan.steps)),
    )
    return strictly(answer, options, exceeded(scene, table), plan.departures)


def _files(
    trial: Trial, table: pd.DataFrame, report: Mapping[str, object]
) -> dict[str, bytes | str]:
    """Return what is written, by file name."""
    return {
        "plan.csv": csv_text(table),
        "selection.csv": csv_text(trial.plan.table()),
        "scenarios.csv": csv_text(trial.table),
        "summary.json": json.dumps(_plain(report), indent=2) + "\n",
        **scene_file(trial.plan.problem.nominal.schedule.scene),
    }


def asked_scenarios(options: argparse.Namespace, scene: Scene) -> tuple[Scenarios, Scenarios]:
    """Return the scenarios to choose by, and those that judge."""
    (count, other), seed = _counts(options)
    return _drawn(scene, options, count, seed), _drawn(scene, options, other, seed + 1)


def _counts(options: argparse.Namespace) -> tuple[tuple[int, int], int]:
    """Return how many scenarios are asked for, known and unseen, and the seed of the former."""
    count = _count("--scenarios", options.scenarios, COUNT)
    other = _count("--unseen", options.unseen, count)
    return (count, other), _count("--seed", options.seed, 0, least=0)


def asked_aim(options: argparse.Namespace, unknown: Sequence[str]) -> RobustAim:
    """Return the aim over scenarios if nothing is asked for that does not go with it."""
    try:
        aim = parse_robust(options.robust)
    except ProblemError as error:
        raise ProblemError(f"--robust: {error}") from error
    given = [name for name in unknown if getattr(options, name)]
    if given:
        name = given[0].replace("_", "-")
        raise ProblemError(f"--{name}: it does not go with --robust {options.robust}; leave it out")
    return aim


def _count(name: str, text: str | None, otherwise: int, least: int = 1) -> int:
    """Return a whole number from words."""
    if text is None:
        return otherwise
    if not (text.isascii() and text.isdecimal()) or not least <= int(text[:12]) <= MOST:
        raise ProblemError(f"{name} {text}: give a whole number from {least} to {MOST}")
    return int(text)


def _drawn(scene: Scene, options: argparse.Namespace, count: int, seed: int) -> Scenarios:
    """Return the scenarios that are asked for."""
    asked: dict[str, float] = {}
    for text in options.vary:
        name, value = split_word(text)
        if name not in SPREADS:
            raise ProblemError(
                f"--vary {text} does not exist{did_you_mean(name, SPREADS)}; give one of "
                f"{', '.join(SPREADS)}, as stiffness=3"
            )
        asked[name] = number_word(value, f"--vary {text}", zero="allowed")
    factor = asked.pop("stiffness", 3.0)
    if factor < 1:
        raise ProblemError(f"--vary stiffness={factor:g}: give a factor from 1")
    return scenarios(scene, stiffness=(1 / factor, factor), count=count, seed=seed, **asked)


def _report(trial: Trial, known: Scenarios, unseen: Scenarios) -> dict[str, object]:
    """Return what there is to say about a plan over scenarios."""
    plan = trial.plan
    problem = plan.problem.nominal
    schedule = problem.schedule
    return {
        "scene": schedule.scene.name,
        "schedule": schedule.method,
        "aim": str(plan.problem.aim),
        "candidates": f"heuristic: {schedule.left_out}" if schedule.left_out else "all",
        "criterion": problem.criterion.name,
        **problem.criterion.settings,
        "scenarios": known.settings,
        "unseen": unseen.settings,
        "status": plan.status,
        "objective": plan.objective,
        "bound": plan.bound,
        "proven_by_weights": plan.proven,
        "gap": plan.gap,
        "worth": trial.summary(),
        "outside_linear_range": [str(departure) for departure in plan.departures],
        "idle_robots": list(idle_robots(schedule.scene, plan.steps)),
        "models_evaluated": sum(costs.models for costs in plan.problem.costs),
        **provenance(problem.engine),
    }


def _plain(value: object) -> object:
    """Return what JSON can hold: null in the place of numbers that are not finite."""
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
