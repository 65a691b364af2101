"""One function over many tasks; results in their order.

The number of tasks under way is limited, so that neither they nor their results pile up. What a
task raises is raised for the first task that does, as in a loop.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from seqopt.errors import WorkerError
from seqopt.work.crew import Crew

Task = TypeVar("Task")
Result = TypeVar("Result")
UNDER_WAY = 4  # tasks given out or waiting to be taken, for every worker
PATIENCE = 1.0  # s without an answer, after which workers are looked after
FAILURES = 3  # times in a row that workers may end without any answer
GUARD = 'if __name__ == "__main__":'


def map_ordered(
    function: Callable[[Task], Result],
    tasks: Iterable[Task],
    crew: Crew | None = None,
    known: Callable[[Task], Result | None] | None = None,
    done: Callable[[Task, Result], None] | None = None,
) -> Generator[Result, None, None]:
    """Return what a function makes of every task, in their order.

    Parameters
    ----------
    function : callable
        Takes a task; of a module, or a `functools.partial` of such a one.
    tasks : iterable
        Taken as they are needed.
    crew : Crew, optional
        From `hire`; by default this process.
    known : callable, optional
        Returns the result of a task that needs no work, or None.
    done : callable, optional
        Told here of every task and its result, as soon as there is one.

    Yields
    ------
    object
        The result of one task after the other.

    Raises
    ------
    WorkerError
        If workers end again and again, or an executor takes no more work.

    Examples
    --------
    >>> from seqopt.work.crew import hire
    >>> with hire(workers=1) as crew:
    ...     list(map_ordered(abs, [-3, 2], crew))
    [3, 2]
    """
    known = known or _unknown
    done = done or _nothing
    if crew is not None:
        yield from _Course(function, crew, known, done).run(iter(tasks))
        return
    for task in tasks:
        result = known(task)
        if result is None:
            result = function(task)
            done(task, result)
        yield result


@dataclass
class _Course(Generic[Task, Result]):
    """What was given out, what came back, and what is to be given out again."""

    function: Callable[[Task], Result]
    crew: Crew
    known: Callable[[Task], Result | None]
    done: Callable[[Task, Result], None]
    waiting: dict[int, Task] = field(default_factory=dict)  # to be given out
    running: dict[Future[Any], tuple[int, Task]] = field(default_factory=dict)
    ready: dict[int, tuple[bool, Any]] = field(default_factory=dict)
    failures: int = 0

    def run(self, tasks: Iterator[Task]) -> Iterator[Result]:
        """Yield the results in order."""
        taken = given = 0
        more = True
        try:
            while more or taken < given:
                while more and given - taken < UNDER_WAY * self.crew.workers:
                    more = self._take(given, tasks)
                    given += more
                if taken not in self.ready and taken < given:
                    self._give_out()
                    self._collect()
                while taken in self.ready:
                    fine, result = self.ready.pop(taken)
                    taken += 1
                    if not fine:
                        raise result
                    yield result
        finally:
            self.crew.drop(self.running)

    def _take(self, number: int, tasks: Iterator[Task]) -> bool:
        """Take the next task up, whose result may be known; return whether there was one."""
        for task in tasks:
            result = self.known(task)
            if result is None:
                self.waiting[number] = task
                self._give_out()
            else:
                self.ready[number] = True, result
            return True
        return False

    def _give_out(self) -> None:
        for number in sorted(self.waiting):
            task = self.waiting[number]
            try:
                future = self.crew.submit(_attempt, self.function, task)
            except Exception as error:  # whatever an executor of others may raise
                self._failed(error)
                return
            self.running[future] = number, self.waiting.pop(number)

    def _collect(self) -> None:
        """Wait for an answer at least; what came without one is to be given out again."""
        failure: BaseException | None = None
        for future in self._ended():
            number, task = self.running.pop(future)
            try:
                fine, result = future.result()
            except Exception as error:  # the work itself raises nothing: its worker is gone
                failure = error
                self.waiting[number] = task
                continue
            self.failures = 0
            self.ready[number] = fine, result
            if fine:
                self.done(task, result)
        if failure is not None:
            self._failed(failure)

    def _ended(self) -> set[Future[Any]]:
        """Wait until a call at least has ended."""
        while True:
            ended = wait(self.running, PATIENCE, FIRST_COMPLETED).done
            if ended:
                return ended
            self.crew.look_after()

    def _failed(self, error: BaseException) -> None:
        """Replace workers that died, unless there are none any more."""
        self.failures += 1
        if self.failures <= FAILURES and self.crew.replace(error):
            gone = [future for future in self.running if future.done() and _lost(future)]
            self.waiting |= dict(self.running.pop(future) for future in gone)
            return
        raise WorkerError(
            f"workers ended {self.failures} times without an answer ({_said(error)}); give another "
            f"executor, or fewer workers where memory is short; a script starts under {GUARD}"
        ) from error


def _attempt(function: Callable[[Task], Result], task: Task) -> tuple[bool, Result | Exception]:
    """Return a result, or the error in its place: what is raised beside tells of the worker."""
    try:
        return True, function(task)
    except Exception as error:  # raised again where the result is taken
        error.add_note(traceback.format_exc())
        return False, error


def _lost(future: Future[Any]) -> bool:
    """Return whether a call that ended did so without an answer."""
    return future.cancelled() or future.exception() is not None


def _unknown(task: object) -> None:
    """Know no result."""


def _nothing(*arguments: object) -> None:
    """Do nothing."""


def _said(error: BaseException) -> str:
    """Return what an error of others says, in a line."""
    return " ".join(f"{type(error).__name__}: {error}".split()).rstrip(": ")
