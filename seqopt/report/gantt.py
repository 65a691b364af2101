"""The grips of a build or of a schedule over its steps, a lane per robot (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Sequence

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
from seqopt.report.style import SMALL, new_picture, styled
from seqopt.responses.table import force_column
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Hold, holds
from seqopt.sequence.steps import AnyStep

SHADES = "YlGnBu"
PALE = "#f2efe9"  # of a grip whose force is not known
INK = "#222222"
LANE = 0.74  # height of a bar, of a lane's
PER_STEP, LEAST, MOST = 0.13, 6.0, 30.0  # inches
LETTER = 0.06  # width of one, inches


@styled
def gantt_picture(
    scene: Scene,
    steps: Sequence[AnyStep],
    responses: pd.DataFrame | None = None,
    shown: tuple[int, int | None] = (1, None),
) -> Figure:
    """Return the grips of a build over its steps, a lane per robot and a bar per grip."""
    first, last = _range(len(steps), *shown)
    width = float(np.clip(PER_STEP * (last - first + 1) + 1.6, LEAST, MOST))
    figure = new_picture(width, 0.62 * len(scene.robots) + 1.2)
    axes = figure.add_subplot()
    inch = (width - 1.6) / (last - first + 1)
    shade = None if responses is None else _shade(scene, responses)
    for hold in holds(scene, steps):
        if hold.last >= first and hold.first <= last:
            force = None if responses is None else _forces(scene, responses, hold)
            _bar(axes, hold, (force, shade))
            _label(axes, _words(scene, hold), hold, inch)
    _frame(axes, scene, (first, last), len(steps))
    _key(figure, axes, shade, is_open=any(_is_open(step) for step in steps))
    return figure


def _range(count: int, first: int, last: int | None) -> tuple[int, int]:
    """Return the numbers of the first and last step that are drawn."""
    end = count if last is None else last
    if not 1 <= first <= end <= count:
        raise StepError(f"steps {first} to {end}: the build has steps 1 to {count}")
    return first, end


def _is_open(step: AnyStep) -> bool:
    return bool(getattr(step, "moves", ()))


def _shade(scene: Scene, responses: pd.DataFrame) -> ScalarMappable:
    """Return the shades of forces, from none to the largest of the build, N."""
    columns = [force_column(robot) for robot in scene.robots]
    largest = np.nanmax(responses[columns].to_numpy(float), initial=0.0)
    return ScalarMappable(Normalize(0.0, largest or 1.0), colormaps[SHADES])


def _forces(scene: Scene, responses: pd.DataFrame, hold: Hold) -> Floats:
    """Return the force of a grip in each of its steps, N."""
    column = responses[force_column(scene.robots[hold.robot])].to_numpy(float)
    return np.asarray(column[hold.first - 1 : hold.last])


def _bar(axes: Axes, hold: Hold, shaded: tuple[Floats | None, ScalarMappable | None]) -> None:
    """Draw a grip: shaded step by step, framed as a whole, marked where it places a brick."""
    forces, shade = shaded
    low = hold.robot - LANE / 2
    if forces is not None and shade is not None:
        for i, force in enumerate(forces):
            color = shade.to_rgba(force)
            axes.add_patch(Rectangle((hold.first + i - 0.5, low), 1, LANE, fc=color, lw=0))
    axes.add_patch(
        Rectangle(
            (hold.first - 0.5, low),
            hold.last - hold.first + 1,
            LANE,
            fc="none" if forces is not None else PALE,
            ec=INK,
            lw=0.9,
            hatch="//" if hold.node is None else None,
            gid=f"hold {hold.robot} {hold.first} {hold.last}",
        )
    )
    if hold.places is not None:
        axes.plot([hold.first - 0.5] * 2, [low, low + LANE], color=INK, lw=3.2)


def _words(scene: Scene, hold: Hold) -> str:
    """Return what a bar says: brick and node, or the number of the open grip."""
    if hold.node is None:
        return f"?{(hold.move or 0) + 1}"
    return f"{scene.brick_of_node[hold.node].name} · {hold.node}"


def _label(axes: Axes, words: str, hold: Hold, inch: float) -> None:
    """Write words into a bar, upright where it is narrow; nothing where they do not fit."""
    room = inch * (hold.last - hold.first + 1)
    if room < 0.12:
        return
    flat = room >= LETTER * len(words) + 0.06
    axes.annotate(
        words,
        ((hold.first + hold.last) / 2, hold.robot),
        ha="center",
        va="center",
        rotation=0 if flat else 90,
        fontsize=SMALL,
        color=INK,
        bbox={"boxstyle": "square,pad=0.1", "fc": (1, 1, 1, 0.72), "lw": 0},
        clip_on=True,
    )


def _frame(axes: Axes, scene: Scene, shown: tuple[int, int], steps: int) -> None:
    """Set lanes, limits and names."""
    count = len(scene.robots)
    axes.set_xlim(shown[0] - 0.7, shown[1] + 0.7)
    axes.set_ylim(count - 0.5, -0.5)
    axes.set_yticks(range(count), [robot.name for robot in scene.robots])
    whole = shown == (1, steps)
    axes.set_xlabel("step" if whole else f"step, {shown[0]} to {shown[1]} of {steps}")
    axes.tick_params(left=False)
    axes.grid(visible=True, axis="x", lw=0.3)
    axes.set_axisbelow(True)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)


def _key(figure: Figure, axes: Axes, shade: ScalarMappable | None, *, is_open: bool) -> None:
    """Explain the marks, the words and the shades."""
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=INK, marker="|", ms=11, mew=3.2, lw=0, label="places the brick"),
        Patch(fc="white", ec=INK, label="holds it (brick · node)"),
    ]
    if is_open:
        handles.append(Patch(fc=PALE, ec=INK, hatch="//", label="still to be chosen"))
    axes.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=3,
        frameon=False,
        borderaxespad=0.2,
    )
    if shade is not None:
        figure.colorbar(shade, ax=axes, label="grip force, N", pad=0.01)
