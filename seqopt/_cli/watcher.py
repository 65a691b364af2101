"""Progress of a command on the terminal: one line, cleared when it is done."""

from __future__ import annotations

import sys
import threading
import time
from contextlib import suppress

from seqopt._cli.terminal import columns, harmless, is_terminal
from seqopt.work import Stage, duration

PATIENCE = 1.0  # s for which a command says nothing
TICK = 0.5  # s between two lines
CLEARED = 2.0  # s for which an end waits until the line is cleared
TAIL = 24  # columns beside the words of a stage


class Watcher:
    """Shows twice a second how far a command is, on standard error.

    A stage of known share has the remaining time, any other the elapsed time. Nothing is shown
    unless standard error is a terminal or that of a notebook, nor in the first second.

    >>> with Watcher() as tell:  # of a test standard error is no terminal
    ...     tell("looking")
    """

    def __init__(self, *, shows: bool = True) -> None:
        self._shows = shows and (is_terminal(sys.stderr) or hasattr(sys.stderr, "pub_thread"))
        self._start = self._reported = time.perf_counter()
        self._began: dict[str, tuple[float, float]] = {}  # of each stage, and its last share
        self._stage = Stage("working", -1.0)  # no share is below zero
        self._over = threading.Event()
        self._ticking = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Watcher:
        if self._shows:
            self._ticking.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Wait until the line is cleared, also where an error or an interrupt ends the command."""
        self._over.set()
        if self._shows:
            self._ticking.join(CLEARED)

    def __call__(self, stage: object) -> None:
        """Record the current stage with its share, or in words."""
        new = stage if isinstance(stage, Stage) else Stage(str(stage), -1.0)
        self._reported = time.perf_counter()
        began, share = self._began.get(new.what, (self._reported, 0.0))
        if new.share >= 0:  # it begins anew where it falls
            self._began[new.what] = began if new.share >= share else self._reported, new.share
        self._stage = new

    def line(self) -> str:
        """Return the line that says how far the command is."""
        now, stage, then = time.perf_counter(), self._stage, self._reported
        what, left = f"{harmless(stage.what)[: columns() - TAIL]} …", stage.left
        if left is None and stage.share > 0:
            left = (then - self._began[stage.what][0]) * (1 / stage.share - 1)
        if stage.share <= 0 or left is None or left <= now - then:
            return f"{what} {duration(now - self._start)} so far"
        share = 100 * min(stage.share, 1.0)
        return f"{what} {share:.0f} %, {duration(max(left - (now - then), 1.0))} left"

    def _tick(self) -> None:
        """Show the line now and then, and clear it in the end."""
        wide = 0
        while not self._over.wait(TICK):
            if time.perf_counter() - self._start >= PATIENCE:
                line = self.line()
                self._put(f"\r{line:{wide}}")
                wide = len(line)
        self._put(f"\r{'':{wide}}\r" * bool(wide))

    def _put(self, text: str) -> None:
        with suppress(OSError, ValueError):  # nobody looks any more
            sys.stderr.write(text)
            sys.stderr.flush()
