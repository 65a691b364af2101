"""How much time a command has in all, and what it left out for lack of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from seqopt._interrupts import ending
from seqopt.errors import TimeUpError

_Result = TypeVar("_Result")
GRACE = 1.0  # s by which work may be late that is nearly done
TIME, INTERRUPT = "time", "interrupt"  # why something ended early


class Clock:
    """How much time a piece of work has in all, and what it left out for lack of it.

    Parts of the work that can say what they have by then ask for what is ``left``. Others are ended
    from outside, `GRACE` after that; an interrupt ends that part alone in which it comes.

    ``left_out``: why, by what was left out: `TIME` or `INTERRUPT`; ``interrupted``: whether anybody
    asked for an end.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self._end = time.perf_counter() + seconds
        self.left_out: dict[str, str] = {}
        self.interrupted = False

    @property
    def left(self) -> float:
        """How much time is left, s; zero where it is over."""
        return max(0.0, self._end - time.perf_counter())

    @property
    def late(self) -> bool:
        """Whether what is done now would be ended at once."""
        return time.perf_counter() >= self._end + GRACE

    def why(self, stopped: str) -> str:
        """Return why a search says that it stopped; what it took for an interrupt was the clock."""
        return TIME if self.late and stopped == INTERRUPT else stopped

    @contextmanager
    def needed(self, what: str) -> Iterator[None]:
        """End a block in time without which there is no answer; `TimeUpError` says what it was."""
        try:
            with ending(self._end + GRACE - time.perf_counter()):
                yield
        except TimeoutError:
            raise TimeUpError(f"{what} takes longer; give more") from None

    def spare(self, what: str, work: Callable[[], _Result], otherwise: _Result) -> _Result:
        """Return what some work finds that can be left out, or where it ends early what else."""
        try:
            with ending(self._end + GRACE - time.perf_counter()):
                return work()
        except TimeoutError:
            self.left_out[what] = TIME
        except KeyboardInterrupt:
            self.left_out[what], self.interrupted = INTERRUPT, True
        return otherwise
