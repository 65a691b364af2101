"""One thread for linear algebra on small matrices: more only wait for each other."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """Return a context in which BLAS uses one thread; on leaving, it uses as many as before.

    The matrices of a partial structure are small enough for one core. Threads that share them spend
    their time waiting, without end where another process wants the second core.

    Returns
    -------
    context manager
        Entered for a whole operator or pass of grip sets, it costs some 10 µs.
    """
    limited: AbstractContextManager[object] = _libraries().limit(limits=1, user_api="blas")
    return limited


@cache
def _libraries() -> ThreadpoolController:
    """Return the handle to the linear algebra of the process; finding it takes milliseconds."""
    return ThreadpoolController()
