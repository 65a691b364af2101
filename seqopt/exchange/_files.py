"""Tables as CSV, whose cells no spreadsheet takes for formulas, and folders that are complete."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import tempfile
from collections.abc import Callable, Container, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import pandas as pd

from seqopt._files import HIDDEN, PAGE, _put_all, _told, make_folder, write_file
from seqopt.errors import FileError, SeqoptError
from seqopt.scene.scene_file import builtin_scenes
from seqopt.sequence.methods import SCHEDULES
from seqopt.sequence.rules import FREE
from seqopt.work import Tell

_FORMULA = ("=", "+", "-", "@")
_MARK = "'"


def harmless(text: str) -> str:
    """Return a cell that spreadsheets take for no formula, with an apostrophe if needed.

    >>> harmless("=cmd_node"), harmless("rob1_node"), plain(harmless("'=x"))
    ("'=cmd_node", 'rob1_node', "'=x")
    """
    return _MARK + text if text.lstrip(_MARK).startswith(_FORMULA) else text


def plain(text: str) -> str:
    """Invert `harmless`."""
    return text[1:] if text.startswith(_MARK) and harmless(text) != text else text


_MOST_CELLS = 10_000_000
Row = dict[str, str]


def read_table(
    text: str, where: str, error: type[SeqoptError] = FileError
) -> tuple[list[str], list[tuple[int, Row]]]:
    """Return the columns of a CSV table, and its rows: the number of the line, cells by column.

    A missing cell is empty; cells beyond the columns are under None. ``error``: raised for other
    content.
    """
    reader = csv.DictReader(io.StringIO(text), restval="")
    try:
        columns = [plain(name or "") for name in reader.fieldnames or ()]
        if len(columns) * text.count("\n") > _MOST_CELLS:
            raise error(f"{where}: it has more than {_MOST_CELLS:,} cells; give fewer")
        reader.fieldnames = columns
        return columns, [(reader.line_num, row) for row in reader]
    except csv.Error as wrong:
        raise error(f"{where}: not a readable CSV file: {wrong}") from wrong


def csv_text(table: pd.DataFrame | Sequence[Mapping[str, object]], digits: int = 6) -> str:
    """Return a table as CSV, without its index, rounded to ``digits``; no cell begins a formula.

    Rows of equal columns are written without loading pandas.

    >>> csv_text([{"step": 1, "brick": "=a", "tilt": 2 / 3}]).splitlines()
    ['step,brick,tilt', "1,'=a,0.666667"]
    """
    if isinstance(table, Sequence):
        names, rows = [*table[0]] if table else [], [tuple(row.values()) for row in table]
    else:
        found = table.astype(object).where(table.notna(), None)
        names, rows = [*table], [*found.itertuples(index=False, name=None)]

    def cell(value: object) -> object:
        if isinstance(value, float):
            return "" if math.isnan(value) else f"{value:.{digits}g}"
        return "" if value is None else harmless(value) if isinstance(value, str) else value

    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(map(cell, row) for row in [names, *rows])
    return text.getvalue()


def write_folder(folder: Path, files: Mapping[str, bytes | str]) -> None:
    """Write files by name into a folder, created if missing, all of them or none.

    A new folder appears under its name with all of its files at once. In an existing one all files
    are written under temporary names before the first is renamed. Raises `FileError`.
    """
    target = Path(os.path.realpath(folder))
    with _told("write", folder):
        if target.exists():
            _put_all([(target / name, content) for name, content in files.items()])
            return
        make_folder(target.parent)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=HIDDEN) as hidden:
            whole = Path(hidden) / "whole"
            whole.mkdir()  # as open as any new folder; the one around it is private
            _put_all([(whole / name, content) for name, content in files.items()])
            whole.rename(target)


def require_apart(outputs: Sequence[Path], inputs: Sequence[Path] = ()) -> None:
    """Raise a `FileError` if two outputs are the same file, or one is an input."""
    for i, path in enumerate(outputs):
        others = [(each, "it is the input") for each in inputs]
        others += [(each, "two outputs go there") for each in outputs[:i]]
        for other, why in others:
            try:
                same = path.samefile(other)
            except OSError:  # one of them is not there
                same = os.path.realpath(path) == os.path.realpath(other)
            if same:
                raise FileError(f"cannot write {path}: {why}; name another file")


def require_folder(path: Path) -> None:
    """Raise `FileError`, before anything is computed, if a folder cannot be created or written."""
    there = Path(os.path.realpath(path))
    while not os.path.lexists(there) and there != there.parent:
        there = there.parent
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        what = "cannot be written" if there.is_dir() else "is not a folder"
        raise FileError(f"cannot make folder {path}: {there} {what}; name another")


def listed(rows: Sequence[Mapping[str, Any]], counts: Container[str] = ()) -> list[str]:
    """Return the lines of a table to read, without columns that are empty.

    ``counts``: columns in which zeros are left out. Pandas would take 0.2 s to load.
    """

    def cell(name: str, value: Any) -> str:
        if value is None or value != value or (name in counts and not value):  # noqa: PLR0124
            return ""
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    columns = [[name, *(cell(name, row[name]) for row in rows)] for name in rows[0]]
    filled = [column for column in columns if any(column[1:])]
    wide = [[text.rjust(max(map(len, column))) for text in column] for column in filled]
    return ["  ".join(line) for line in zip(*wide, strict=True)]


_NOT_IN_JSON = {"NaN": None, "Infinity": "inf", "-Infinity": "-inf"}  # what is said in its place


def json_value(value: object) -> Any:
    """Convert a value to types of JSON, numbers with all digits.

    NaN becomes null, an infinite number the string ``inf`` or ``-inf``, a table a list of rows.

    >>> json_value({"gap": float("nan"), "bond": float("inf"), "nodes": (1, 20)})
    {'gap': None, 'bond': 'inf', 'nodes': [1, 20]}
    """
    return json.loads(json.dumps(value, default=_unpacked), parse_constant=_NOT_IN_JSON.get)


def _unpacked(value: Any) -> Any:
    """Return the contents of a table, an array, an enumeration's member or another value."""
    if hasattr(value, "to_dict"):
        return value.to_dict(orient="records")
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, Sequence | set | frozenset):
        return list(value)
    if callable(value):
        return value()
    if hasattr(value, "tolist"):
        return value.tolist()
    return value.value if isinstance(value, Enum) else str(value)


