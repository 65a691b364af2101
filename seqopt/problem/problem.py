"""The problem: what is asked of a build, independent of the graph that answers it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from numbers import Real
from types import EllipsisType
from typing import TYPE_CHECKING, Any

import numpy as np

from seqopt._registry import Shown, registered
from seqopt.arrays import Floats
from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError, did_you_mean
from seqopt.network.network import Network
from seqopt.problem.amounts import BUILT_IN, STATE_RESPONSES, Amount, parse_goals, steps_over
from seqopt.problem.criteria import Criterion, RankSum, _counts_every_step
from seqopt.problem.requirements import (
    LINEAR_RANGE,
    Filter,
    Limit,
    Resource,
    _prop_limits,
    _step_limits,
    parse_limits,
    require_parts,
)
from seqopt.responses._grip_sets import HERE, Resources
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import PROP_EXCESS, robot_response
from seqopt.responses.scales import SceneFacts
from seqopt.scene._checks import settle, short
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.stability.standing import Standing

if TYPE_CHECKING:
    from seqopt.scene.scenarios import Scenarios


class Aim(Enum):
    """What to minimize over the build: the sum of costs or the largest cost."""

    SUM = "sum"
    PEAK = "peak"


class RobustKind(Enum):
    """How values of many scenarios become one."""

    WORST_PEAK = "worst-peak"
    WORST_TOTAL = "worst-total"
    CVAR = "cvar"


@dataclass(frozen=True)
class RobustAim:
    """What to minimize over scenarios, all of which are equally likely.

    That is the largest cost of any step in any scenario, the largest total over the build of any
    scenario, or the mean total of the worst scenarios (conditional value at risk), where ``level``
    is the share of scenarios that is left out, from 0 (the mean over all) to below 1.

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
        """Return the largest weight of one of so many scenarios in the mean of the worst."""
        if self.kind is not RobustKind.CVAR:
            return 1.0
        return min(1.0, 1.0 / ((1.0 - self.level) * count))

    def allowed(self, weights: Floats) -> Floats:
        """Return scenario weights (S,), projected to those that prove a bound on totals from 0.

        They are from zero to the largest weight of one scenario, and add up to one or less.
        """
        within = np.clip(weights, 0.0, self.most(len(weights)))
        return np.asarray(within / max(1.0, float(within.sum())))

    def value(self, values: Floats) -> float:
        """Return one value from the totals or peaks (S,) of all scenarios."""
        return float(self.each(np.asarray(values, dtype=float)[None])[0])

    def each(self, values: Floats) -> Floats:
        """Return one value (n,) from every row of values (n, S), weighed from the worst down."""
        most = self.most(values.shape[1])
        weights = np.clip(1.0 - most * np.arange(values.shape[1]), 0.0, most)
        weights, used = weights / weights.sum(), int(np.count_nonzero(weights))
        if used == 1:
            return np.asarray(values.max(axis=1))
        return np.asarray(np.sort(values, axis=1)[:, ::-1][:, :used] @ weights[:used])


WORST_PEAK = RobustAim(RobustKind.WORST_PEAK)
WORST_TOTAL = RobustAim(RobustKind.WORST_TOTAL)


def cvar(level: float) -> RobustAim:
    """Return the aim of the mean total over the worst scenarios: of 0.9, over their worst tenth."""
    return RobustAim(RobustKind.CVAR, level)


def parse_robust(given: RobustAim | str) -> RobustAim:
    """Return an aim that is given as such, or in words: ``worst-peak``, ``cvar=0.9``."""
    known = {str(aim): aim for aim in (WORST_PEAK, WORST_TOTAL)}
    if isinstance(given, RobustAim):
        return given
    if not isinstance(given, str):
        raise ProblemError(f"robust aim {short(given)}: give worst-peak, worst-total or cvar=0.9")
    if given in known:
        return known[given]
    name, _, number = given.partition("=")
    level = math.nan
    if name == RobustKind.CVAR.value:
        with suppress(ValueError):
            level = float(number)
    if not math.isnan(level):
        return cvar(level)
    hint = did_you_mean(name, (*known, RobustKind.CVAR.value))
    raise ProblemError(
        f"robust aim {given} does not exist{hint}; give worst-peak, worst-total or cvar=0.9, say"
    )


