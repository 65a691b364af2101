"""The pages with the step viewer that commands write beside their tables, and plans show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, count
from pathlib import Path

import pandas as pd

from seqopt._files import csv_text
from seqopt._showing import Page, display
from seqopt.engines.interface import Engine
from seqopt.errors import ExtraError, FileError, ProblemError
from seqopt.plan.build import ShownBuild
from seqopt.plan.front import Front
from seqopt.problem.requirements import overloads
from seqopt.report._robots import _known_arms
from seqopt.report._speed._table import SpeedTable
from seqopt.report.comparison import (
    CLOSED,
    LARGEST,
    Comparison,
    fixed_methods,
    largest,
    shown_table,
)
from seqopt.report.page import Build, Scatter, _Drawn, report_page
from seqopt.responses.quantities import _number_text, length_text
from seqopt.responses.table import OUTSIDE, REMEDY, Departure, LinearRange, analyze, builds_in_words
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE
from seqopt.sequence.schedule_file import parse_plan, read_plan
from seqopt.stability._builds import SHOWN, BuildProver, BuildVerdicts
from seqopt.stability.assessment import Verdict

WORDS = {
    "F_rob": "grip force, N",
    "M_sup": "support moment, N m",
    "T_max": "tension, N",
    "D_max": "displacement, 1e-3 mm",
}  # as of seqopt.report.comparison.LARGEST
OVER = "over payload"
LEGEND = {OVER: "a robot would hold more than it can", OUTSIDE: "its numbers are not reliable"}
FIRST = (CLOSED, FREE)  # of a comparison: its other rows may be more than are seen at once
PLANS = ("plan.csv", "pick.csv", "steps_*.csv")  # of optimize, pareto and compare
PHONE = 3.75  # inches: as wide as a telephone shows at 100 pixels an inch
SMALL = 60  # bricks up to which a plan is shown beside the fixed methods
Tables = Mapping[str, pd.DataFrame]


def _builds(
    scene: Scene,
    tables: Tables,
    departures: Mapping[str, Sequence[Departure]],
    verdicts: Mapping[str, Sequence[BuildVerdicts]],
) -> list[Build]:
    """Return builds by their tables, and a payload that all robots have, where forces exceed it."""
    payloads = {robot.payload for robot in scene.robots}
    out = []
    for name, table in tables.items():
        over = len(payloads) == 1 and overloads(scene, table)
        bounds = {"F_largest": max(payloads)} if over else {}
        steps = parse_plan(scene, csv_text(table), name)
        stands = verdicts.get(name, ())
        left, arms = departures.get(name, ()), _known_arms(scene, steps)
        out.append(Build(name, steps, table, stands, bounds, left, arms=arms))
    return out


def _outside(builds: Sequence[Build]) -> str:
    """Return which builds leave the linear range and what to do; of a single one by what."""
    said = builds_in_words({build.name: build.departures for build in builds})
    if said and len(builds) == 1:
        said = (*map(str, builds[0].departures),)
    return f"{OUTSIDE.capitalize()}: {'; '.join(said)}. {REMEDY} " if said else ""


def _with_legend(caption: str, table: pd.DataFrame) -> str:
    """Return the caption of a table of builds, with a legend where it marks what is wrong."""
    said = "".join(f". {name.capitalize()}: {why}" for name, why in LEGEND.items() if name in table)
    return f"{caption}{said}. Such steps are marked in red" if said else caption


def _page(
    engine: Engine,
    builds: Sequence[Build],
    sentence: str,
    tables: Sequence[tuple[str, pd.DataFrame | _Drawn]],
    scatter: Scatter | None = None,
) -> str:
    """Return a page of several builds, whose sentence also says what is wrong with some."""
    count = sum(bool(build.overloads(engine.network.scene)) for build in builds)
    over = f"; in {count} of them a robot would hold more than its payload" if count else ""
    return report_page(engine, builds, f"{_outside(builds)}{sentence}{over}.", tables, scatter)


def _worst_table(scene: Scene, builds: Sequence[Build]) -> tuple[str, pd.DataFrame]:
    """Return the largest responses of builds, a row each, under their caption."""
    rows = {build.name: largest(scene, build.table) for build in builds}
    found = pd.DataFrame.from_dict(rows, orient="index")
    found.insert(0, "steps", [len(build.steps) for build in builds])
    over = [{n for each in build.overloads(scene) for n in each.steps} for build in builds]
    if any(over):
        found[OVER] = [f"{len(steps):,} steps" if steps else "" for steps in over]
    if any(build.departures for build in builds):
        found[OUTSIDE] = ["yes" if build.departures else "" for build in builds]
    found = found.join(_falls(builds))
    caption = _with_legend("Largest responses", found)
    return caption, found.rename(columns=WORDS).rename_axis("build").reset_index()


def _falls(builds: Sequence[Build]) -> pd.DataFrame:
    """Return how many steps of builds fall with every mortar, a row each; nothing if not asked."""
    rows = {
        build.name: {f"fall {each.how}": each.count(Verdict.FALLS) for each in build.verdicts}
        for build in builds
    }
    return pd.DataFrame.from_dict(rows, orient="index")


def _standing_said(build: Build) -> str:
    """Return which steps of a build stand, as sentences; nothing if that was not asked."""
    return "".join(f" {str(each)[:1].upper()}{str(each)[1:]}." for each in build.verdicts)


def plan_page(  # a plan, what there is to say about it, and what is beside it
    engine: Engine,
    name: str,
    table: pd.DataFrame,
    said: str,
    prover: BuildProver | None = None,
    *,
    others: Tables | None = None,
) -> str:
    """Return the page of a plan, beside others and, where the scene is small, fixed methods.

    ``name`` is what found it, ``said`` what it is worth, and ``prover`` says which steps stand:
    by default dry, and with epoxy, where the scene is small.
    """
    scene = engine.network.scene
    tables = {name: table, **(others or {})}
    if len(scene.bricks) <= SMALL:
        tables |= {key: each for key, each in fixed_methods(engine).items() if key not in tables}
    small = len(scene.bricks) <= SMALL
    prover = prover or BuildProver(engine.network, SHOWN if small else {})
    verdicts = prover.of_tables(tables)
    builds = _builds(scene, tables, LinearRange(engine).of_builds(tables), verdicts)
    first = builds[0]
    robots = int(sum(table[f"{robot.name}_node"].notna().any() for robot in scene.robots))
    verb = "take down" if (table["type"] == "remove").any() else "build"
    does = "1 robot builds" if robots == 1 else f"{robots} robots {verb}"
    how = ""
    if over := first.overloads(scene):
        steps = {number for excess in over for number in excess.steps}
        worst = max(over, key=lambda excess: excess.largest / excess.limit.bound)
        does = f"{robots} robot{'s' * (robots != 1)} cannot {verb}"
        how = (
            f" like this: in {len(steps):,} of {len(table):,} a robot would hold more than its "
            f"payload, up to {worst.largest:,.0f} N where {worst.robot} can hold "
            f"{worst.limit.bound:.4g} N"
        )
    values = largest(scene, table)
    shown = {n: f"{_number_text(values[n])} {LARGEST[n]}" for n in WORDS}
    shown["D_max"] = length_text(1e-6 * values["D_max"])
    most = ", ".join(f"{word.split(',')[0]} {shown[n]}" for n, word in WORDS.items())
    sentence = (
        f"{_outside(builds[:1])}{does} {scene.name} in {len(table):,} steps{how} ({name}: {said}). "
        f"The largest of any step: {most}.{_standing_said(first)}"
    )
    return report_page(engine, builds, sentence, [_worst_table(scene, builds)])


def comparison_page(engine: Engine, result: Comparison) -> str:
    """Return the page of a comparison."""
    scene = engine.network.scene
    builds = _builds(scene, result.tables, result.departures, result.verdicts)
    marks = {"overloaded": OVER, "outside": OUTSIDE}
    marks = {name: said for name, said in marks.items() if result.table[name].any()}
    columns = ["problem", "objective", "gap", *WORDS, *marks, "models", "seconds"]
    shown = result.table[columns].replace({True: "yes", False: ""}).rename(columns=WORDS | marks)
    shown = shown.join(_falls(builds))
    shown = shown.sort_values("problem", key=lambda each: ~each.isin(FIRST), kind="stable")
    shown = shown.rename_axis("method or formulation").reset_index()
    tables: list[tuple[str, pd.DataFrame | _Drawn]] = (
        [] if result.speed is None else [*_speed_parts(result.speed)]
    )
    tables += [(_with_legend("Methods and formulations; a click shows the build", shown), shown)]
    if result.printed is not None:
        printed = result.printed.add_suffix(", printed").rename_axis("largest").reset_index()
        tables.append(("What the paper prints", printed))
    scatter, found = None, result.table.loc[result.table["gap"].notna(), ["seconds", "gap"]]
    if not found.empty:  # how long each formulation took and how far from the best its choice is
        axes = ("seconds to choose, responses being known", "above the best, %")
        points = found.assign(gap=100 * found["gap"]).set_axis(axes, axis=1)
        scatter = Scatter("Speed against accuracy: a click shows the plan", points, axes[:1])
    sentence = f"{len(builds)} ways to build {scene.name}, step by step and side by side"
    return _page(engine, builds, sentence, tables, scatter)


def _speed_parts(speed: SpeedTable) -> Iterator[tuple[str, pd.DataFrame | _Drawn]]:
    """Yield speed against accuracy as a picture, where matplotlib is installed, and a table."""
    title = f"Speed against accuracy, errors beside {speed.reference}"
    with suppress(ExtraError):
        draw = display("speed_chart")
        from seqopt.report._style import WIDTH, picture_files  # noqa: PLC0415  # an extra

        wide, narrow = (
            picture_files("", draw(speed, width=width))[".png"] for width in (WIDTH, PHONE)
        )
        yield title, _Drawn(wide, narrow, speed.sentence)
    yield f"{title}, in numbers. {speed.sentence}", speed.rows()


def folder_page(engine: Engine, folder: Path, prover: BuildProver) -> str:
    """Return the page of the plans in a folder that a command has written."""
    scene, builds = engine.network.scene, folder_builds(engine, folder, prover)
    ways = f"{len(builds)} way{'s' * (len(builds) > 1)}"
    sentence = f"{scene.name}, built in {ways}, step by step"
    return _page(engine, builds, sentence, [_worst_table(scene, builds)])


def folder_builds(engine: Engine, folder: Path, prover: BuildProver) -> list[Build]:
    """Return the plans in a folder that a command has written, analyzed."""
    scene = engine.network.scene
    paths = [path for name in PLANS for path in sorted(folder.glob(name))]
    if not paths:
        raise FileError(
            f"folder {folder}: there is no plan in it; give one that optimize, pareto --pick or "
            "compare has written"
        )
    plans = {path.stem.removeprefix("steps_"): read_plan(scene, path) for path in paths}
    tables = {name: analyze(engine, steps) for name, steps in plans.items()}
    found = prover.of_tables(tables)
    return _builds(scene, tables, LinearRange(engine).of_builds(tables), found)


def front_page(
    engine: Engine,
    front: Front,
    plans: Sequence[pd.DataFrame],
    departures: Sequence[Sequence[Departure]],
    verdicts: Sequence[Sequence[BuildVerdicts]],
) -> str:
    """Return the page of a Pareto set: its points, and what is known of each plan."""
    scene, table = engine.network.scene, shown_table(front.table)
    names = [f"point {number}" for number in range(1, len(plans) + 1)]
    builds = []
    each = zip(names, front.engines, plans, departures, verdicts, strict=True)
    for name, own, plan, left, stands in each:
        placed = own.network.scene
        (build,) = _builds(placed, {name: plan}, {name: left}, {name: stands})
        another = placed.build_order != scene.build_order
        builds.append(replace(build, order=placed.build_order) if another else build)
    words = {**WORDS, "F_largest": WORDS["F_rob"]}  # another name for the same
    points = table.rename(columns=words).set_axis(names)
    lengths = [name for name in points if str(name).endswith("1e-3 mm")]
    points = points.assign(**{str(name): 1e6 * points[name] for name in lengths})
    shown = points.join(_falls(builds)).rename_axis("plan").reset_index()
    if any(departures):
        shown[OUTSIDE] = ["yes" if each else "" for each in departures]
    sentence = (
        f"{len(plans)} plans for {scene.name}, none of which is better than another in everything"
    )
    scatter = Scatter("The Pareto set: every point is a plan; a click shows it", points)
    shows = [(_with_legend("The Pareto set; a click shows a plan", shown), shown)]
    return _page(engine, builds, sentence, shows, scatter)


def build_page(plan: ShownBuild, *others: ShownBuild) -> Page:
    """Return a page that shows a plan step by step, beside others for the same scene."""
    engine = plan.engine
    scene, tables = engine.network.scene, {plan.title: plan.responses()}
    for other in others:
        if other.engine.network.scene != scene:
            raise ProblemError(
                f"plan {other.title} is for {other.engine.network.scene.name}, not for the same "
                f"scene {scene.name}; show it on its own"
            )
        names = chain([other.title], (f"{other.title} ({number})" for number in count(2)))
        tables[next(name for name in names if name not in tables)] = other.responses()
    table = tables.pop(plan.title)
    return Page(plan_page(engine, plan.title, table, plan.result, others=tables))
