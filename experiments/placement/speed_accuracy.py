"""Claim: no method proves its plan much sooner than rigid bricks with dynamic programming.

On the reference arch, a barrel vault and a wall, what README says to take proves its plan and loses
nothing; with another engine nothing that does is sooner by more than half, and a stiff-bar frame
takes at least five times as long wherever it answers.

Method: what ``seqopt compare --speed`` measures, every engine with every formulation, a minute for
each, in processor time from the scene to the plan; gaps and errors are those by rigid bricks. Every
scene has a process of its own on one core. There is no randomness.

Inputs: the shipped scenes. Command: ``python -m experiments speed_accuracy [--quick]``.
"""

import json
import platform
import sys
import time
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

import seqopt
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import apart, drawn
from seqopt.report._speed._chart import speed_chart
from seqopt.report._speed._measure import Timer, speed_accuracy
from seqopt.report._speed._table import SpeedTable
from seqopt.sequence.schedule_file import find_schedule

SCENES = ("arch25", "barrel:test=1", "wall:columns=4,courses=3")
QUICK = ("wall:columns=3,courses=2",)
LIMIT, QUICK_LIMIT = 60.0, 5.0  # s for an engine and a formulation
REFERENCE, CRITERION = "compliance", "equations-2-3"
ABOUT = ["scene", "bricks", "method", "reference", "limit"]


def points(scene: str, seconds: float) -> pd.DataFrame:
    """Return a row for every engine and formulation, with what is said of all."""
    engine = seqopt.make_engine(REFERENCE, seqopt.load_scene(scene))
    problem = seqopt.pose(engine, find_schedule(engine.network), seqopt.CRITERIA[CRITERION])
    found = speed_accuracy(problem, seconds, timer=Timer(time.process_time))
    return found.table.assign(**{name: getattr(found, name) for name in ABOUT})


def speed_tables(rows: pd.DataFrame) -> list[SpeedTable]:
    """Return stored rows as what they were made from, a scene after the other."""
    rows = rows.assign(why=rows["why"].astype(object).fillna(""))
    return [
        SpeedTable(*about, own.reset_index(drop=True))  # type: ignore[misc]
        for about, own in rows.groupby(ABOUT, sort=False)
    ]


def chart(rows: pd.DataFrame) -> Figure:
    """Return README's chart: what `seqopt compare --speed` draws, its scenes side by side."""
    return speed_chart(*speed_tables(rows))


def machine() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    model = next((line.split(": ")[1] for line in lines if line.startswith("model name")), "")
    return f"{model or platform.processor()}, Python {platform.python_version()}"


def holds(rows: pd.DataFrame) -> dict[str, bool]:
    """Return whether each part of the claim does."""
    tables = speed_tables(rows)
    took = [table.take for table in tables]
    frame = [table.table[table.table["engine"] == "frame"] for table in tables]
    return {
        "what README says to take proves its plan, and loses nothing": all(
            each["exact"] and each["gap"] == each["error"] == 0 for each in took
        ),
        "another engine with a proof is sooner in none of its scenes by more than half": all(
            _soonest(table) >= _soonest(table, REFERENCE) / 2 for table in tables
        ),
        "the frame takes at least five times as long wherever it answers": all(
            own["seconds"].dropna().ge(5 * each["seconds"]).all()
            for own, each in zip(frame, took, strict=True)
        )
        and any(own["gap"].notna().any() for own in frame),
    }


def _soonest(table: SpeedTable, engine: str = "") -> float:
    """Return the least time of what proves its plan, by one engine or by any."""
    own = table.table[table.table["exact"] & (table.table["gap"] == 0)]
    return float(own["seconds"][own["engine"].str.startswith(engine)].min())


def experiment(options: Options) -> Finding:
    scenes, limit = (QUICK, QUICK_LIMIT) if options.quick else (SCENES, LIMIT)
    module = "experiments.placement.speed_accuracy"
    rows = pd.DataFrame([row for scene in scenes for row in apart(module, scene, limit)])
    print(rows.to_string(index=False, float_format="%.4g"))
    return Finding(holds(rows), tables={"speed_points": rows.assign(machine=machine())})


CLAIM = Claim(
    experiment,
    digits=4,
    quick="a small wall",
    timed=True,
    pictures={"speed_accuracy.png": drawn(chart, "speed_points")},
)

if __name__ == "__main__":
    print(json.dumps(points(sys.argv[1], float(sys.argv[2])).to_dict("records")))
