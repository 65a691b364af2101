"""How far a computation is, how long it will still take, and what ends it early."""

from __future__ import annotations

import _thread
import math
import signal
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import TypeAlias, TypeVar

from seqopt.errors import TimeUpError

_QUIET = 1.0  # s after which a computation says how far it is
_PAUSE = 0.2  # s between two lines of that

Tell: TypeAlias = Callable[[object], object]  # called with the progress, in words or as a `Stage`
_Item = TypeVar("_Item")


@dataclass(frozen=True)
class Stage:
    """How far one stage of a computation is.

    Attributes
    ----------
    what : str
        What is being done, in a few words.
    share : float
        How much of it is done, from 0 to 1.
    left : float or None
        Estimated time left, s; None if the work itself has no estimate.

    Examples
    --------
    >>> print(Stage("responses", 0.25, 12.0))
    responses: 25 %, 12 s left
    """

    what: str
    share: float
    left: float | None = None

    def __str__(self) -> str:
        said = f"{self.what}: {100 * self.share:.0f} %"
        return said if self.left is None else f"{said}, {duration(self.left)} left"


class Progress:
    """Reports a computation as a `Stage` once it takes longer than `_QUIET`.

    Parameters
    ----------
    what : str
        What is computed.
    total : float
        How much work that is, in any unit.
    tell : callable, optional
        Called with a `Stage`, whose text is a line.
    """

    def __init__(self, what: str, total: float, tell: Tell | None) -> None:
        self._what, self._total, self._tell = what, max(total, 1e-300), tell
        self._start = self._told = time.perf_counter()
        self._done = 0.0

    def add(self, work: float) -> None:
        """Say that some work is done, in the unit of the total."""
        self._done += work
        now = time.perf_counter()
        if self._tell is None or now - self._start < _QUIET or now - self._told < _PAUSE:
            return
        self._told = now
        share = min(self._done / self._total, 1.0)
        left = (now - self._start) * (1 - share) / max(share, 1e-9)
        self._tell(Stage(self._what, share, left))


def with_progress(what: str, items: Collection[_Item], tell: Tell | None) -> Iterator[_Item]:
    """Yield items one after the other, and report a `Stage` before the work on each.

    Examples
    --------
    >>> [item for item in with_progress("steps", [4, 7], print)]
    steps: 0 %
    steps: 50 %
    [4, 7]
    """
    for done, item in enumerate(items):
        if tell is not None:
            tell(Stage(what, done / len(items)))
        yield item


def duration(seconds: float) -> str:
    """Return a time in words.

    Examples
    --------
    >>> duration(12.3), duration(600), duration(9000)
    ('12 s', '10 min', '2.5 h')
    """
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


_ENDS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)


@contextmanager
def answered(told: Callable[[], object]) -> Iterator[None]:
    """Answer the first termination signal by a call; a second one is handled as before.

    Signals with foreign handlers are left to these. The call runs between two instructions of the
    main thread, and should only set a flag.
    """
    mine = threading.current_thread() is threading.main_thread()
    numbers = [n for n in _ENDS if mine and signal.getsignal(n) is signal.default_int_handler]

    def give_back() -> None:
        for number in numbers:
            signal.signal(number, signal.default_int_handler)

    def note(_: int, __: FrameType | None) -> None:
        give_back()
        told()

    try:
        for number in numbers:
            signal.signal(number, note)
        yield
    finally:
        give_back()


def interrupt_main() -> None:
    """Interrupt the main thread like ctrl-C, from any other thread, also while it waits."""
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main:
        signal.pthread_kill(main, signal.SIGINT)
    else:
        _thread.interrupt_main()


@contextmanager
def ending(seconds: float) -> Iterator[None]:
    """Raise `TimeoutError` between two instructions of a block that exceeds its time limit.

    In the main thread only; in others there is no limit.
    """
    if seconds <= 0:
        raise TimeoutError
    if math.isinf(seconds) or threading.current_thread() is not threading.main_thread():
        yield
        return
    over, before = threading.Event(), signal.getsignal(signal.SIGINT)

    def end() -> None:
        over.set()
        interrupt_main()

    def end_only(*_: object) -> None:
        if over.is_set():
            raise KeyboardInterrupt

    timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), end)
    timer.daemon = True
    if before == signal.SIG_IGN:  # as in a background job, where only the end is heard
        signal.signal(signal.SIGINT, end_only)
    try:
        timer.start()
        yield
        timer.cancel()
        timer.join()  # an end that is on its way comes now, and not later
    except KeyboardInterrupt:
        if not over.is_set():
            raise
        raise TimeoutError from None
    finally:
        if before == signal.SIG_IGN:
            signal.signal(signal.SIGINT, before)
        timer.cancel()


_Result = TypeVar("_Result")
GRACE = 1.0  # s by which work may be late that is nearly done
TIME, INTERRUPT = "time", "interrupt"  # why something ended early


class Clock:
    """How much time posing, search and proof have in all.

    Searches ask for what is ``left``. Other work is ended from outside, `GRACE` after that.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self._end = time.perf_counter() + seconds

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

    def tried(self, work: Callable[[], _Result]) -> tuple[_Result | None, str]:
        """Return what some work finds, or None and why it ended early: `TIME` or `INTERRUPT`."""
        try:
            with ending(self._end + GRACE - time.perf_counter()):
                return work(), ""
        except TimeoutError:
            return None, TIME
        except KeyboardInterrupt:
            return None, INTERRUPT
