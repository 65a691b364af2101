"""How text is laid out for people: the width of the terminal, wrapped lines, color."""

from __future__ import annotations

import os
import shutil
import textwrap
from typing import TextIO

NARROWEST, WIDEST = 40, 100  # columns that text is wrapped to
STYLES = {"heading": "1", "bad": "1;31", "doubt": "33"}  # of terminals: bold, bold red, yellow


def columns() -> int:
    """Return how many columns text may take: those of the terminal, 80 where there is none.

    Result: ``COLUMNS`` of the environment wins; no less than 40 and no more than 100.
    """
    return min(max(shutil.get_terminal_size((80, 24)).columns, NARROWEST), WIDEST)


def wrapped(text: str, width: int | None = None, first: str = "", rest: str | None = None) -> str:
    """Return a text as lines that fit the terminal.

    ``width``: columns; those of the terminal by default; ``first``, ``rest``: what the first line
    and all others begin with; the latter by default blanks as wide as the former. Result: words
    longer than a line, as paths, stay whole.

    Examples
    --------
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
    """Return whether a person looks at a stream."""
    try:
        return stream is not None and stream.isatty()
    except ValueError:  # it is closed
        return False


def colored(stream: TextIO | None) -> bool:
    """Return whether a stream takes colors.

    Result: not where ``NO_COLOR`` is set in the environment; where ``FORCE_COLOR`` is; else if it
    is a terminal that can.
    """
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return stream is not None
    return is_terminal(stream) and os.environ.get("TERM") != "dumb"


def painted(text: str, style: str, stream: TextIO | None) -> str:
    r"""Return text in a style where a stream takes colors, else as it is.

    ``style``: a key of `STYLES`; ``stream``: to which it will be written.

    Examples
    --------
    >>> painted("unsafe", "bad", None)
    'unsafe'
    """
    return f"\033[{STYLES[style]}m{text}\033[0m" if colored(stream) else text
