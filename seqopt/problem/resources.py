r"""Resources: what depends on the whole path so far.

A *label* of a state is what a path to it has come to, a vector :math:`z`. It begins as :math:`z_0`,
and a step from state :math:`s` to :math:`s'` extends it,

.. math:: z' = f(s, s', z), \qquad z' = \infty \; \text{ where the step may not follow this path.}

Of two labels of one state the first *dominates* the other one if every extension of that
one is feasible for it: by default where none of its values is larger, so :math:`f` must not fall
in :math:`z`. When robots are free, how old mortar is and sums within budgets are carried by labels
in the same way (`seqopt.graph._labels`). A further resource is registered (`seqopt.register`) and
named as a limit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import ProblemError, message_of


class StepArrays(NamedTuple):
    """Steps as resources see them, one beside each label: N steps, R robots.

    ``bricks`` (N,): how many stand after them; ``before``, ``after`` (N, R): the scene's nodes that
    robots hold, robot by robot, -1 for none; robots that are alike may stand in any order. Of an
    instance ``bricks`` is the level, and a row what its node stands for.
    """

    bricks: Ints
    before: Ints
    after: Ints

    def only(self, rows: Ints) -> StepArrays:
        """Select steps by their indices, (k,)."""
        return StepArrays._make(each[rows] for each in self)


@dataclass(frozen=True, repr=False)
class Resource:
    """What a path so far has come to, and with which steps it may go on.

    Parameters
    ----------
    name : str
        By which it is asked for, among limits.
    start : tuple of float
        Values where builds begin, (k,).
    extend : callable
        Takes `StepArrays` and values before, (N, k); returns values after, infinite where a step
        may not follow.
    may_end : callable, optional
        Takes values, (N, k); returns with which a build may end, (N,) bool; by default with any.
    dominates : callable, optional
        Takes values of two labels of one state, (N, k) each; returns where the first dominates,
        (N,) bool; by default where no value is larger.
    twin : Resource, optional
        The same, written a second time, with which the judge follows plans and proves bounds;
        without one the certificate says "claimed".

    Examples
    --------
    >>> Resource("steps in all", (0.0,), lambda steps, values: values + 1.0)
    Resource('steps in all')
    """

    name: str
    start: tuple[float, ...] = field(compare=False)
    extend: Callable[[StepArrays, Floats], Floats] = field(compare=False)
    may_end: Callable[[Floats], Bools] | None = field(default=None, compare=False)
    dominates: Callable[[Floats, Floats], Bools] | None = field(default=None, compare=False)
    twin: Resource | None = field(default=None, compare=False)

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        return f"Resource({self.name!r})"

    def extended(self, steps: StepArrays, values: Floats) -> Floats:
        """Return values after steps, (N, k); a `ProblemError` if its function fails."""
        try:
            found = np.asarray(self.extend(steps, values), dtype=float)
        except Exception as error:  # foreign code may raise any error
            raise ProblemError(
                f"resource {self.name}: its function failed: {message_of(error)}"
            ) from error
        if found.shape != values.shape or np.isnan(found).any():
            raise ProblemError(
                f"resource {self.name}: its function returned shape {found.shape}; give numbers "
                f"{values.shape}, a row for each label"
            )
        return found

    def ends(self, values: Floats) -> Bools:
        """Return with which values (N, k) a build may end, (N,)."""
        if self.may_end is None:
            return np.ones(len(values), dtype=bool)
        return np.asarray(self.may_end(values), dtype=bool)

    def dominated(self, first: Floats, other: Floats) -> Bools:
        """Return where the first of two values (N, k) dominates the other one, (N,)."""
        if self.dominates is None:
            return np.asarray((first <= other).all(axis=1))
        return np.asarray(self.dominates(first, other), dtype=bool)

    def fault(self, steps: StepArrays) -> int | None:
        """Return with which of the steps of a path, from 0, it is not kept; None if it is."""
        values = np.array([self.start], dtype=float)
        for k in range(len(steps.bricks)):
            values = self.extended(steps.only(np.array([k])), values)
            if not np.isfinite(values).all():
                return k
        return None if self.ends(values)[0] else len(steps.bricks) - 1

    def ways(self, problem: Any) -> Iterator[tuple[str, Any]]:
        """Yield relaxations of a problem: the resource left out."""
        rest = tuple(other for other in problem.paths if other is not self)
        yield f"the resource {self.name} left out", replace(problem, paths=rest)


def _first_fault(resources: Sequence[Resource], steps: StepArrays) -> tuple[Resource, int] | None:
    """Return a resource that a path does not keep, with its step from 0; None if all are kept.

    Each is followed by its twin, and by itself.
    """
    for each in resources:
        for own in (each.twin, each):
            if own is not None and (at := own.fault(steps)) is not None:
                return each, at
    return None
