r"""Amounts: what a build takes, state by state, move by move, or as a whole.

A build is a path of states :math:`s_0, s_1, \dots, s_n`. An amount :math:`a` has a value in every
state, or of every move, and counts on a path

.. math:: \max_k a(s_k) \quad \text{or} \quad \sum_k a(s_{k-1}, s_k).

Aims and budgets are amounts by their names: a further one is a function on arrays of states or
moves, registered (`seqopt.register`) with its twin, an independent implementation for the judge.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees, pi
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from seqopt._registry import registered
from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import ProblemError, did_you_mean, message_of
from seqopt.problem.criteria import Criterion, state_costs
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import NO_TOLERANCE, OFFERED, TOLERANCE
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.stability.standing import MARGINS, StandingSets

LARGEST = "F_largest"
STATE_RESPONSES = (*OFFERED, LARGEST, TOLERANCE)
"""Responses of a state, independent of the last move, for goals, criteria and limits."""
NONE = -1  # in place of a node, of a robot that holds none


class StateArrays(NamedTuple):
    """States with equally many bricks, as amounts and filters see them: n states, r robots.

    ``bricks``: how many stand; ``nodes`` (n, r): the scene's nodes that are held, in any order, -1
    in place of one where a robot holds none; ``responses``: by name (n,), those that were asked
    for, SI units; ``forces``, ``most`` (n, r): of grips, and what those may carry who hold, N;
    ``possible`` (n,): which states hang together and pass filters; ``criterion``: of the problem,
    posed for its scene; ``rows`` (n, c): the states as their space has them.
    """

    bricks: int
    nodes: Ints
    responses: Mapping[str, Floats]
    forces: Floats
    most: Floats
    possible: Bools
    criterion: Criterion
    rows: Ints

    def only(self, kept: Ints) -> StateArrays:
        """Select states by their indices, (k,)."""
        responses = {name: values[kept] for name, values in self.responses.items()}
        names = ("nodes", "forces", "most", "possible", "rows")
        parts = {name: getattr(self, name)[kept] for name in names}
        return self._replace(responses=responses, **parts)


class MoveArrays(NamedTuple):
    """Moves as amounts see them.

    ``regrips`` (m,): 1 where a grip is taken on a brick that stands, else 0; ``distances`` (m,):
    how far robots go from one grip to the next, m.
    """

    regrips: Floats
    distances: Floats


def call(
    what: str, function: Any, arrays: StateArrays | MoveArrays, kind: type | None = None
) -> np.ndarray:
    """Return a user's function of states or moves, (n,); a `ProblemError` if it fails."""
    count = len(arrays.possible if isinstance(arrays, StateArrays) else arrays.regrips)
    try:
        found = np.asarray(function(arrays), dtype=kind)
    except Exception as error:  # foreign code may raise any error
        raise ProblemError(f"{what}: its function failed: {message_of(error)}") from error
    if found.shape != (count,):
        raise ProblemError(
            f"{what}: its function returned shape {found.shape}; give ({count},), one for each"
        )
    return found


def require_named(part: Any, *functions: str) -> None:
    """Raise a `ProblemError` if words cannot ask for a part, or what it consists of is wrong."""
    name, kind = part.name, type(part).__name__.lower()
    if not isinstance(name, str) or not name.strip() or "," in name:
        raise ProblemError(f"{kind} {short(name)}: give a name without commas, by which to ask")
    if isinstance(given := getattr(part, "responses", ()), str):
        raise ProblemError(f"{kind} {name}: responses are {given!r}; give names, as ('T_max',)")
    for each, given in ((each, getattr(part, each)) for each in functions):
        if not (given is None or callable(given) or isinstance(given, tuple)):  # of functions
            raise ProblemError(f"{kind} {name}: {each} is {short(given)}; give a function")


