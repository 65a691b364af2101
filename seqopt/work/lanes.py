"""Processes of our own, each with a queue of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Future
from typing import Any

from seqopt.work.processes import Processes


class Lanes:
    """Processes that get the tasks of one lane each; see `seqopt.work.crew.Crew`.

    For tasks of which neighbors share what a process prepares for one of them.

    Parameters
    ----------
    workers : int
        How many.
    """

    def __init__(self, workers: int) -> None:
        self._lanes = [Processes(1) for _ in range(workers)]

    @property
    def workers(self) -> int:
        """How many tasks are worked on at once."""
        return len(self._lanes)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Give a call out; see `Crew`.

        Parameters
        ----------
        function : callable
        *arguments : object
            The last one has a ``lane``.
        """
        lane: int = arguments[-1].lane
        return self._lanes[lane].submit(function, *arguments)

    def drop(self, calls: Iterable[Future[Any]]) -> None:
        """Leave calls to their processes; see `Crew`."""

    def look_after(self) -> None:
        """End processes if one has died while it sent an answer; see `Crew`."""
        for lane in self._lanes:
            lane.look_after()

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
        for lane in self._lanes:
            lane.end(now=now)
