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
TAIL = 50  # columns beside the words of a stage, with a bar
SHORT = 24  # the same without one


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

    def __enter__(self) -> Watcher:
        if self._shows:
            threading.Thread(target=self._tick, daemon=True).start()
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
            self._told = time.perf_counter()
            began, share = self._began.get(new.what, (self._told, 0.0))
            if new.share >= 0:  # it begins anew where it falls
                self._began[new.what] = began if new.share >= share else self._told, new.share
            self._stage = new
            if not self._notebook:
                self._show()

    def _tick(self) -> None:
        """Refresh the line periodically: a stage may not report for long."""
        while not self._over.wait(TICK):
            with self._lock:
                self._show()

    def _show(self) -> None:
        """Show the stage, from a second after the start of the command on."""
        now, stage = time.perf_counter(), self._stage
        if self._over.is_set() or now - self._start < PATIENCE:
            return
        what, left = harmless(stage.what), 0.0
        if stage.left is not None:
            left = stage.left - (now - self._told)
        elif stage.share > 0:
            left = (now - self._began[stage.what][0]) * (1 / stage.share - 1)
        if stage.share > 0 and left > 0:
            share = min(stage.share, 1.0)
            about = f"about {duration(max(left, 1.0))} left"
            bar = "#" * round(WIDE * share)
            self._put(f"{what[: columns() - TAIL]}: {100 * share:3.0f} % |{bar:{WIDE}}| {about}")
        else:
            self._put(f"{what[: columns() - SHORT]} … {duration(now - self._start)} so far")

    def _put(self, line: str) -> None:
        """Show a line in the place of the one before."""
        with suppress(OSError, ValueError):  # nobody looks any more
            sys.stderr.write(f"\r{line:{self._wide}}")
            sys.stderr.flush()
        self._wide = len(line)
