"""One function over many tasks; results in their order; and threads of linear algebra.

The number of tasks under way is limited, so that neither they nor their results pile up. What a
task raises is raised for the first task that does, as in a loop.

Workers are processes of our own or an executor of the caller. Our own end with the one that started
them, however that ends. One that dies ends the computation: it lacked memory, and so would another.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
import traceback
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from contextlib import AbstractContextManager, contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from itertools import islice
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.linalg import blas, lapack
from threadpoolctl import ThreadpoolController

from seqopt.errors import MemoryShortError, WorkerError, message_of

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")
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


_BUFFERS = 100e6  # bytes; taken at once: OpenBLAS waits without end for buffers it does not get


def one_thread() -> AbstractContextManager[object]:
    """Return a context in which BLAS uses one thread; on leaving, it uses as many as before.

    The matrices of a partial structure are small enough for one core. Threads that share them spend
    their time waiting, without end where another process wants the second core. Entered for a whole
    operator or pass of grip sets, it costs some 10 µs.
    """
    limited: AbstractContextManager[object] = _libraries().limit(limits=1, user_api="blas")
    return limited


@cache
def cores() -> int:
    """Return on how many cores this process may work: one where it is one of several workers."""
    if parent_process() is not None:
        return 1
    known = getattr(os, "sched_getaffinity", None)  # not everywhere
    return len(known(0)) if known else os.cpu_count() or 1


def in_threads(function: Callable[[_Task], _Result], tasks: Sequence[_Task]) -> list[_Result]:
    """Return what a function that leaves Python's lock alone makes of tasks, one a thread."""
    first, *others = tasks
    if not others:
        return [function(first)]
    with ThreadPoolExecutor(len(others)) as pool:
        found = pool.map(function, others)  # begun at once
        return [function(first), *found]


@cache
def _libraries() -> ThreadpoolController:
    """Return the handle to the linear algebra of the process; finding it takes milliseconds."""
    free = free_memory()
    if free < _BUFFERS:
        raise MemoryShortError(
            f"linear algebra takes buffers of {_BUFFERS / 1e6:.0f} MB, and {free / 1e6:.0f} MB are "
            "free; raise the limit"
        )
    found = ThreadpoolController()
    with found.limit(limits=1, user_api="blas"):
        some = np.eye(200)  # large enough for its product and factors to need them
        _ = some @ some, np.linalg.inv(some)  # of NumPy's library, and
        _ = blas.dgemm(1.0, some, some), lapack.dgetrf(some)  # of SciPy's
    return found


class _Processes(ProcessPoolExecutor):
    """Processes of our own: started when they are needed, ended with the one that started them."""

    def __init__(self, workers: int) -> None:
        context = multiprocessing.get_context("spawn")  # threads and fork do not go together
        end, self.leash = context.Pipe(duplex=False)
        super().__init__(workers, context, _follow, (end,))

    def submit(self, function: Callable[..., Any], /, *tasks: object, **named: Any) -> Future[Any]:
        """Submit a call; a process that starts for it hears no interrupt, which is its master's."""
        if os.name != "posix":
            return super().submit(function, *tasks, **named)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(function, *tasks, **named)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def look_after(self) -> None:
        """End all processes if one has died while it sent an answer.

        The rest of that answer would be waited for without end: others, and this process itself,
        keep open what it was sent through. Once they let go, the pool knows that it is broken.
        """
        started: dict[int, Any] = getattr(self, "_processes", None) or {}
        if all(process.is_alive() for process in [*started.values()]):
            return
        self.leash.close()
        results = getattr(self, "_result_queue", None)  # there is no public way to it
        if writer := getattr(results, "_writer", None):
            writer.close()


