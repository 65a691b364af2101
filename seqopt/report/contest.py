"""Every method and formulation on one scene, in one table, beside what the study printed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.placement.costs import TINY
from seqopt.placement.criteria import Criterion
from seqopt.placement.formulation import Reads, formulations
from seqopt.placement.plan import Outcome, optimize, prepare
from seqopt.report.comparison import Comparison
from seqopt.responses.choices import window_models
from seqopt.responses.table import analyze
from seqopt.scene.scene import Scene
from seqopt.sequence.three_robots import modified_sequential, three_robot_loop
from seqopt.study.published import (
    is_reference_arch,
    published_choice,
    published_ranks,
)

Progress = Callable[[str], None]
PUBLISHED = "published plan"
RESPONSES = ["F_rob", "M_sup", "T_max", "D_max"]
COLUMNS = ["objective", "gap", *RESPONSES, "models", "seconds", "solve_seconds"]


@dataclass(frozen=True)
class Contest:
    """Methods and formulations side by side.

    Attributes
    ----------
    methods : Comparison
        Methods without a choice, and the published plan, step by step.
    table : pandas.DataFrame
        A row per method or formulation: ``objective`` and ``gap`` to the exact optimum of its aim,
        the largest ``F_rob`` [N], ``M_sup`` [N m], ``T_max`` [N] and ``D_max`` [1e-3 mm] of any
        step, the distinct ``models`` it looks at, and ``seconds`` with all of them evaluated.
    tables : mapping of str to pandas.DataFrame
        Responses of every step, by row of ``table``.
    ranks : pandas.DataFrame or None
        Where the published plan's nodes rank, move by move: in the window of the move alone, with
        the cost to go of the full overlap, and with the worst cost to go.
    paper_models : tuple of int
        Models that the study counts: cascading, full overlap.
    """

    methods: Comparison
    table: pd.DataFrame
    tables: Mapping[str, pd.DataFrame]
    ranks: pd.DataFrame | None
    paper_models: tuple[int, int]


def contest(
    engine: Engine,
    methods: Comparison,
    criterion: Criterion,
    progress: Progress = lambda _: None,
) -> Contest:
    """Solve the three-robot loop of a scene by every registered formulation.

    Raises
    ------
    StepError, ProblemError
        If the scene has no such loop, or no choice in it is allowed.
    """
    scene = engine.network.scene
    tables = dict(methods.tables)
    rows = {name: maxima(scene, table) for name, table in tables.items()}
    progress("modified sequential method")
    modified = prepare(engine, modified_sequential(engine.network), criterion)
    outcome = optimize(modified, formulations()["rank_search"])
    tables["modified-sequential"] = analyze(engine, outcome.plan)
    rows["modified-sequential"] = _row(engine, outcome, tables["modified-sequential"])
    posed = prepare(engine, three_robot_loop(engine.network), criterion)
    for name, which in formulations().items():
        progress(f"three-robot loop by {name}")
        outcome = optimize(posed, which)
        tables[name] = analyze(engine, outcome.plan)
        rows[name] = _row(engine, outcome, tables[name])
    ranks = None
    if is_reference_arch(scene):
        choice = published_choice(posed.problem)
        ranks = published_ranks(posed.problem, choice)
        best = rows["overlap_dp"]["objective"]
        value = posed.problem.sums.cost(choice)
        rows["three-robot"] |= {"objective": value, "gap": (value - best) / max(abs(value), TINY)}
    names = {name: PUBLISHED if name == "three-robot" else name for name in rows}
    table = pd.DataFrame.from_dict(rows, orient="index").rename(index=names)
    tables = {names[name]: steps for name, steps in tables.items()}
    return Contest(methods, table[COLUMNS], tables, ranks, posed.problem.paper_models)


def maxima(scene: Scene, table: pd.DataFrame) -> dict[str, float]:
    """Return the largest responses of any step."""
    forces = table[[f"F_{robot.name}_N" for robot in scene.robots]].abs()
    return {
        "F_rob": float(np.nanmax(forces.to_numpy(float))),
        "M_sup": float(table["M_sup_Nm"].max()),
        "T_max": float(table["F_max_N"].max()),
        "D_max": float(table["D_max_1e-3mm"].max()),
    }


def _row(engine: Engine, outcome: Outcome, table: pd.DataFrame) -> dict[str, float]:
    return {
        "objective": outcome.certificate.objective,
        "gap": outcome.certificate.gap,
        **maxima(engine.network.scene, table),
        "models": (
            window_models(outcome.problem.schedule, outcome.selection.choice)
            if outcome.which.reads is Reads.WINDOW
            else outcome.problem.evaluation.models
        ),
        "seconds": sum(outcome.seconds.values()),
        "solve_seconds": outcome.seconds["solve"],
    }


def format_contest(result: Contest, criterion: Criterion) -> str:
    """Return the contest as text."""
    cascading, overlap = result.paper_models
    lines = [
        f"Three-robot loop, criterion {criterion.name}; models counted the study's way: "
        f"{cascading:,} cascading,",
        f"{overlap:,} with the full overlap; below, the different ones that each looks at",
        "",
        f"{'':20}{'objective':>11}{'gap':>8}{'F_rob':>8}{'M_sup':>8}{'T_max':>8}{'D_max':>8}"
        f"{'models':>8}{'seconds':>9}",
    ]
    for name, row in result.table.iterrows():
        cells = [
            f"{row['objective']:11.2f}" if np.isfinite(row["objective"]) else f"{'-':>11}",
            f"{100 * row['gap']:7.2f}%" if np.isfinite(row["gap"]) else f"{'-':>8}",
            *(f"{row[column]:8.1f}" for column in RESPONSES),
            f"{row['models']:8.0f}" if np.isfinite(row["models"]) else f"{'-':>8}",
            f"{row['seconds']:9.4f}" if np.isfinite(row["seconds"]) else f"{'-':>9}",
        ]
        lines.append(f"{name!s:20}" + "".join(cells))
    lines.append(
        "(N, N m, N, 1e-3 mm; gap to the exact optimum of the same aim; minimax has its own)"
    )
    if result.ranks is not None:
        lines += ["", "Where the published plan's nodes rank, optimization by optimization"]
        for column, label in (
            ("rank_in_window", "rank_search, cascade"),
            ("rank_overlap", "overlap"),
            ("rank_peak", "minimax"),
        ):
            ranks = result.ranks[column]
            places = " ".join(map(str, ranks))
            lines.append(
                f"  {label:21}first in {(ranks == 1).sum()} of {len(ranks)}, "
                f"among three in {(ranks <= 3).sum()}: {places}"
            )
    return "\n".join(lines)
