"""The pages with the step viewer that commands write beside their tables, and plans show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, count
from pathlib import Path

import pandas as pd

from seqopt._files import Page
from seqopt._registry import display
from seqopt.arms._kept import arm_faults
from seqopt.engines.interface import Engine
from seqopt.errors import ExtraError, FileError, ProblemError
from seqopt.exchange.schedules import read_plan
from seqopt.plan.build import ShownBuild
from seqopt.plan.front import Front
from seqopt.problem.requirements import overloads
from seqopt.report._regret._table import RegretTable
from seqopt.report._robots import _known_arms
from seqopt.report.comparison import CLOSED, Comparison, largest, method_tables, shown_table
from seqopt.report.page import Build, report_page
from seqopt.report.text import IN_UNITS
from seqopt.responses.table import (
    OUTSIDE,
    REMEDY,
    Departure,
    LinearRange,
    _steps_in_table,
    analyze_builds,
    builds_in_words,
)
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE
from seqopt.stability.failure_map import SHOWN, BuildProver, BuildVerdicts
from seqopt.stability.verdict import Verdict

OVER = "over payload"
LEGEND = {OVER: "a robot would hold more than it can", OUTSIDE: REMEDY[:-1]}
FIRST = (CLOSED, FREE)  # of a comparison: its other rows may be more than are seen at once
PLANS = ("plan.csv", "pick/plan.csv", "steps_*.csv")  # of optimize, pareto and compare
GAP = "above the best, %"
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
        steps = _steps_in_table(scene, table)
        arms = _known_arms(scene, steps)
        faults = arm_faults(scene, steps) if arms else ()
        known = verdicts.get(name, ()), bounds, departures.get(name, ())
        out.append(Build(name, steps, table, *known, arms=arms, faults=faults))
    return out


def _page(
    engine: Engine,
    builds: Sequence[Build],
    sentence: str,
    tables: Sequence[tuple[str, pd.DataFrame | bytes]],
    scatter: tuple[str, pd.DataFrame] | None = None,
) -> str:
    """Return a page of several builds, whose sentence also names their faults."""
    lines = builds_in_words({build.name: build.departures for build in builds})
    if lines and len(builds) == 1:
        lines = (*map(str, builds[0].departures),)
    outside = f"{OUTSIDE.capitalize()}: {'; '.join(lines)}. Do not rely on it. " if lines else ""
    count = sum(bool(overloads(engine.network.scene, build.table)) for build in builds)
    over = f"; in {count} of them a robot would hold more than its payload" if count else ""
    return report_page(engine, builds, f"{outside}{sentence}{over}.", tables, scatter)


def _captioned(caption: str, table: pd.DataFrame) -> tuple[str, pd.DataFrame]:
    """Return a table of builds under its caption, with a legend where it marks faults."""
    text = "".join(f". {name.capitalize()}: {why}" for name, why in LEGEND.items() if name in table)
    return f"{caption}{text}. Such steps are marked in red" if text else caption, table


def _worst_table(scene: Scene, builds: Sequence[Build]) -> tuple[str, pd.DataFrame]:
    """Return the largest responses of builds, a row each, under their caption."""
    rows = {build.name: largest(scene, build.table) for build in builds}
    found = pd.DataFrame.from_dict(rows, orient="index")
    found.insert(0, "steps", [len(build.steps) for build in builds])
    over = [{n for each in overloads(scene, build.table) for n in each.steps} for build in builds]
    if any(over):
        found[OVER] = [f"{len(n):,} step{'s' * (len(n) != 1)}" * bool(n) for n in over]
    if any(build.departures for build in builds):
        found[OUTSIDE] = ["yes" if build.departures else "" for build in builds]
    found = found.rename(columns=IN_UNITS).join(_falls(builds))
    found = found.rename_axis("build").reset_index()
    return _captioned("Largest responses", found)


def _falls(builds: Sequence[Build]) -> pd.DataFrame:
    """Return how many steps of builds fall with every mortar, a row each; nothing if not asked."""
    counts = [{f"fall {v.how}": v.count(Verdict.FALLS) for v in each.verdicts} for each in builds]
    return pd.DataFrame(counts, [build.name for build in builds])


def plan_page(
    plan: ShownBuild,
    prover: BuildProver | None = None,
    *,
    table: pd.DataFrame | None = None,
    others: Tables | None = None,
) -> str:
    """Return the page of a plan, beside others and, where the scene is small, fixed methods.

    ``prover`` says which steps stand: by default dry, and with epoxy, where the scene is small;
    ``table``: the responses of the plan, where they are known.
    """
    engine, name = plan.engine, plan.title
    scene = engine.network.scene
    tables = {name: plan.responses() if table is None else table, **(others or {})}
    small = len(scene.bricks) <= SMALL
    if small:
        tables |= {key: each for key, each in method_tables(engine)[0].items() if key not in tables}
    prover = prover or BuildProver(engine.network, SHOWN if small else {})
    verdicts = prover.of_builds({key: _steps_in_table(scene, t) for key, t in tables.items()})
    left = plan._within.of_builds(tables)  # knows the plan's own steps
    builds = _builds(scene, tables, left, verdicts)
    shown, found = [_worst_table(scene, builds)], f"Found by: {name} ({plan.result})."
    return report_page(engine, builds, builds[0].sentence(scene), shown, found=found)


def comparison_page(engine: Engine, result: Comparison) -> str:
    """Return the page of a comparison."""
    scene = engine.network.scene
    builds = _builds(scene, result.tables, result.departures, result.verdicts)
    marks = {"overloaded": OVER, "outside": OUTSIDE}
    marks = {name: text for name, text in marks.items() if result.table[name].any()}
    columns = ["problem", "objective", "gap", *IN_UNITS, *marks, "models", "seconds"]
    shown = result.table[columns].replace({True: "yes", False: ""})
    shown = shown.assign(gap=100 * shown["gap"].astype(float))
    shown = shown.rename(columns={**marks, **IN_UNITS, "gap": GAP}).join(_falls(builds))
    shown = shown.sort_values("problem", key=lambda each: ~each.isin(FIRST), kind="stable")
    shown = shown.rename_axis("method or formulation").reset_index()
    tables: list[tuple[str, pd.DataFrame | bytes]] = []
    if (speed := result.speed) is not None:
        title = f"Speed against regret, valued by {speed.reference}"
        with suppress(ExtraError):
            draw = display(RegretTable, "plot")
            from seqopt.report._style import picture_files  # noqa: PLC0415  # an extra

            tables.append((speed.sentence, picture_files("", draw(speed))[".png"]))
        tables.append((title, speed.shown))
    tables.append(_captioned("Methods and formulations; a click shows the build", shown))
    sentence = f"{len(builds)} ways to build {scene.name}, step by step and side by side"
    return _page(engine, builds, sentence, tables)


def folder_page(engine: Engine, folder: Path, prover: BuildProver) -> str:
    """Return the page of the plans in a folder that a command has written."""
    scene = engine.network.scene
    paths = [path for name in PLANS for path in sorted(folder.glob(name))]
    if not paths:
        raise FileError(
            f"folder {folder}: there is no plan in it; give one that optimize, pareto --pick or "
            "compare has written"
        )
    plans = {path.stem.removeprefix("steps_"): read_plan(scene, path) for path in paths}
    tables = analyze_builds(engine, plans)
    left = LinearRange(engine).of_builds(tables)
    builds = _builds(scene, tables, left, prover.of_builds(plans))
    shown = [_worst_table(scene, builds)]
    if len(builds) == 1:
        return report_page(engine, builds, builds[0].sentence(scene), shown)
    sentence = f"{scene.name}, built in {len(builds)} ways, step by step"
    return _page(engine, builds, sentence, shown)


def front_page(
    engine: Engine,
    front: Front,
    plans: Tables,
    departures: Mapping[str, Sequence[Departure]],
    verdicts: Mapping[str, Sequence[BuildVerdicts]],
) -> str:
    """Return the page of a Pareto set: its points, and the facts of each plan by its name."""
    scene, builds = engine.network.scene, []
    for (name, plan), own in zip(plans.items(), front.engines, strict=True):
        placed = own.network.scene
        (build,) = _builds(placed, {name: plan}, departures, verdicts)
        another = placed.build_order != scene.build_order
        builds.append(replace(build, order=placed.build_order) if another else build)
    points = shown_table(front.table).set_axis([*plans])
    points = points.assign(**{n: 1e6 * points[n] for n in ["D_max"] if n in points})
    points = points.rename(columns={**IN_UNITS, "F_largest": IN_UNITS["F_rob"]})
    shown = points.join(_falls(builds)).rename_axis("plan").reset_index()
    if departures:
        shown[OUTSIDE] = ["yes" if name in departures else "" for name in plans]
    sentence = f"1 plan for {scene.name} is best in everything"
    if len(plans) > 1:
        sentence = f"{len(plans):,} plans for {scene.name}, of which none beats another everywhere"
    scatter = "The Pareto set: every point is a plan; a click shows it", points
    table = _captioned("The Pareto set; a click shows a plan", shown)
    return _page(engine, builds, sentence, [table], scatter)


def build_page(plan: ShownBuild, *others: ShownBuild) -> Page:
    """Return a page that shows a plan step by step, beside others for the same scene."""
    scene, tables = plan.engine.network.scene, {plan.title: plan.responses()}
    for other in others:
        if other.engine.network.scene != scene:
            raise ProblemError(
                f"plan {other.title} is for {other.engine.network.scene.name}, not for the same "
                f"scene {scene.name}; show it on its own"
            )
        names = chain([other.title], (f"{other.title} ({number})" for number in count(2)))
        tables[next(name for name in names if name not in tables)] = other.responses()
    return Page(plan_page(plan, table=tables.pop(plan.title), others=tables))
