"""Where results are, how they are stored, read again and timed; numbers and tables on pages."""

from __future__ import annotations

import io
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HOME = Path(__file__).resolve().parent.parent
RESULTS = HOME / "results"
FIGURES = HOME.parent / "docs" / "figures"
ONE_CORE = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}


def save_figure(figure: Figure, name: str) -> None:
    """Store a figure in 256 colors: a half to a third of the bytes, and no eye sees it."""
    from PIL import Image  # noqa: PLC0415  # comes with matplotlib, an extra

    from seqopt.report._style import DPI  # noqa: PLC0415  # an extra

    FIGURES.mkdir(exist_ok=True)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI, format="png")
    few = (
        Image.open(buffer)
        .convert("RGB")
        .quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    )
    few.save(FIGURES / name, optimize=True)


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


def apart(module: str, *words: object, limit: float | None = None, **more: Any) -> Any:
    """Return what a module or file prints last as JSON, run in a process of its own on one core.

    It raises what `subprocess.run` does where that ends badly or takes longer than the limit, s.
    """
    program = [module] if module.endswith(".py") else ["-m", module]
    run = {"env": os.environ | ONE_CORE, "capture_output": True, "text": True, **more}
    command = [sys.executable, *program, *map(str, words)]
    done = subprocess.run(command, check=True, timeout=limit, **run)
    return json.loads(done.stdout.splitlines()[-1])


def exponents_by(name: str, table: pd.DataFrame, values: pd.Series) -> dict[Any, float]:
    """Return the slopes of values over ``bricks``, both logarithmic, by a column of the table."""
    logs = np.log(pd.DataFrame({"x": table["bricks"], "y": values})).groupby(table[name])
    return {key: np.polyfit(own["x"], own["y"], 1)[0] for key, own in logs if len(own) > 1}


def two(value: float) -> str:
    """Return a number with two digits that count: 0.0034, 12, 1,300; a dash for none."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    places = 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):,.{max(0, places)}f}"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(cells)} |" for cells in [head, ["---"] * len(head), *rows])


def best(call: Callable[[], object], rounds: int) -> float:
    """Return the shortest of several runs, s."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)
