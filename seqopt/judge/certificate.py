"""Certificates of optimality, and the judge's own functions of amounts and filters.

Each amount is written a second time. What is built in has its twin here; what rooms, packages and
users register brings its own. Without one an amount or a filter is what the search says, and no
bound is proven.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from seqopt._registry import registered
from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import ProblemError
from seqopt.problem.amounts import BUILT_IN, Amount, StateArrays
from seqopt.problem.requirements import Limit
from seqopt.responses._grip_sets import Moved
from seqopt.responses._tolerance import is_tolerance

TOLERANCE = 1e-6  # of the costs that a choice meets: how far a claim may be from what the data say
ROUNDED = 1e-9  # by which a response may be over a limit, over its size
BETTER = 1e-9  # over a value: a path must be better by more than this


def _known_gap(gap: float) -> float:
    """Return a gap, or zero if it is within the tolerance of proofs."""
    return 0.0 if gap <= TOLERANCE else gap


def limit_below(value: float) -> float:
    """Return the least that is no better than a value."""
    return value - BETTER * abs(value)


class Basis(StrEnum):
    """What a lower bound rests on."""

    REBUILT = "rebuilt"  # states and their responses, which the judge computed again
    GIVEN = "given"  # costs: of an instance, or of all choices of open grips
    CLAIMED = "claimed"  # by the formulation; nothing is proven


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(FrozenValue):
    """The values of a plan and bounds on all others, from the problem's data alone.

    Attributes
    ----------
    values : tuple of float
        The value of every goal, recomputed, then what the plan uses of every budget.
    bounds : tuple of float
        Lexicographic lower bounds of the goals, recomputed from the data; minus infinity where
        nothing is proven. A budget has none.
    gap : float
        Largest difference of value and bound, relative to the size of the values: of the costs
        that a choice of candidates meets, their sum or the largest. Infinite where nothing is
        proven; margins of stability are proven to `seqopt.stability.standing.NARROW`.
    claimed_gap : float
        Gap to the formulation's own bound, if that is higher; it is not proven.
    spent : mapping of str to float
        The amount that the plan uses of each budget.
    states : int
        Number of states in the proof, where it is about states.
    models : int
        Number of models that the judge solved for the proof; none where costs are given.
    basis : Basis
        What proven bounds rest on.
    moved : Moved or None
        How far the steps of the plan move nodes, over the limit of the linear range.

    Examples
    --------
    >>> import seqopt
    >>> proof = seqopt.optimize("arch25", criterion="worst-ratio-published").certificate
    >>> round(proof.objective, 3), round(proof.bound, 3), proof.gap
    (57.941, 57.941, 0.0)
    """

    values: tuple[float, ...]
    bounds: tuple[float, ...]
    gap: float
    claimed_gap: float
    spent: Mapping[str, float] = field(default_factory=dict)
    states: int = 0
    models: int = 0
    basis: Basis = Basis.GIVEN
    moved: Moved | None = None

    def __repr__(self) -> str:
        values = f"objective {self.objective:.6g}, no choice below {self.bound:.6g}"
        return f"<Certificate: {values}, gap {100 * _known_gap(self.gap):.3g} %>"

    @property
    def objective(self) -> float:
        """The value of the first goal."""
        return self.values[0]

    @property
    def bound(self) -> float:
        """Lower bound of the first goal."""
        return self.bounds[0]

    @property
    def rests_on(self) -> tuple[Basis, ...]:
        """What the bound of each goal rests on: a claim where nothing is proven."""
        return tuple(self.basis if isfinite(bound) else Basis.CLAIMED for bound in self.bounds)


class Twin(NamedTuple):
    """How an amount of states or moves is computed once more.

    ``values``: of the same arrays as the amount's own function; ``to_go``: of a count, of which
    every move takes one: takes the tables of what rules or a schedule allow, a level and states,
    returns lower bounds from there to an end.
    """

    values: Callable[[Any], Floats]
    to_go: Callable[[Any, int, Ints], Floats] | None = None


class PathTwin(NamedTuple):
    """How an amount of whole paths is computed and bounded once more.

    ``value``: of the steps of a problem, with the starts that are claimed; ``clocks``: makes of an
    evaluator, rebuilt states and claimed motions these in time, as of
    `seqopt.times._clock.TimedRows`; ``path_value``: of arcs and acts of an instance; ``claimed``:
    what a claim about an instance proves, as of `seqopt.instances._judge.proven`.
    """

    value: Callable[[Any, Sequence[Any], Sequence[float]], float]
    clocks: Callable[..., Any]
    path_value: Callable[[Any, Any, Any], float]
    claimed: Callable[..., float]


def _criterion(states: StateArrays) -> Floats:
    """Return the criterion of responses; infinite where states are infeasible."""
    criterion, able = states.criterion, states.possible
    costs = criterion.costs(states.responses, states.bricks, len(able))
    if (least := costs[able].min(initial=0.0)) < 0:
        raise ProblemError(f"criterion {criterion.name}: a step costs {least:.6g}, less than zero")
    return np.where(able, costs, np.inf)


TWINS = {
    "minmax": Twin(_criterion),
    "sum": Twin(_criterion),
    "steps": Twin(
        lambda moves: np.full(moves.regrips.shape, 1.0),
        lambda tables, level, states: tables.steps_to_go(level, states),
    ),
    "regrips": Twin(lambda moves: np.where(moves.regrips > 0, 1.0, 0.0)),
    "travel": Twin(lambda moves: np.abs(moves.distances)),
}


def _twin_of(amount: Amount) -> Twin | None:
    """Return the twin of an amount of states or moves; None if it has none, or is of paths."""
    if amount.name in TWINS:
        return TWINS[amount.name]
    if amount.name in BUILT_IN or is_tolerance(amount.name):
        if amount.margins:  # the cone program finds them, step by step
            return Twin(lambda states: np.zeros(len(states.possible)))
        least = -np.inf if amount.is_peak else 0.0  # a sum counts no tension that is none
        return Twin(lambda states: states.responses[amount.responses[0]].clip(min=least))
    if amount.twin is None or amount.in_time:
        return None
    return Twin(partial(amount.checked, amount.twin))


def _path_twin() -> PathTwin | None:
    """Return the twin of makespans; None if no room offers one, so that they are claimed."""
    found: PathTwin | None = getattr(registered(Amount).get("makespan"), "twin", None)
    return found


def _own_values(amount: Amount) -> Callable[[Any], Floats] | None:
    """Return the judge's function of an amount, or its own where it has no twin; None of paths."""
    twin = _twin_of(amount)
    if twin is not None:
        return twin.values
    return None if amount.in_time or amount.margins else amount.value


def exceeds(limit: Limit, values: Floats) -> Bools:
    """Return where a response is beyond a limit; NaN, of a robot without a grip, is not."""
    most = 1 / limit.bound if is_tolerance(limit.response) else limit.bound
    return np.asarray(values - most > ROUNDED * np.abs(most))