BUDGET = re.compile(
    r"(?P<name>sum\([^=]+\)|[^:=]+)(:(?P<of>.+))?"
    r"=((?P<level>[^:=]+):)?(?P<bound>[^:=]+?)(?P<unit>[msx]?)"
)
COUNTED = ("steps_over", "robot_use")  # a response or a robot, and a level
CAPS = (
    "travel=3.5m, makespan=600s, regrips=2, steps=50, sum(T_max)=900, robot_use:rob1=100:5, "
    "steps_over:F_largest=250:10 or, of what the best plan without budgets takes, travel=0.8"
)


@dataclass(frozen=True)
class Budget:
    """A cap on an amount: ``bound`` in SI units, or a share of what the best plan without takes."""

    amount: Amount
    bound: float
    share: bool = False


def parse_budgets(given: Sequence[str | Budget] | str | Budget) -> tuple[Budget, ...]:
    """Return budgets that are given as such, or in words as of `CAPS`."""
    some = (given,) if isinstance(given, str | Budget) else given
    if not isinstance(some, Sequence) or not all(isinstance(each, str | Budget) for each in some):
        raise ProblemError(f"budgets {short(some)}: give {CAPS}, as words")
    found = [_parse(each) if isinstance(each, str) else each for each in some]
    names = [each.amount.name for each in found]
    for each, name in zip(some, names, strict=True):
        if names.count(name) > 1:
            raise ProblemError(f"budget {each}: it stands there twice; give one bound")
    return tuple(found)


def _parse(text: str) -> Budget:
    found, known = BUDGET.fullmatch(text), {**BUILT_IN, **registered(Amount)}
    name = found["name"] if found else re.split("[=:]", text)[0]
    if found is None or name not in (*known, *COUNTED):
        hint = did_you_mean(name, (*known, *COUNTED))
        raise ProblemError(f"budget {short(text)} does not exist{hint}; give {CAPS}")
    bound, share = _positive(found["bound"], text), found["unit"] == "x"
    if name in COUNTED:
        if not (found["of"] and found["level"]) or found["unit"] in ("m", "s"):
            raise ProblemError(
                f"budget {text}: name what is counted, a level and a number of steps"
            )
        response = robot_response(found["of"]) if name == "robot_use" else found["of"]
        return Budget(steps_over(response, _positive(found["level"], text)), bound, share)
    amount = known[name]
    share |= name == "travel" and not found["unit"]
    if found["of"] or found["level"] or not (share or found["unit"] == amount.unit):
        raise ProblemError(f"budget {text}: give it as {name}={bound:g}{amount.unit}")
    return Budget(amount, bound, share)


def _positive(text: str, words: str) -> float:
    value = -1.0
    with suppress(ValueError):
        value = float(text)
    if not (np.isfinite(value) and value >= 0):
        raise ProblemError(f"budget {words}: {text!r} is not a number from 0; give {CAPS}")
    return value


