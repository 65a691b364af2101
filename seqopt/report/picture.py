"""A figure that a notebook shows by itself, whichever backend matplotlib has."""

from __future__ import annotations

import io

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

DPI = 110


class _Picture(Figure):
    """A figure that pyplot does not manage: it is shown once, where it is returned."""

    def _repr_png_(self) -> bytes:
        """Return the figure as a PNG."""
        return png(self)


def new_picture(width: float, height: float, *, constrained: bool = True) -> Figure:
    """Return an empty figure that a notebook shows where it is returned.

    Parameters
    ----------
    width, height : float
        Inches.
    constrained : bool, optional
        Whether matplotlib arranges what is drawn.
    """
    layout = ConstrainedLayoutEngine(h_pad=0.08, w_pad=0.06) if constrained else None
    return _Picture(figsize=(width, height), layout=layout)


def png(figure: Figure, dpi: float = DPI) -> bytes:
    """Return a figure as a PNG.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    dpi : float, optional
        Pixels per inch.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()
