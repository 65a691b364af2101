"""Grips of a build over its steps, or over seconds: a lane per robot, a bar per grip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from seqopt.arrays import Floats
from seqopt.errors import StepError
from seqopt.report._style import SMALL, new_picture, styled
from seqopt.responses.table import force_column
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Hold, holds
from seqopt.sequence.steps import AnyStep, Site
from seqopt.times._curing import Waits
from seqopt.times._steps import StepTime, step_times

SHADES = "YlGnBu"
PALE = "#f2efe9"  # of a grip whose force is not known
DARK, CURES = "#222222", "#f3dcc0"
PREPARED: Any = {"fc": "#e8e8e8", "ec": DARK, "hatch": "///"}
LANE = 0.74  # height of a bar, of a lane's
STEP, LEAST, BESIDE, ABOVE = 0.14, 6.5, 1.7, 1.25
"""Inches: of a step, of a chart at least, beside the bars, above and below them."""
WIDEST, LETTER = 30.0, 0.06  # inches: of a chart, of a letter
Clock = tuple[Waits | None, Site | None]
"""Of a chart over seconds: how mortar waits, and where a part of a build begins, if it does."""


@styled
def gantt_picture(
    scene: Scene,
    steps: Sequence[AnyStep],
    responses: pd.DataFrame | None = None,
    shown: tuple[int | None, int | None] = (None, None),
    clock: Clock | None = None,
) -> Figure:
    """Return the grips of a build over its steps, shaded by their forces, where these are given.

    With a ``clock`` over seconds: with what robots prepare, and waits for mortar behind all lanes.
    """
    begins, done = steps[0].number, steps[-1].number
    first = begins if shown[0] is None else shown[0]
    last = done if shown[1] is None else shown[1]
    if not begins <= first <= last <= done:
        raise StepError(f"steps {first} to {last}: the build has steps {begins} to {done}")
    times = None if clock is None else step_times(scene, steps, *clock)
    figure, axes, shade = _lanes(scene, steps, responses, (first, last), times)
    marks: list[Line2D | Patch] = [
        Line2D([], [], color=DARK, marker="|", ms=11, mew=3.2, lw=0, label="places the brick"),
        Patch(fc="white", ec=DARK, label="holds it (brick · node)"),
    ]
    if times is not None:
        start = times[first - begins - 1].end if first > begins else 0.0
        cures = _prepared(axes, times[first - begins : last - begins + 1], start)
        marks.insert(0, Patch(lw=0.5, label="prepares", **PREPARED))
        marks += [Patch(fc=CURES, label="waits for mortar")] if cures else []
        axes.set_xlabel("seconds")
    else:
        whole = (first, last) == (1, done)
        axes.set_xlabel("step" if whole else f"step, {first} to {last} of {done}")
        if any(getattr(step, "moves", ()) for step in steps):
            marks.append(Patch(fc=PALE, ec=DARK, hatch="//", label="still to be chosen"))
    place: Any = {"loc": "lower left", "bbox_to_anchor": (0, 1), "borderaxespad": 0.2}
    axes.legend(handles=marks, ncols=len(marks), frameon=False, **place)
    if shade is not None:
        figure.colorbar(shade, ax=axes, label="grip force, N", pad=0.01)
    return figure


def _prepared(axes: Axes, times: Sequence[StepTime], start: float) -> bool:
    """Draw what robots prepare for steps, and waits for mortar; return whether there are any.

    ``start``: of the first of the steps, s.
    """
    cures = False
    for time in times:
        if time.prepares is not None and time.ready is not None:
            low, wide = time.robots[0] - LANE / 4, time.ready - time.prepares
            named: Any = {"gid": f"prepares {time.step}", "lw": 0.4, **PREPARED}
            axes.add_patch(Rectangle((time.prepares, low), wide, LANE / 2, **named))
        ready = max(start, time.ready or 0.0)
        if time.joint and time.start > ready:  # it waits for mortar alone
            axes.axvspan(ready, time.start, fc=CURES, lw=0, zorder=0, gid="cures")
            cures = True
        start = time.end
    return cures


def _lanes(
    scene: Scene,
    steps: Sequence[AnyStep],
    responses: pd.DataFrame | None,
    shown: tuple[int, int],
    times: Sequence[StepTime] | None,
) -> tuple[Figure, Axes, ScalarMappable | None]:
    """Draw a lane per robot and a bar per grip; return what shades them, too, if forces are known.

    With ``times`` over seconds: from a grip's own act, or from the start, up to letting go.
    """
    (first, last), begins, count = shown, steps[0].number, len(scene.robots)
    ends = np.arange(len(steps) + 1, dtype=float) + begins - 0.5  # before and after every step
    if times is not None:
        ends = np.array([0.0, *(time.end for time in times)])
    left, right = float(ends[first - begins]), float(ends[last - begins + 1])
    width = float(np.clip(STEP * (last - first + 1) + BESIDE, LEAST, WIDEST))
    figure = new_picture(width, 0.62 * count + ABOVE)
    axes = figure.add_subplot()
    inch = (width - BESIDE) / (right - left or 1.0)
    shade, colors = None, None
    if responses is not None:  # N, by step and robot
        forces = responses[[force_column(robot) for robot in scene.robots]].to_numpy(float)
        most = np.nanmax(forces, initial=0.0) or 1.0
        shade = ScalarMappable(Normalize(0.0, most), colormaps[SHADES])
        colors = shade.to_rgba(forces)
    for hold in holds(scene, steps):
        if hold.last >= first and hold.first <= last:
            at, end = hold.first - begins, hold.last - begins + 1
            stops = ends[at : end + 1].copy()
            if times is not None:
                stops[0] = times[at].start if hold.robot in times[at].robots else 0.0
                stops[-1] = ends[min(end + 1, len(times))]
            own = None if colors is None else colors[at:end, hold.robot]
            _grip(axes, scene, hold, stops, own, inch)
    room = 0.2 if times is None else 0.01 * (right - left)
    axes.set(ylim=(count - 0.5, -0.5), xlim=(left - room, right + room), axisbelow=True)
    axes.set_yticks(range(count), [robot.name for robot in scene.robots])
    axes.tick_params(left=False)
    axes.grid(visible=True, axis="x", lw=0.3)
    axes.spines[["top", "right", "left"]].set_visible(False)
    return figure, axes, shade


def _grip(
    axes: Axes, scene: Scene, hold: Hold, stops: Floats, colors: np.ndarray | None, inch: float
) -> None:
    """Draw a grip: shaded step by step, framed as a whole, marked where it places a brick.

    Brick and node, or the number of an open grip, stand in it as far as they fit.
    """
    low, begin, end = hold.robot - LANE / 2, float(stops[0]), float(stops[-1])
    for start, stop, color in zip(stops, stops[1:], () if colors is None else colors, strict=False):
        axes.add_patch(Rectangle((start, low), stop - start, LANE, fc=color, lw=0))
    look: Any = {"fc": PALE if colors is None else "none", "ec": DARK, "lw": 0.9}
    look |= {"hatch": "//"} if hold.node is None else {}
    name = f"hold {hold.robot} {hold.first} {hold.last}"
    axes.add_patch(Rectangle((begin, low), end - begin, LANE, gid=name, **look))
    if hold.places is not None:
        axes.plot([begin] * 2, [low, low + LANE], color=DARK, lw=3.2)
    room = inch * (end - begin)
    if room < 0.12:
        return
    words = f"?{(hold.move or 0) + 1}"
    if hold.node is not None:
        words = f"{scene.brick_of_node[hold.node].name} · {hold.node}"
    flat = room >= LETTER * len(words) + 0.06
    style: Any = {"ha": "center", "va": "center", "fontsize": SMALL, "color": DARK, "clip_on": True}
    style["bbox"] = {"boxstyle": "square,pad=0.1", "fc": (1, 1, 1, 0.72), "lw": 0}
    axes.annotate(words, ((begin + end) / 2, hold.robot), rotation=0 if flat else 90, **style)
