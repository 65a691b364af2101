"""What several charts do: panels, notes beside points, ticks in plain numbers."""

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure

from seqopt.report._style import SMALL, new_figure


def subplots(height: float, *shape: int, **options: Any) -> tuple[Figure, Any]:
    """Return a figure as wide as the site, inches high, and its panels."""
    figure = new_figure(height)
    return figure, figure.subplots(*shape, **options)


def note(axes: Axes, text: str, at: Any, shift: tuple[float, float], **look: Any) -> None:
    """Write a few words beside a point, so many typographic points away."""
    axes.annotate(text, at, shift, **{"textcoords": "offset points", "fontsize": SMALL, **look})


def ticks(values: Sequence[float], *axes: Axis) -> None:
    """Label axes at these numbers alone."""
    for axis in axes:
        axis.set_ticks(values, [f"{value:g}" for value in values])
        axis.set_ticks([], minor=True)


def name_panels(*panels: Axes) -> None:
    """Put a letter before the title of each panel, so that a text can name it."""
    for letter, axes in zip("abcdefghijkl", panels, strict=False):
        axes.set_title(f"({letter}) {axes.get_title(loc='left')}", loc="left")
