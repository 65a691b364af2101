"""The pages with the step viewer that commands write beside their tables, and plans show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.errors import FileError, StepError
from seqopt.files import csv_text
from seqopt.report.comparison import LARGEST, Comparison, largest
from seqopt.report.methods import method_tables
from seqopt.report.page import report_page
from seqopt.report.page_data import Build, Scatter
from seqopt.responses.table import analyze
from seqopt.scene.scene import Scene
from seqopt.sequence.plan_file import parse_plan, read_plan

PAGE = "report.html"
WORDS = {
    "F_rob": "grip force, N",
    "M_sup": "support moment, N m",
    "T_max": "tension, N",
    "D_max": "displacement, 1e-3 mm",
}  # as of seqopt.report.comparison.LARGEST
FORCES = {"F_largest": "F_rob"}  # another name for the same
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

    Returns
    -------
    str
    """
    scene = engine.network.scene
    tables = {name: table, **(others or {})}
    if len(scene.bricks) <= SMALL:
        methods = _methods(engine)
        tables |= {key: each for key, each in methods.items() if key not in tables}
    builds = [
        _build(scene, key, each, stands if key == name else ()) for key, each in tables.items()
    ]
    values = largest(scene, table)
    worst = ", ".join(
        f"{word.split(',')[0]} {values[key]:.4g} {LARGEST[key]}" for key, word in WORDS.items()
    )
    robots = int(sum(table[f"{robot.name}_node"].notna().any() for robot in scene.robots))
    who = "1 robot builds" if robots == 1 else f"{robots} robots build"
    sentence = (
        f"{who} {scene.name} in {len(table)} steps ({name}: {said}). "
        f"The largest of any step: {worst}."
    )
    return report_page(engine, builds, sentence, [("Largest responses", _worst(scene, tables))])


def comparison_page(engine: Engine, result: Comparison) -> str:
    """Return the page of a comparison.

    Parameters
    ----------
    engine : Engine
    result : Comparison

    Returns
    -------
    str
    """
    scene = engine.network.scene
    builds = [_build(scene, name, table) for name, table in result.tables.items()]
    columns = ["problem", "objective", "gap", *WORDS, "overloaded", "models", "seconds"]
    shown = result.table[columns].rename(columns=WORDS)
    shown["overloaded"] = shown["overloaded"].map({True: "yes", False: ""})
    shown = shown.rename_axis("method or formulation").reset_index()
    tables = [("Methods and formulations; a click shows the build", shown)]
    if result.printed is not None:
        printed = result.printed.add_suffix(", printed").rename_axis("largest").reset_index()
        tables.append(("What the paper prints", printed))
    sentence = f"{len(builds)} ways to build {scene.name}, step by step and side by side."
    return report_page(engine, builds, sentence, tables, _speed_and_accuracy(result))


def folder_page(engine: Engine, folder: Path) -> str:
    """Return the page of the plans in a folder that a command has written.

    Parameters
    ----------
    engine : Engine
    folder : pathlib.Path

    Returns
    -------
    str

    Raises
    ------
    FileError, StepError
        If there are no plans in it, or they are not for the engine's scene.
    """
    scene, builds = engine.network.scene, folder_builds(engine, folder)
    tables = {build.name: build.table for build in builds}
    sentence = f"{scene.name}, built in {len(builds)} way{'s' * (len(builds) > 1)}, step by step."
    return report_page(engine, builds, sentence, [("Largest responses", _worst(scene, tables))])


def folder_builds(engine: Engine, folder: Path) -> list[Build]:
    """Return the plans in a folder that a command has written, analyzed.

    Parameters
    ----------
    engine : Engine
    folder : pathlib.Path

    Returns
    -------
    list of Build

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
    return [Build(name, steps, analyze(engine, steps)) for name, steps in plans.items()]


def front_page(engine: Engine, table: pd.DataFrame, plans: Sequence[pd.DataFrame]) -> str:
    """Return the page of a Pareto set.

    Parameters
    ----------
    engine : Engine
    table : pandas.DataFrame
        A row per point.
    plans : sequence of pandas.DataFrame
        Responses of the steps of each.

    Returns
    -------
    str
    """
    scene = engine.network.scene
    names = [f"point {number}" for number in range(1, len(plans) + 1)]
    builds = [_build(scene, name, plan) for name, plan in zip(names, plans, strict=True)]
    points = _in_words(table).set_axis(names)
    shown = points.rename_axis("plan").reset_index()
    sentence = (
        f"{len(plans)} plans for {scene.name}, none of which is better than another in everything."
    )
    scatter = Scatter("The Pareto set: every point is a plan; a click shows it", points)
    shows = [("The Pareto set; a click shows a plan", shown)]
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


def _build(scene: Scene, name: str, table: pd.DataFrame, stands: Sequence[str] = ()) -> Build:
    return Build(name, parse_plan(scene, csv_text(table), name), table, stands)


def _methods(engine: Engine) -> dict[str, pd.DataFrame]:
    try:
        return method_tables(engine)[0]
    except StepError:
        return {}


def _worst(scene: Scene, tables: Tables) -> pd.DataFrame:
    """Return the largest responses of builds, a row each."""
    rows = {name: largest(scene, table) for name, table in tables.items()}
    found = pd.DataFrame.from_dict(rows, orient="index")
    found.insert(0, "steps", [len(table) for table in tables.values()])
    return found.rename(columns=WORDS).rename_axis("build").reset_index()
