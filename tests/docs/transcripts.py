"""Pages whose commands and Python are run, block by block, and whose outputs are compared.

``python -m tests.docs.transcripts`` writes the outputs of today into the pages; read what it
changes before it is kept.
"""

import contextlib
import importlib.util
import io
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from seqopt._cli.main import main
from tests.builders import ROOT

DOCS = ROOT / "docs"
PAGES = (
    "../README",
    "index",
    "quickstart",
    "faq",
    "coming_from",
    "orders",
    *(
        f"guides/{name}"
        for name in ("own_robots", "arms", "driving", "props", "robot_failed", "how_long", "report")
    ),
)
BLOCK = re.compile(r"```(sh|python)\n(.*?)```(?:\n\n```text\n(.*?)```)?", flags=re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A block of code on a page.

    Attributes
    ----------
    kind : str
        ``sh`` or ``python``.
    code : str
    printed : str or None
        The output that the page shows; None where it shows none.
    """

    kind: str
    code: str
    printed: str | None

    @property
    def commands(self) -> list[str]:
        """The lines that call seqopt."""
        lines = self.code.splitlines()
        return [line.split(" #")[0].strip() for line in lines if line.startswith("seqopt")]


def blocks(text: str) -> Iterator[Block]:
    """Yield the blocks of a page that can be run, in their order."""
    for found in BLOCK.finditer(text):
        block = Block(*found.groups())
        if block.kind == "python" or block.commands:
            yield block


def furnish(folder: Path) -> None:
    """Put the file that pages read into a folder: the bridge that ships with compas_cra."""
    found = importlib.util.find_spec("compas_cra")
    if found is None or found.origin is None:
        raise LookupError("compas_cra is missing: install the extra witness")
    shutil.copy(Path(found.origin).parent / "data" / "samples" / "bridge.json", folder)


def run(block: Block, folder: Path, names: dict[str, object] | None = None) -> tuple[str, bool]:
    """Run a block in a folder; return what it prints, and whether all of it ended well.

    ``names`` are those that Python on the page has defined; they grow.
    """
    if block.kind == "python":
        return _python(block.code, folder, {} if names is None else names), True
    done = [_command(line, folder) for line in block.commands]
    return "".join(text for text, _ in done), all(code == 0 for _, code in done)


def _python(code: str, folder: Path, names: dict[str, object]) -> str:
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        names["__name__"] = "__main__"
        exec(compile(code, "page", "exec"), names)
    return printed.getvalue()


def _command(line: str, folder: Path) -> tuple[str, int]:
    """Run a command in this process: a program would load the same libraries for every line."""
    printed = io.StringIO()
    with (
        contextlib.chdir(folder),
        patch.dict(os.environ, COLUMNS="80"),
        contextlib.redirect_stdout(printed),
        contextlib.redirect_stderr(printed),
    ):
        status = main(line.split()[1:])
    return printed.getvalue(), status


def refresh(name: str) -> None:
    """Write today's outputs into a page."""
    path = DOCS / f"{name}.md"
    text = path.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        furnish(Path(folder))
        names: dict[str, object] = {}

        def renewed(found: re.Match[str]) -> str:
            block = Block(*found.groups())
            if block.kind == "sh" and not block.commands:
                return found[0]
            printed, _ = run(block, Path(folder), names)
            shown = f"```{block.kind}\n{block.code}```"
            return shown if block.printed is None else f"{shown}\n\n```text\n{printed.strip()}\n```"

        path.write_text(BLOCK.sub(renewed, text), encoding="utf-8")


if __name__ == "__main__":
    for page in sys.argv[1:] or PAGES:
        refresh(page)
