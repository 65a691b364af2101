"""One function over many tasks; results in their order.

The number of tasks under way is limited, so that neither they nor their results pile up. What a
task raises is raised for the first task that does, as in a loop.

Workers are processes of our own, each with a queue of its own, or an executor of the caller. Our
own end with the one that started them, however that ends.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
import traceback
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from itertools import islice
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from seqopt.errors import WorkerError, message_of

_MEMORY = Path("/proc/meminfo")
_OWN = Path("/proc/self/statm")
_GROUPS = (
    ("memory.max", "memory.current"),
    ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"),
)  # what a container may have, and has


def free_memory() -> float:
    """Return how many bytes can still be had, infinite where the system does not say."""
    free = math.inf
    if _MEMORY.exists():
        rows = (line.split() for line in _MEMORY.read_text(encoding="ascii").splitlines())
        free = next((1024.0 * int(row[1]) for row in rows if row[0] == "MemAvailable:"), free)
    for names in _GROUPS:
        with suppress(OSError, ValueError):  # not there, or "max"
            limit, used = (Path("/sys/fs/cgroup", name).read_text("ascii") for name in names)
            free = min(free, float(limit) - float(used))
            break
    if os.name == "posix":
        import resource  # noqa: PLC0415  # POSIX has it alone

        limit_of_own = resource.getrlimit(resource.RLIMIT_AS)[0]  # of addresses
        if limit_of_own != resource.RLIM_INFINITY:
            pages = int(_OWN.read_text("ascii").split()[0]) if _OWN.exists() else 0
            free = min(free, float(limit_of_own - pages * resource.getpagesize()))
    return max(free, 0.0)


class Crew:
    """Workers that work on tasks: here those of an executor, which its caller ends.

    Parameters
    ----------
    executor : concurrent.futures.Executor
    workers : int
        How many tasks are worked on at once.
    """

    def __init__(self, executor: Executor, workers: int) -> None:
        self.executor, self.workers = executor, workers

    def submit(self, function: Callable[..., Any], *arguments: object) -> Future[Any]:
        """Submit a call of a function of a module, so that it can be sent to another process."""
        return self.executor.submit(function, *arguments)

    def drop(self, calls: Iterable[Future[Any]]) -> None:
        """Cancel calls whose answers are no longer needed."""
        for call in calls:
            call.cancel()

    def look_after(self) -> None:
        """See to it that a worker that has died does not keep the others waiting."""

    def replace(self) -> bool:
        """Replace workers that died; return whether there are workers again."""
        try:
            self.executor.submit(int)  # an executor's workers are its own matter
        except Exception:  # a broken foreign executor may raise any error
            return False
        return True


class _Processes(Crew):
    """Processes of our own: started when they are needed, replaced when they die.

    They end with the process that started them, however that ends.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._pool: ProcessPoolExecutor | None = None
        self._leash: Connection | None = None
        self._started: list[BaseProcess] = []

    def submit(self, function: Callable[..., Any], *arguments: object) -> Future[Any]:
        """Submit a call; a process that starts for it hears no interrupt, which is its master's."""
        if self._pool is None:
            context = multiprocessing.get_context("spawn")  # threads and fork do not go together
            end, self._leash = context.Pipe(duplex=False)
            self._pool = ProcessPoolExecutor(self.workers, context, _follow, (end,))
        children = multiprocessing.active_children()
        if os.name == "posix":
            before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            future = self._pool.submit(function, *arguments)  # it starts a process at a time
        finally:
            if os.name == "posix":
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
        self._started += [p for p in multiprocessing.active_children() if p not in children]
        return future

    def drop(self, calls: Iterable[Future[Any]]) -> None:
        """Leave calls to the pool, which cancels them when it ends.

        If its processes end before it has seen that a call was cancelled, its thread ends with an
        `InvalidStateError` (Python's issue gh-107219) and leaves other calls without an answer.
        """

    def look_after(self) -> None:
        """End all processes if one has died while it sent an answer.

        The rest of that answer would be waited for without end: others, and this process itself,
        keep open what it was sent through. Once they let go, the pool knows that it is broken.
        """
        if self._leash is None or all(process.is_alive() for process in self._started):
            return
        self._leash.close()
        results = getattr(self._pool, "_result_queue", None)  # there is no public way to it
        if writer := getattr(results, "_writer", None):
            writer.close()

    def replace(self) -> bool:
        """Take new processes for those that died."""
        self.end(now=True)
        return True

    def end(self, *, now: bool) -> None:
        """End the processes, at once or when all dispatched tasks are done; wait for it."""
        if self._leash is not None and now:
            self._leash.close()
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
        if self._leash is not None:
            self._leash.close()
        self._pool = self._leash = None
        self._started = []


