"""Entry points of installed packages, read once for as long as nothing is installed."""

from __future__ import annotations

import os
import sys
from functools import lru_cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points

_Places = tuple[tuple[str, int], ...]


def plugins(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name.

    Result: also of packages that were installed since Python started.

    Examples
    --------
    >>> sorted(plugins("seqopt.limit_analysis"))
    ['lp', 'socp']
    """
    return {entry.name: entry for entry in _read(_places()).select(group=group)}


def _places() -> _Places:
    """Return where packages lie and when something there last changed."""
    return tuple((place, _changed(place)) for place in sys.path)


def _changed(place: str) -> int:
    try:
        return os.stat(place).st_mtime_ns  # noqa: PTH116  # of a hundred places, in microseconds
    except OSError:
        return 0


@lru_cache(maxsize=1)
def _read(places: _Places) -> EntryPoints:  # noqa: ARG001  # what is read follows from them
    found: EntryPoints = entry_points()  # type: ignore[assignment]  # typed as of Python 3.9
    return found
