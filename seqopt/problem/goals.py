"""Goals of a free schedule: the quantities to minimize over a build, and their names."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from math import degrees, pi
from numbers import Real
from typing import Protocol, TypeVar

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.requirements import Criterion
from seqopt.problem.standing import MARGINS
from seqopt.scene.checks import short


class Costs(Protocol):
    """Costs of choices, of which an aim takes the sum or the largest."""

    def cost(self, choice: Sequence[int]) -> float:
        """Return the sum of the costs that a choice meets.

        Parameters
        ----------
        choice : sequence of int
            A candidate for every move.

        Returns
        -------
        float
        """

    def worst(self, choice: Sequence[int]) -> float:
        """Return the largest cost that a choice meets.

        Parameters
        ----------
        choice : sequence of int
            A candidate for every move.

        Returns
        -------
        float
        """


Found_co = TypeVar("Found_co", bound=Costs, covariant=True)


class Costed(Protocol[Found_co]):
    """What has costs to be summed up, and costs whose largest counts."""

    @property
    def sums(self) -> Found_co:
        """The costs whose sum over the build is minimized."""

    @property
    def peaks(self) -> Found_co:
        """The costs whose largest over the build is minimized."""


class Aim(Enum):
    """What to minimize over the build: the sum of costs or the largest cost."""

    SUM = "sum"
    PEAK = "peak"

    @property
    def worth(self) -> Callable[[Costs, Sequence[int]], float]:
        """The value of a choice: its total, or its largest cost."""
        if self is Aim.SUM:
            return lambda costs, choice: costs.cost(choice)
        return lambda costs, choice: costs.worst(choice)

    def costs(self, problem: Costed[Found_co]) -> Found_co:
        """Return the costs of a problem that this aim is about: its sums or its peaks."""
        return problem.sums if self is Aim.SUM else problem.peaks


class RobustKind(Enum):
    """How values of many scenarios become one."""

    WORST_PEAK = "worst-peak"
    WORST_TOTAL = "worst-total"
    CVAR = "cvar"


@dataclass(frozen=True)
class RobustAim:
    """What to minimize over scenarios, all of which are equally likely.

    ``kind``: the largest cost of any step in any scenario; the largest total over the build of any
    scenario; or the mean total of the worst scenarios (conditional value at risk); ``level``: of
    the last: the share of scenarios that is left out, from 0 (the mean over all) to below 1. Raises
    `ProblemError` if the level is none.

    Examples
    --------
    >>> aim = RobustAim(RobustKind.CVAR, 0.5)
    >>> aim, aim.value(np.array([1.0, 4.0, 2.0, 3.0]))
    (RobustAim(cvar=0.5), 3.5)
    """

    kind: RobustKind
    level: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.kind, RobustKind):
            raise ProblemError(f"{short(self.kind)} is not a kind of robust aim; give a RobustKind")
        number = isinstance(self.level, Real) and not isinstance(self.level, bool)
        if not number or not 0 <= self.level < 1:
            raise ProblemError(f"cvar={short(self.level)}: give a level from 0 to below 1")

    def __repr__(self) -> str:
        return f"RobustAim({self})"

    def __str__(self) -> str:
        level = f"={self.level:g}" if self.kind is RobustKind.CVAR else ""
        return self.kind.value + level

    @property
    def aim(self) -> Aim:
        """What counts in one scenario: the sum of the costs, or the largest."""
        return Aim.PEAK if self.kind is RobustKind.WORST_PEAK else Aim.SUM

    def most(self, count: int) -> float:
        """Return the largest weight of a scenario in the mean of the worst.

        ``count``: how many scenarios there are. Result: one over how many scenarios the mean is of;
        one where the worst alone counts.
        """
        if self.kind is not RobustKind.CVAR:
            return 1.0
        return min(1.0, 1.0 / ((1.0 - self.level) * count))

    def ordered_weights(self, count: int) -> Floats:
        """Return the weights of scenarios from the worst to the best.

        Result (count,): they add up to one.
        """
        most = self.most(count)
        weights = np.clip(1.0 - most * np.arange(count), 0.0, most)
        return np.asarray(weights / weights.sum())

    def value(self, values: Floats) -> float:
        """Return one value from the values of all scenarios.

        ``values`` (S,): a total or a peak for every scenario.
        """
        return float(self.each(np.asarray(values, dtype=float)[None])[0])

    def each(self, values: Floats) -> Floats:
        """Return one value from every row of values.

        ``values`` (n, S). Result (n,).
        """
        weights = self.ordered_weights(values.shape[1])
        used = int(np.count_nonzero(weights))
        if used == 1:
            return np.asarray(values.max(axis=1))
        return np.asarray(np.sort(values, axis=1)[:, ::-1][:, :used] @ weights[:used])


WORST_PEAK = RobustAim(RobustKind.WORST_PEAK)
WORST_TOTAL = RobustAim(RobustKind.WORST_TOTAL)


def cvar(level: float) -> RobustAim:
    """Return the aim of the mean total over the worst scenarios.

    ``level``: share of the scenarios that is left out, from 0 to below 1: 0.9 is the mean of the
    worst tenth.
    """
    return RobustAim(RobustKind.CVAR, level)


def parse_robust(text: str) -> RobustAim:
    """Return an aim from words.

    ``text``: ``worst-peak``, ``worst-total`` or as ``cvar=0.9``. Raises `ProblemError` if it is
    none of these.
    """
    known = {str(aim): aim for aim in (WORST_PEAK, WORST_TOTAL)}
    if text in known:
        return known[text]
    name, _, number = text.partition("=")
    try:
        level = float(number) if name == RobustKind.CVAR.value else math.nan
    except ValueError:
        level = math.nan
    if math.isnan(level):
        hint = did_you_mean(name, (*known, RobustKind.CVAR.value))
        raise ProblemError(
            f"robust aim {text} does not exist{hint}; give worst-peak, worst-total or cvar=0.9, say"
        )
    return cvar(level)


LARGEST = "F_largest"
STATE_RESPONSES = ("T_max", "M_sup", "D_max", "C_max", LARGEST)
"""Responses of a state, whoever moved last: those that goals, criteria and limits may name."""


class Measure(Enum):
    """How a goal adds up over the steps of a build."""

    PEAK = "peak"  # the largest of any step
    SUM = "sum"  # the sum over all steps
    STEPS = "steps"  # how many steps there are
    REGRIPS = "regrips"  # how many grips are taken beside those that place a brick
    TRAVEL = "travel"  # how far robots go from one grip to the next, m


@dataclass(frozen=True)
class Goal:
    """A quantity that a free schedule minimizes.

    ``response``: whose peak or sum it is, or a margin of stability; that of the criterion if none
    is named.
    """

    measure: Measure
    response: str = ""

    def __str__(self) -> str:
        names = {Measure.PEAK: "minmax", Measure.SUM: "sum"}
        if not self.response:
            return names.get(self.measure, self.measure.value)
        return f"sum({self.response})" if self.measure is Measure.SUM else self.response

    @property
    def of_states(self) -> bool:
        """Whether it is about states, and not about moves alone."""
        return self.measure in (Measure.PEAK, Measure.SUM)

    @property
    def of_margins(self) -> bool:
        """Whether it is about how surely states stand, and not about responses."""
        return self.response in MARGINS

    def shown(self, value: float) -> float:
        """Return a value as people read it: of a tilt, how much is survived, in degrees.

        ``value``: SI units; of a tilt, how far it is from a right angle.
        """
        return degrees(pi / 2 - value) if self.response == "tilt" else value


def judged_by(goals: Sequence[Goal], criterion: Criterion) -> dict[str, object]:
    """Return the criterion with its numbers, for a summary.

    Result: ``criterion`` is None where every goal names a response of its own, or is about moves.
    """
    if not any(goal.of_states and not goal.response for goal in goals):
        return {"criterion": None}
    return {"criterion": criterion.name, **criterion.settings}


def parse_goals(text: str) -> tuple[Goal, ...]:
    """Return goals from words, the most important first.

    ``text``: ``minmax`` (the worst of the criterion), ``sum`` (over all steps), ``steps``,
    ``regrips``, ``travel``, a response (its worst) or ``sum(RESPONSE)``, with commas between them;
    also ``bond`` and ``friction`` (the least with which every state stands) and ``tilt`` (the
    largest that every state survives). Raises `ProblemError` if there is no such goal, or one
    stands there twice.

    Examples
    --------
    >>> [str(goal) for goal in parse_goals("minmax,steps,sum(T_max)")]
    ['minmax', 'steps', 'sum(T_max)']
    """
    known = {"minmax": Goal(Measure.PEAK), "sum": Goal(Measure.SUM)}
    known |= {m.value: Goal(m) for m in (Measure.STEPS, Measure.REGRIPS, Measure.TRAVEL)}
    known |= {name: Goal(Measure.PEAK, name) for name in STATE_RESPONSES}
    known |= {name: Goal(Measure.PEAK, name) for name in MARGINS}
    known |= {f"sum({name})": Goal(Measure.SUM, name) for name in STATE_RESPONSES}
    words = [word.strip() for word in text.split(",")] if isinstance(text, str) else [text]
    for word in words:
        if word not in known:
            why = f"does not exist{did_you_mean(word, known)}; give {', '.join(known)}"
            raise ProblemError(f"aim {short(word)} {why}")
        if words.count(word) > 1:
            raise ProblemError(f"aim {word}: it is listed twice; name it once")
    return tuple(known[word] for word in words)
