"""How far a computation is, and how long it will still take."""

from __future__ import annotations

import time
from collections.abc import Callable

QUIET = 1.0  # s after which a computation says how far it is
PAUSE = 0.2  # s between two lines of that


class Progress:
    """How far a computation is, told in a few words once it takes longer than `QUIET`.

    Parameters
    ----------
    what : str
        What is computed.
    total : float
        How much work that is, in any unit.
    tell : callable, optional
        Told a line; by default nobody is.
    """

    def __init__(self, what: str, total: float, tell: Callable[[str], None] | None) -> None:
        self._what, self._total, self._tell = what, max(total, 1e-300), tell
        self._start = self._told = time.perf_counter()
        self._done = 0.0

    def add(self, work: float) -> None:
        """Say that some work is done.

        Parameters
        ----------
        work : float
            In the unit of the total.
        """
        self._done += work
        now = time.perf_counter()
        if self._tell is None or now - self._start < QUIET or now - self._told < PAUSE:
            return
        self._told = now
        share = min(self._done / self._total, 1.0)
        left = (now - self._start) * (1 - share) / max(share, 1e-9)
        self._tell(f"{self._what}: {100 * share:.0f} %, {_duration(left)} left")


def _duration(seconds: float) -> str:
    """Return a time in words."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
