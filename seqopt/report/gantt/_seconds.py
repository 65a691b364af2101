"""Grips of a build over seconds: what robots prepare, when they act, and how long they hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
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

from seqopt.errors import StepError
from seqopt.report._pictures import DARK, LANE, SHADES, _label, _lanes
from seqopt.report._style import new_picture, styled
from seqopt.responses.table import force_column
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Hold, holds
from seqopt.sequence.site import Site
from seqopt.sequence.steps import Step
from seqopt.times._curing import Waits
from seqopt.times._steps import StepTime, step_times

PER_STEP, NARROWEST, WIDEST = 0.15, 7.0, 30.0  # inches
BESIDE = 1.8  # inches that names and the key of shades take
PREPARES = "#e8e8e8"
CURES = "#f3dcc0"


@styled
def seconds_picture(
    scene: Scene,
    steps: Sequence[Step],
    responses: pd.DataFrame,
    shown: tuple[int | None, int | None] = (None, None),
    waits: Waits | None = None,
    begin: Site | None = None,
) -> Figure:
    """Return the grips of a build over seconds, a lane per robot, shaded by their forces.

    ``waits``: as of `step_times`, where mortar cures: such waits are marked behind all lanes;
    ``begin``: where a part of a build begins.
    """
    before = steps[0].number - 1
    own = range(before + 1, before + len(steps) + 1)
    first, last = (own[end] if s is None else s for s, end in zip(shown, (0, -1), strict=True))
    if not own[0] <= first <= last <= own[-1]:
        raise StepError(f"steps {first} to {last}: the build has steps {own[0]} to {own[-1]}")
    times = step_times(scene, steps, waits, begin)
    first, last = first - before, last - before
    start, end = 0.0 if first == 1 else times[first - 2].end, times[last - 1].end
    width = float(np.clip(PER_STEP * (last - first + 1) + BESIDE, NARROWEST, WIDEST))
    figure = new_picture(width, 0.62 * len(scene.robots) + 1.3)
    axes = figure.add_subplot()
    forces = responses[[force_column(robot) for robot in scene.robots]].to_numpy(float)
    shade = ScalarMappable(Normalize(0.0, np.nanmax(forces, initial=0.0) or 1.0), colormaps[SHADES])
    colors = shade.to_rgba(forces)
    inch = (width - BESIDE) / (end - start or 1.0)
    for hold in holds(scene, [replace(step, number=step.number - before) for step in steps]):
        if hold.last >= first and hold.first <= last:
            stops = _stops(times, hold)
            _bar(axes, hold, stops, colors[hold.first - 1 : hold.last, hold.robot])
            _label(axes, scene, hold, (stops[0][0], stops[-1][1], inch))
    for time in times[first - 1 : last]:
        _prepared(axes, time)
    ends = [0.0, *(time.end for time in times)]
    pairs = zip(ends[first - 1 : last], times[first - 1 : last], strict=True)
    spans = [span for end, time in pairs if (span := _cured(end, time)) is not None]
    for span in spans:
        axes.axvspan(*span, fc=CURES, lw=0, zorder=0, gid="cures")
    _frame(axes, scene, (start, end), cures=bool(spans))
    figure.colorbar(shade, ax=axes, label="grip force, N", pad=0.01)
    return figure


def _bar(axes: Axes, hold: Hold, stops: Sequence[tuple[float, float]], colors: np.ndarray) -> None:
    """Draw a grip: shaded step by step, framed as a whole, marked where it places a brick."""
    low = hold.robot - LANE / 2
    for (start, stop), color in zip(stops, colors, strict=True):
        axes.add_patch(Rectangle((start, low), stop - start, LANE, fc=color, lw=0))
    begin, end = stops[0][0], stops[-1][1]
    look: Any = {"fc": "none", "ec": DARK, "lw": 0.9, "gid": f"hold {hold.robot} {hold.first}"}
    axes.add_patch(Rectangle((begin, low), end - begin, LANE, **look))
    if hold.places is not None:
        axes.plot([begin] * 2, [low, low + LANE], color=DARK, lw=3.2)


def _cured(before: float, time: StepTime) -> tuple[float, float] | None:
    """Return from when to when a step after an end waits for mortar alone, s, if it does."""
    ready = max(before, time.ready or 0.0)
    return (ready, time.start) if time.joint and time.start > ready else None


def _frame(axes: Axes, scene: Scene, span: tuple[float, float], *, cures: bool) -> None:
    """Set lanes, limits and names, and explain the marks."""
    room = 0.01 * (span[1] - span[0])
    _lanes(axes, scene, "seconds", (span[0] - room, span[1] + room))
    handles = [
        Patch(fc=PREPARES, ec=DARK, lw=0.5, hatch="///", label="prepares"),
        Line2D([], [], color=DARK, marker="|", ms=11, mew=3.2, lw=0, label="places the brick"),
        Patch(fc="white", ec=DARK, label="holds it (brick · node)"),
    ]
    if cures:
        handles.append(Patch(fc=CURES, label="waits for mortar"))
    place: Any = {"loc": "lower left", "bbox_to_anchor": (0, 1), "borderaxespad": 0.2}
    axes.legend(handles=handles, ncols=len(handles), frameon=False, **place)


def _stops(times: Sequence[StepTime], hold: Hold) -> list[tuple[float, float]]:
    """Return from when to when a grip lasts in each of its steps, up to when it is let go, s."""
    taken = times[hold.first - 1]
    out = [(taken.start if hold.robot in taken.robots else 0.0, taken.end)]  # who held at first
    out += [(times[n - 2].end, times[n - 1].end) for n in range(hold.first + 1, hold.last + 1)]
    if hold.last < len(times):
        out[-1] = (out[-1][0], times[hold.last].end)
    return out


def _prepared(axes: Axes, time: StepTime) -> None:
    """Draw what a robot prepares before a step."""
    if time.prepares is None or time.ready is None:
        return
    low, span = time.robots[0] - LANE / 4, time.ready - time.prepares
    look: Any = {"fc": PREPARES, "ec": DARK, "lw": 0.4, "hatch": "///"}
    look["gid"] = f"prepares {time.step}"
    axes.add_patch(Rectangle((time.prepares, low), span, LANE / 2, **look))
