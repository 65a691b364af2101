"""The command ``pareto``: all non-dominated plans."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import inf
from pathlib import Path
from typing import Any

import pandas as pd

from seqopt._cli import outputs, remarks
from seqopt._cli.answer import Answer, Result
from seqopt._cli.commands.optimize import posed
from seqopt._cli.inputs import find_prover
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call, door
from seqopt._cli.words import Bricks, BuiltFrom, Folder, Numbers, Words, parse_numbers, shown
from seqopt._files import csv_text, write_folder
from seqopt._showing import PAGE
from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import provenance
from seqopt.network.network import Network
from seqopt.plan.build import GivenSequence
from seqopt.plan.front import Front, find_front
from seqopt.plan.front import pick as pick_point
from seqopt.plan.pose import states_of
from seqopt.problem.amounts import judged_by
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import Limit, _said_limits
from seqopt.problem.standing import Standing
from seqopt.report._pages import front_page, plan_page
from seqopt.report.comparison import method_tables, shown_table
from seqopt.responses._tolerance import values_text
from seqopt.responses.table import Departure, LinearRange, _analyze_builds, builds_in_words
from seqopt.scene.scene_file import dump_scene
from seqopt.sequence.rules import FREE, FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step
from seqopt.stability._builds import BuildProver, BuildVerdicts
from seqopt.stability.assessment import Verdict
from seqopt.work.progress import INTERRUPT, Clock, Tell, within
from seqopt.workflow import Part, _pose_build

DETAILS = "responses, verdicts and the page"
INTERRUPTED = "seqopt: interrupted; the points are those that were found"
MOST_ROWS = 30  # of a table on the terminal
FOUR = "F_largest,M_sup,T_max,D_max"


@dataclass(frozen=True, repr=False)
class _Picked(GivenSequence):
    """A plan of a Pareto set."""

    result: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Found:
    """A Pareto set with its request, and the evaluations that the time limit allows."""

    problem: Problem
    value: Front
    clock: Clock
    prover: Callable[[Network], BuildProver]
    out: Output
    tell: Tell
    engine: str | None  # that is named
    schedule: str

    @cached_property
    def provers(self) -> dict[Engine, BuildProver]:
        """Provers of stability, by the engine of a build order."""
        return {own: self.prover(own.network) for own in {*self.value.engines}}

    @cached_property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Responses of the steps of every plan."""
        each: dict[str, pd.DataFrame] = {}
        for own, builds in _by_engine(self.value).items():
            each |= zip(builds, _analyze_builds(own, [*builds.values()]), strict=True)
        return {name: each[name] for name in _names(self.value)}

    @cached_property
    def departures(self) -> dict[str, tuple[Departure, ...]]:
        """Exceeded limits of the linear range, by plan."""

        def departures() -> dict[str, tuple[Departure, ...]]:
            left: dict[str, tuple[Departure, ...]] = {}
            for own, builds in _by_engine(self.value).items():
                own_tables = {name: self.tables[name] for name in builds}
                left |= LinearRange(own).of_builds(own_tables)
            return {name: left[name] for name in _names(self.value) if name in left}

        return self.clock.spare("which points leave the linear range", departures, {})

    @property
    def counts(self) -> dict[str, object]:
        """Number of points, completeness, and run times."""
        front = self.value
        counts = {"points": len(front.steps), "complete": front.complete}
        return {**counts, "seconds": dict(front.seconds)}


