"""How figures of experiments are stored, and tables read again."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.places import FIGURES, HOME, RESULTS
from seqopt.report.style import DPI

__all__ = ["FIGURES", "HOME", "RESULTS", "save_all", "save_figure", "stored"]


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
