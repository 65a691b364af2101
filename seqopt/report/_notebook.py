"""What a notebook shows of a value: what it says at the prompt and, with matplotlib, a picture.

Pictures have a white background; nothing slow is computed for them.
"""

from __future__ import annotations

import io
from base64 import b64encode
from contextlib import suppress
from functools import singledispatch
from html import escape
from typing import TYPE_CHECKING

from seqopt._showing import display
from seqopt.errors import ExtraError
from seqopt.plan.build import ShownBuild
from seqopt.problem.problem import Problem
from seqopt.report.text import _in_a_sentence
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Schedule

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SMALL = 60  # bricks up to which responses of a plan are computed and several steps drawn
DPI = 90
COLORS = 128  # of a picture: a quarter of the bytes; an octree keeps colors of small areas
WIDTH = 4.5  # of a structure, inches
STEPS = 34  # of a build whose grips are drawn
STYLE = "display:block;max-width:100%;height:auto;background:#fff"


def card(value: object) -> str:
    """Return what a value says of itself and, with matplotlib, small pictures of it, as HTML."""
    said, images = [repr(value), *sentences(value)], ""
    with suppress(ExtraError):
        for figure in pictures(value):
            from PIL import Image  # noqa: PLC0415  # comes with matplotlib, an extra

            large, small = io.BytesIO(), io.BytesIO()
            figure.savefig(large, format="png", dpi=DPI)
            few = Image.open(large).convert("RGB").quantize(COLORS, Image.Quantize.FASTOCTREE)
            few.save(small, format="png", optimize=True)
            source = f"data:image/png;base64,{b64encode(small.getvalue()).decode()}"
            images += f'<img alt="{escape(said[0])}" src="{source}" style="{STYLE}">'
    return f"<div>{''.join(f'<p>{escape(line)}</p>' for line in said)}{images}</div>"


@singledispatch
def sentences(_: object) -> list[str]:
    """Return what is said of a value beside its representation."""
    return []


@singledispatch
def pictures(_: object) -> list[Figure]:
    """Return small pictures of a value."""
    return []


@sentences.register(Scene)
def _(value: Scene) -> list[str]:
    return [f"Beside the weight: {value.loading}."] if value.loading else []


@pictures.register(Scene)
def _(value: Scene) -> list[Figure]:
    return [display(Scene, "plot")(value, width=WIDTH)]


@pictures.register(Schedule)
def _(value: Schedule) -> list[Figure]:
    return [value.gantt(1, min(len(value.steps), STEPS))]


@pictures.register(Problem)
def _(value: Problem) -> list[Figure]:
    return pictures(value.moves) or pictures(value.scene)


@sentences.register(ShownBuild)
def _(value: ShownBuild) -> list[str]:
    if not _is_small(value):
        return ["Responses and stability are not computed here: see responses() and stability()."]
    scene = value.engine.network.scene
    return [_in_a_sentence(scene, value.responses(), (), value.departures)]


@pictures.register(ShownBuild)
def _(value: ShownBuild) -> list[Figure]:
    if not value.steps:  # costs alone were given
        return []
    paint = display(ShownBuild, "plot")
    from seqopt.report._pictures import spread_steps  # noqa: PLC0415  # matplotlib is an extra

    if not _is_small(value):
        return [paint(value.engine, value.steps, value.steps[len(value.steps) // 2].number)]
    last = value.steps[min(len(value.steps), STEPS) - 1].number
    shown = spread_steps(value.steps, 3)
    return [paint(value.engine, value.steps, shown), value.gantt(None, last)]


def _is_small(value: ShownBuild) -> bool:
    """Return whether responses of a build are computed for its card."""
    return bool(value.steps) and len(value.engine.network.scene.bricks) <= SMALL