@door
def pareto(  # noqa: PLR0913  # every option is a parameter
    scene: BuiltFrom = "arch25",
    *,
    schedule: Schedule | Part | Path | str = FREE,
    order: Bricks | None = None,
    robots: int | Words | None = None,
    rules: FreeRules | Words = (),
    limits: Sequence[Limit | str] | Limit | str = (),
    stands: Standing | Mortar | str | None = None,
    engine: str | None = None,
    mortar: Mortar | str | None = None,
    stability: bool = True,
    progress: Tell = shown,
    aim: Words = FOUR,
    rounding: Numbers = (),
    pick: str | None = None,
    under: Words = (),
    time_limit: float = inf,
    out: Folder | None = None,
) -> Result[Front]:
    """Find every plan of the free schedule, or of a sequence with open grips, that no other beats.

    No other plan beats it in all aims at once (the Pareto set). Check each, and write a table, the
    plans, a chart and a page for the browser.

    Parameters
    ----------
    scene, schedule, order, robots, rules, limits, stands : optional
        As of `optimize`; any steps are allowed by default.
    engine, mortar, stability, progress : optional
        As of `optimize`.
    aim : str or sequence of str, optional
        What is to be small: responses and, of the free schedule, steps or regrips (default:
        {default}).
    rounding : mapping or sequence of str, optional
        Round a number up to multiples of a step (SI units).
    pick : str, optional
        Also write a folder, pick, of the plan with the least of a column.
    under : str or sequence of str, optional
        For ``pick``: only plans below it, as F_largest=250 (SI units).
    time_limit : float, optional
        Limit of the whole command, with its proof, verdicts and page: what it has no time for is
        left out and named; the points that were found by then are there.
    out : pathlib.Path or str, optional
        Folder to write.

    Returns
    -------
    Front
        Its points and plans, and whether they are all.

    Examples
    --------
    >>> pareto("wall:columns=2,courses=2", aim="F_largest,steps")
    <Front: 1 plans, complete; F_largest, steps, regrips>

    $ seqopt pareto arch25 --out front
    $ seqopt pareto arch25 --pick D_max --under F_largest=250 --out front
    $ seqopt pareto arch25 --aim D_max,steps --time-limit 60 --out front
    $ seqopt pareto chain:bricks=7 --order search --aim T_max,F_largest --out front
    """
    output = Output(out, scene, schedule)
    output.require()
    clock = Clock(time_limit)
    words: dict[str, Any] = {
        "scene": scene,
        "schedule": schedule,
        "aim": str(aim),
        "robots": robots,
    }
    words |= {"engine": engine, "mortar": mortar, "order": order, "stands": stands}
    words |= {"rules": rules or None, "limits": limits, "progress": progress}
    with clock.needed("posing the problem"):
        problem: Problem = posed(Call(_pose_build, words), verdicts=stability)()
        free = states_of(problem)
    steps = parse_numbers("--round", rounding, [str(goal) for goal in free.goals])
    tell = within(progress, clock.left)
    front = find_front(problem, rounding=steps, progress=tell, clock=clock)
    clock.interrupted |= front.stopped == INTERRUPT
    required = stands if isinstance(stands, Standing) else None
    own = mortar if required is None else None

    def prover(network: Network) -> BuildProver:
        return find_prover(network, own, progress, asks=stability, stands=required)

    named = str(schedule.schedule if isinstance(schedule, Part) else schedule)
    found = Found(problem, front, clock, prover, output, progress, engine, named)
    return Result(front, lambda: _answer(found, pick, under))


def _answer(found: Found, pick: str | None, under: Words) -> Answer[Front]:
    """Write a Pareto set, and return its answer, without the parts that exceed the time limit."""
    front, free, clock = found.value, states_of(found.problem), found.clock
    scene = free.engine.network.scene
    files: Mapping[str, bytes | str] = {}
    path, engine, methods = found.out.path, found.problem.engine, dict[str, pd.DataFrame]()
    if path is not None:
        beside = "fixed methods beside"
        methods = clock.spare(beside, lambda: method_tables(engine)[0], methods)
    _ = found.departures
    if path is not None:
        pairs = zip(front.engines, front.steps, strict=True)
        bare = _files(found, [outputs.steps_table(_Picked(own, steps)) for own, steps in pairs], {})
        files = clock.spare(DETAILS, partial(_front_files, found, methods), bare)
    said = f"{len(front.steps)} points, {'complete' if front.complete else 'not complete'}"
    picked = None
    if path and not pick:
        said += "; --pick D_max also writes a folder of the plan with the least"
    if pick:
        chosen, picked, row = _chosen(pick, under, found)
        scene = front.engines[chosen].network.scene  # in the order of what is picked
        said += f"; picked row {chosen + 1}: {row}"
    written = found.out.write(found.tell, lambda: {**files, "scene.json": dump_scene(scene)})
    shown = "" if written else f"{_numbered(front).to_string(max_rows=MOST_ROWS)}\n"
    if path is not None and pick and picked is not None:
        write = partial(_write_picked, path / "pick", pick, found, chosen, picked)
        clock.spare("the folder of the plan that is picked", write, None)
    points = {"points": shown_table(front.table), "picked": picked}
    answer: Answer[Front] = Answer(
        facts={**found.counts, **points},
        scene=scene,
        text=f"{shown}{said}; {outputs.written_to(path, page=DETAILS not in clock.left_out)}",
        written=written,
        notes=(
            *remarks.level_notes(found.engine, free.engine),
            *remarks.rule_notes(free.rules, scene),
            *remarks.refused(next(iter(found.provers.values()))),
            *outputs.figure_notes(written),
        ),
    )
    answer = remarks.marked(answer, builds_in_words(found.departures))
    answer = remarks.in_time(answer, clock, INTERRUPTED)
    return remarks.kept_range(answer, front.beyond or None)


