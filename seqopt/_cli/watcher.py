"""Progress of a command on the terminal: one line, cleared when it is done."""

from __future__ import annotations

import sys
import threading
import time
from contextlib import suppress

from seqopt._cli.terminal import columns, harmless, is_terminal
from seqopt.work.progress import Stage, duration

PATIENCE = 1.0  # s for which a command says nothing
TICK = 0.5  # s between two looks at the clock
WIDE = 20  # of a bar
TAIL = ": 100 % |12345678901234567890| about 100 min left "  # beside which words have to find room


class Watcher:
    """Shows the stage, progress and remaining time of a command on standard error.

    A stage of known share has a bar and the remaining time, any other the elapsed time. Nothing is
    shown unless standard error is a terminal or that of a notebook, nor in the first second.

    >>> with Watcher() as tell:  # of a test standard error is no terminal
    ...     tell("looking")
    """

    def __init__(self, *, shows: bool = True) -> None:
        self._notebook = hasattr(sys.stderr, "pub_thread")  # every refresh is kept in its file
        self._shows = shows and (is_terminal(sys.stderr) or self._notebook)
        self._start = self._told = time.perf_counter()
        self._began: dict[str, tuple[float, float]] = {}  # of each stage, and its last share
        self._stage = Stage("working", -1.0)  # no share is below zero
        self._wide = 0  # what is shown, in columns
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._clock = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Watcher:
        if self._shows:
            self._clock.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Clear the line, also where an error or an interrupt ends the command."""
        self._over.set()
        self._shows = False
        if self._lock.acquire(timeout=TICK):  # an interrupt may have met whoever has it
            if self._wide:
                self._put("")
                self._put("")  # back at the begin of the line
            self._lock.release()

    def __call__(self, told: object) -> None:
        """Record the current stage with its share, or in words."""
        if not self._shows:
            return
        with self._lock:
            new = told if isinstance(told, Stage) else Stage(str(told), -1.0)
            began, share = self._began.get(new.what, (time.perf_counter(), 0.0))
            if new.share < share:  # it begins anew
                began = time.perf_counter()
            if new.share >= 0:
                self._began[new.what] = began, new.share
            self._stage, self._told = new, time.perf_counter()
            if not self._notebook:
                self._show()

    def _tick(self) -> None:
        """Refresh the line periodically: a stage may not report for long."""
        while not self._over.wait(TICK):
            with self._lock:
                self._show()

    def _show(self) -> None:
        """Show the stage, from a second after the start of the command on."""
        now = time.perf_counter()
        if self._over.is_set() or now - self._start < PATIENCE:
            return
        stage, left = self._stage, self._left(now)
        what = harmless(stage.what)
        if stage.share > 0 and left > 0:
            share = min(stage.share, 1.0)
            bar = "#" * round(WIDE * share)
            about = f"about {duration(max(left, 1.0))} left"
            what = what[: columns() - len(TAIL)]
            self._put(f"{what}: {100 * share:3.0f} % |{bar:{WIDE}}| {about}")
        else:
            what = what[: columns() - 24]
            self._put(f"{what} … {duration(now - self._start)} so far")

    def _put(self, line: str) -> None:
        """Show a line in the place of the one before."""
        with suppress(OSError, ValueError):  # nobody looks any more
            sys.stderr.write(f"\r{line:{self._wide}}")
            sys.stderr.flush()
        self._wide = len(line)

    def _left(self, now: float) -> float:
        """Return the remaining time of the stage, s; zero if it is not known."""
        stage = self._stage
        if stage.left is not None:
            return stage.left - (now - self._told)
        took = now - self._began[stage.what][0] if stage.share > 0 else 0.0
        return took * (1 - stage.share) / max(stage.share, 1e-9)
