"""Builds as pages show them: their largest responses, and what is wrong with them in words."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from seqopt.files import csv_text
from seqopt.placement.promises import overloads
from seqopt.report.comparison import LARGEST, largest
from seqopt.report.page_data import Build
from seqopt.responses.linear_range import OUTSIDE, REMEDY, Departure, builds_in_words
from seqopt.responses.quantities import length_text, number_text
from seqopt.scene.scene import Scene
from seqopt.sequence.plan_file import parse_plan

WORDS = {
    "F_rob": "grip force, N",
    "M_sup": "support moment, N m",
    "T_max": "tension, N",
    "D_max": "displacement, 1e-3 mm",
}  # as of seqopt.report.comparison.LARGEST
OVER = "over payload"
LEGEND = {
    OVER: "a robot would hold more than it can",
    OUTSIDE: "its numbers are not reliable",
}


def shown_build(
    scene: Scene,
    name: str,
    table: pd.DataFrame,
    departures: Sequence[Departure] = (),
    stands: Sequence[str] = (),
) -> Build:
    """Return a build; a payload that all robots have is drawn beside forces that exceed it.

    Parameters
    ----------
    scene : Scene
    name : str
    table : pandas.DataFrame
        Responses of its steps.
    departures, stands : optional
        As of `Build`.
    """
    payloads = {robot.payload for robot in scene.robots}
    over = len(payloads) == 1 and overloads(scene, table)
    bounds = {"F_largest": payloads.pop()} if over else {}
    return Build(name, parse_plan(scene, csv_text(table), name), table, stands, bounds, departures)


def outside_in_words(builds: Sequence[Build]) -> str:
    """Return which builds leave the linear range and what to do; of a single one by what.

    Returns
    -------
    str
        Sentences to begin with; empty if none leaves it.
    """
    said = builds_in_words({build.name: build.departures for build in builds})
    if said and len(builds) == 1:
        said = (*map(str, builds[0].departures),)
    return f"{OUTSIDE.capitalize()}: {'; '.join(said)}. {REMEDY} " if said else ""


def overloads_in_words(scene: Scene, build: Build) -> str:
    """Return in how many steps payloads are exceeded, and by how much.

    Returns
    -------
    str
        A clause; empty if in none.
    """
    over = build.overloads(scene)
    if not over:
        return ""
    steps = {number for excess in over for number in excess.steps}
    worst = max(over, key=lambda excess: excess.largest / excess.limit.bound)
    return (
        f"in {len(steps):,} of {len(build.steps):,} a robot would hold more than its payload, up "
        f"to {worst.largest:,.0f} N where {worst.robot} can hold {worst.limit.bound:.4g} N"
    )


def count_overloads(scene: Scene, builds: Sequence[Build]) -> str:
    """Return how many builds ask a robot for more than its payload.

    Returns
    -------
    str
        A clause to end with; empty if none does.
    """
    count = sum(bool(build.overloads(scene)) for build in builds)
    return f"; in {count} of them a robot would hold more than its payload" if count else ""


def worst_in_words(scene: Scene, table: pd.DataFrame) -> str:
    """Return the largest responses of any step, each with its unit.

    Parameters
    ----------
    scene : Scene
    table : pandas.DataFrame
        Responses of the steps.
    """
    values = largest(scene, table)
    said = {name: f"{number_text(values[name])} {LARGEST[name]}" for name in WORDS}
    said["D_max"] = length_text(1e-6 * values["D_max"])
    return ", ".join(f"{word.split(',')[0]} {said[name]}" for name, word in WORDS.items())


def with_legend(caption: str, table: pd.DataFrame) -> str:
    """Return the caption of a table of builds, with a legend where it marks what is wrong."""
    said = "".join(f". {name.capitalize()}: {why}" for name, why in LEGEND.items() if name in table)
    return f"{caption}{said}. Such steps are marked in red" if said else caption


def worst_table(scene: Scene, builds: Sequence[Build]) -> tuple[str, pd.DataFrame]:
    """Return the largest responses of builds, a row each, under their caption.

    Returns
    -------
    caption : str
        With a legend where something is wrong with a build.
    table : pandas.DataFrame
    """
    rows = {build.name: largest(scene, build.table) for build in builds}
    found = pd.DataFrame.from_dict(rows, orient="index")
    found.insert(0, "steps", [len(build.steps) for build in builds])
    over = [{n for each in build.overloads(scene) for n in each.steps} for build in builds]
    if any(over):
        found[OVER] = [f"{len(steps):,} steps" if steps else "" for steps in over]
    if any(build.departures for build in builds):
        found[OUTSIDE] = ["yes" if build.departures else "" for build in builds]
    caption = with_legend("Largest responses", found)
    return caption, found.rename(columns=WORDS).rename_axis("build").reset_index()
