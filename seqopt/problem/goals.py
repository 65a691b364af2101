"""Goals of a free schedule: the quantities to minimize over a build, and their names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import degrees, pi

from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.requirements import Criterion
from seqopt.problem.standing import MARGINS
from seqopt.scene.checks import short

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
