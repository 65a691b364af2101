"""Claim: memory grows at most as the square of the brick count, and answers stay exact to 1e-9.

Exponents up to 2.1 for memory count as that. Time: up to 2.5 for an analysis, up to 3 for a search
without proof, which meets as many models as the square of the brick count, each with fields as long
as that count, and for the lazy proof of the least worst ratio; the proof over all pairs is shown.
Edge forces of the steps of every plan err by at most 1e-9 of the largest of each grip set, and by
1e-6 where candidates are only compared.

Method: `analyze` of all steps of the sequential method, and the three-robot loop without proof
(criterion `equations-2-3`, cascade; also with two processes), with proof (the same criterion,
overlap_dp) and with a lazy proof (`worst-ratio`, minimax), on chains of 25 to 1,000 bricks in the
shape of `arch25` and on `vault338`. Every run has a process of its own; seconds of the core are
counted, since other processes may want it too, by the clock where two processes work, and the
largest memory of the process that asked. Errors are those against the refined mixed system at up
to forty steps of the plan, and at random sets of three grips as they are screened. Exponents are
fitted over 100 bricks and more; of memory what the smallest run takes is taken off, libraries above
all.
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
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.engines.parts import growth_runs
from experiments.harness.claim import Claim, Finding, Option, Options, Times, on_this_run
from experiments.harness.plotting import HOME, RESULTS, save_all, stored
from seqopt.report.style import GRAY, dress, looks, new_figure, plain, styled

SMALL = ["chain25", "chain50", "chain100"]
LARGE = [*SMALL, "chain200", "chain338", "vault338"]
SCENES = {
    "analyze": [*LARGE, "chain1000"],
    "no proof": LARGE,
    "no proof, two processes": LARGE,
    "proof": SMALL,
    "lazy proof": LARGE,
}
QUICK = {"analyze": ["chain13", "chain25"], "no proof": ["chain13"], "lazy proof": ["chain13"]}
NEW = ("no proof, two processes", "lazy proof")  # what the older version does not do
PATIENCE, ROOM = 120.0, 6 * 2**30  # s and bytes of an older version's run
FROM = 100  # bricks from which on exponents are fitted
MOST_MEMORY = 2.1  # exponents that are claimed
MOST_TIME = {"analyze": 2.5, "no proof": 3.0, "lazy proof": 3.0}
MOST_ERROR, MOST_SCREEN_ERROR = 1e-9, 1e-6  # of the largest edge force of a set
STYLES = {
    "analyze": "analysis of a sequence",
    "no proof": "search without proof",
    "no proof, two processes": "search without proof, two processes",
    "proof": "proof over all pairs",
    "lazy proof": "lazy proof",
}  # in words


def run_apart(task: str, name: str, home: Path, patience: float | None = None) -> growth_runs.Row:
    """Return the row of a run by the version in a folder; without numbers if it takes too long."""
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}
    environment = os.environ | threads | {"PYTHONPATH": str(home)}
    command = [sys.executable, growth_runs.__file__, task, name]
    command += ["--no-errors"] if patience else []
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
            if older and task not in NEW and not name.startswith("vault"):
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


def taken(rows: pd.DataFrame) -> pd.Series:
    """Return the seconds of the core, or by the clock where two processes work."""
    return rows["seconds"].where(~rows["task"].str.contains("two"), rows["clock_s"])


@styled
def chart(table: pd.DataFrame) -> Figure:
    """Draw time and memory over the size; stars are the vault, hollow marks an older version."""
    figure = new_figure(4.2)
    panels = figure.subplots(1, 2)
    columns = {"time of a processor [s]": taken(table), "peak memory [MB]": table["memory_MB"]}
    for axes, (label, values) in zip(panels, columns.items(), strict=True):
        for task, style in looks(STYLES).items():
            for version in ("this", "older"):
                mine = (table["task"] == task) & (table["version"] == version)
                own = mine & table["scene"].str.startswith("chain") & values.notna()
                if own.any():
                    line = style.line()
                    if version == "older":
                        line |= {"mfc": "white", "lw": 0.8}
                    name = STYLES[task] + (", an older version" if version == "older" else "")
                    axes.plot(table["bricks"][own], values[own], label=name, **line)
                vault = mine & table["scene"].str.startswith("vault")
                axes.plot(table["bricks"][vault], values[vault], "*", color=style.color, ms=9)
        axes.set(xscale="log", yscale="log", xlabel="bricks in the chain", ylabel=label)
        plain(axes.xaxis, axes.yaxis)
        dress(axes)
    panels[0].plot([], [], "*", color=GRAY, ms=9, label="the vault of 338 bricks, by color")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=2, loc="outside lower center")
    return figure


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    table = pd.DataFrame(measured(QUICK if quick else SCENES, options.older))
    print(table.to_string(index=False, float_format="%.3g"))
    print("exponents of time", exponents(table, "seconds"))
    print("of memory", exponents(table, "memory_MB", table["memory_MB"].min()))
    if not quick:
        RESULTS.mkdir(exist_ok=True)
        table.to_csv(RESULTS / "engine_growth_runs.csv", index=False, float_format="%.4g")
        save_all(PICTURES)
    return on_this_run(holds=holds(table))


def holds(table: pd.DataFrame) -> bool:
    """Return whether every run of this version ended and grows no faster than is claimed."""
    mine = table[table["version"] == "this"]
    memory = exponents(table, "memory_MB", float(mine["memory_MB"].min()))
    time = exponents(table, "seconds")
    small = all(memory.get(task, 0.0) <= MOST_MEMORY for task in MOST_TIME)
    fast = all(time.get(task, 0.0) <= most for task, most in MOST_TIME.items())
    exact = mine["error"].max() <= MOST_ERROR and mine["screen_error"].max() <= MOST_SCREEN_ERROR
    return bool(mine["seconds"].notna().all() and small and fast and exact)


PICTURES: dict[str, Callable[[], Figure]] = {
    "growth.png": lambda: chart(stored("engine_growth_runs")),
}
CLAIM = Claim(
    experiment,
    quick="small chains, nothing written",
    times=Times.SHOWN,
    options=(Option("--older", "the folder of an older version to run in turns", default=""),),
    pictures=PICTURES,
)

if __name__ == "__main__":
    CLAIM.main()
