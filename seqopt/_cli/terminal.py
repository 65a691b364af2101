"""Terminal output of commands, also where streams are closed.

Results go to standard output, everything else a line each to standard error, wrapped on a terminal.
Names come from foreign files: control characters are escaped.
"""

from __future__ import annotations

import os
import shutil
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from seqopt._registry import Later
from seqopt.errors import FileError, PluginWarning, SceneWarning

NUMPY = Later("numpy")  # 50 ms
CHECKS = Later("seqopt.scene._checks")  # 300 ms: names of others come with scenes

NARROWEST, WIDEST = 40, 100  # columns that text is wrapped to
CLEAR = "\r\033[K"  # of a terminal: the line it is on
LONGEST = 2000  # characters of a line on standard error


def columns() -> int:
    """Return the width of text in columns: of ``COLUMNS`` or the terminal, else 80."""
    return min(max(shutil.get_terminal_size((80, 24)).columns, NARROWEST), WIDEST)


def wrapped(text: str, width: int | None = None, first: str = "", rest: str | None = None) -> str:
    """Wrap a text to the terminal; words longer than a line stay whole.

    ``first``, ``rest``: prefixes of the first line and of all others; the latter by default blanks
    of the same width.

    >>> print(wrapped("one two three four", 12, "- "))
    - one two
      three four
    """
    return textwrap.fill(
        text,
        columns() if width is None else width,
        initial_indent=first,
        subsequent_indent=" " * len(first) if rest is None else rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


def is_terminal(stream: TextIO | None) -> bool:
    """Return whether a stream is a terminal."""
    try:
        return stream is not None and stream.isatty()
    except ValueError:  # it is closed
        return False


def harmless(text: str, kept: str = "") -> str:
    r"""Return text with control characters escaped, except those in ``kept``.

    >>> harmless("rob" + chr(27) + "[2J")
    'rob\\x1b[2J'
    """
    if text.translate(dict.fromkeys(map(ord, kept))).isprintable():
        return text
    return "".join(
        repr(sign)[1:-1] if sign not in kept and CHECKS.steers(sign) else sign for sign in text
    )


def show(text: str) -> None:
    """Write a result, newline included, to standard output; raise `FileError` if that is closed."""
    if sys.stdout is None:
        raise FileError("standard output is closed, and there is a result to write; open it")
    sys.stdout.write(harmless(text, "\n\t"))


def show_text(text: str) -> None:
    """Write lines to standard output, wrapped on a terminal; else as `show`."""
    if is_terminal(sys.stdout):
        fits = columns()
        lines = (wrapped(x, rest="  ") if len(x) > fits else x for x in text.split("\n"))
        text = "\n".join(lines)
    show(text + "\n")


def complain(text: str) -> None:
    """Print a line on standard error; ignore a closed or full one."""
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 2]} … {text[-LONGEST // 4 :]}"
    text = harmless(text)
    try:
        if sys.stderr is not None:
            watched = is_terminal(sys.stderr)
            text = wrapped(text, rest="  ") if watched else text
            print(CLEAR * watched + text, file=sys.stderr, flush=True)
    except OSError:
        silence(sys.stderr)


def flush() -> None:
    """Flush standard output."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        silence(sys.stdout)
        raise


def silence(stream: TextIO) -> None:
    """Redirect a failed stream to the null device, so that the interpreter exits without errors."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@contextmanager
def quiet_numbers(*, quiet: bool = False) -> Iterator[None]:
    """Print warnings about scenes and plug-ins, a line each; none if ``quiet``.

    NumPy's warnings are ignored: values that are not finite raise errors of their own.
    """
    with warnings.catch_warnings(), NUMPY.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)
        for kind in (SceneWarning, PluginWarning):
            warnings.simplefilter("ignore" if quiet else "always", kind)
        otherwise = warnings.showwarning
        said: set[str] = set()  # pandas makes Python forget what it has warned of

        def show_warning(message: Warning | str, category: type[Warning], *rest: Any) -> None:
            if issubclass(category, SceneWarning | PluginWarning):
                if str(message) not in said:
                    complain(f"seqopt: warning: {message}")
                said.add(str(message))
            else:
                otherwise(message, category, *rest)

        shown: Callable[..., None] = show_warning
        warnings.showwarning = shown
        yield
