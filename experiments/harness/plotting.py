"""Where experiments put tables and figures, and how a figure is stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from seqopt.report.style import DPI

HOME = Path(__file__).resolve().parent.parent
RESULTS = HOME / "results"
FIGURES = HOME.parent / "docs" / "figures"


def save_figure(figure: Figure, name: str) -> None:
    """Write a figure of the documentation."""
    FIGURES.mkdir(exist_ok=True)
    figure.savefig(FIGURES / name, dpi=DPI, metadata={"Software": None})


def stored(name: str) -> pd.DataFrame:
    """Return a table of results as it is stored, by its name without an ending."""
    return pd.read_csv(RESULTS / f"{name}.csv")


def save_all(pictures: Mapping[str, Callable[[], Figure]]) -> None:
    """Draw figures from stored results and write them, by file name."""
    for name, draw in pictures.items():
        save_figure(draw(), name)
