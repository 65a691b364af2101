"""Errors of numerical libraries, such as overflow, turned into errors of seqopt."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np

from seqopt.errors import SolverError

Asked = ParamSpec("Asked")
Answer = TypeVar("Answer")
NOT_FINITE = "infs or NaNs"  # what SciPy says of arrays that it does not take


def failing_in_a_line(solve: Callable[Asked, Answer]) -> Callable[Asked, Answer]:
    """Return a function whose numerical failures are a `SolverError`.

    Parameters
    ----------
    solve : callable
        That of an engine.

    Returns
    -------
    callable
        The same, but for what it raises.
    """

    @wraps(solve)
    def solved(*arguments: Asked.args, **named: Asked.kwargs) -> Answer:
        try:
            return solve(*arguments, **named)
        except (np.linalg.LinAlgError, ValueError) as error:
            if not isinstance(error, np.linalg.LinAlgError) and NOT_FINITE not in str(error):
                raise
            raise SolverError(
                f"the equations have no answer in numbers ({error}); correct lengths, masses or "
                "stiffnesses beyond all bounds in the scene"
            ) from error

    return solved
