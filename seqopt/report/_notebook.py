"""What a notebook shows of a value: what it says at the prompt and, with matplotlib, a picture.

Of a page it is the step viewer as a widget: Python reads and sets its step (extra ``notebook``).
Pictures have a white background; nothing slow is computed for them.
"""

from __future__ import annotations

import io
from base64 import b64encode
from contextlib import suppress
from functools import cache
from html import escape
from importlib import resources
from typing import TYPE_CHECKING, Any

from seqopt._files import Page
from seqopt._registry import display
from seqopt.errors import ExtraError
from seqopt.plan.build import ShownBuild
from seqopt.problem.problem import Problem
from seqopt.report.text import _in_a_sentence
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import StepKind

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
    lines, images = [repr(value)], ""
    if isinstance(value, Scene) and value.loading:
        lines.append(f"Beside the weight: {value.loading}.")
    elif isinstance(value, ShownBuild) and _is_small(value):
        scene = value.engine.network.scene
        lines.append(_in_a_sentence(scene, value.responses(), (), value.departures))
    elif isinstance(value, ShownBuild):
        lines.append("Responses and stability are not computed here: see responses(), stability().")
    with suppress(ExtraError):
        for figure in _pictures(value):
            from PIL import Image  # noqa: PLC0415  # comes with matplotlib, an extra

            large, small = io.BytesIO(), io.BytesIO()
            figure.savefig(large, format="png", dpi=DPI)
            few = Image.open(large).convert("RGB").quantize(COLORS, Image.Quantize.FASTOCTREE)
            few.save(small, format="png", optimize=True)
            source = f"data:image/png;base64,{b64encode(small.getvalue()).decode()}"
            images += f'<img alt="{escape(lines[0])}" src="{source}" style="{STYLE}">'
    return f"<div>{''.join(f'<p>{escape(line)}</p>' for line in lines)}{images}</div>"


def _pictures(value: object) -> list[Figure]:
    """Return small pictures of a value."""
    if isinstance(value, Problem):
        value = value.moves if isinstance(value.moves, Schedule) else value.scene
    if isinstance(value, Scene):
        return [display(Scene, "plot")(value, width=WIDTH)]
    if isinstance(value, Schedule):
        return [value.gantt(1, min(len(value.steps), STEPS))]
    if not isinstance(value, ShownBuild) or not value.steps:  # costs alone were given
        return []
    paint, steps = display(ShownBuild, "plot"), value.steps
    if not _is_small(value):
        return [paint(value.engine, steps, steps[len(steps) // 2].number)]
    placing = [step.number for step in steps if step.kind in (StepKind.PLACE, StepKind.REMOVE)]
    thirds = {placing[len(placing) * k // 3] for k in (1, 2) if placing} | {steps[-1].number}
    last = steps[min(len(steps), STEPS) - 1].number
    return [paint(value.engine, steps, sorted(thirds)), value.gantt(None, last)]


def _is_small(value: ShownBuild) -> bool:
    """Return whether responses of a build are computed for its card."""
    return bool(value.steps) and len(value.engine.network.scene.bricks) <= SMALL


@cache
def _viewer_class() -> type[Any]:
    """Return the class of widgets, which lists what goes to and fro between Python and page."""
    try:
        import anywidget  # noqa: PLC0415  # an extra
        from traitlets import Int, Unicode  # noqa: PLC0415  # comes with it
    except ModuleNotFoundError:
        raise ExtraError(
            "widgets need anywidget, which is not installed: pip install 'seqopt[notebook]'"
        ) from None
    traits = {
        "_esm": (resources.files("seqopt") / "data/viewer/widget.mjs").read_text(encoding="utf-8"),
        "page": Unicode(read_only=True).tag(sync=True),
        "height": Int(900, min=100).tag(sync=True),
        "step": Int(0, min=0, help="from 1; 0: the one that decides").tag(sync=True),
        "build": Unicode(help="name of the first build that is shown").tag(sync=True),
        "__module__": __name__,
    }
    return type("StepViewer", (anywidget.AnyWidget,), traits)


def step_viewer(page: Page, step: int = 0) -> Any:
    """Return the widget of a page with the step viewer, at one of its steps."""
    widget = _viewer_class()(height=page.height, step=step)
    widget.set_trait("page", page.text)
    return widget
