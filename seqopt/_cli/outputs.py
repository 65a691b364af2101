"""Outputs of commands: folders that are written atomically and never overwrite inputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from seqopt._files import PAGE, write_file
from seqopt.exchange._files import csv_text, require_apart, require_folder, write_folder
from seqopt.scene.scene_file import builtin_scenes
from seqopt.sequence.methods import SCHEDULES
from seqopt.sequence.rules import FREE
from seqopt.work import Tell

ALWAYS = ("plan.csv", "summary.json", "scene.json", PAGE)  # names in the folder of any plan


def put_table(
    path: Path | None, table: pd.DataFrame | Sequence[Mapping[str, object]], said: str
) -> dict[str, Any]:
    """Write a table, and return the entries of its answer; without a file the table is the text."""
    if path is None:
        return {"data": csv_text(table)}
    write_file(path, csv_text(table))
    return {"text": f"{said} written to {path}", "written": (path,)}


def written_to(
    folder: Path | None, *, tables: str = "the plan, its tables", what: str = "it step by step"
) -> str:
    """Describe the folder and its page, or how to request one; ``what``: that the page shows."""
    if folder is None:
        return f"--out DIR writes {tables} and a page that shows {what}"
    return f"written to {folder}; {folder / PAGE} shows {what}"


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
