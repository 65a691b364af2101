"""From where a picture is seen, and what all pictures of structures share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from seqopt.arrays import Floats

HALO = (withStroke(linewidth=2.5, foreground="white"),)


@dataclass(frozen=True)
class View:
    """A parallel projection.

    Parameters
    ----------
    azimuth : float
        Direction from which the scene is seen, degrees from -y towards +x.
    elevation : float
        Degrees above the horizon.
    """

    azimuth: float = 25.0
    elevation: float = 15.0

    def axes(self) -> Floats:
        """Return the unit vectors to the right, up and towards the viewer.

        Returns
        -------
        (3, 3) float
            A row for each.
        """
        a, e = np.radians([self.azimuth, self.elevation])
        right = np.array([np.cos(a), np.sin(a), 0.0])
        toward = np.array([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])
        return np.stack([right, np.cross(toward, right), toward])


def frame(axes: Axes) -> None:
    """Fit axes to a picture, which has none."""
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()
