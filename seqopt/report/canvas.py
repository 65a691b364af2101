"""What pictures of scenes and of steps share: from where, how wide, and panels of one shape."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from seqopt.arrays import Floats
from seqopt.report.picture import new_picture
from seqopt.report.style import WIDTH
from seqopt.report.view import View
from seqopt.scene.boxes import boxes
from seqopt.scene.scene import Scene

VIEW = View(azimuth=25, elevation=18)


def new_panels(
    scene: Scene, count: int, width: float = WIDTH, room: float = 0.35
) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels, each of the shape of the whole structure.

    Parameters
    ----------
    scene : Scene
    count : int
        How many panels.
    width : float, optional
        Of the figure, inches.
    room : float, optional
        For a title above every row, inches.
    """
    columns = min(count, 3)
    rows = -(-count // columns)
    low, high = seen_box(scene)
    across, up = high - low
    ratio = min(max(up / across, 0.25), 1.6)
    figure = new_picture(width, rows * (width / columns * ratio + room))
    panels = [figure.add_subplot(rows, columns, i + 1) for i in range(count)]
    for axes in panels:
        axes.set_axis_off()
    return figure, panels


def seen_box(scene: Scene) -> tuple[Floats, Floats]:
    """Return the lower left and the upper right corner of a structure as it is seen, and some room.

    Returns
    -------
    low, high : (2,) float
        m.
    """
    seen = boxes(scene.placed).corners().reshape(-1, 3) @ VIEW.axes()[:2].T
    room = 0.06 * np.ptp(seen, axis=0).max()
    return np.asarray(seen.min(axis=0) - room), np.asarray(seen.max(axis=0) + room)
