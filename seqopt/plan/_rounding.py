"""Numbers of a Pareto set, rounded: no plan is better by an error of rounding."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import ProblemError

DIGITS = 9  # after the first
EDGE = 1e-9  # of a rounding step: how far above a multiple a value still counts as it


def _rounding_steps(names: Sequence[str], rounding: Mapping[str, float] | None) -> Floats:
    """Return what every number is rounded up to multiples of; zero where it is not.

    Result (k,). Raises `ProblemError` if a name is none of these, or a step is no positive number.
    """
    for name, step in (rounding or {}).items():
        if name not in names or not 0 < step < np.inf:
            known = ", ".join(names)
            raise ProblemError(f"round {name}={step:g}: give a positive step for one of {known}")
    return np.array([(rounding or {}).get(name, 0.0) for name in names])


def _rounded_up(values: Floats, steps: Floats) -> Floats:
    """Return values rounded up to multiples of steps, others rounded to ten digits.

    What differs by less than ten digits is the same: no plan is better by an error of rounding.

    ``values`` (..., k); ``steps`` (k,): zero where no step is given. Result (..., k).
    """
    safe = np.where(steps > 0, steps, 1.0)
    size = np.abs(np.where((values != 0) & np.isfinite(values), values, 1.0))
    digit = 10.0 ** (np.floor(np.log10(size)) - DIGITS)
    plain = np.where(np.isfinite(values), np.round(values / digit) * digit, values)
    return np.where(steps > 0, np.ceil(values / safe - EDGE) * safe, plain)
