"""Interrupts: answered by callbacks, and raised by time limits."""

from __future__ import annotations

import _thread
import math
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

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
def _heard(over: threading.Event) -> Iterator[None]:
    """Handle termination signals where interrupts are ignored, as in a background job."""
    before = signal.getsignal(signal.SIGINT)

    def end_only(*_: object) -> None:
        if over.is_set():
            raise KeyboardInterrupt

    if before != signal.SIG_IGN:
        yield
        return
    signal.signal(signal.SIGINT, end_only)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


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
    over = threading.Event()

    def end() -> None:
        over.set()
        interrupt_main()

    timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), end)
    timer.daemon = True
    try:
        with _heard(over):
            timer.start()
            yield
            timer.cancel()
            timer.join()  # an end that is on its way comes now, and not later
    except KeyboardInterrupt:
        if not over.is_set():
            raise
        raise TimeoutError from None
    finally:
        timer.cancel()
