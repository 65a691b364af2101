"""Rows of a table that takes long: kept as they come, so that a run goes on where it ended."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from seqopt._files import read_text
from seqopt.errors import FileError

Row = dict[str, object]


class Rows:
    """Rows beside the file that they are for, until it is written.

    ``asked``: what determines the rows; those of anything else are not taken up.
    """

    def __init__(self, out: Path | None, asked: object) -> None:
        self.path = None if out is None else out.with_name(f"{out.name}.part")
        self._mark = sha256(repr(asked).encode()).hexdigest()
        self.rows = [*self._earlier()]
        self.taken_up = len(self.rows)

    def _earlier(self) -> Iterator[Row]:
        """Yield the rows of an earlier run that asked the same; a line cut short ends them."""
        if self.path is None or not self.path.exists():
            return
        mark, *lines = read_text(self.path).splitlines() or [""]
        if mark != self._mark:
            return
        for line in lines:
            try:
                yield json.loads(line)
            except ValueError:
                return

    def add(self, row: Row) -> None:
        """Add a row, and keep it."""
        self.rows.append(row)
        if self.path is None:
            return
        fresh = len(self.rows) == self.taken_up + 1
        kept = self.rows if fresh else [row]
        lines = [json.dumps(each, default=_plain) for each in kept]
        try:
            if fresh:  # what was cut short is not kept
                self.path.write_text("\n".join([self._mark, *lines, ""]), encoding="utf-8")
            else:
                with self.path.open("a", encoding="utf-8") as stream:
                    stream.write(f"{lines[0]}\n")
        except OSError as error:
            wrong = f"cannot write {self.path}: {error.strerror or error}"
            raise FileError(wrong) from error

    def where(self, total: int, what: str) -> str:
        """Return where the rows found so far are, for whoever ended the run; empty if nowhere."""
        if self.path is None or not self.rows:
            return ""
        found = f"{len(self.rows)} of {total} {what}"
        return f"{found} are in {self.path}; the same command goes on from there"

    def done(self) -> None:
        """Let go of what was kept: the table is written."""
        if self.path is not None:
            with suppress(OSError):
                self.path.unlink(missing_ok=True)


def _plain(number: Any) -> object:
    """Return a number of NumPy as one of Python."""
    return number.item()
