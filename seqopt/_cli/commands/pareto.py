"""The command ``pareto``: all plans that no other one beats in every aim at once."""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import pandas as pd

from seqopt._cli.answer import Answer, Status
from seqopt._cli.asked import (
    _not_done,
    asked_prover,
    level_notes,
    marked,
    refused,
    rule_notes,
    scene_facts,
)
from seqopt._cli.options import (
    BEST,
    BUILT,
    HOLDS,
    LIMIT,
    MOVES,
    PROVES,
    RULE,
    STANDING,
    WHERE,
    WRITTEN,
    declare,
    engine_options,
    form_options,
    robots_option,
    scene_options,
)
from seqopt._cli.outputs import _picked_files, _steps_table, figure_notes, write_outputs, written_to
from seqopt._cli.posing import asked_problem
from seqopt._cli.screens import question
from seqopt._cli.values import parse_numbers
from seqopt._files import csv_text, write_folder
from seqopt._showing import PAGE
from seqopt.engines.interface import Engine
from seqopt.engines.registry import provenance
from seqopt.errors import ProblemError, TimeUpError, did_you_mean
from seqopt.plan.build import GivenSequence
from seqopt.plan.front import Front, find_front, pick
from seqopt.plan.solving import states_of
from seqopt.problem.problem import Problem, judged_by
from seqopt.problem.requirements import LIFTED, LINEAR_RANGE, _said_limits
from seqopt.report._pages import front_page
from seqopt.report.comparison import _worst_of, fixed_methods, shown_table
from seqopt.responses._tolerance import value_text
from seqopt.responses.table import OUTSIDE, Departure, LinearRange, _analyze_builds, builds_in_words
from seqopt.scene.scene_file import dump_scene
from seqopt.sequence.rules import FREE
from seqopt.sequence.steps import Step
from seqopt.sequence.three_robots import SCHEDULES
from seqopt.stability._builds import BuildProver, BuildVerdicts
from seqopt.stability.assessment import Verdict
from seqopt.work._clock import INTERRUPT, Clock
from seqopt.work.progress import within

