"""Where results are, how figures are stored and tables read again; numbers and tables on pages."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HOME = Path(__file__).resolve().parent.parent
RESULTS = HOME / "results"
FIGURES = HOME.parent / "docs" / "figures"
ONE_CORE = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}


def save_figure(figure: Figure, name: str) -> None:
    """Write a figure of the documentation."""
    from seqopt.report._style import DPI  # noqa: PLC0415  # an extra

    FIGURES.mkdir(exist_ok=True)
    figure.savefig(FIGURES / name, dpi=DPI, metadata={"Software": None})


def save_table(table: pd.DataFrame, name: str, digits: int | None = None) -> None:
    """Write a table of results, floats with so many digits, or whole."""
    RESULTS.mkdir(exist_ok=True)
    form = digits and f"%.{digits}g"
    table.to_csv(RESULTS / f"{name}.csv", index=False, float_format=form, lineterminator="\n")


def stored(name: str) -> pd.DataFrame:
    """Return a table of results as it is stored, by its name without an ending."""
    return pd.read_csv(RESULTS / f"{name}.csv")


def drawn(chart: Callable[..., Figure], *names: str) -> Callable[[], Figure]:
    """Return what draws a chart from stored tables."""
    return lambda: chart(*map(stored, names))


def apart(module: str, *words: object, limit: float | None = None) -> Any:
    """Return what a module prints last as JSON, run in a process of its own on one core.

    Raises
    ------
    subprocess.CalledProcessError
        If it ends otherwise than well.
    subprocess.TimeoutExpired
        If it takes longer than the limit, s.
    """
    command = [sys.executable, "-m", module, *map(str, words)]
    run: dict[str, Any] = {"env": os.environ | ONE_CORE, "capture_output": True, "text": True}
    done = subprocess.run(command, check=True, timeout=limit, **run)
    return json.loads(done.stdout.splitlines()[-1])


def two(value: float) -> str:
    """Return a number with two digits that count: 0.0034, 12, 1,300; a dash for none."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    places = 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):,.{max(0, places)}f}"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in [head, ["---"] * len(head), *rows])