def _chosen(name: str, under: Words, found: Found) -> tuple[int, dict[str, object], str]:
    """Return the index of the picked plan, its point, and its description."""
    known = [str(column) for column in found.value.table.columns]
    bounds = parse_numbers("--under", under, known)
    chosen = pick_point(found.value.table, name, bounds)
    row = shown_table(found.value.table).iloc[chosen]
    values = {str(name): value for name, value in row.items()}
    return chosen, {"point": chosen + 1, **values}, values_text(values)


def _files(
    found: Found,
    plans: Sequence[pd.DataFrame],
    more: Mapping[str, object],
    numbered: pd.DataFrame | None = None,
) -> dict[str, bytes | str]:
    """Return the tables and the summary of a Pareto set."""
    points = _numbered(found.value).reset_index() if numbered is None else numbered
    plans = [table.assign(point=number) for number, table in enumerate(plans, start=1)]
    return {
        "pareto.csv": csv_text(points),
        "plans.csv": csv_text(pd.concat(plans, ignore_index=True)),
        "summary.json": json.dumps({**found.counts, **more}, indent=2) + "\n",
    }


def _write_picked(
    folder: Path, name: str, found: Found, chosen: int, picked: Mapping[str, object]
) -> None:
    """Write the folder of the picked plan."""
    own = found.value.engines[chosen]
    result = f"one of {len(found.value.steps)} plans"
    plan = _Picked(own, found.value.steps[chosen], f"plan with the least {name}", result=result)
    report = {"scene": own.network.scene.name, "picked": picked, **provenance(own)}
    table = plan.responses()
    files = {
        **outputs.bare_files(plan, table, report),
        **outputs.task_files(plan),
        **outputs.time_files(plan),
        PAGE: plan_page(plan, found.provers[own], table=table),
    }
    write_folder(folder, files)


def _front_files(found: Found, methods: Mapping[str, pd.DataFrame]) -> dict[str, bytes | str]:
    """Return the files of a Pareto set by name."""
    front, problem = found.value, found.problem
    engine, free = problem.engine, states_of(problem)
    found.tell("analyzing plans")
    tables = found.tables
    verdicts: dict[str, tuple[BuildVerdicts, ...]] = {}
    for own, builds in _by_engine(front).items():
        verdicts |= found.provers[own].of_builds(builds)
    found.tell("drawing and writing the page")
    left = found.departures
    summary = {
        "outside_linear_range": list(builds_in_words(left)),
        "scene": engine.network.scene.name,
        "schedule": found.schedule,
        "aims": [str(goal) for goal in free.goals],
        **judged_by(free.goals, free.criterion),
        "limits": _said_limits(problem.limits),
        **({"filters": [*map(str, problem.filters)]} if problem.filters else {}),
        **provenance(engine),
    }
    numbered = _numbered(front).reset_index()
    for own_verdicts in [*zip(*(verdicts.get(name, ()) for name in tables), strict=True)]:
        falls = [proven.count(Verdict.FALLS) for proven in own_verdicts]
        numbered[f"falls_{own_verdicts[0].mortar}"] = falls
    if left:
        numbered["outside_linear_range"] = ["yes" if name in left else "" for name in tables]
    orders = [own.network.scene.build_order for own in front.engines]
    if {*orders} - {engine.network.scene.build_order}:
        numbered["order"] = [",".join(map(str, order)) for order in orders]
    files = _files(found, [*tables.values()], summary, numbered)
    page = front_page(engine, front, tables, left, verdicts)
    drawn = outputs.picture("pareto", lambda charts: charts.front_figure(front, methods))
    return {PAGE: page, **files, **drawn}


def _names(front: Front) -> list[str]:
    """Return the names of the plans of a Pareto set, by row."""
    return [f"point {number}" for number in range(1, len(front.steps) + 1)]


def _by_engine(front: Front) -> dict[Engine, dict[str, Sequence[Step]]]:
    """Return the steps of plans by name, grouped by the engine of their build order."""
    found = defaultdict[Engine, dict[str, Sequence[Step]]](dict)
    for name, own, steps in zip(_names(front), front.engines, front.steps, strict=True):
        found[own][name] = steps
    return found


def _numbered(front: Front) -> pd.DataFrame:
    """Return the table of a Pareto set, its points counted from 1."""
    table = shown_table(front.table)
    return table.set_axis(pd.RangeIndex(1, len(table) + 1, name="point"))
