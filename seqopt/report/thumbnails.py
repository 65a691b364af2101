"""Small pictures of values for a notebook (extra ``plot``)."""

from __future__ import annotations

import io
from functools import singledispatch

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from seqopt.errors import ProblemError
from seqopt.network.network import Network
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.order_problem import OrderProblem
from seqopt.placement.problem import Problem
from seqopt.placement.robust_problem import RobustProblem
from seqopt.placement.shown_build import ShownBuild
from seqopt.report.gantt import gantt_picture
from seqopt.report.picture import new_picture, png
from seqopt.report.pictures import network_picture, scene_picture
from seqopt.report.step_pictures import spread_steps, steps_picture
from seqopt.report.style import BLUE, styled
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Schedule
from seqopt.stability.assessment import Stability, Verdict

DPI = 90
COLORS = 128  # of a picture: a quarter of the bytes; an octree keeps colors of small areas
WIDTH = 4.5  # of a structure, inches
STEPS = 34  # of a build whose grips are drawn
BRICKS = 60  # up to which several steps are drawn


@singledispatch
def thumbnails(value: object) -> list[bytes]:
    """Return small pictures of a value, as PNG.

    Parameters
    ----------
    value : object
        A scene, network, schedule, problem, plan or stability.

    Returns
    -------
    list of bytes
        None for other values.
    """
    del value
    return []


@thumbnails.register
def _scene(value: Scene) -> list[bytes]:
    return [small(scene_picture(value, width=WIDTH))]


@thumbnails.register
def _network(value: Network) -> list[bytes]:
    return [small(network_picture(value, width=WIDTH))]


@thumbnails.register
def _schedule(value: Schedule) -> list[bytes]:
    return [small(gantt_picture(value.scene, value.steps, None, (1, _last(len(value.steps)))))]


@thumbnails.register
def _problem(value: Problem) -> list[bytes]:
    return _schedule(value.schedule)


@thumbnails.register
def _robust_problem(value: RobustProblem) -> list[bytes]:
    return _schedule(value.nominal.schedule)


@thumbnails.register
def _free_problem(value: FreeProblem) -> list[bytes]:
    return _scene(value.network.scene)


@thumbnails.register
def _order_problem(value: OrderProblem) -> list[bytes]:
    return _scene(value.scene)


@thumbnails.register
def _build(value: ShownBuild) -> list[bytes]:
    try:
        scene, count = value.engine.network.scene, len(value.steps)
    except ProblemError:  # costs alone were given
        return []
    if len(scene.bricks) > BRICKS:
        return [small(steps_picture(value.engine, value.steps, count // 2 + 1))]
    pictures = [steps_picture(value.engine, value.steps, spread_steps(value.steps, 3))]
    pictures.append(value.gantt(1, _last(count)))
    return [small(picture) for picture in pictures]


@thumbnails.register
@styled
def _stability(value: Stability) -> list[bytes]:
    """Return the tilt survived in every direction; nothing where it does not stand."""
    if value.verdict is not Verdict.STANDS:
        return []
    figure = new_picture(3.0, 3.0)
    axes = figure.add_subplot(projection="polar")
    angles = 2 * np.pi * np.arange(len(value.pull) + 1) / len(value.pull)
    tilts = np.degrees(np.arctan(value.pull))
    axes.plot(angles, [*tilts, tilts[0]], "o-", color=BLUE, ms=4)
    axes.fill(angles, [*tilts, tilts[0]], color=BLUE, alpha=0.15)
    axes.set_title("tilt survived, degrees", loc="center")
    axes.set_yticks([float(f"{np.nanmax(tilts) / 2:.2g}"), float(f"{np.nanmax(tilts):.2g}")])
    return [small(figure)]


def _last(count: int) -> int:
    return min(count, STEPS)


def small(figure: Figure) -> bytes:
    """Return a figure as a small PNG of few colors."""
    picture = Image.open(io.BytesIO(png(figure, DPI))).convert("RGB")
    buffer = io.BytesIO()
    picture.quantize(COLORS, Image.Quantize.FASTOCTREE).save(buffer, format="png", optimize=True)
    return buffer.getvalue()
