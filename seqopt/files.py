"""Reading and writing files so that nothing is left half-written."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pandas as pd

from seqopt.errors import FileError


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file.

    Parameters
    ----------
    path : pathlib.Path

    Returns
    -------
    str

    Raises
    ------
    FileError
        If the file cannot be read, or is not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise FileError(f"cannot read {path}: {reason}; name a readable file") from error


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 file whole: it appears under its name only once complete.

    Parameters
    ----------
    path : pathlib.Path
    text : str

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_bytes(path, text.encode())


def csv_text(table: pd.DataFrame) -> str:
    """Return a table as CSV, without its index, numbers with six digits.

    Parameters
    ----------
    table : pandas.DataFrame

    Returns
    -------
    str
        A line per row, after one with the names of the columns.
    """
    return str(table.to_csv(index=False, float_format="%.6g", lineterminator="\n"))


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """Write a table as a CSV file, whole.

    Parameters
    ----------
    path : pathlib.Path
    table : pandas.DataFrame
        Written as `csv_text` does.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_text(path, csv_text(table))


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole: it appears under its name only once complete.

    Parameters
    ----------
    path : pathlib.Path
    content : bytes

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
            Path(name).chmod(0o666 & ~_umask())
            Path(name).replace(path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror}; name a writable file") from error


def make_folder(path: Path) -> None:
    """Make a folder, and those above it, unless it is there.

    Parameters
    ----------
    path : pathlib.Path

    Raises
    ------
    FileError
        If the folder cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"cannot make folder {path}: {error.strerror}; name another") from error


def _umask() -> int:
    """Return the mask that an ordinary new file would get (a temporary one is private)."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
