"""Claim: memory grows at most as the square of the brick count, and time of an analysis not faster.

Not faster but for a half: the exponents that are held against it are 2.1 and 2.5.

Method: `analyze` of all steps of the sequential method, and the three-robot loop without proof
(criterion `equations-2-3`, cascade), on chains of 25 to 1,000 bricks in the shape of `arch25` and
on `vault338`. Every run has a process of its own on one core; seconds of that core are counted,
since other processes may want it too, and the largest memory of the process. Exponents are fitted
over 100 bricks and more; of memory what the smallest run takes is taken off, libraries above all.
An older version, checked out in a folder, is run in turns with this one; its runs end after two
minutes, or with 6 GB.

Inputs: the shipped scenes. Command: ``python -m experiments.engines.engine_growth [--quick]
[--older FOLDER]``. Writes ``experiments/results/engine_growth_runs.csv`` and
``docs/figures/growth.png``.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.engines.parts import growth_runs
from experiments.harness.claim import Claim, Finding, Option, Options, Times, on_this_run
from experiments.harness.plotting import HOME, RESULTS, new_figure, save_figure

SCENES = {
    "analyze": ["chain25", "chain50", "chain100", "chain200", "chain338", "vault338", "chain1000"],
    "no proof": ["chain25", "chain50", "chain100", "chain200", "chain338", "vault338"],
}
QUICK = {"analyze": ["chain13", "chain25"], "no proof": ["chain13"]}
PATIENCE, ROOM = 120.0, 6 * 2**30  # s and bytes of an older version's run
FROM = 100  # bricks from which on exponents are fitted
MOST_MEMORY, MOST_TIME = 2.1, 2.5  # exponents that are claimed


def run_apart(task: str, name: str, home: Path, patience: float | None = None) -> growth_runs.Row:
    """Return the row of a run by the version in a folder; without numbers if it takes too long."""
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}
    environment = os.environ | threads | {"PYTHONPATH": str(home)}
    command = [sys.executable, growth_runs.__file__, task, name]
    try:
        done = subprocess.run(
            command,
            env=environment,
            timeout=patience,
            preexec_fn=_limit if patience else None,
            capture_output=True,
            check=True,
            text=True,
        )
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError):
        return {"task": task, "scene": name}
    row: growth_runs.Row = json.loads(done.stdout.splitlines()[-1])
    return row


def _limit() -> None:
    """Let a process take little more memory than an older version can use to its end."""
    resource.setrlimit(resource.RLIMIT_AS, (ROOM, ROOM))


def measured(scenes: dict[str, list[str]], older: str) -> Iterator[growth_runs.Row]:
    """Yield the rows of all runs, this version's and an older one's in turns."""
    for task, names in scenes.items():
        for name in names:
            yield {"version": "this", **run_apart(task, name, HOME.parent)}
            if older and not name.startswith("vault"):
                yield {"version": "older", **run_apart(task, name, Path(older), PATIENCE)}


def exponents(table: pd.DataFrame, column: str, least: float = 0.0) -> dict[str, float]:
    """Return the slopes over the brick counts of chains, by task; what is least is taken off."""
    out = {}
    mine = table[(table["version"] == "this") & table["scene"].str.startswith("chain")]
    for task, rows in mine[mine["bricks"] >= FROM].groupby("task"):
        if len(rows) > 1:
            values = np.log(rows[column] - least)
            out[str(task)] = float(np.polyfit(np.log(rows["bricks"]), values, 1)[0])
    return out


def chart(table: pd.DataFrame) -> None:
    figure = new_figure(7.5, 3.4)
    for axes, column, label in zip(
        figure.subplots(1, 2),
        ("seconds", "memory_MB"),
        ("time on one core [s]", "peak memory [MB]"),
        strict=True,
    ):
        for (version, task), rows in table.groupby(["version", "task"]):
            own = rows[rows["scene"].str.startswith("chain")]
            style = ("o-" if task == "analyze" else "s-") if version == "this" else "x:"
            axes.loglog(own["bricks"], own[column], style, ms=5, label=f"{task}, {version}")
            other = rows[rows["scene"].str.startswith("vault")]
            axes.loglog(other["bricks"], other[column], "k*", ms=7)
        axes.set(xlabel="bricks in the chain (star: vault338)", ylabel=label)
        axes.grid(visible=True, which="both", lw=0.2)
    axes.legend(frameon=False, fontsize=8)
    save_figure(figure, "growth.png")


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    table = pd.DataFrame(measured(QUICK if quick else SCENES, options.older))
    print(table.to_string(index=False, float_format="%.3g"))
    print("exponents of time", exponents(table, "seconds"))
    print("of memory", exponents(table, "memory_MB", table["memory_MB"].min()))
    if not quick:
        RESULTS.mkdir(exist_ok=True)
        table.to_csv(RESULTS / "engine_growth_runs.csv", index=False, float_format="%.4g")
        chart(table)
    return on_this_run(holds=holds(table))


def holds(table: pd.DataFrame) -> bool:
    """Return whether every run of this version ended and grows no faster than is claimed."""
    mine = table[table["version"] == "this"]
    memory = exponents(table, "memory_MB", float(mine["memory_MB"].min()))
    slow = max(exponents(table, "seconds").values(), default=0.0) > MOST_TIME
    return bool(
        mine["seconds"].notna().all() and not slow and memory.get("analyze", 0) <= MOST_MEMORY
    )


CLAIM = Claim(
    experiment,
    quick="small chains, nothing written",
    times=Times.SHOWN,
    options=(Option("--older", "the folder of an older version to run in turns", default=""),),
)

if __name__ == "__main__":
    CLAIM.main()