ALWAYS = ("plan.csv", "summary.json", "scene.json", PAGE)  # names in the folder of any plan


class Output:
    """Where a command writes, if it does, and what it reads, which it never overwrites."""

    def __init__(self, out: Path | None, *given: object) -> None:
        """Take scene, plan and schedule that are given; those that are words for paths count."""
        self.path, self._given = out, given

    def keep_apart(self, *outputs: Path | None) -> None:
        """Raise `FileError` if two outputs are the same file, or one is an input."""
        names = {*builtin_scenes(), *SCHEDULES, FREE}
        paths = [Path(e) for e in self._given if isinstance(e, str | Path) and str(e) not in names]
        inside = [p / name for p in paths if p.is_dir() for name in ("scene.json", "plan.csv")]
        require_apart([path for path in outputs if path is not None], [*paths, *inside])

    def require(self, *names: str) -> None:
        """Raise `FileError`, before anything is computed, if the folder cannot be created."""
        if self.path is not None:
            require_folder(self.path)
            self.keep_apart(*(self.path / name for name in names))

    def write(self, tell: Tell, files: Callable[[], Mapping[str, bytes | str]]) -> tuple[Path, ...]:
        """Write the files to the folder, all or none, if there is one; return the paths."""
        if self.path is None:
            return ()
        tell("writing the plan")
        made = files()
        self.keep_apart(*(self.path / name for name in made))
        write_folder(self.path, made)
        return (self.path,)

    def put(self, text: str, said: str) -> dict[str, Any]:
        """Write a file, and return the entries of its answer; without a file that prints it."""
        if self.path is None:
            return {"data": text}
        write_file(self.path, text)
        return {"text": f"{said} written to {self.path}", "written": (self.path,)}

    def said(self, *, tables: str = "the plan, its tables", what: str = "it step by step") -> str:
        """Describe folder and page, or how to request one; ``what``: that the page shows."""
        if self.path is None:
            return f"--out DIR writes {tables} and a page that shows {what}"
        return f"written to {self.path}; {self.path / PAGE} shows {what}"
