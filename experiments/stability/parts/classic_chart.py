"""The picture of how some classical structures fall."""

from math import radians

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from experiments.harness.charts import subplots
from experiments.stability.parts.blocks import Blocks, ring
from experiments.stability.parts.classics import ROUGH, half_arch, proven, pushed, wall, whole
from seqopt.report._style import styled
from seqopt.stability._prover import Proven


def _draw(axes: Axes, blocks: Blocks, found: Proven, title: str) -> None:
    """Draw the outlines of blocks in x and z, at rest and moved."""
    assembly = blocks.assembly(1.0)
    motion = found.answer.motion[:, None] / np.repeat([1.0, assembly.scales[1]], 3)
    step = motion[..., :3] + np.cross(motion[..., 3:], blocks.vertex - assembly.centroid[:, None])
    step *= 0.1 * np.ptp(blocks.vertex[..., 0]) / np.linalg.norm(step, axis=2).max()
    for moved, look in ((0.0, ("0.95", "0.8")), (1.0, ("#9cc4e4", "k"))):
        seen = (blocks.vertex + moved * step)[..., [0, 2]]
        outlines = [points[ConvexHull(points).vertices] for points in seen]
        axes.add_collection(PolyCollection(outlines, lw=0.5, fc=look[0], ec=look[1]))
    axes.autoscale_view()
    axes.set(aspect="equal")
    axes.set_title(title, loc="center")
    axes.set_axis_off()


@styled
def picture() -> Figure:
    figure, axes = subplots(5.2, 2, 2)
    semicircle, arch = whole(half_arch(30, 0.1)), ring(7, 10.0, 1.5, radians(78.75))
    _draw(axes[0, 0], semicircle, proven(semicircle, ROUGH), "semicircle, t/R 0.1: by its weight")
    _draw(axes[0, 1], arch, pushed(arch, ROUGH), "Oppenheim's arch: by a push of 0.37")
    _draw(axes[1, 0], wall(1), pushed(wall(1), 0.65), "wall 1: by a push of 0.64")
    _draw(axes[1, 1], wall(3), pushed(wall(3), 0.65), "wall 3: by a push of 0.40")
    return figure