class Orders(Enum):
    """Which orders are feasible."""

    TIED = "tied"  # a joint or ground end ties every brick to what stands when it is placed
    ANY = "any"

    @classmethod
    def of(cls, given: Orders | str) -> Orders:
        """Return orders that are given as such, or by name; raises `ProblemError`."""
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
    goals : tuple of Amount
        What is to be small, the most important first; empty where the formulation says whether
        the sum of the costs of open grips or the largest counts.
    limits : tuple of Limit
        Bounds that no step may exceed, whether or not a grip is open in it. Without one on
        ``linear_range``, plans keep the linear range wherever any does.
    filters : tuple of Filter
        What states must pass beside these.
    paths : tuple of Resource
        What plans must keep from the first step to the last.
    budgets : tuple of Budget
        Caps on totals over the build.
    stands : Standing or None
        The demand that every state stands.
    scenarios : tuple of Scene
        The same scene in other states of the world; limits and standing hold in all of them.
    over : RobustAim
        What counts of the values in all scenarios.
    orders : Orders or None
        Among which build orders the best is sought; None for the scene's own.
    resources : Resources
        Processes, own or of an executor.

    Examples
    --------
    >>> import seqopt
    >>> problem = seqopt.optimize("chain:bricks=7", "free", aim="minmax,steps").problem
    >>> problem
    Problem('chain 7', 'free', criterion 'worst-ratio', minmax, steps)
    >>> seqopt.solve(problem.but(budgets="regrips=3")).status
    <Status.OPTIMAL: 'optimal'>
    """

    engine: Engine
    moves: Schedule | FreeRules
    criterion: Criterion
    goals: tuple[Amount, ...] = ()
    limits: tuple[Limit, ...] = ()
    budgets: tuple[Budget, ...] = ()
    stands: Standing | None = None
    scenarios: tuple[Scene, ...] = ()
    over: RobustAim = WORST_PEAK
    orders: Orders | None = None
    resources: Resources = HERE
    filters: tuple[Filter, ...] = ()
    paths: tuple[Resource, ...] = ()

    def __post_init__(self) -> None:
        """Let props keep to their capacities."""
        network, limits = getattr(self.engine, "network", None), self.limits
        if isinstance(network, Network):  # another engine is refused later
            kept = (each for each in limits if each.response != PROP_EXCESS)
            limits = (*kept, *_prop_limits(network.scene))
        settle(self, limits=tuple(limits), goals=tuple(self.goals))

    def __repr__(self) -> str:
        parts = [f"{self.scene.name!r}, {self.method!r}, criterion {self.criterion.name!r}"]
        parts += map(str, self.goals)
        for name in ("limits", "filters", "paths", "budgets", "scenarios"):
            count = len(getattr(self, name))
            parts += [f"{count} {name[: -1 if count == 1 else None]}"] if count else []
        parts += ["every state stands"] if self.stands is not None else []
        parts += [f"{self.orders.value} orders"] if self.orders is not None else []
        return f"Problem({', '.join(parts)})"

    @property
    def scene(self) -> Scene:
        """What is built."""
        return self.engine.network.scene

    @property
    def method(self) -> str:
        """The name of the schedule, or ``free``."""
        return self.moves.method

    @property
    def is_timed(self) -> bool:
        """Whether the makespan is a goal or has a budget."""
        capped = (cap.amount for cap in self.budgets)
        return any(goal.in_time for goal in (*self.goals, *capped))

    @property
    def schedule(self) -> Schedule:
        """The schedule whose grips are open; a `ProblemError` where rules say what can be done."""
        if isinstance(self.moves, Schedule):
            return self.moves
        raise ProblemError("the free schedule has no open grips; it has states")

    def but(  # noqa: PLR0913  # what `seqopt.pose` takes
        self,
        *,
        engine: Engine | EllipsisType = ...,
        moves: Schedule | FreeRules | EllipsisType = ...,
        criterion: Criterion | EllipsisType = ...,
        goals: Sequence[Amount | str] | str | EllipsisType = ...,
        limits: Sequence[Limit | Filter | Resource | str] | str | EllipsisType = ...,
        budgets: Sequence[Budget | str] | str | EllipsisType = ...,
        stands: Standing | Mortar | str | EllipsisType | None = ...,
        scenarios: Scenarios | Sequence[Scene] | EllipsisType = ...,
        over: RobustAim | str | EllipsisType = ...,
        orders: Orders | str | EllipsisType | None = ...,
        resources: Resources | EllipsisType = ...,
    ) -> Problem:
        """Return the problem with other values or words, as of `seqopt.pose`; ... keeps one.

        Filters and resources of a path stand among ``limits``.
        """
        given = {name: value for name, value in locals().items() if value is not ...}
        del given["self"]
        names = "engine", "moves", "criterion", "resources"
        parts = [given.get(name, getattr(self, name)) for name in names]
        require_parts(*parts)
        if "limits" in given:
            found = parse_limits(given["limits"], parts[0].network.scene)
            for name, kind in (("limits", Limit), ("filters", Filter), ("paths", Resource)):
                given[name] = tuple(each for each in found if isinstance(each, kind))
        read = {name: READ[name](v) if name in READ else v for name, v in given.items()}
        return replace(self, **read)

    @property
    def says_range(self) -> bool:
        """Whether the limit of the linear range is given, or lifted."""
        return any(limit.response == LINEAR_RANGE for limit in self.limits)

    @property
    def lifts_range(self) -> bool:
        """Whether it is lifted: then plans need not keep it even where some do."""
        return self.says_range and all(
            math.isinf(limit.bound) for limit in self.limits if limit.response == LINEAR_RANGE
        )

    @cached_property
    def graphs(self) -> dict[tuple[Amount, ...], Any]:
        """Cached graphs of choices, with the responses that they computed."""
        return {}


def _goals(given: Sequence[Amount | str] | str, least: int = 0) -> tuple[Amount, ...]:
    """Return amounts, ``least`` of them or more, that are given as such, or by their names."""
    some = (given,) if isinstance(given, str) else given
    known = isinstance(some, Sequence) and all(isinstance(each, str | Amount) for each in some)
    if not known or len(some) < least:
        raise ProblemError(f"aims {short(given)}: give goals, or their names, as 'minmax,steps'")
    each = (parse_goals(one) if isinstance(one, str) else (one,) for one in some)
    return tuple(goal for goals in each for goal in goals)


def _scenes(given: object) -> tuple[Scene, ...]:
    some = getattr(given, "scenes", given)
    if isinstance(some, str) or not isinstance(some, Sequence):
        raise ProblemError(f"scenarios {short(given)}: give seqopt.scenarios(scene), or scenes")
    for number, each in enumerate(some, start=1):
        if not isinstance(each, Scene):
            raise ProblemError(f"scenario {number}: {short(each)} is not a scene; give scenes")
    return tuple(some)


READ: dict[str, Callable[[Any], Any]] = {
    "goals": _goals,
    "budgets": parse_budgets,
    "stands": Standing.of,
    "scenarios": _scenes,
    "over": parse_robust,
    "orders": lambda given: None if given is None else Orders.of(given),
}


def robot_responses(rules: FreeRules | Schedule, scene: Scene) -> tuple[str, ...]:
    """Return the responses of single robots, where states say which of them holds."""
    own = ("F_move", *(robot_response(robot.name) for robot in scene.robots))
    return own if rules.names_robots() else ()


def checked_limits(
    limits: Sequence[Limit], network: Network, rules: FreeRules | Schedule
) -> tuple[Limit, ...]:
    """Return the limits, checked to be on responses of a state."""
    limits = _step_limits(limits, network.scene)
    robots = {robot_response(robot.name) for robot in network.scene.robots}
    known = {*STATE_RESPONSES, PROP_EXCESS, *robots, *robot_responses(rules, network.scene)}
    for limit in limits:
        _require(limit.response, known, "limit")
    return limits


def check_parts(
    parts: Sequence[Amount | Filter], scene: Scene, rules: FreeRules | Schedule
) -> None:
    """Raise a `ProblemError` if an amount or a filter asks for a response that no state has."""
    known = {*STATE_RESPONSES, *robot_responses(rules, scene)}
    for part in parts:
        for name in part.responses:
            _require(name, known, f"{type(part).__name__.lower()} {part}")


def of_states(engine: Engine, criterion: Criterion, rules: FreeRules | Schedule) -> Criterion:
    """Return a criterion posed for a scene, if states have what it asks for."""
    own = robot_responses(rules, engine.network.scene)
    if isinstance(criterion, RankSum) and not own:
        raise ProblemError(
            f"criterion {criterion.name}: it ranks the choices of a move, and a free schedule "
            "has none; take worst-ratio or weighted, or a schedule with open grips, as loop"
        )
    posed = criterion.for_scene(SceneFacts(engine))
    for name in {n for bricks in (1, len(engine.network.inner)) for n in posed.wanted(bricks)}:
        _require(name, {*STATE_RESPONSES, *own}, f"criterion {criterion.name}")
    if not _counts_every_step(posed):
        rules.names_robots(in_pairs=True)
    return posed


def _require(name: str, known: set[str], where: str) -> None:
    if name not in known and not is_tolerance(name):
        listed = ", ".join(sorted(known))
        hint = did_you_mean(name, known)
        raise ProblemError(f"{where}: a state of the build has no {name}{hint}; give {listed}")
