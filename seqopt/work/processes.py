"""Processes of our own, which end with the one that started them, however that ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import numpy as np


class Processes:
    """Processes of our own: started when they are needed, replaced when they die.

    They end with the process that started them, however that ends.

    Parameters
    ----------
    workers : int
        How many.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._pool: ProcessPoolExecutor | None = None
        self._leash: Connection | None = None
        self._started: list[BaseProcess] = []

    def submit(self, function: Callable[..., Any], *arguments: object) -> Future[Any]:
        """Give a call out; see `Crew`."""
        if self._pool is None:
            context = multiprocessing.get_context("spawn")  # threads and fork do not go together
            end, self._leash = context.Pipe(duplex=False)
            self._pool = ProcessPoolExecutor(self.workers, context, _follow, (end,))
        before = [] if self._started else multiprocessing.active_children()
        with _deaf():
            future = self._pool.submit(function, *arguments)
        if not self._started:
            self._started = [p for p in multiprocessing.active_children() if p not in before]
        return future

    def drop(self, calls: Iterable[Future[Any]]) -> None:
        """Leave calls to the pool, which cancels them when it ends; see `Crew`.

        If its processes end before it has seen that a call was cancelled, its thread ends with an
        `InvalidStateError` (Python's issue gh-107219) and leaves other calls without an answer.
        """

    def look_after(self) -> None:
        """End all processes if one has died while it sent an answer; see `Crew`.

        The rest of that answer would be waited for without end: others, and this process itself,
        keep open what it was sent through. Once they let go, the pool knows that it is broken.
        """
        if self._leash is None or all(process.is_alive() for process in self._started):
            return
        self._leash.close()
        results = getattr(self._pool, "_result_queue", None)  # there is no public way to it
        writer = getattr(results, "_writer", None)
        if writer is not None:
            writer.close()

    def replace(self, error: BaseException) -> bool:
        """Take new processes for those that died; see `Crew`.

        Returns
        -------
        bool
            True.
        """
        self.end(now=True)
        return True

    def end(self, *, now: bool) -> None:
        """End the processes, and wait for their end.

        Parameters
        ----------
        now : bool
            Whether at once, or when all that was given out is done.
        """
        if self._leash is not None and now:
            self._leash.close()
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
        if self._leash is not None and not now:
            self._leash.close()
        self._pool = self._leash = None
        self._started = []


@contextmanager
def _deaf() -> Iterator[None]:
    """Let processes that start here hear no interrupt: it is their master's."""
    if os.name != "posix":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _follow(end: Connection) -> None:
    """Let a process of ours live no longer than its leash, and leave interrupts to its master."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # errors are sent; what dies is replaced
    warnings.simplefilter("ignore", RuntimeWarning)
    np.seterr(all="ignore")  # what is not finite is an error of its own
    threading.Thread(target=_wait_and_end, args=(end,), daemon=True).start()


def _wait_and_end(end: Connection) -> None:
    with suppress(EOFError, OSError):
        end.recv()
    os._exit(1)
