"""What folders hold that commands write: tables, pictures and pages, by file name."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from typing import Any

import pandas as pd

from seqopt._files import PAGE
from seqopt._registry import Later
from seqopt.engines.interface import Engine
from seqopt.engines.registry import provenance
from seqopt.exchange._files import csv_text
from seqopt.exchange._tasks import plan_tasks, tasks_csv, tasks_in_postures, tasks_json
from seqopt.plan._spent import Spent, spent_on
from seqopt.plan.build import ShownBuild
from seqopt.plan.front import Front
from seqopt.plan.plan import Plan
from seqopt.plan.solve import graph_of
from seqopt.problem.amounts import judged_by
from seqopt.problem.requirements import _said_limits
from seqopt.report._pages import comparison_page, front_page, plan_page
from seqopt.report.comparison import Comparison, method_tables, shown_table
from seqopt.responses.table import Departure, builds_in_words
from seqopt.scene.scene_file import dump_scene
from seqopt.stability.failure_map import BuildProver, BuildVerdicts
from seqopt.stability.verdict import Verdict

CHARTS = Later("seqopt.report.charts")  # matplotlib is an extra
STYLE = Later("seqopt.report._style")  # likewise
Files = dict[str, bytes | str]


def figure_notes() -> tuple[str, ...]:
    """Return a note that figures are left out if matplotlib is not installed."""
    missing = find_spec("matplotlib") is None
    return ("figures are left out, they need matplotlib: pip install 'seqopt[plot]'",) * missing


def picture_files(name: str, draw: Callable[[Any], Any]) -> Mapping[str, bytes]:
    """Return files of a picture, none without matplotlib; ``draw`` takes the charts."""
    return {} if figure_notes() else STYLE.picture_files(name, draw(CHARTS))


def plan_files(plan: Plan) -> Files:
    """Return tables and tasks of a plan."""
    tables = {"plan": plan.responses()}
    if plan.graph.standing is not None:
        tables["stability"] = plan.stability()
    if plan.engine.network.scene.props:
        tables["props"] = plan.props()
    drawn: Mapping[str, bytes] = {}
    if plan.makespan is not None:
        tables["times"], drawn = plan.times(), picture_files("times", lambda _: plan.gantt())
    files = {f"{n}.csv": csv_text(table) for n, table in tables.items()}
    return {**files, **drawn, **task_files(plan)}


def task_files(plan: ShownBuild) -> dict[str, str]:
    """Return the tasks of robots for their programming."""
    scene, arms = plan.engine.network.scene, getattr(plan, "arms", None)
    if arms is None:
        tasks = [*tasks_in_postures(scene, plan.steps)]
    else:
        tasks = [*plan_tasks(scene, plan.steps, postures=arms.postures)]
    return {"tasks.json": tasks_json(scene, tasks), "tasks.csv": tasks_csv(tasks)}


def plan_pages(
    plan: Plan, prover: BuildProver, summary: Callable[[], Mapping[str, object]]
) -> Files:
    """Return page, summary, scene and trace of a plan; the summary says what the page took."""
    page, names = plan_page(plan, prover), ("seconds", "objective", "bound", "gap")
    trace = pd.DataFrame([[getattr(each, n) for n in names] for each in plan.trace], columns=names)
    finite = json.loads(json.dumps(summary()), parse_constant=lambda _: None)
    return {
        "summary.json": json.dumps(finite, indent=2) + "\n",
        "scene.json": dump_scene(plan.engine.network.scene),
        PAGE: page,
        **({} if trace.empty else {"trace.csv": csv_text(trace)}),
    }


def front_counts(front: Front) -> dict[str, object]:
    """Return number of points, completeness, and run times."""
    return {"points": len(front.steps), "complete": front.complete, "seconds": {**front.seconds}}


def front_spent(front: Front) -> Spent:
    """Return what was computed for a Pareto set, of all orders too; its proof is among that."""
    graph = graph_of(front.problem)
    models = graph.models or sum(getattr(each, "solved", 0) for each in graph.answers.values())
    spent = spent_on(graph, [step for steps in front.steps for step in steps], models)
    spent["models"]["proof"] = models if front.complete else None
    return spent


def numbered(front: Front) -> pd.DataFrame:
    """Return the table of a Pareto set, its points counted from 1."""
    return shown_table(front.table).set_axis(pd.RangeIndex(1, len(front.table) + 1, name="point"))


def front_files(
    front: Front,
    tables: Mapping[str, pd.DataFrame],
    left: Mapping[str, Sequence[Departure]],
    verdicts: Mapping[str, Sequence[BuildVerdicts]],
    schedule: str,
    showing: Mapping[str, int],
) -> Files:
    """Return tables, chart and page of a Pareto set."""
    problem, engine, free = front.problem, front.problem.engine, graph_of(front.problem)
    summary = {
        **front_counts(front),
        "outside_linear_range": list(builds_in_words(left)),
        "scene": engine.network.scene.name,
        "schedule": schedule,
        "aims": [str(goal) for goal in free.goals],
        **judged_by(free.goals, free.criterion),
        "limits": _said_limits(problem.limits),
        **({"filters": [*map(str, problem.filters)]} if problem.filters else {}),
        **provenance(engine),
    }
    points = numbered(front).reset_index()
    for own in [*zip(*(verdicts.get(name, ()) for name in tables), strict=True)]:
        points[f"falls_{own[0].mortar}"] = [proven.count(Verdict.FALLS) for proven in own]
    if left:
        points["outside_linear_range"] = ["yes" if name in left else "" for name in tables]
    orders = [own.network.scene.build_order for own in front.engines]
    if {*orders} - {engine.network.scene.build_order}:
        points["order"] = [",".join(map(str, order)) for order in orders]
    plans = [table.assign(point=k) for k, table in enumerate(tables.values(), start=1)]
    methods = method_tables(engine)[0]
    page = front_page(engine, front, tables, left, verdicts)
    summary |= {"spent": front_spent(front), "spent_on_showing": showing}  # with what the page took
    return {
        "scene.json": dump_scene(engine.network.scene),
        PAGE: page,
        "pareto.csv": csv_text(points),
        "plans.csv": csv_text(pd.concat(plans, ignore_index=True)),
        "summary.json": json.dumps(summary, indent=2) + "\n",
        **picture_files("pareto", lambda charts: charts.front_figure(front, methods)),
    }


def comparison_files(engine: Engine, result: Comparison, about: Mapping[str, object]) -> Files:
    """Return tables, the chart of speed, the page and the summary of a comparison."""
    speed, summary = result.speed, {"scene": engine.network.scene.name, **about}
    files: Files = {
        "summary.json": json.dumps(summary, indent=2) + "\n",
        "comparison.csv": result.table.to_csv(float_format="%.6g"),
        **{f"steps_{name}.csv": csv_text(table) for name, table in result.tables.items()},
        PAGE: comparison_page(engine, result),
    }
    if speed is not None:
        files |= {"speed.csv": csv_text(speed.table)}
        files |= picture_files("speed", lambda _: speed.plot())
    return files
