"""The lines of arches: circular, catenary and pointed, from springing to springing."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError

Line = Callable[[float], Floats]
"""Takes a number from 0 at the first springing to 1 at the second; returns (x, z), m."""


def circular(span: float, rise: float) -> Line:
    """Return the arc of a circle through both springings and the crown.

    Parameters
    ----------
    span, rise : float
        m; at most a half circle.

    Raises
    ------
    SceneError
        If the rise is more than half of the span.
    """
    if rise > 0.5 * span * (1 + 1e-12):
        raise SceneError(
            f"arch: rise is {rise:g} m; a circular arch rises at most half of its span, "
            f"{0.5 * span:g}: give less, or the curve pointed or catenary"
        )
    radius = (0.25 * span**2 + rise**2) / (2 * rise)
    half = 2 * math.atan(2 * rise / span)

    def line(at: float) -> Floats:
        turn = half * (2 * at - 1)
        return np.array(
            [0.5 * span + radius * math.sin(turn), rise - radius * (1 - math.cos(turn))]
        )

    return line


def catenary(span: float, rise: float) -> Line:
    """Return a hanging chain turned upside down: the line of thrust of an even arch.

    Parameters
    ----------
    span, rise : float
        m.
    """
    from scipy.optimize import brentq  # noqa: PLC0415  # slow to import, for arches only

    # with u = span / 2a: rise / span = (cosh u - 1) / 2u
    slope = float(brentq(lambda u: (math.cosh(u) - 1) / (2 * u) - rise / span, 1e-9, 100.0))
    scale = 0.5 * span / slope
    end = math.sinh(slope)

    def line(at: float) -> Floats:
        x = scale * math.asinh(end * (2 * at - 1))  # evenly along the line
        return np.array([0.5 * span + x, rise - scale * (math.cosh(x / scale) - 1)])

    return line


def pointed(span: float, rise: float) -> Line:
    """Return two arcs that leave the springings upright and meet in a point.

    Parameters
    ----------
    span, rise : float
        m; more than a half circle rises.

    Raises
    ------
    SceneError
        If the rise is half of the span or less.
    """
    if rise <= 0.5 * span:
        raise SceneError(
            f"arch: rise is {rise:g} m; a pointed arch rises more than half of its span, "
            f"{0.5 * span:g}: give more, or the curve circular"
        )
    radius = (0.25 * span**2 + rise**2) / span
    turn = math.asin(rise / radius) if radius > rise else 0.5 * math.pi

    def line(at: float) -> Floats:
        angle = turn * (2 * at if at <= 0.5 else 2 - 2 * at)
        x = radius * (1 - math.cos(angle))
        return np.array([x if at <= 0.5 else span - x, radius * math.sin(angle)])

    return line


CURVES: dict[str, Callable[[float, float], Line]] = {
    "circular": circular,
    "catenary": catenary,
    "pointed": pointed,
}
"""By name; each takes span and rise, m."""


def chords(line: Line, lengths: Floats) -> Floats | None:
    """Return the points of a chain of rigid links laid along a line from its start.

    Parameters
    ----------
    line : Line
    lengths : (n,) float
        Of the links, m.

    Returns
    -------
    (n + 1, 2) float or None
        m; none if the line is too short.
    """
    from scipy.optimize import brentq  # noqa: PLC0415  # slow to import, for arches only

    at, points = 0.0, [line(0.0)]
    for length in lengths.tolist():
        here = points[-1]
        if _apart(line(1.0), here) < length:
            return None
        at = float(brentq(lambda s: _apart(line(s), here) - length, at, 1.0, xtol=1e-15))  # noqa: B023
        points.append(line(at))
    return np.array(points)


def _apart(first: Floats, second: Floats) -> float:
    return math.dist(first.tolist(), second.tolist())
