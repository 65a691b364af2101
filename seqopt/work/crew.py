"""Workers: processes of our own, or an executor of the caller."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from seqopt.work.lanes import Lanes
from seqopt.work.processes import Processes

UNKNOWN = 16  # workers of an executor that does not say how many it has


class Crew(Protocol):
    """Workers that work on tasks."""

    @property
    def workers(self) -> int:
        """How many tasks are worked on at once."""

    def submit(self, function: Callable[..., Any], *arguments: object) -> Future[Any]:
        """Give a call out.

        Parameters
        ----------
        function : callable
            Of a module, so that it can be sent to another process.
        *arguments : object

        Returns
        -------
        concurrent.futures.Future
        """

    def drop(self, calls: Iterable[Future[Any]]) -> None:
        """Let go of calls whose answers nobody waits for any more.

        Parameters
        ----------
        calls : iterable of concurrent.futures.Future
        """

    def look_after(self) -> None:
        """See to it that a worker that has died does not keep the others waiting."""

    def replace(self, error: BaseException) -> bool:
        """Take new workers for those that died.

        Parameters
        ----------
        error : BaseException
            What came in place of an answer.

        Returns
        -------
        bool
            Whether there are workers again.
        """


@dataclass(frozen=True)
class Given:
    """An executor of the caller, who also ends it.

    Parameters
    ----------
    executor : concurrent.futures.Executor
    workers : int
        How many tasks it works on at once.
    """

    executor: Executor
    workers: int

    def submit(self, function: Callable[..., Any], *arguments: object) -> Future[Any]:
        """Give a call out; see `Crew`."""
        return self.executor.submit(function, *arguments)

    def drop(self, calls: Iterable[Future[Any]]) -> None:
        """Cancel calls; see `Crew`."""
        for call in calls:
            call.cancel()

    def look_after(self) -> None:
        """Leave the workers to the executor; see `Crew`."""

    def replace(self, error: BaseException) -> bool:
        """Say whether the executor still takes work; its workers are its own matter."""
        try:
            self.executor.submit(_nothing)
        except Exception:  # whatever an executor of others may raise where it is broken
            return False
        return True


@contextmanager
def hire(
    executor: Executor | None = None, workers: int = 1, *, lanes: bool = False
) -> Iterator[Crew | None]:
    """Hire workers for the duration of a with block.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        Any; by default processes of our own.
    workers : int, optional
        How many processes, or how many tasks the executor works on at once if it does not say.
    lanes : bool, optional
        Whether tasks have a ``lane``: each process of our own then gets those of one.

    Yields
    ------
    Crew or None
        None where there is but this process.
    """
    if executor is not None:
        known = getattr(executor, "_max_workers", None)
        most = known if isinstance(known, int) else UNKNOWN
        yield Given(executor, workers if workers > 1 else most)
    elif workers > 1:
        processes = Lanes(workers) if lanes else Processes(workers)
        try:
            yield processes
        except BaseException:
            processes.end(now=True)
            raise
        processes.end(now=False)
    else:
        yield None


def _nothing(*arguments: object) -> None:
    """Do nothing."""