@dataclass(frozen=True, repr=False)
class Amount:
    """An amount of a build: an aim minimizes it, a budget caps it.

    Parameters
    ----------
    name : str
        By which aims and budgets ask for it.
    states, moves : callable, optional
        Takes `StateArrays` or `MoveArrays`, returns values from zero, (n,) or (m,); one of the two.
    is_peak : bool
        Whether the largest value on a path counts, not the sum.
    responses : tuple of str
        Of states, those that it needs.
    twin : callable, optional
        An independent implementation, with which the judge recomputes values and proves bounds;
        without one the certificate says "claimed".
    unit : str
        Of a budget in words, as ``m`` of ``travel=3.5m``.
    least : callable, optional
        Takes the space of states and moves, returns a lower bound that is known before anything is
        searched.
    show : callable, optional
        Converts a value from SI to display units.
    margins : callable, optional
        Of a margin of stability: takes `StandingSets`, and grip sets; returns brackets, (n, 2).
    of_criterion : bool
        Whether it is the criterion's.
    needs_stays : bool or callable
        Whether states must contain where a free robot held last, as for its travel; or takes the
        scene and returns that.
    check : callable, optional
        Takes the problem; raises an error where it cannot be asked for.

    Examples
    --------
    >>> Amount("held", lambda states: (states.nodes >= 0).sum(axis=1))
    Amount('held', the sum over states)
    """

    name: str
    states: Callable[[StateArrays], Floats] | None = field(default=None, compare=False)
    moves: Callable[[MoveArrays], Floats] | None = field(default=None, compare=False)
    is_peak: bool = False
    responses: tuple[str, ...] = ()
    twin: Any = field(default=None, compare=False)
    unit: str = ""
    least: Callable[[Any], float] | None = field(default=None, compare=False)
    show: Callable[[float], float] | None = field(default=None, compare=False)
    margins: Callable[[StandingSets, int, Ints, Floats], Floats] | None = field(
        default=None, compare=False
    )
    of_criterion: bool = False
    needs_stays: bool | Callable[[Scene], bool] = field(default=False, compare=False)
    check: Callable[[Any], None] | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        require_named(self, "states", "moves", "twin", "least", "show", "margins", "check")

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        what = "states" if self.states or self.margins else "moves" if self.moves else "time"
        return f"Amount({self.name!r}, the {'largest' if self.is_peak else 'sum'} over {what})"

    @property
    def in_time(self) -> bool:
        """Whether it is of a whole path, in time: neither of states nor of moves."""
        return self.states is None and self.moves is None and self.margins is None

    @property
    def has_few_digits(self) -> bool:
        """Whether single-precision responses are enough to search by."""
        return self.is_peak and (self.of_criterion or isinstance(self.states, _Response))

    def value(self, arrays: StateArrays | MoveArrays) -> Floats:
        """Return its values of states or moves, (n,), by its own function."""
        return self.checked(self.states or self.moves, arrays)

    def checked(self, function: Any, arrays: StateArrays | MoveArrays) -> Floats:
        """Return the values (n,) of its function or twin; a `ProblemError` if they are invalid."""
        if self.name in BUILT_IN or isinstance(self.states, _Response):
            found: Floats = function(arrays)
            return found
        values = call(f"amount {self.name}", function, arrays, float)
        if not (values >= 0).all():
            raise ProblemError(
                f"amount {self.name}: a value is {values.min():.6g}; give numbers from zero"
            )
        return values

    def tracks_free_robots(self, scene: Scene) -> bool:
        """Return whether states of a scene must contain where a free robot held last."""
        return self.needs_stays(scene) if callable(self.needs_stays) else self.needs_stays

    def shown(self, value: float) -> float:
        """Return a value in display units."""
        return value if self.show is None else self.show(value)


@dataclass(frozen=True)
class _Response:
    """The values of a response, of a total zero where it is below: all compressed is no tension."""

    name: str
    least: float = -np.inf

    def __call__(self, states: StateArrays) -> Floats:
        return np.maximum(states.responses[self.name], self.least)


@dataclass(frozen=True)
class _Margin:
    """Brackets of a margin of stability, (n, 2)."""

    name: str

    def __call__(self, known: StandingSets, bricks: int, held: Ints, payload: Floats) -> Floats:
        return known.margins(self.name, bricks, held, payload)


def _costs(states: StateArrays) -> Floats:
    return state_costs(states.criterion, states.responses, states.bricks, states.possible)


