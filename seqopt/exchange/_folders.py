"""Folders of files that are complete once they are there; outputs that are no inputs."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from seqopt._files import HIDDEN, _put_all, _told, make_folder
from seqopt.errors import FileError


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