RANGE = "which points leave the linear range"
DETAILS = "responses, verdicts and the page"
INTERRUPTED = "seqopt: interrupted; the points are those that were found"
MOST_ROWS = 30  # of a table on the terminal
FOUR = "F_largest,M_sup,T_max,D_max"
DESCRIPTION = (
    "Find every plan of the free schedule, or of a sequence with open grips, that no other plan "
    "beats in all aims at once (the Pareto set); check each, and write a table, the plans, a chart "
    "and a page for the browser."
)
USAGE = ("[SCENE] [--out DIR] [--aim NAME,NAME] [other options]",)
EXAMPLES = (
    "seqopt pareto arch25 --out front",
    "seqopt pareto arch25 --pick D_max --under F_largest=250 --out front",
    "seqopt pareto arch25 --aim D_max,steps --seconds 60 --out front",
    "seqopt pareto chain:bricks=7 --order search --aim T_max,F_largest --out front",
)
AIM = {
    "--aim NAME,NAME": "what is to be small: responses and, of the free schedule, steps and "
    "regrips (default: %(default)s)"
}
SCHEDULE = {
    "--schedule NAME|FILE": f"{FREE} (default): any robot may place, hold or release next; or a "
    f"sequence with open grips: {', '.join(SCHEDULES)}, or a CSV file"
}
CHOICE = {
    "--pick NAME": "also write a folder, pick, of the plan with the least of a column",
    "--round NAME=STEP ...": "round a number up to multiples of a step (SI units)",
    "--under BOUND ...": "for --pick: only plans below it: NAME=VALUE (SI units), or a method that "
    "is to be beaten in everything: sequential, cantilever, published",
}
OF_MOVES = (
    f"--rule and --direction go with --schedule {FREE} alone, --keep with --direction take-down "
    "and not with --to."
)
OF_HOLDS = "--friction and --tilt go with --stands."
SECONDS = {
    "--seconds S": "limit of the whole command, with its proof, verdicts and page: what it has no "
    "time for is left out and named; the points that were found by then are there"
}


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``pareto``."""
    built, moves = question(command, BUILT), question(command, MOVES, OF_MOVES)
    scene_options(built)
    robots_option(built, "the build")
    declare(moves, SCHEDULE, default=FREE)
    declare(moves, RULE | WHERE)
    best = question(command, BEST, "--under goes with --pick.")
    declare(best, AIM, default=FOUR)
    declare(best, CHOICE)
    declare(question(command, HOLDS, OF_HOLDS), LIMIT | STANDING)
    declare(question(command, PROVES), SECONDS, default="inf", type=float)
    engine_options(command)
    declare(question(command, WRITTEN), {"--out DIR": "folder to write"})
    form_options(command, builds=True)
    command.set_defaults(criteria=None, crown=None)


@dataclass(frozen=True, repr=False)
class _Picked(GivenSequence):
    """A plan of a Pareto set."""

    result: str = ""


def run(options: argparse.Namespace) -> Answer:
    """Find all plans that no other beats in every aim, and write them."""
    return answered(options, *find(options))


def find(options: argparse.Namespace) -> tuple[Problem, Front]:
    """Find all plans that no other beats in every aim; with the problem that they are plans of."""
    seconds = float(options.seconds)
    if not seconds >= 0:
        raise ProblemError(f"--seconds {seconds:g}: give a number from 0")
    clock = options.clock = Clock(seconds)
    with clock.needed("posing the problem"):
        problem = asked_problem(options).problem
        free = states_of(problem)
    rounding = parse_numbers("--round", options.round, [str(goal) for goal in free.goals])
    tell = within(options.tell, clock.left)
    front = find_front(problem, rounding=rounding, progress=tell, clock=clock)
    clock.interrupted |= front.stopped == INTERRUPT
    return problem, front


def answered(options: argparse.Namespace, problem: Problem, front: Front) -> Answer:
    """Write a Pareto set, and return what is in it; what there is no time for is left out."""
    free, clock = states_of(problem), options.clock
    scene = free.engine.network.scene
    provers = {own: asked_prover(options, own.network) for own in {*front.engines}}
    methods, left, files = _content(options, problem, front, provers)
    said = f"{len(front.steps)} points, {'complete' if front.complete else 'not complete'}"
    picked = None
    if options.out and not options.pick:
        said += "; --pick D_max also writes a folder of the plan with the least"
    if options.pick:
        chosen, picked, row = _chosen(options, front, methods)
        scene = front.engines[chosen].network.scene  # in the order of what is picked
        said += f"; picked row {chosen + 1}: {row}"
    written = write_outputs(options, lambda: {**files, "scene.json": dump_scene(scene)})
    shown = "" if written else f"{_numbered(front).to_string(max_rows=MOST_ROWS)}\n"
    missing = figure_notes() if written else ()
    if written and picked is not None:
        prover = provers[front.engines[chosen]]
        write = partial(_write_picked, options, front, chosen, picked, prover)
        clock.spare("the folder of the plan that is picked", write, None)
    answer = Answer(
        facts={
            "scene": scene_facts(scene),
            "complete": front.complete,
            "seconds": dict(front.seconds),
            "points": shown_table(front.table),
            "picked": picked,
        },
        text=f"{shown}{said}; {written_to(options.out, page=DETAILS not in clock.left_out)}",
        written=written,
        notes=(
            *level_notes(options, free.engine),
            *rule_notes(free.rules, scene),
            *refused(next(iter(provers.values()))),
            *missing,
            *_not_done(clock),
        ),
        failures=(INTERRUPTED,) if clock.interrupted else (),
        status=Status.INTERRUPTED if clock.interrupted else Status.DONE,
    )
    answer = marked(answer, left)
    if not front.beyond or clock.interrupted:
        return answer
    said = f"seqopt: {OUTSIDE}: {front.beyond}; --limit {LINEAR_RANGE}={LIFTED} lifts this limit"
    return replace(answer, failures=(said,), status=Status.DOES_NOT_HOLD)


def _content(
    options: argparse.Namespace,
    problem: Problem,
    front: Front,
    provers: Mapping[Engine, BuildProver],
) -> tuple[Mapping[str, pd.DataFrame], tuple[str, ...], Mapping[str, bytes | str]]:
    """Return fixed methods, which points leave the linear range, and files, as far as needed."""
    shows, clock = options.out is not None, options.clock
    methods: Mapping[str, pd.DataFrame] = {}
    if shows or any("=" not in text for text in options.under):
        beside = partial(fixed_methods, problem.engine)
        methods = clock.spare("fixed methods beside", beside, methods)
    none: dict[str, tuple[Departure, ...]] = {}
    departures = clock.spare(RANGE, partial(_departures, front), none)
    files: Mapping[str, bytes | str] = _bare_files(front) if shows else {}
    if shows:
        found = partial(_front_files, front, problem, methods, provers, departures, options)
        files = clock.spare(DETAILS, found, files)
    return methods, builds_in_words(departures), files


def _chosen(
    options: argparse.Namespace, front: Front, methods: Mapping[str, pd.DataFrame]
) -> tuple[int, dict[str, object], str]:
    """Return which plan is picked, its point, and that in words."""
    if options.under and not methods and options.clock.left_out:
        raise TimeUpError(f"--pick {options.pick}: --under was not looked at; give more")
    chosen = pick(front.table, options.pick, _under(options.under, methods))
    values = shown_table(front.table).iloc[chosen]
    row = ", ".join(f"{name} {value_text(str(name), v)}" for name, v in values.items())
    return chosen, {"point": chosen + 1, **values}, row


def _bare_files(front: Front) -> dict[str, bytes | str]:
    """Return a Pareto set without what takes time: its points, and the steps of their plans."""
    pairs = zip(front.engines, front.steps, strict=True)
    plans = [
        _steps_table(_Picked(own, steps)).assign(point=number)
        for number, (own, steps) in enumerate(pairs, start=1)
    ]
    summary = {"points": len(plans), "complete": front.complete, "seconds": dict(front.seconds)}
    return {
        "pareto.csv": csv_text(_numbered(front).reset_index()),
        "plans.csv": csv_text(pd.concat(plans, ignore_index=True)),
        "summary.json": json.dumps(summary, indent=2) + "\n",
    }


def _write_picked(
    options: argparse.Namespace,
    front: Front,
    chosen: int,
    picked: Mapping[str, object],
    prover: BuildProver,
) -> None:
    """Write the plan that is picked, a folder as of any plan."""
    own = front.engines[chosen]
    title = f"plan with the least {options.pick}"
    plan = _Picked(own, front.steps[chosen], title, result=f"one of {len(front.steps)} plans")
    report = {"scene": own.network.scene.name, "picked": picked, **provenance(own)}
    write_folder(options.out / "pick", _picked_files(plan, report, prover))


def _front_files(
    front: Front,
    problem: Problem,
    methods: Mapping[str, pd.DataFrame],
    provers: Mapping[Engine, BuildProver],
    departures: Mapping[str, Sequence[Departure]],
    options: argparse.Namespace,
) -> dict[str, bytes | str]:
    """Return the files of a Pareto set by name."""
    engine, free = problem.engine, states_of(problem)
    options.tell("analyzing plans")
    found: dict[str, pd.DataFrame] = {}
    verdicts: dict[str, tuple[BuildVerdicts, ...]] = {}
    for own, builds in _by_engine(front).items():
        found |= zip(builds, _analyze_builds(own, [*builds.values()]), strict=True)
        verdicts |= provers[own].of_builds(builds)
    options.tell("drawing and writing the page")
    tables = {name: found[name] for name in _names(front)}
    posed = {
        "scene": engine.network.scene.name,
        "schedule": str(options.schedule),
        "aims": [str(goal) for goal in free.goals],
        **judged_by(free.goals, free.criterion),
        "limits": _said_limits(problem.limits),
    }
    summary = {
        "points": len(front.steps),
        "complete": front.complete,
        "seconds": dict(front.seconds),
        "outside_linear_range": list(builds_in_words(departures)),
        **posed,
        **provenance(engine),
    }
    numbered = _numbered(front).reset_index()
    for each in [*zip(*(verdicts.get(name, ()) for name in tables), strict=True)]:
        numbered[f"falls_{each[0].mortar}"] = [found.count(Verdict.FALLS) for found in each]
    if departures:
        numbered["outside_linear_range"] = ["yes" if name in departures else "" for name in tables]
    orders = [own.network.scene.build_order for own in front.engines]
    if {*orders} - {engine.network.scene.build_order}:
        numbered["order"] = [",".join(map(str, order)) for order in orders]
    plans = [table.assign(point=number) for number, table in enumerate(tables.values(), start=1)]
    return {
        PAGE: front_page(engine, front, tables, departures, verdicts),
        "pareto.csv": csv_text(numbered),
        "plans.csv": csv_text(pd.concat(plans, ignore_index=True)),
        **_picture(front, methods),
        "summary.json": json.dumps(summary, indent=2) + "\n",
    }


def _names(front: Front) -> list[str]:
    """Return what the plans of a Pareto set are called, in the order of its rows."""
    return [f"point {number}" for number in range(1, len(front.steps) + 1)]


def _by_engine(front: Front) -> dict[Engine, dict[str, Sequence[Step]]]:
    """Return the steps of plans by name, those of one build order under their engine."""
    found = defaultdict[Engine, dict[str, Sequence[Step]]](dict)
    for name, own, steps in zip(_names(front), front.engines, front.steps, strict=True):
        found[own][name] = steps
    return found


def _departures(front: Front) -> dict[str, tuple[Departure, ...]]:
    """Return how plans leave the linear range, for those that do, by name."""
    left: dict[str, tuple[Departure, ...]] = {}
    for own, builds in _by_engine(front).items():
        left |= LinearRange(own).of_steps(builds)
    return {name: left[name] for name in _names(front) if name in left}


def _numbered(front: Front) -> pd.DataFrame:
    """Return the table of a Pareto set, its points counted from 1."""
    table = shown_table(front.table)
    return table.set_axis(pd.RangeIndex(1, len(table) + 1, name="point"))


def _picture(front: Front, methods: Mapping[str, pd.DataFrame]) -> Mapping[str, bytes | str]:
    """Return the chart of a Pareto set by file name, if it can be drawn."""
    if figure_notes():
        return {}
    from seqopt.report._style import picture_files  # noqa: PLC0415
    from seqopt.report.charts import front_figure  # noqa: PLC0415  # matplotlib is an extra

    return picture_files("pareto", front_figure(front, methods))


def _under(texts: Sequence[str], methods: Mapping[str, pd.DataFrame]) -> dict[str, float]:
    """Return bounds from words: RESPONSE=VALUE, or the name of a method to beat."""
    out: dict[str, float] = {}
    for text in texts:
        if "=" not in text and text not in methods:
            known = ", ".join(methods)
            why = f"no such method{did_you_mean(text, methods)}"
            raise ProblemError(f"--under {text}: {why}; give {known}, or a bound as F_largest=250")
        bounds = _worst_of(methods[text]) if text in methods else parse_numbers("--under", [text])
        for name, value in bounds.items():
            out[name] = min(value, out.get(name, value))
    return out