def _follow(end: Connection) -> None:
    """Let a process of ours live no longer than its leash, and leave interrupts to its master."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # errors are sent; what dies is replaced
    warnings.simplefilter("ignore", RuntimeWarning)
    np.seterr(all="ignore")  # what is not finite is an error of its own

    def wait_and_end() -> None:
        with suppress(EOFError, OSError):
            end.recv()
        os._exit(1)

    threading.Thread(target=wait_and_end, daemon=True).start()


@contextmanager
def hire(executor: Executor | None = None, workers: int = 1) -> Iterator[Crew | None]:
    """Hire workers for the duration of a with block.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        Any; by default processes of our own.
    workers : int, optional
        How many processes, or how many tasks the executor works on at once if it does not say.

    Yields
    ------
    Crew or None
        None where there is but this process.
    """
    kept = _KEPT.get()
    if kept is not None:
        yield kept
    elif executor is not None:
        known = getattr(executor, "_max_workers", None)
        most = known if isinstance(known, int) else 16  # where it does not say
        yield Crew(executor, workers if workers > 1 else most)
    elif workers > 1:
        processes = _Processes(workers)
        try:
            yield processes
        except BaseException:
            processes.end(now=True)
            raise
        processes.end(now=False)
    else:
        yield None


_KEPT: ContextVar[Crew | None] = ContextVar("_KEPT", default=None)


@contextmanager
def keep(executor: Executor | None = None, workers: int = 1) -> Iterator[None]:
    """Hire workers once for all who `hire` some within a with block."""
    with hire(executor, workers) as crew:
        before = _KEPT.set(crew)
        try:
            yield
        finally:
            _KEPT.reset(before)


_Task = TypeVar("_Task")
_Result = TypeVar("_Result")
_UNDER_WAY = 4  # tasks dispatched or queued, for every worker
_PATIENCE = 1.0  # s without an answer, after which workers are looked after
_FAILURES = 3  # times in a row that workers may end without any answer


def map_ordered(
    function: Callable[[_Task], _Result],
    tasks: Iterable[_Task],
    crew: Crew | None = None,
    done: Callable[[_Task, _Result], None] | None = None,
) -> Generator[_Result, None, None]:
    """Return what a function makes of every task, in their order.

    Parameters
    ----------
    function : callable
        Takes a task; of a module, or a `functools.partial` of such a one.
    tasks : iterable
        Taken as they are needed.
    crew : Crew, optional
        From `hire`; by default this process.
    done : callable, optional
        Called with every task and its result, as soon as there is one.

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
    >>> from seqopt.work._workers import hire
    >>> with hire(workers=1) as crew:
    ...     list(map_ordered(abs, [-3, 2], crew))
    [3, 2]
    """
    if crew is not None:
        yield from _Course(function, crew, done).run(iter(tasks))
        return
    for task in tasks:
        result = function(task)
        if done is not None:
            done(task, result)
        yield result


@dataclass(eq=False, repr=False)
class _Course(Generic[_Task, _Result]):
    """Tasks that wait, that run, and results that are ready."""

    function: Callable[[_Task], _Result]
    crew: Crew
    done: Callable[[_Task, _Result], None] | None
    waiting: dict[int, _Task] = field(default_factory=dict)  # to be dispatched
    running: dict[Future[Any], tuple[int, _Task]] = field(default_factory=dict)
    ready: dict[int, tuple[bool, Any]] = field(default_factory=dict)
    failures: int = 0

    def run(self, tasks: Iterator[_Task]) -> Iterator[_Result]:
        """Yield the results in order."""
        taken = given = 0
        more = True
        try:
            while more or taken < given:
                room = _UNDER_WAY * self.crew.workers - (given - taken)
                new = [*islice(tasks, room)]
                more = more and len(new) == room
                self.waiting |= enumerate(new, given)
                given += len(new)
                self._give_out()
                if taken not in self.ready and taken < given:
                    self._collect()
                while taken in self.ready:
                    fine, result = self.ready.pop(taken)
                    taken += 1
                    if not fine:
                        raise result
                    yield result
        finally:
            self.crew.drop(self.running)

    def _give_out(self) -> None:
        for number in sorted(self.waiting):
            task = self.waiting[number]
            try:
                future = self.crew.submit(_attempt, self.function, task)
            except Exception as error:  # foreign code may raise any error
                self._failed(error)
                return
            self.running[future] = number, self.waiting.pop(number)

    def _collect(self) -> None:
        """Wait for at least one answer; tasks whose workers died wait again."""
        failure: BaseException | None = None
        if not self.running:  # nothing could be dispatched
            return
        while not (ended := wait(self.running, _PATIENCE, FIRST_COMPLETED).done):
            self.crew.look_after()
        for future in ended:
            number, task = self.running.pop(future)
            try:
                fine, result = future.result()
            except Exception as error:  # the work itself raises nothing: its worker is gone
                failure = error
                self.waiting[number] = task
                continue
            self.failures = 0
            self.ready[number] = fine, result
            if fine and self.done is not None:
                self.done(task, result)
        if failure is not None:
            self._failed(failure)

    def _failed(self, error: BaseException) -> None:
        """Replace workers that died, unless there are none any more."""
        self.failures += 1
        if self.failures <= _FAILURES and self.crew.replace():
            ended = [call for call in self.running if call.done()]
            lost = [call for call in ended if call.cancelled() or call.exception() is not None]
            self.waiting |= dict(self.running.pop(call) for call in lost)
            return
        said = message_of(error).rstrip(": ")
        raise WorkerError(
            f"workers ended {self.failures} times without an answer ({said}); give another "
            "executor, or fewer workers where memory is short; a script starts under "
            'if __name__ == "__main__":'
        ) from error


def _attempt(function: Callable[[_Task], _Result], task: _Task) -> tuple[bool, _Result | Exception]:
    """Return a result, or the error in its place: what is raised beside tells of the worker."""
    try:
        return True, function(task)
    except Exception as error:  # raised again where the result is taken
        error.add_note(traceback.format_exc())
        return False, error
