"""The step viewer as a widget: Python reads and sets the step it shows (extra ``notebook``)."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Any

from seqopt._files import Page
from seqopt.errors import ExtraError


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
    script = resources.files("seqopt") / "data/viewer/widget.mjs"
    traits = {
        "_esm": script.read_text(encoding="utf-8"),
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
