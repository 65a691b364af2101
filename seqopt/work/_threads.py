"""Linear algebra of small matrices on one thread; loops that need no lock on several."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from multiprocessing import parent_process
from typing import TypeVar

import numpy as np
from scipy.linalg import blas, lapack
from threadpoolctl import ThreadpoolController

from seqopt.errors import MemoryShortError
from seqopt.work._workers import free_memory

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

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
