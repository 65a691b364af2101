"""Reading files, writing them atomically, and pages that a notebook or a browser shows."""

from __future__ import annotations

import json
import os
import stat
import tempfile
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from itertools import chain
from pathlib import Path
from typing import Any

from seqopt._registry import display
from seqopt.errors import FileError, SeqoptError

_LARGEST_INPUT = 64_000_000  # bytes; a scene of 100,000 bricks has 40 million
HIDDEN = ".seqopt-"  # start of the names of what is not complete yet


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file.

    Raises `FileError` if it cannot be read, is a pipe or device, is too large, or is not UTF-8.
    """
    with _told("read", path):
        return read_bytes(path).decode("utf-8-sig")  # spreadsheets start text with a mark


def read_bytes(path: Path) -> bytes:
    """Return the content of a file; as `read_text`."""
    with _told("read", path):
        if not stat.S_ISREG(Path(path).stat().st_mode):  # a pipe would be waited for
            raise FileError(f"cannot read {path}: it is not a regular file; name one")
        with Path(path).open("rb") as stream:
            content = stream.read(_LARGEST_INPUT + 1)
    if len(content) > _LARGEST_INPUT:
        most = _LARGEST_INPUT / 1e6
        raise FileError(f"cannot read {path}: it has more than {most:g} MB; name a smaller one")
    return content


_DEEPEST = 100  # lists and objects in each other
_MOST_VALUES = 10_000_000  # an empty list has two bytes in a file, and sixty in memory


def parse_json(text: str, where: str, error: type[SeqoptError] = FileError, **how: Any) -> Any:
    """Parse a JSON document; raise an ``error`` with one line for an invalid one.

    ``where``: its name in messages; ``how``: options of `json.loads`.
    """
    if sum(map(text.count, ",[{")) > _MOST_VALUES:
        raise error(f"{where}: it has more than {_MOST_VALUES:,} values; give fewer")
    deep = f"{where}: nested too deep; give {_DEEPEST} levels at most"
    try:
        document = json.loads(text, **how)
    except json.JSONDecodeError as wrong:
        raise error(f"{where}: not JSON, line {wrong.lineno}: {wrong.msg}") from None
    except RecursionError:
        raise error(deep) from None
    except SeqoptError:
        raise
    except ValueError:
        raise error(f"{where}: a number has too many digits; give fewer") from None
    level: list[Any] = [[document]]
    for _ in range(_DEEPEST + 1):
        inside = chain.from_iterable(x.values() if isinstance(x, dict) else x for x in level)
        level = [each for each in inside if isinstance(each, dict | list)]
    if level:
        raise error(deep)
    return document


def write_file(path: Path, content: bytes | str) -> None:
    """Write a file atomically, of bytes or UTF-8: it appears under its name only once complete.

    A link is followed to its target; an existing file keeps its mode. Raises `FileError` if it
    cannot be written, or the target is no regular file, as a device.
    """
    with _told("write", path):
        _put_all([(path, content)])


def make_folder(path: Path) -> None:
    """Create a folder and its parents, unless they exist. Raises `FileError`."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"cannot make folder {path}: {error.strerror}; name another") from error


@contextmanager
def _told(verb: str, path: Path) -> Iterator[None]:
    """Turn errors of reading or writing into a `FileError`. ``verb``: read or write."""
    try:
        yield
    except FileError:
        raise
    except (OSError, ValueError) as error:
        why = str(error)
        if isinstance(error, OSError):
            why = error.strerror or why
        elif isinstance(error, UnicodeEncodeError):
            why = f"{error.object[error.start]!r} in it is half a character"
        elif isinstance(error, UnicodeError):
            why = "it is not UTF-8 text"
        wanted = {"read": "readable", "write": "writable"}[verb]
        raise FileError(f"cannot {verb} {path}: {why}; name a {wanted} file") from error


def _stage(path: Path, content: bytes | str) -> tuple[Path, Path]:
    """Write content to a temporary file in the target's folder; return it and the target."""
    content = content.encode() if isinstance(content, str) else content
    target = Path(os.path.realpath(path))
    mask = os.umask(0)  # a new file gets it; a temporary one is private
    os.umask(mask)
    mode = 0o666 & ~mask
    if target.exists():
        if not target.is_file():
            what = "folder" if target.is_dir() else "device or pipe"
            raise FileError(f"cannot write {path}: it is a {what}; name a regular file")
        mode = stat.S_IMODE(target.stat().st_mode)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=HIDDEN)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        Path(name).chmod(mode)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return Path(name), target


def _put_all(files: Sequence[tuple[Path, bytes | str]]) -> None:
    """Write temporary files; then rename all to their targets."""
    staged: list[tuple[Path, Path]] = []
    try:
        for path, content in files:
            staged.append(_stage(path, content))
        for hidden, target in staged:
            hidden.replace(target)
    finally:
        for hidden, _ in staged:
            hidden.unlink(missing_ok=True)


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
        write_file(Path(path), self.text)
        return Path(path)

    def open(self, path: str | Path | None = None) -> Path:
        """Write the page to a file, or a temporary one, and show it in a browser."""
        written = self.save(path or Path(tempfile.mkdtemp(prefix="seqopt-")) / "report.html")
        webbrowser.open(written.resolve().as_uri())
        return written
