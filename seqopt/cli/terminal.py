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
from seqopt.scene.checks import steers

LONGEST = 2000  # characters of a line on standard error


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
    return "".join(repr(sign)[1:-1] if sign not in kept and steers(sign) else sign for sign in text)


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
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 2]} … {text[-LONGEST // 4 :]}"
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
        In a few words; empty once it is done.
    """
    if sys.stderr is not None and sys.stderr.isatty():
        text = f"{harmless(stage)} …" if stage else ""
        print(f"\r\033[K{text}", end="\r", file=sys.stderr, flush=True)


def tell(finding: object) -> None:
    """Say what a formulation has found so far where a person watches.

    Parameters
    ----------
    finding : seqopt.placement.watch.Finding
    """
    progress(str(finding))


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