def _follow(end: Connection) -> None:
    """Let a process of ours live no longer than its leash, and leave interrupts to its master."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # errors are sent
    warnings.simplefilter("ignore", RuntimeWarning)
    np.seterr(all="ignore")  # what is not finite is an error of its own

    def wait_and_end() -> None:
        with suppress(EOFError, OSError):
            end.recv()
        os._exit(1)

    threading.Thread(target=wait_and_end, daemon=True).start()


class Crew(NamedTuple):
    """Workers that are hired.

    Attributes
    ----------
    executor : concurrent.futures.Executor
    workers : int
        How many tasks it works on at once.
    """

    executor: Executor
    workers: int


_KEPT: ContextVar[Crew | None] = ContextVar("_KEPT", default=None)


@contextmanager
def hire(executor: Executor | None = None, workers: int = 1) -> Iterator[Crew | None]:
    """Hire workers for the duration of a with block.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        Any, which its caller ends; by default processes of our own.
    workers : int, optional
        How many processes, or how many tasks the executor works on at once if it does not say.

    Yields
    ------
    Crew or None
        None where there is but this process.
    """
    kept = _KEPT.get()
    if kept is not None or (executor is None and workers == 1):
        yield kept
        return
    if executor is not None:
        known = getattr(executor, "_max_workers", None)
        most = known if isinstance(known, int) else 16  # where it does not say
        yield Crew(executor, workers if workers > 1 else most)
        return
    processes = _Processes(workers)
    try:
        yield Crew(processes, workers)
    except BaseException:
        processes.leash.close()  # at once; else when all that is under way is done
        raise
    finally:
        processes.shutdown(wait=True, cancel_futures=True)
        processes.leash.close()


@contextmanager
def keep(executor: Executor | None = None, workers: int = 1) -> Iterator[None]:
    """Hire workers once for all who `hire` some within a with block."""
    with hire(executor, workers) as crew:
        before = _KEPT.set(crew)
        try:
            yield
        finally:
            _KEPT.reset(before)


_UNDER_WAY = 4  # tasks dispatched or answered but not taken, for every worker
_PATIENCE = 1.0  # s without an answer, after which workers are looked after


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
        If a worker ends without an answer, or an executor takes no more work.

    Examples
    --------
    >>> from seqopt.work._workers import hire
    >>> with hire(workers=1) as crew:
    ...     list(map_ordered(abs, [-3, 2], crew))
    [3, 2]
    """
    if crew is not None:
        yield from _map_by_workers(function, tasks, crew, done)
        return
    for task in tasks:
        result = function(task)
        if done is not None:
            done(task, result)
        yield result


def _map_by_workers(
    function: Callable[[_Task], _Result],
    tasks: Iterable[_Task],
    crew: Crew,
    done: Callable[[_Task, _Result], None] | None,
) -> Generator[_Result, None, None]:
    """Yield the results of tasks in order, of which some are always under way."""
    running, ready = dict[Future[Any], tuple[int, _Task]](), dict[int, tuple[bool, Any]]()
    numbered, taken = enumerate(tasks), 0
    own = crew.executor if isinstance(crew.executor, _Processes) else None
    try:
        while True:
            room = _UNDER_WAY * crew.workers - len(running) - len(ready)
            for number, task in islice(numbered, room):
                with _failing_as_workers():
                    running[crew.executor.submit(_attempt, function, task)] = number, task
            if taken in ready:
                fine, result = ready.pop(taken)
                taken += 1
                if not fine:
                    raise result
                yield result
                continue
            if not running:
                return
            while not (ended := wait(running, _PATIENCE, FIRST_COMPLETED).done):
                if own is not None:
                    own.look_after()
            for future in ended:
                number, task = running.pop(future)
                with _failing_as_workers():
                    fine, result = ready[number] = future.result()
                if fine and done is not None:
                    done(task, result)
    finally:
        # our own pool cancels calls when it ends: if its processes end before it has seen that one
        # was cancelled, its thread ends with an `InvalidStateError` (Python's issue gh-107219)
        for call in () if own is not None else running:
            call.cancel()


@contextmanager
def _failing_as_workers() -> Iterator[None]:
    """Let what is raised beside the work itself be a `WorkerError`."""
    try:
        yield
    except Exception as error:  # foreign code may raise any error
        raise WorkerError(
            f"a worker ended without an answer ({message_of(error).rstrip(': ')}); give another "
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