def _tolerated(value: float) -> float:
    """Return a tolerance, m, from its reciprocal."""
    return 1 / value if 0 < value < NO_TOLERANCE else 0.0 if value else np.inf


def worst(response: str) -> Amount:
    """Return the largest value of a response; of a tolerance, the least length, m, is shown."""
    show = _tolerated if is_tolerance(response) else None
    return Amount(response, _Response(response), is_peak=True, responses=(response,), show=show)


@dataclass(frozen=True)
class _Over:
    """One for every state in which a response is above a level; none where no robot holds."""

    response: str
    level: float

    def __call__(self, states: StateArrays) -> Floats:
        return (states.responses[self.response] > self.level).astype(float)


def steps_over(response: str, level: float) -> Amount:
    """Return the number of steps in which a response is above a level, SI units."""

    def again(states: StateArrays) -> Floats:
        return np.heaviside(np.nan_to_num(states.responses[response] - level, nan=-1.0), 0.0)

    name = f"steps_over:{response}={level:g}"
    return Amount(name, _Over(response, level), responses=(response,), twin=again)


def _one(moves: MoveArrays) -> Floats:
    return np.ones(len(moves.regrips))


def _fewest_steps(space: Any) -> float:
    return float(space.steps_to_go(space.first, space.start())[0])


def _tilt_survived(value: float) -> float:
    """Return the critical tilt, degrees, from its distance to a right angle, rad."""
    return degrees(pi / 2 - value)


MINMAX = Amount("minmax", _costs, is_peak=True, of_criterion=True)
SUM = Amount("sum", _costs, of_criterion=True)
STEPS = Amount("steps", moves=_one, least=_fewest_steps)
REGRIPS = Amount("regrips", moves=attrgetter("regrips"))
TRAVEL = Amount("travel", moves=attrgetter("distances"), unit="m", needs_stays=True)
_SHOWN = {"tilt": _tilt_survived}
_BOUNDS = [Amount(n, margins=_Margin(n), is_peak=True, show=_SHOWN.get(n)) for n in MARGINS]
_TOTALS = [Amount(f"sum({n})", _Response(n, 0.0), responses=(n,)) for n in (*OFFERED, LARGEST)]
_EVERY = (MINMAX, SUM, STEPS, REGRIPS, TRAVEL, *map(worst, STATE_RESPONSES), *_BOUNDS, *_TOTALS)
BUILT_IN = {amount.name: amount for amount in _EVERY}
"""Amounts that are always there, by name."""


def find_amount(name: str, what: str = "aim") -> Amount:
    """Return an amount by its name; a `ProblemError` lists all, and names the nearest."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    known: dict[str, Amount] = {**BUILT_IN, **registered(Amount)}
    if name in known:
        return known[name]
    why = f"does not exist{did_you_mean(name, known)}; give {', '.join(known)}"
    raise ProblemError(f"{what} {short(name)} {why}")


def parse_goals(text: str) -> tuple[Amount, ...]:
    """Return amounts from words, the most important first, with commas between them.

    They are ``minmax`` (the worst of the criterion), ``sum`` (over all steps), ``steps``,
    ``regrips``, ``travel``, ``makespan`` (how long the build takes, where robots have durations), a
    response (its worst) or ``sum(RESPONSE)``; also ``bond`` and ``friction`` (the least with which
    every state stands), ``tilt`` (the largest that every state survives), ``tolerance`` (how far
    grips may be off in every state), and what was registered.

    >>> [str(goal) for goal in parse_goals("minmax,steps,sum(T_max)")]
    ['minmax', 'steps', 'sum(T_max)']
    """
    words = [word.strip() for word in text.split(",")] if isinstance(text, str) else [text]
    found = tuple(map(find_amount, words))
    for word in words:
        if words.count(word) > 1:
            raise ProblemError(f"aim {word}: it is listed twice; name it once")
    return found


def judged_by(goals: Sequence[Amount], criterion: Criterion) -> dict[str, object]:
    """Return the criterion with its numbers, for a summary; None where no goal asks for it."""
    if not any(goal.of_criterion for goal in goals):
        return {"criterion": None}
    return {"criterion": criterion.name, **criterion.settings}
