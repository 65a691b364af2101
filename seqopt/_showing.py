"""Pages that a notebook or a browser shows."""

from __future__ import annotations

import tempfile
import webbrowser
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from seqopt._files import write_text
from seqopt._registry import display

PAGE = "report.html"  # the page in a folder that a command writes


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
