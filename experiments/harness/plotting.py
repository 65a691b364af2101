"""Where experiments put tables and figures, and how they open a figure."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

HOME = Path(__file__).resolve().parent.parent
RESULTS = HOME / "results"
FIGURES = HOME.parent / "docs" / "figures"
DPI = 150


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, size in inches, that needs no screen."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt  # noqa: PLC0415  # only after the choice of backend

    return plt.figure(figsize=(width, height), layout="constrained")


def save_figure(figure: Figure, name: str) -> None:
    """Write a figure of the documentation."""
    FIGURES.mkdir(exist_ok=True)
    figure.savefig(FIGURES / name, dpi=DPI, metadata={"Software": None})
