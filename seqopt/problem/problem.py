"""The problem: what is asked of a build, whatever graph of choices answers it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np

from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.goals import WORST_PEAK, Goal, RobustAim, parse_goals, parse_robust
from seqopt.problem.requirements import Criterion, Limit, as_limits
from seqopt.problem.standing import Standing
from seqopt.responses.quantities import robot_response
from seqopt.responses.resources import HERE, Resources
from seqopt.scene.checks import short
from seqopt.scene.scenarios import Scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.free_rules import FREE, FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.showing import Shown

SHAPE = re.compile(
    r"(?P<kind>travel|steps_over:(?P<response>.+)|robot_use:(?P<robot>.+))"
    r"=((?P<level>[^:=]+):)?(?P<bound>[^:=]+?)(?P<unit>m|x|)"
)
CAP = re.compile(r"(?P<name>[^=]+)=(?P<bound>[^:=]+?)(?P<unit>m?)")
CAPS = "travel=3.5m, regrips=2, steps=50 or sum(T_max)=900, say"
FORMS = "travel=0.8, travel=3.5m, steps_over:F_largest=250:10 or robot_use:rob1=100:5"


@dataclass(frozen=True)
class AskedBudget:
    """A budget as it is asked for.

    ``response``: whose steps over a level are counted; empty for the way that robots go; ``level``:
    SI units; ``bound``: how much there is, or a share of what the optimum without budgets takes;
    ``share``: whether it is one.
    """

    words: str
    response: str
    level: float
    bound: float
    share: bool


def parse_budgets(texts: Sequence[str] | str) -> tuple[AskedBudget, ...]:
    """Return budgets from words.

    ``texts``: one or several, each ``travel=BOUND``, ``steps_over:RESPONSE=LEVEL:BOUND`` or
    ``robot_use:ROBOT=LEVEL:BOUND``, SI units. A bound of travel is a share of what the optimum
    without budgets travels, or in meters, as ``3.5m``; other bounds are numbers of steps, or
    shares, as ``0.8x``. Raises `ProblemError` if one has another form, or stands there twice.
    """
    texts = (texts,) if isinstance(texts, str) else texts
    if not isinstance(texts, Sequence) or not all(isinstance(text, str) for text in texts):
        raise ProblemError(f"budgets {short(texts)}: give {FORMS}, as words")
    found = tuple(_parse(text) for text in texts)
    for i, budget in enumerate(found):
        if any((b.response, b.level) == (budget.response, budget.level) for b in found[:i]):
            raise ProblemError(f"budget {budget.words}: it stands there twice; give one bound")
    return found


def _parse(text: str) -> AskedBudget:
    found = SHAPE.fullmatch(text)
    if found is None or (found["level"] is None) != (found["kind"] == "travel"):
        hint = did_you_mean(re.split("[=:]", text)[0], ("travel", "steps_over", "robot_use"))
        states = f", or with an aim {CAPS}" if CAP.fullmatch(text) else ""
        raise ProblemError(f"budget {text} does not exist{hint}; give {FORMS}{states}")
    is_travel = found["kind"] == "travel"
    if found["unit"] == "m" and not is_travel:
        raise ProblemError(f"budget {text}: steps have no meters; give a number of them")
    response = found["response"] or (robot_response(found["robot"]) if found["robot"] else "")
    level = 0.0 if is_travel else _positive(found["level"], text)
    share = found["unit"] == "x" or (is_travel and not found["unit"])
    return AskedBudget(text, response, level, _positive(found["bound"], text), share)


def parse_caps(texts: Sequence[str] | str) -> dict[str, float]:
    """Return caps on totals of states from words: ``travel=3.5m``, ``regrips=2``, ``sum(T_max)=9``.

    Raises `ProblemError` if one has another form, or stands there twice.
    """
    out: dict[str, float] = {}
    for text in (texts,) if isinstance(texts, str) else texts:
        found = CAP.fullmatch(text) if isinstance(text, str) else None
        if found is None or (found["name"] == "travel") != bool(found["unit"]):
            raise ProblemError(f"budget {short(text)} of states does not exist; give {CAPS}")
        if found["name"] in out:
            raise ProblemError(f"budget {text}: it stands there twice; give one bound")
        out[found["name"]] = _positive(found["bound"], text)
    return out


def _positive(text: str, words: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not (np.isfinite(value) and value >= 0):
        raise ProblemError(f"budget {words}: {text!r} is not a number from 0; give {FORMS}")
    return value


class Orders(Enum):
    """Among which orders the best is sought."""

    TIED = "tied"  # a joint or ground end ties every brick to what stands when it is placed
    ANY = "any"

    @classmethod
    def of(cls, given: Orders | str) -> Orders:
        """Return orders that are given as such, or by name; a `ProblemError` names those known."""
        try:
            return cls(given)
        except ValueError:
            known = ", ".join(each.value for each in cls)
            raise ProblemError(f"orders {given!r}: give one of {known}") from None


@dataclass(frozen=True, repr=False)
class Problem(Shown):
    """What is asked of a build. Nothing is computed before a formulation needs it.

    Attributes
    ----------
    engine : Engine
        What computes responses; it has the scene.
    moves : Schedule or FreeRules
        What can be chosen: the open grips of a schedule, or every move that rules allow.
    criterion : Criterion
        What a step costs.
    goals : tuple of Goal
        What is to be small, the most important first; empty where the formulation says whether
        the sum of the costs of open grips or the largest counts.
    limits : tuple of Limit
        Bounds that no step may exceed, whether or not a grip is open in it.
    budgets : tuple of str
        Caps on totals over the build, in words.
    stands : Standing or None
        The demand that every state stands.
    scenarios : tuple of Scene
        The same scene in other states of the world; limits and standing hold in all of them.
    over : RobustAim
        What counts of the values in all scenarios.
    orders : Orders or None
        Among which build orders the best is sought; None for the scene's own.
    also : tuple of str
        Further responses to compute, besides those that are needed.
    resources : Resources
        Processes, memory and a folder for results.

    Examples
    --------
    >>> import seqopt
    >>> problem = seqopt.optimize("arch25", "free", aim="minmax,steps").problem
    >>> problem
    Problem('arch25', 'free', criterion 'worst-ratio', minmax, steps)
    >>> seqopt.solve(problem.but(budgets="regrips=3")).status
    <Status.OPTIMAL: 'optimal'>
    """

    engine: Engine
    moves: Schedule | FreeRules
    criterion: Criterion
    goals: tuple[Goal, ...] = ()
    limits: tuple[Limit, ...] = ()
    budgets: tuple[str, ...] = ()
    stands: Standing | None = None
    scenarios: tuple[Scene, ...] = ()
    over: RobustAim = WORST_PEAK
    orders: Orders | None = None
    also: tuple[str, ...] = ()
    resources: Resources = HERE

    def __repr__(self) -> str:
        what = f"{self.scene.name!r}, {self.method!r}, criterion {self.criterion.name!r}"
        counts = {
            "limits": len(self.limits),
            "budgets": len(self.budgets),
            "scenarios": len(self.scenarios),
        }
        parts = [what, *map(str, self.goals), *(f"{n} {name}" for name, n in counts.items() if n)]
        if self.stands is not None:
            parts.append("every state stands")
        if self.orders is not None:
            parts.append(f"{self.orders.value} orders")
        return f"Problem({', '.join(parts)})"

    @property
    def scene(self) -> Scene:
        """What is built."""
        return self.engine.network.scene

    @property
    def method(self) -> str:
        """The name of the schedule, or ``free``."""
        return FREE if isinstance(self.moves, FreeRules) else self.moves.method

    @property
    def schedule(self) -> Schedule:
        """The schedule whose grips are open; a `ProblemError` where rules say what can be done."""
        if isinstance(self.moves, FreeRules):
            raise ProblemError("the free schedule has no open grips; it has states")
        return self.moves

    @classmethod
    def asked(
        cls, engine: Engine, moves: Schedule | FreeRules, criterion: Criterion, **words: Any
    ) -> Problem:
        """Return a problem of what is asked, in values or in words, as of `seqopt.pose`."""
        return cls(engine, moves, criterion, **_in_values(words))

    def but(self, **words: Any) -> Problem:
        """Return the same problem with something else asked, in values or in words."""
        return replace(self, **_in_values(words))

    @cached_property
    def graphs(self) -> dict[str, Any]:
        """The graphs of choices that were made for it, which keep what was computed."""
        return {}


def _in_values(words: Mapping[str, Any]) -> dict[str, Any]:
    """Return values in the place of words, by what they are about."""
    return {name: READ.get(name, _as_it_is)(value) for name, value in words.items()}


def _as_it_is(given: object) -> object:
    return given


def _goals(given: Sequence[Goal] | str) -> tuple[Goal, ...]:
    """Return goals that are given as such, or by their names."""
    goals = parse_goals(given) if isinstance(given, str) else given
    if not isinstance(goals, Sequence) or {*map(type, goals)} - {Goal}:
        raise ProblemError(f"aims {short(given)}: give goals, or their names, as 'minmax,steps'")
    return tuple(goals)


def _budgets(given: Sequence[str] | str) -> tuple[str, ...]:
    """Return budgets in words; what is none is refused where they are read."""
    several = isinstance(given, Sequence) and not isinstance(given, str)
    return tuple(given) if several else (given,)  # type: ignore[return-value]


def _standing(given: Standing | Mortar | str | None) -> Standing | None:
    return given if isinstance(given, Standing | None) else Standing(find_mortar(given))


def _scenes(given: Scenarios | Sequence[Scene]) -> tuple[Scene, ...]:
    return given.scenes if isinstance(given, Scenarios) else tuple(given)


def _over(given: RobustAim | str) -> RobustAim:
    """Return an aim over scenarios that is given as such, or in words."""
    aim = parse_robust(given) if isinstance(given, str) else given
    if not isinstance(aim, RobustAim):
        raise ProblemError(f"robust aim {short(aim)}: give worst-peak, worst-total or cvar=0.9")
    return aim


def _orders(given: Orders | str | None) -> Orders | None:
    return None if given is None else Orders.of(given)


READ: dict[str, Callable[[Any], Any]] = {
    "goals": _goals,
    "limits": as_limits,
    "budgets": _budgets,
    "stands": _standing,
    "scenarios": _scenes,
    "over": _over,
    "orders": _orders,
    "also": tuple,
}
