"""What shows values, registered by their classes, since values may not import it.

Pictures are drawn by `seqopt.report`, which imports scenes and plans. These ask `display` for what
is registered for them.
"""

from __future__ import annotations

import tempfile
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from seqopt._files import write_text
from seqopt._registry import view
from seqopt.errors import ExtraError

PAGE = "report.html"  # the page in a folder that a command writes


def display(kind: type, way: str) -> Callable[..., Any]:
    """Return the renderer of a class of values, as ``plot``, loaded on first use."""
    try:
        found: Callable[..., Any] = view(kind, way)
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "matplotlib":
            raise
        raise ExtraError(
            "pictures need matplotlib, which is not installed: pip install 'seqopt[plot]'"
        ) from None
    return found


class Shown:
    """Base class of values that notebooks show as a small table with a picture."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return the table and, where matplotlib is installed, the picture, as HTML."""
        return str(display(type(self), "html")(self))


@dataclass(frozen=True, repr=False)
class Page:
    """A self-contained page of HTML, shown in a notebook or, by `open`, in a browser."""

    text: str  # the whole page
    height: int = 900  # height of the frame that shows it in a notebook, pixels

    def __repr__(self) -> str:
        size = len(self.text.encode()) / 1e6
        return f"<Page of {size:.1f} MB: save('report.html') writes it, open() shows it>"

    def _repr_html_(self) -> str:
        """Return an ``iframe`` with the page."""
        return (
            f'<iframe srcdoc="{escape(self.text)}" width="100%" height="{self.height}" '
            'style="border:0;background:#fff" title="step viewer"></iframe>'
        )

    def widget(self, step: int = 0) -> Any:
        """Return it as a widget (extra ``notebook``), whose ``step`` and ``build`` can be set.

        ``step``: which one it shows first, from 1; by default the one that decides.
        """
        return display(Page, "widget")(self, step)

    def save(self, path: str | Path) -> Path:
        """Write the page to a file. Raises `FileError` if it cannot be written."""
        write_text(Path(path), self.text)
        return Path(path)

    def open(self, path: str | Path | None = None) -> Path:
        """Write the page to a file, or a temporary one, and show it in a browser."""
        written = self.save(path or Path(tempfile.mkdtemp(prefix="seqopt-")) / "report.html")
        webbrowser.open(written.resolve().as_uri())
        return written
