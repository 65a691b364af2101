"""What a command says, and what it does where nobody can hear it.

Results go to standard output, everything else a line each to standard error. Names come from files
of others: what steers a terminal is written as its code.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

import numpy as np

from seqopt.errors import FileError, SceneWarning

STEERING = {  # what Unicode has to turn lines about, beside its controls
    *range(0x202A, 0x202F),
    *range(0x2066, 0x206A),
    0x2028,
    0x2029,
}


def harmless(text: str, kept: str = "") -> str:
    r"""Return text in which what steers a terminal is replaced by its code.

    Parameters
    ----------
    text : str
    kept : str, optional
        Controls that stay.

    Returns
    -------
    str

    Examples
    --------
    >>> harmless("rob" + chr(27) + "[2J")
    'rob\\x1b[2J'
    """
    return "".join(
        repr(sign)[1:-1] if sign not in kept and _steers(ord(sign)) else sign for sign in text
    )


def _steers(code: int) -> bool:
    return code < 0x20 or 0x7F <= code < 0xA0 or 0xD800 <= code < 0xE000 or code in STEERING


def say(text: str) -> None:
    """Print what was done; nothing is lost where nobody listens.

    Parameters
    ----------
    text : str
        A line or several.
    """
    if sys.stdout is not None:
        print(harmless(text, "\n"))


def show(text: str) -> None:
    """Write a result to standard output.

    Parameters
    ----------
    text : str
        With the end of its last line.

    Raises
    ------
    FileError
        If standard output is closed.
    """
    if sys.stdout is None:
        raise FileError("standard output is closed, and there is a result to write; open it")
    sys.stdout.write(harmless(text, "\n\t"))


def complain(text: str) -> None:
    """Print a line on standard error, or nothing where that is closed or full.

    Parameters
    ----------
    text : str
    """
    try:
        if sys.stderr is not None:
            print(harmless(text), file=sys.stderr, flush=True)
    except OSError:
        silence(sys.stderr)


def progress(stage: str) -> None:
    """Say what is being done where a person watches.

    Parameters
    ----------
    stage : str
        In a few words.
    """
    if sys.stderr is not None and sys.stderr.isatty():
        print(f"\r\033[K{harmless(stage)} …", end="\r", file=sys.stderr, flush=True)


def flush() -> None:
    """Write what standard output still holds back.

    Raises
    ------
    OSError
        If it cannot be written; what is left is given up.
    """
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        silence(sys.stdout)
        raise


def silence(stream: TextIO) -> None:
    """Let a stream that failed lead nowhere, so that the end of the program is quiet.

    Parameters
    ----------
    stream : file
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@contextmanager
def quiet_numbers() -> Iterator[None]:
    """Print warnings about a scene as a line each; what is not finite is an error of its own."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)
        warnings.simplefilter("always", SceneWarning)
        warnings.showwarning = _as_a_line(warnings.showwarning)
        yield


def _as_a_line(otherwise: Callable[..., None]) -> Callable[..., None]:
    def show_warning(message: Warning | str, category: type[Warning], *rest: Any) -> None:
        if issubclass(category, SceneWarning):
            complain(f"seqopt: warning: {message}")
        else:
            otherwise(message, category, *rest)

    return show_warning
