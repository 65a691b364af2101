"""The command ``pareto``: all non-dominated plans."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import pandas as pd

from seqopt._cli import outputs, remarks
from seqopt._cli.answer import Answer, Status
from seqopt._cli.inputs import find_prover, mortar_of_engine
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call
from seqopt._cli.words import Folder
from seqopt._files import csv_text
from seqopt._showing import PAGE
from seqopt.engines.interface import Engine
from seqopt.engines.registry import provenance
from seqopt.plan.front import Front, find_front
from seqopt.plan.pose import states_of
from seqopt.problem.amounts import judged_by
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import _said_limits
from seqopt.report._pages import front_page
from seqopt.report.comparison import method_tables, shown_table
from seqopt.responses.table import Departure, LinearRange, analyze, builds_in_words
from seqopt.scene.scene_file import dump_scene
from seqopt.sequence.rules import FREE
from seqopt.sequence.steps import Step
from seqopt.stability._builds import BuildVerdicts
from seqopt.stability.assessment import Verdict
from seqopt.work.progress import INTERRUPT, Clock, Tell
from seqopt.workflow import optimize, parse_numbers, pose_build

INTERRUPTED = "seqopt: interrupted; the points are those that were found"
MOST_ROWS = 30  # of a table on the terminal
FOUR = "F_largest,M_sup,T_max,D_max"
ASKED = (
    *("scene", "order", "grips", "props", "payload", "robots"),
    *("schedule", "begin", "to", "direction", "rules", "limits", "engine", "mortar"),
    *("stands", "friction", "tilt", "curing", "time_limit"),
)
Departures = Mapping[str, Sequence[Departure]]
Verdicts = Mapping[str, Sequence[BuildVerdicts]]


def pareto(
    asked: Annotated[Call, ("call", optimize), ("of", ASKED)],
    *,
    stability: bool = True,
    aim: str = FOUR,
    rounding: Sequence[str] = (),
    out: Folder = None,
    progress: Tell,
) -> Answer:
    """Find every plan of the free schedule, or of a sequence with open grips, that no other beats.

    No other plan beats it in all aims at once (the Pareto set). Check each, and write a table, the
    plans, a chart and a page for the browser. Any steps are allowed by default.

    Parameters
    ----------
    stability : bool, optional
        As of `optimize`.
    aim : str, optional
        What is to be small: responses and, of the free schedule, steps or regrips (default:
        {default}).
    rounding : sequence of str, optional
        Round a number up to multiples of a step (SI units).
    out : pathlib.Path, optional
        Folder to write.

    Examples
    --------
    $ seqopt pareto arch25 --out front
    $ seqopt pareto arch25 --aim D_max,steps --time-limit 60 --out front
    $ seqopt pareto chain:bricks=7 --order search --aim T_max,F_largest --out front
    """
    words, mortar = asked.words, asked.words.get("mortar")
    schedule = words.get("schedule", FREE)
    output = Output(out, words.get("scene"), schedule)
    output.require()
    own = mortar_of_engine(words.get("engine"), mortar, verdicts=stability)
    values = asked.values(schedule=schedule, aim=aim, mortar=own, progress=progress)
    clock = Clock(values["search"].time_limit)
    with clock.needed("posing the problem"):
        problem = pose_build(values)
        free = states_of(problem)
    steps = parse_numbers("--round", rounding, [str(goal) for goal in free.goals])
    stands = values["stands"]
    front = find_front(problem, rounding=steps, progress=progress, clock=clock)
    shown = None if stands else mortar
    provers = {
        each: find_prover(each.network, shown, progress, asks=stability, stands=stands)
        for each in {*front.engines}
    }
    tables, left = _responses(front)

    def files() -> dict[str, bytes | str]:
        verdicts = dict[str, Sequence[BuildVerdicts]]()
        for own, builds in _by_engine(front).items():
            verdicts |= provers[own].of_builds(builds)
        return _files(problem, front, tables, left, verdicts, str(schedule))

    written = output.write(progress, files)
    notes = (
        *remarks.level_notes(words.get("engine"), free.engine),
        *(f"rules: {each}" for each in free.rules.relaxed(free.engine.network.scene)),
        *remarks.refused(next(iter(provers.values()))),
        *outputs.figure_notes(written),
    )
    answer = remarks.marked(_answer(front, free.engine, output, written), builds_in_words(left))
    answer = replace(answer, notes=(*answer.notes, *notes))
    return remarks.kept_range(answer, front.beyond)


def _answer(front: Front, engine: Engine, output: Output, written: tuple[Path, ...]) -> Answer:
    """Return the answer of a Pareto set that is written, if it is."""
    early, scene = front.stopped == INTERRUPT, engine.network.scene
    shown = "" if written else f"{_numbered(front).to_string(max_rows=MOST_ROWS)}\n"
    said = f"{len(front.steps)} points, {'complete' if front.complete else 'not complete'}"
    return Answer(
        {**_counts(front), "points": shown_table(front.table)},
        f"{shown}{said}; {outputs.written_to(output.path)}",
        written=written,
        failures=(INTERRUPTED,) if early else (),
        status=Status.INTERRUPTED if early else Status.DONE,
        scene=scene,
    )


def _counts(front: Front) -> dict[str, object]:
    """Return number of points, completeness, and run times."""
    counts = {"points": len(front.steps), "complete": front.complete}
    return {**counts, "seconds": dict(front.seconds)}


def _by_engine(front: Front) -> dict[Engine, dict[str, Sequence[Step]]]:
    """Return the steps of plans by name, grouped by the engine of their build order."""
    found = defaultdict[Engine, dict[str, Sequence[Step]]](dict)
    for number, (own, steps) in enumerate(zip(front.engines, front.steps, strict=True), start=1):
        found[own][f"point {number}"] = steps
    return found


def _responses(front: Front) -> tuple[dict[str, pd.DataFrame], Departures]:
    """Return the responses of the steps of every plan, and where they leave the linear range."""
    each, left = dict[str, pd.DataFrame](), dict[str, Sequence[Departure]]()
    for own, builds in _by_engine(front).items():
        found = {name: analyze(own, steps) for name, steps in builds.items()}
        each |= found
        left |= LinearRange(own).of_builds(found)
    names = [f"point {number}" for number in range(1, len(front.steps) + 1)]
    return {name: each[name] for name in names}, {n: left[n] for n in names if n in left}


def _files(
    problem: Problem,
    front: Front,
    tables: Mapping[str, pd.DataFrame],
    left: Departures,
    verdicts: Verdicts,
    schedule: str,
) -> dict[str, bytes | str]:
    """Return the files of a Pareto set by name."""
    engine, free = problem.engine, states_of(problem)
    summary = {
        **_counts(front),
        "outside_linear_range": list(builds_in_words(left)),
        "scene": engine.network.scene.name,
        "schedule": schedule,
        "aims": [str(goal) for goal in free.goals],
        **judged_by(free.goals, free.criterion),
        "limits": _said_limits(problem.limits),
        **({"filters": [*map(str, problem.filters)]} if problem.filters else {}),
        **provenance(engine),
    }
    points = _numbered(front).reset_index()
    for own in [*zip(*(verdicts.get(name, ()) for name in tables), strict=True)]:
        points[f"falls_{own[0].mortar}"] = [proven.count(Verdict.FALLS) for proven in own]
    if left:
        points["outside_linear_range"] = ["yes" if name in left else "" for name in tables]
    orders = [own.network.scene.build_order for own in front.engines]
    if {*orders} - {engine.network.scene.build_order}:
        points["order"] = [",".join(map(str, order)) for order in orders]
    plans = [table.assign(point=number) for number, table in enumerate(tables.values(), start=1)]
    methods = method_tables(engine)[0]
    return {
        "scene.json": dump_scene(engine.network.scene),
        PAGE: front_page(engine, front, tables, left, verdicts),
        "pareto.csv": csv_text(points),
        "plans.csv": csv_text(pd.concat(plans, ignore_index=True)),
        "summary.json": json.dumps(summary, indent=2) + "\n",
        **outputs.picture("pareto", lambda charts: charts.front_figure(front, methods)),
    }


def _numbered(front: Front) -> pd.DataFrame:
    """Return the table of a Pareto set, its points counted from 1."""
    table = shown_table(front.table)
    return table.set_axis(pd.RangeIndex(1, len(table) + 1, name="point"))
