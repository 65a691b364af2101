"""What the words of the command line let a computation use."""

from __future__ import annotations

import argparse
import re

from seqopt.cli.words.values import LARGEST
from seqopt.errors import ProblemError
from seqopt.responses.resources import Resources
from seqopt.work.progress import Tell

SIZE = re.compile(r"([0-9]*\.?[0-9]+(?:e[0-9]+)?) *((?:[kmgt]i?)?b?)", re.IGNORECASE)
MOST_WORKERS = 1024


def parse_resources(options: argparse.Namespace, progress: Tell | None = None) -> Resources:
    """Return what a computation may use.

    ``options``: with ``workers``, ``cache`` and ``max_memory``; ``progress``: told how far it is.
    Raises `ProblemError` if a number is none that can be meant.
    """
    if not options.workers.isdecimal() or not 1 <= int(options.workers) <= MOST_WORKERS:
        raise ProblemError(
            f"--workers {options.workers}: give a whole number from 1 to {MOST_WORKERS}"
        )
    most = None if options.max_memory is None else parse_size(options.max_memory)
    return Resources(int(options.workers), None, options.cache, most, progress)


def parse_size(text: str) -> float:
    """Return a number of bytes.

    ``text``: as ``2GB``, ``500 MB`` or ``1.5GiB``; bytes without a unit. Raises `ProblemError` if
    it is none.

    Examples
    --------
    >>> parse_size("1.5GB")
    1500000000.0
    """
    found = SIZE.fullmatch(text.strip())
    if found is None or not 0 < float(found[1]) < LARGEST:
        raise ProblemError(f"--max-memory {text}: give a size, as 500MB or 2GB")
    unit = found[2].upper()
    power = "KMGT".find(unit[:1]) + 1 if unit[:1] in "KMGT" and unit[:1] else 0
    return float(found[1]) * float(1024 if "I" in unit else 1000) ** power
