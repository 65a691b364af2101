"""Linear algebra of small matrices on one thread."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

import numpy as np
from scipy.linalg import blas, lapack
from threadpoolctl import ThreadpoolController

from seqopt.errors import MemoryShortError
from seqopt.work._workers import free_memory

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
