"""Work: one function over many tasks, in this process, in others, or on any executor.

Results are those of a loop and come in the same order, whichever worker computes them. The number
of tasks under way is limited, so that neither they nor their results pile up. What a task raises is
raised for the first task that does, as in a loop.

Workers are processes of our own or an executor of the caller. Our own end with the one that started
them, however that ends. One that dies ends the computation in an error of one line: it lacked
memory, and so would another.

>>> from seqopt.work import map_ordered, worker_pool
>>> with worker_pool(workers=1) as pool:  # more workers are processes
...     list(map_ordered(abs, [-3, 2], pool))
[3, 2]

Beside it: threads of linear algebra, how far a computation is and what ends it early.
"""

from __future__ import annotations

import _thread
import math
import multiprocessing
import os
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Collection, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from itertools import islice
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from scipy.linalg import blas, lapack
from threadpoolctl import ThreadpoolController

from seqopt.errors import MemoryShortError, TimeUpError, WorkerError, message_of

__all__ = ["Progress", "Stage", "WorkerPool", "map_ordered", "worker_pool"]

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")
_MEMORY = Path("/proc/meminfo")
_OWN = Path("/proc/self/statm")
_GROUPS = (
    ("memory.max", "memory.current"),
    ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"),
)  # what a container may have, and has


def _free_memory() -> float:
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


def _one_thread() -> AbstractContextManager[object]:
    """Return a context in which BLAS uses one thread; on leaving, it uses as many as before.

    The matrices of a partial structure are small enough for one core. Threads that share them spend
    their time waiting, without end where another process wants the second core. Entered for a whole
    operator or pass of grip sets, it costs some 10 µs.
    """
    limited: AbstractContextManager[object] = _libraries().limit(limits=1, user_api="blas")
    return limited


@cache
def _libraries() -> ThreadpoolController:
    """Return the handle to the linear algebra of the process; finding it takes milliseconds."""
    free = _free_memory()
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
        end, self.pipe = context.Pipe(duplex=False)
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
        self.pipe.close()
        results = getattr(self, "_result_queue", None)  # there is no public way to it
        if writer := getattr(results, "_writer", None):
            writer.close()


