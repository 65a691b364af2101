"""The pages with the step viewer that commands write beside their tables, and plans show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.errors import FileError, StepError
from seqopt.report.comparison import CLOSED, Comparison
from seqopt.report.methods import method_tables
from seqopt.report.page import report_page
from seqopt.report.page_builds import (
    OVER,
    WORDS,
    count_overloads,
    outside_in_words,
    overloads_in_words,
    shown_build,
    with_legend,
    worst_in_words,
    worst_table,
)
from seqopt.report.page_data import Build, Scatter
from seqopt.responses.linear_range import OUTSIDE, Departure, LinearRange
from seqopt.responses.table import analyze
from seqopt.sequence.free_rules import FREE
from seqopt.sequence.plan_file import read_plan

PAGE = "report.html"
FORCES = {"F_largest": "F_rob"}  # another name for the same
FIRST = (CLOSED, FREE)  # of a comparison: its other rows may be more than are seen at once
PLANS = ("plan.csv", "pick.csv", "steps_*.csv")  # of optimize, pareto and compare
SMALL = 60  # bricks up to which a plan is shown beside the fixed methods

Tables = Mapping[str, pd.DataFrame]


def plan_page(  # a plan, what there is to say about it, and what is beside it
    engine: Engine,
    name: str,
    table: pd.DataFrame,
    said: str,
    stands: Sequence[str] = (),
    *,
    others: Tables | None = None,
) -> str:
    """Return the page of a plan, beside the fixed methods where the scene is small.

    Parameters
    ----------
    engine : Engine
    name : str
        What found it.
    table : pandas.DataFrame
        Responses of its steps.
    said : str
        What it is worth, in words.
    stands : sequence of str, optional
        Of every step, whether it stands.
    others : mapping of str to pandas.DataFrame, optional
        Responses of the steps of other plans for the scene, by name.
    """
    scene, within = engine.network.scene, LinearRange(engine)
    tables = {name: table, **(others or {})}
    if len(scene.bricks) <= SMALL:
        methods = _methods(engine)
        tables |= {key: each for key, each in methods.items() if key not in tables}
    builds = [
        shown_build(scene, key, each, within.departures(each), stands if key == name else ())
        for key, each in tables.items()
    ]
    robots = int(sum(table[f"{robot.name}_node"].notna().any() for robot in scene.robots))
    over = overloads_in_words(scene, builds[0])
    who = "1 robot" if robots == 1 else f"{robots} robots"
    does = "cannot build" if over else "builds" if robots == 1 else "build"
    sentence = (
        f"{outside_in_words(builds[:1])}{who} {does} {scene.name} in {len(table):,} steps"
        f"{' like this: ' if over else ''}{over} ({name}: {said}). "
        f"The largest of any step: {worst_in_words(scene, table)}."
    )
    return report_page(engine, builds, sentence, [worst_table(scene, builds)])


def comparison_page(engine: Engine, result: Comparison) -> str:
    """Return the page of a comparison."""
    scene = engine.network.scene
    builds = [
        shown_build(scene, name, table, result.departures.get(name, ()))
        for name, table in result.tables.items()
    ]
    marks = {"overloaded": OVER, "outside": OUTSIDE}
    marks = {name: said for name, said in marks.items() if result.table[name].any()}
    columns = ["problem", "objective", "gap", *WORDS, *marks, "models", "seconds"]
    shown = result.table[columns].replace({True: "yes", False: ""}).rename(columns=WORDS | marks)
    shown = shown.sort_values("problem", key=lambda each: ~each.isin(FIRST), kind="stable")
    shown = shown.rename_axis("method or formulation").reset_index()
    tables = [(with_legend("Methods and formulations; a click shows the build", shown), shown)]
    if result.printed is not None:
        printed = result.printed.add_suffix(", printed").rename_axis("largest").reset_index()
        tables.append(("What the paper prints", printed))
    sentence = (
        f"{outside_in_words(builds)}{len(builds)} ways to build {scene.name}, step by step and "
        f"side by side{count_overloads(scene, builds)}."
    )
    return report_page(engine, builds, sentence, tables, _speed_and_accuracy(result))


def folder_page(engine: Engine, folder: Path) -> str:
    """Return the page of the plans in a folder that a command has written.

    Raises
    ------
    FileError, StepError
        If there are no plans in it, or they are not for the engine's scene.
    """
    scene, builds = engine.network.scene, folder_builds(engine, folder)
    sentence = (
        f"{outside_in_words(builds)}{scene.name}, built in {len(builds)} "
        f"way{'s' * (len(builds) > 1)}, step by step{count_overloads(scene, builds)}."
    )
    return report_page(engine, builds, sentence, [worst_table(scene, builds)])


def folder_builds(engine: Engine, folder: Path) -> list[Build]:
    """Return the plans in a folder that a command has written, analyzed.

    Raises
    ------
    FileError, StepError
        As of `folder_page`.
    """
    scene = engine.network.scene
    paths = [path for name in PLANS for path in sorted(folder.glob(name))]
    if not paths:
        raise FileError(
            f"folder {folder}: there is no plan in it; give one that optimize, pareto --pick or "
            "compare has written"
        )
    plans = {path.stem.removeprefix("steps_"): read_plan(scene, path) for path in paths}
    within = LinearRange(engine)
    tables = {name: analyze(engine, steps) for name, steps in plans.items()}
    return [
        shown_build(scene, name, table, within.departures(table)) for name, table in tables.items()
    ]


def front_page(
    engine: Engine,
    table: pd.DataFrame,
    plans: Sequence[pd.DataFrame],
    departures: Sequence[Sequence[Departure]],
) -> str:
    """Return the page of a Pareto set.

    Parameters
    ----------
    engine : Engine
    table : pandas.DataFrame
        A row per point.
    plans : sequence of pandas.DataFrame
        Responses of the steps of each.
    departures : sequence of sequence of Departure
        The limits of the linear range that each leaves.
    """
    scene = engine.network.scene
    names = [f"point {number}" for number in range(1, len(plans) + 1)]
    builds = [
        shown_build(scene, name, plan, left)
        for name, plan, left in zip(names, plans, departures, strict=True)
    ]
    points = _in_words(table).set_axis(names)
    shown = points.rename_axis("plan").reset_index()
    if any(departures):
        shown[OUTSIDE] = ["yes" if left else "" for left in departures]
    sentence = (
        f"{outside_in_words(builds)}{len(plans)} plans for {scene.name}, none of which is better "
        f"than another in everything{count_overloads(scene, builds)}."
    )
    scatter = Scatter("The Pareto set: every point is a plan; a click shows it", points)
    shows = [(with_legend("The Pareto set; a click shows a plan", shown), shown)]
    return report_page(engine, builds, sentence, shows, scatter)


def _speed_and_accuracy(result: Comparison) -> Scatter | None:
    """Return how long each formulation took and how far from the best its choice is."""
    found = result.table.loc[result.table["gap"].notna(), ["seconds", "gap"]]
    if found.empty:
        return None
    axes = ("seconds to choose, responses being known", "above the best, %")
    points = found.assign(gap=100 * found["gap"]).set_axis(axes, axis=1)
    return Scatter("Speed against accuracy: a click shows the plan", points, axes[:1])


def _in_words(table: pd.DataFrame) -> pd.DataFrame:
    """Return the points of a Pareto set with columns in words, displacements in 1e-3 mm."""
    words = {name: WORDS.get(FORCES.get(name, name), name) for name in map(str, table)}
    lengths = [name for name in words.values() if name.endswith("1e-3 mm")]
    shown = table.rename(columns=words)
    return shown.assign(**{name: 1e6 * shown[name] for name in lengths})


def _methods(engine: Engine) -> dict[str, pd.DataFrame]:
    try:
        return method_tables(engine)[0]
    except StepError:
        return {}