def _follow(end: Connection) -> None:
    """Let a process of ours live no longer than its parent, and leave interrupts to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # errors are sent
    warnings.simplefilter("ignore", RuntimeWarning)
    np.seterr(all="ignore")  # what is not finite is an error of its own

    def wait_and_end() -> None:
        with suppress(EOFError, OSError):
            end.recv()
        os._exit(1)

    threading.Thread(target=wait_and_end, daemon=True).start()


class WorkerPool(NamedTuple):
    """An executor and how many workers it has.

    Attributes
    ----------
    executor : concurrent.futures.Executor
    workers : int
        How many tasks it works on at once.
    """

    executor: Executor
    workers: int


_KEPT: ContextVar[WorkerPool | None] = ContextVar("_KEPT", default=None)


@contextmanager
def worker_pool(executor: Executor | None = None, workers: int = 1) -> Iterator[WorkerPool | None]:
    """Open a pool of workers for the duration of a with block.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        Any, which its caller ends; by default processes of our own.
    workers : int, optional
        How many processes, or how many tasks the executor works on at once if it does not say.

    Yields
    ------
    WorkerPool or None
        None where there is but this process.
    """
    if workers < 1:
        raise WorkerError(f"workers is {workers}; give a whole number from 1")
    alone, kept = executor is None and workers == 1, _KEPT.get()
    if alone or kept is not None:
        yield None if alone else kept
        return
    if executor is not None:
        known = getattr(executor, "_max_workers", None)
        most = known if isinstance(known, int) else 16  # where it does not say
        yield WorkerPool(executor, workers if workers > 1 else most)
        return
    processes = _Processes(workers)
    try:
        yield WorkerPool(processes, workers)
    except BaseException:
        processes.pipe.close()  # at once; else when all that is under way is done
        raise
    finally:
        processes.shutdown(wait=True, cancel_futures=True)
        processes.pipe.close()


@contextmanager
def _keep(executor: Executor | None = None, workers: int = 1) -> Iterator[None]:
    """Open one pool for every `worker_pool` within a with block."""
    with worker_pool(executor, workers) as pool:
        before = _KEPT.set(pool)
        try:
            yield
        finally:
            _KEPT.reset(before)


_UNDER_WAY = 4  # tasks dispatched or answered but not taken, for every worker
_PATIENCE = 1.0  # s without an answer, after which workers are looked after


def map_ordered(
    function: Callable[[_Task], _Result],
    tasks: Iterable[_Task],
    pool: WorkerPool | None = None,
    done: Callable[[_Task, _Result], None] | None = None,
) -> Generator[_Result, None, None]:
    """Return what a function makes of every task, in their order.

    Parameters
    ----------
    function : callable
        Takes a task; of a module, or a `functools.partial` of such a one.
    tasks : iterable
        Taken as they are needed.
    pool : WorkerPool, optional
        From `worker_pool`; by default this process.
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
    """
    if pool is not None:
        yield from _map_by_workers(function, tasks, pool, done)
        return
    for task in tasks:
        result = function(task)
        if done is not None:
            done(task, result)
        yield result


def _map_by_workers(
    function: Callable[[_Task], _Result],
    tasks: Iterable[_Task],
    pool: WorkerPool,
    done: Callable[[_Task, _Result], None] | None,
) -> Generator[_Result, None, None]:
    """Yield the results of tasks in order, of which some are always under way."""
    running, ready = dict[Future[Any], tuple[int, _Task]](), dict[int, tuple[bool, Any]]()
    numbered, taken = enumerate(tasks), 0
    own = pool.executor if isinstance(pool.executor, _Processes) else None
    try:
        while True:
            room = _UNDER_WAY * pool.workers - len(running) - len(ready)
            for number, task in islice(numbered, room):
                with _failing_as_workers():
                    running[pool.executor.submit(_attempt, function, task)] = number, task
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


_QUIET = 1.0  # s after which a computation says how far it is
_PAUSE = 0.2  # s between two lines of that

Tell: TypeAlias = Callable[[object], object]  # called with the progress, in words or as a `Stage`
_Item = TypeVar("_Item")


@dataclass(frozen=True)
class Stage:
    """How far one stage of a computation is.

    Attributes
    ----------
    what : str
        What is being done, in a few words.
    share : float
        How much of it is done, from 0 to 1.
    left : float or None
        Estimated time left, s; None if the work itself has no estimate.

    Examples
    --------
    >>> print(Stage("responses", 0.25, 12.0))
    responses: 25 %, 12 s left
    """

    what: str
    share: float
    left: float | None = None

    def __str__(self) -> str:
        text = f"{self.what}: {100 * self.share:.0f} %"
        return text if self.left is None else f"{text}, {duration(self.left)} left"


class Progress:
    """Reports a computation as a `Stage` once it takes longer than `_QUIET`.

    Parameters
    ----------
    what : str
        What is computed.
    total : float
        How much work that is, in any unit.
    tell : callable, optional
        Called with a `Stage`, whose text is a line.
    """

    def __init__(self, what: str, total: float, tell: Tell | None) -> None:
        self._what, self._total, self._tell = what, max(total, 1e-300), tell
        self._start = self._told = time.perf_counter()
        self._done = 0.0

    def add(self, work: float) -> None:
        """Say that some work is done, in the unit of the total."""
        self._done += work
        now = time.perf_counter()
        if self._tell is None or now - self._start < _QUIET or now - self._told < _PAUSE:
            return
        self._told = now
        share = min(self._done / self._total, 1.0)
        left = (now - self._start) * (1 - share) / max(share, 1e-9)
        self._tell(Stage(self._what, share, left))


def with_progress(what: str, items: Collection[_Item], tell: Tell | None) -> Iterator[_Item]:
    """Yield items one after the other, and report a `Stage` before the work on each.

    Examples
    --------
    >>> [item for item in with_progress("steps", [4, 7], print)]
    steps: 0 %
    steps: 50 %
    [4, 7]
    """
    for done, item in enumerate(items):
        if tell is not None:
            tell(Stage(what, done / len(items)))
        yield item


def duration(seconds: float) -> str:
    """Return a time in words.

    Examples
    --------
    >>> duration(12.3), duration(600), duration(9000)
    ('12 s', '10 min', '2.5 h')
    """
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


_ENDS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)


@contextmanager
def _answered(call: Callable[[], object]) -> Iterator[None]:
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
        call()

    try:
        for number in numbers:
            signal.signal(number, note)
        yield
    finally:
        give_back()


def _interrupt_main() -> None:
    """Interrupt the main thread like ctrl-C, from any other thread, also while it waits."""
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main:
        signal.pthread_kill(main, signal.SIGINT)
    else:
        _thread.interrupt_main()


@contextmanager
def _ending(seconds: float) -> Iterator[None]:
    """Raise `TimeoutError` between two instructions of a block that exceeds its time limit.

    In the main thread only; in others there is no limit.
    """
    if seconds <= 0:
        raise TimeoutError
    if math.isinf(seconds) or threading.current_thread() is not threading.main_thread():
        yield
        return
    over, before = threading.Event(), signal.getsignal(signal.SIGINT)

    def end() -> None:
        over.set()
        _interrupt_main()

    def end_only(*_: object) -> None:
        if over.is_set():
            raise KeyboardInterrupt

    timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), end)
    timer.daemon = True
    if before == signal.SIG_IGN:  # as in a background job, where only the end is heard
        signal.signal(signal.SIGINT, end_only)
    try:
        timer.start()
        yield
        timer.cancel()
        timer.join()  # an end that is on its way comes now, and not later
    except KeyboardInterrupt:
        if not over.is_set():
            raise
        raise TimeoutError from None
    finally:
        if before == signal.SIG_IGN:
            signal.signal(signal.SIGINT, before)
        timer.cancel()


GRACE = 1.0  # s by which work may be late that is nearly done
TIME, INTERRUPT = "time", "interrupt"  # why something ended early


class Clock:
    """How much time posing, search and proof have in all.

    Searches ask for what is ``left``. Other work is ended from outside, `GRACE` after that.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self._end = time.perf_counter() + seconds

    @property
    def left(self) -> float:
        """How much time is left, s; zero where it is over."""
        return max(0.0, self._end - time.perf_counter())

    @property
    def late(self) -> bool:
        """Whether what is done now would be ended at once."""
        return time.perf_counter() >= self._end + GRACE

    def why(self, stopped: str) -> str:
        """Return why a search says that it stopped; what it took for an interrupt was the clock."""
        return TIME if self.late and stopped == INTERRUPT else stopped

    @contextmanager
    def needed(self, what: str) -> Iterator[None]:
        """End a block in time without which there is no answer; `TimeUpError` says what it was."""
        try:
            with _ending(self._end + GRACE - time.perf_counter()):
                yield
        except TimeoutError:
            raise TimeUpError(f"{what} takes longer; give more time") from None

    def tried(self, work: Callable[[], _Result]) -> tuple[_Result | None, str]:
        """Return what some work finds, or None and why it ended early: `TIME` or `INTERRUPT`."""
        try:
            with _ending(self._end + GRACE - time.perf_counter()):
                return work(), ""
        except TimeoutError:
            return None, TIME
        except KeyboardInterrupt:
            return None, INTERRUPT
