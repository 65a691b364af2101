r"""The requirements on a plan: limits, filters of states, resources of paths; what exceeds them.

A filter answers twice, since what it asks may stay open. A plan passes states :math:`s` that are
*proven to pass*; a proof leaves out those that are *proven not to*:

.. math:: P = \{s : f(s) \text{ is proven}\}, \qquad R = \{s : \neg f(s) \text{ is proven}\}, \qquad
   P \cap R = \emptyset .

Limits, payloads, rules, standing and arms are filters of one kind. Each knows how it can be
loosened, from which remedies of an infeasible problem are found.

A resource is what depends on the whole path so far. A *label* of a state is what a path to it has
come to, a vector :math:`z` that begins as :math:`z_0`, and a step from :math:`s` to :math:`s'`
extends it,

.. math:: z' = f(s, s', z), \qquad z' = \infty \; \text{ where the step may not follow this path.}

Of two labels of one state the first *dominates* the other one if every extension of that one is
feasible for it: by default where none of its values is larger, so :math:`f` must not fall in
:math:`z`. When robots are free, how old mortar is and sums within budgets are carried by labels in
the same way (`seqopt.graph._budgets`). Further filters and resources are registered
(`seqopt.register`) and named as limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from seqopt._registry import ADDED, Part, registered
from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Engine, linear_limit
from seqopt.engines.registry import recipe_of
from seqopt.errors import ProblemError, did_you_mean, message_of
from seqopt.network.network import Network
from seqopt.problem.amounts import BUILT_IN, Amount, StateArrays, call, require_named
from seqopt.problem.criteria import Criterion
from seqopt.responses._grip_sets import Resources
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import (
    NO_TOLERANCE,
    OFFERED,
    PROP_EXCESS,
    TOLERANCE,
    _steps_in_words,
    length_text,
    robot_response,
)
from seqopt.responses.scales import _response_along
from seqopt.responses.table import _Columns, _steps_in_table
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene, loads
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import Schedule, carried
from seqopt.sequence.steps import AnyStep

LARGEST = 1e100  # number: products of larger ones overflow
CHOICE_RESPONSES = (*OFFERED, "F_move", "F_largest")  # of choices, and one per robot
NAMES = (*CHOICE_RESPONSES, TOLERANCE)
UNITS = {"F": "N", "T": "N", "C": "N", "M": "N m", "D": "m", "position": "m"}
"""Units of numbers, by what they are of, or by the first letter of a response."""
_LENGTHS = {"mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9, "m": 1.0}


LIMIT_TOLERANCE = 1e-9  # by which a response may exceed a limit, over the limit's size
LINEAR_RANGE = "linear_range"  # the largest displacement over that up to which the model holds
LIFTED = "any"  # in words, where that is no limit


@dataclass(frozen=True)
class Limit:
    """A bound on a response that no step may exceed by more than `LIMIT_TOLERANCE` of it.

    Parameters
    ----------
    response : str
        A name as in `seqopt.problem.criteria`, ``tolerance`` or ``linear_range``.
    bound : float
        SI units; of a tolerance a lower bound, m; of the linear range a share of it: by default
        plans keep within 1 wherever any does, and infinite lifts that.

    Raises
    ------
    ProblemError
        If the arguments are not a name and a number.

    Examples
    --------
    >>> import seqopt
    >>> seqopt.Limit("F_largest", 300.0)
    Limit(response='F_largest', bound=300.0)
    """

    response: str
    bound: float

    def __post_init__(self) -> None:
        if not isinstance(self.response, str) or not isinstance(self.bound, Real):
            raise ProblemError(
                f"limit {short(self.response)} of {short(self.bound)}: give the name of a response "
                "and a number"
            )
        if math.isnan(self.bound):
            raise ProblemError(f"limit {self.response}: its bound is NaN; give a number")
        if is_tolerance(self.response) and not self.bound > 0:
            raise ProblemError(f"limit tolerance={self.bound:g}: give a length above zero, m")
        if self.response[:1] in ("F", "M", "D") and self.bound < 0:
            raise ProblemError(f"limit {self.response}={self.bound:g}: give a number from zero")
        if self.response == LINEAR_RANGE and not self.bound > 0:
            raise ProblemError(f"limit linear_range={self.bound:g}: give a share above zero")

    @property
    def label(self) -> str:
        """Name of the limit in messages and summaries."""
        return self.response

    def shown(self, value: float) -> float:
        """Return a value of the response in display units."""
        return value

    @property
    def counted(self) -> float:
        """Upper bound of the computed values: of a tolerance its reciprocal, 1/m."""
        return 1 / self.bound if is_tolerance(self.response) else self.bound

    def exceeded(self, values: Floats) -> Bools:
        """Return where values exceed the limit; NaN, as of a robot without a grip, does not."""
        return np.asarray(values > self.counted + LIMIT_TOLERANCE * abs(self.counted))


@dataclass(frozen=True)
class _RangeLimit(Limit):
    """The limit of the linear range as steps are compared with it: on ``D_max``, m.

    ``unit``: the displacement up to which the model holds, m.
    """

    unit: float = 1.0

    @property
    def label(self) -> str:
        return LINEAR_RANGE

    def shown(self, value: float) -> float:
        return value / self.unit


def _step_limits(given: Sequence[Limit] | Limit, scene: Scene) -> tuple[Limit, ...]:
    """Return limits as steps are compared with them: of the linear range in meters, or lifted."""
    far, out = linear_limit(scene), list[Limit]()
    for limit in as_limits(given):
        if limit.response != LINEAR_RANGE:
            out.append(limit)
        elif math.isfinite(limit.bound):
            out.append(_RangeLimit("D_max", limit.bound * far, far))
    return tuple(out)


def _said_limits(limits: Sequence[Limit]) -> dict[str, object]:
    """Return bounds by the names of limits, in display units, ready for JSON."""
    return {e.label: e.shown(e.bound) if math.isfinite(e.bound) else LIFTED for e in limits}


def as_limits(given: Sequence[Limit] | Limit) -> tuple[Limit, ...]:
    """Return limits, one or several; a `ProblemError` if it is something else."""
    limits = (given,) if isinstance(given, Limit) else given
    if not isinstance(limits, Sequence) or not all(isinstance(each, Limit) for each in limits):
        raise ProblemError(
            f"limits {short(given)}: give values, as [seqopt.Limit('F_largest', 300.0)]; "
            "seqopt.problem.requirements.payload_limits(scene) has those of all payloads"
        )
    return tuple(limits)


def payload_limits(scene: Scene) -> tuple[Limit, ...]:
    """Return limits that keep every robot of a scene within its payload, N."""
    return tuple(Limit(robot_response(robot.name), robot.payload) for robot in scene.robots)


_LITTLE = 1e-4  # of the mean weight of a brick: by how much props may bear more than they may


def _prop_limits(scene: Scene) -> tuple[Limit, ...]:
    """Return the limit of the props' capacities; none where all bear anything."""
    if all(prop.capacity is None and prop.direction is None for prop in scene.props):
        return ()
    weight = sum(b.mass for b in scene.bricks) * math.hypot(*scene.gravity) * scene.weight_factor
    return (Limit(PROP_EXCESS, _LITTLE * (weight / len(scene.bricks) or 1.0)),)


def require_parts(
    engine: Engine, moves: Schedule | FreeRules, criterion: Criterion, resources: Resources
) -> None:
    """Raise a `ProblemError` if a part of a problem is none."""
    wanted = (
        (engine, isinstance(getattr(engine, "network", None), Network), "engine", "make_engine"),
        (moves, isinstance(moves, Schedule | FreeRules), "schedule", "three_robot_loop"),
        (criterion, hasattr(criterion, "for_scene"), "criterion", "CRITERIA"),
        (resources, isinstance(resources, Resources), "Resources", "responses.Resources"),
    )
    for given, right, what, source in wanted:
        if not right:
            raise ProblemError(f"{short(given)} is no {what}; take one of seqopt.{source}")


@dataclass(frozen=True)
class Excess:
    """A limit that some steps of a build exceed."""

    limit: Limit
    steps: tuple[int, ...]  # their numbers
    largest: float  # value in them, SI units
    robot: str = ""  # whose payload it is; empty for other limits
    brick: int | None = None  # the heaviest that it places or takes away by itself, in these steps

    def __str__(self) -> str:
        bound, where = self.limit.bound, _steps_in_words(self.steps)
        if is_tolerance(self.limit.response):
            least = 1 / self.largest if self.largest < NO_TOLERANCE else 0.0
            return f"tolerance is only {length_text(least)} of {length_text(bound)} ({where})"
        if self.limit.response == PROP_EXCESS:
            return f"a prop bears up to {self.largest:.1f} N more than it may, or pulls ({where})"
        if not self.robot:
            most, bound = self.limit.shown(self.largest), self.limit.shown(bound)
            return f"{self.limit.label} is up to {most:.6g} of {bound:.6g} ({where})"
        does = "holds" if self.brick is None else "carries"
        what = "" if self.brick is None else f" (brick {self.brick})"
        return (
            f"{self.robot} {does} up to {self.largest:.1f} N{what}, more than its payload of "
            f"{bound:g} N ({where})"
        )


def _excesses(scene: Scene, table: _Columns, limits: Sequence[Limit]) -> tuple[Excess, ...]:
    """Return the limits that steps of a table of `seqopt.analyze` exceed, in their order.

    A limit on ``F_move``, which only open steps have, is left out.
    """
    out = []
    for limit in (each for each in limits if each.response != "F_move"):
        values = _response_along(scene, table, limit.response)
        over = limit.exceeded(values)
        if over.any():
            steps = tuple(np.asarray(table["step"], dtype=int)[over].tolist())
            out.append(Excess(limit, steps, float(values[over].max())))
    return tuple(out)


def overloads(scene: Scene, table: _Columns) -> tuple[Excess, ...]:
    """Return the payloads that steps exceed: by grips, then by bricks that one robot carries.

    ``table``: of `seqopt.analyze`. Result: each in the order of the robots.
    """
    names = {robot_response(robot.name): robot.name for robot in scene.robots}
    found = _excesses(scene, table, payload_limits(scene))
    held = (replace(excess, robot=names[excess.limit.response]) for excess in found)
    return (*held, *_carrying_excesses(scene, _steps_in_table(scene, table)))


def _carrying_excesses(scene: Scene, steps: Sequence[AnyStep]) -> tuple[Excess, ...]:
    """Return who carries bricks that are heavier than its payload, in the order of the robots."""
    out, every = [], [*carried(scene, steps)]
    for r, (robot, limit) in enumerate(zip(scene.robots, payload_limits(scene), strict=True)):
        load = loads(scene, robot)
        own = ((float(load[scene.since[e.brick] - 1]), e) for e in every if e.robot == r)
        over = [(load, each) for load, each in own if limit.exceeded(np.array(load))]
        if over:
            numbers = tuple(sorted(each.step for _, each in over))
            most, worst = max(over)
            out.append(Excess(limit, numbers, most, robot.name, worst.brick))
    return tuple(out)


class PayloadUse(NamedTuple):
    """What a robot holds or carries in a step, over its payload."""

    share: float
    robot: str  # its name
    step: int  # number
    brick: int | None = None  # the one that it carries, placing or removing it; None if it holds


def payload_uses(scene: Scene, table: _Columns) -> list[PayloadUse]:
    """Return the share of its payload that every robot uses, by grips, then by bricks it carries.

    ``table``: of `seqopt.analyze`.
    """
    out, numbers = [], np.asarray(table["step"], dtype=int).tolist()
    for robot in scene.robots:
        forces = _response_along(scene, table, robot_response(robot.name))
        shares = np.nan_to_num(forces / robot.payload).tolist()
        out += [PayloadUse(s, robot.name, n) for s, n in zip(shares, numbers, strict=True)]
    every = [(robot, loads(scene, robot)) for robot in scene.robots]
    for number, r, brick in carried(scene, _steps_in_table(scene, table)):
        robot, load = every[r]
        share = float(load[scene.since[brick] - 1]) / robot.payload
        out.append(PayloadUse(share, robot.name, number, brick))
    return out


def _prop_faults(scene: Scene, table: _Columns) -> tuple[Excess, ...]:
    """Return in which steps props bear more than they may; see `_excesses`."""
    return _excesses(scene, table, _prop_limits(scene))


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

    def __post_init__(self) -> None:
        require_named(self)
        if not isinstance(self.twin, Resource | None):
            raise ProblemError(f"twin of resource {self.name}: give a Resource")
        if not all(isinstance(value, Real) for value in self.start):
            raise ProblemError(f"resource {self.name}: start is {short(self.start)}; give numbers")

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
            what = "NaN" if found.shape == values.shape else f"shape {found.shape}"
            raise ProblemError(
                f"resource {self.name}: its function returned {what}; give numbers "
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


Passes = Callable[[StateArrays], Bools]
Loosened = Callable[[Any], Iterator[tuple[str, Any]]]


@dataclass(frozen=True, repr=False)
class Filter:
    """Which states a plan may pass.

    Parameters
    ----------
    name : str
        By which it is asked for, among limits.
    passes : callable or None
        Takes `StateArrays`, returns which states are proven to pass, (n,) bool; None where moves
        lead only to what passes.
    responses : tuple of str
        Those that it needs.
    refuses : callable, optional
        Returns which states are proven not to pass, (n,) bool; by default all others.
    expensive : bool
        Whether it is asked only of states that pass all other filters.
    twin : callable, optional
        An independent implementation of ``refuses``, with which the judge proves bounds; without
        one the certificate says "claimed".
    loosened : callable, optional
        Takes a problem; yields a relaxation in words, and the relaxed problem. By default the
        filter is left out.

    Examples
    --------
    >>> Filter("two robots hold", lambda states: (states.nodes >= 0).sum(axis=1) == 2)
    Filter('two robots hold')
    """

    name: str
    passes: Passes | None = field(compare=False)
    responses: tuple[str, ...] = ()
    refuses: Passes | None = field(default=None, compare=False)
    expensive: bool = False
    twin: Passes | None = field(default=None, compare=False)
    loosened: Loosened | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        require_named(self, "passes", "refuses", "twin", "loosened")

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        return f"Filter({self.name!r})"

    def proven(self, states: StateArrays) -> Bools:
        """Return which states are proven to pass, (n,)."""
        if self.passes is None:
            return np.ones(len(states.rows), dtype=bool)
        return _truths(f"filter {self.name}", self.passes, states)

    def refuted(self, states: StateArrays) -> Bools:
        """Return which states are proven not to pass, (n,)."""
        if self.refuses is None:
            return ~self.proven(states)
        return _truths(f"filter {self.name}", self.refuses, states)

    def refuted_again(self, states: StateArrays) -> Bools:
        """Return which states its twin proves not to pass, (n,); none without a twin."""
        if self.twin is None:
            return np.zeros(len(states.rows), dtype=bool)
        return _truths(f"twin of filter {self.name}", self.twin, states)

    def ways(self, problem: Any) -> Iterator[tuple[str, Any]]:
        """Yield relaxations of a problem in this filter: in words, and the relaxed problem."""
        if self.loosened is not None:
            yield from self.loosened(problem)
        else:
            rest = _without(self, problem.filters)
            yield f"the filter {self.name} left out", replace(problem, filters=rest)


def _truths(what: str, function: Any, states: StateArrays) -> Bools:
    """Return what a user's function says of states, (n,) bool."""
    found = call(what, function, states)
    if found.dtype.kind != "b" and not np.isin(found, (0, 1)).all():
        raise ProblemError(f"{what}: its function returned {short(found[0].item())}; give bool")
    return found.astype(bool)


def _without(part: object, parts: Sequence[Any]) -> tuple[Any, ...]:
    return tuple(other for other in parts if other is not part)


def _limit_filter(limit: Limit) -> Filter:
    """Return the filter of a limit on a response."""

    def passes(states: StateArrays) -> Bools:
        values = states.responses.get(limit.response)
        return states.possible if values is None else ~limit.exceeded(values)

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        yield limit.label, replace(problem, limits=_without(limit, problem.limits))

    return Filter(limit.label, passes, (limit.response,), loosened=loosened)


IGNORED = "payload=ignored"
STANDING = "no requirement to stand"
PAYLOADS = "robots that carry more"  # where states must stand, held by what robots carry
ARMS = "arms that reach more, or stand elsewhere"
APART = "arms that are out of each other's way (slimmer, or elsewhere)"
TAKEN = ("payload", LINEAR_RANGE, "rules", "stands", "arms")
LARGE = 1e6  # N; more than robots have to carry


def _rules_filter() -> Filter:
    """Return the filter of the rules of a free schedule: moves lead only to states that pass."""

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        for words, rules in problem.rules.loosened(problem.network.scene):
            if not (problem.demands and words == IGNORED):  # robots hold with payloads
                yield words, replace(problem, rules=rules)

    return Filter("rules", None, loosened=loosened)


def _standing_filter(problem: Any) -> Filter:
    """Return the filter of the stability requirement, which may stay open for a state."""

    def passes(states: StateArrays) -> Bools:
        held = problem.held_to_stand(states.rows)
        return np.asarray(problem.stability.stand(states.bricks, *held))

    def refuses(states: StateArrays) -> Bools:
        held = problem.held_to_stand(states.rows)
        return np.asarray(~problem.stability.may_stand(states.bricks, *held))

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        yield STANDING, replace(problem, standing=None, settled=())

    return Filter("stands", passes, refuses=refuses, expensive=True, loosened=loosened)


def _payloads_filter() -> Filter:
    """Return the filter of payloads, by each grip."""

    def passes(states: StateArrays) -> Bools:
        over = states.forces > states.most + LIMIT_TOLERANCE * states.most
        return np.asarray(~over.any(axis=1))

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        if recipe_of(problem.engine):
            yield PAYLOADS, problem.carrying(LARGE)

    return Filter("payload", passes, loosened=loosened)


def _arms_filter() -> Filter:
    """Return the filter of compatible postures: moves lead only to states that pass."""

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        scene = problem.network.scene  # robots without arms hold as those whose joints are rigid
        if scene.grip_kinds.arms.any() or not recipe_of(problem.engine):
            return
        alone = replace(problem, scenarios=())
        near = (
            r if r.arm is None else replace(r, arm=replace(r.arm, keeps_apart=False))
            for r in scene.robots
        )
        yield APART, alone.in_scene(scene.with_robots(*near))
        yield ARMS, alone.in_scene(scene.with_robots(*(replace(r, arm=None) for r in scene.robots)))

    return Filter("arms", None, loosened=loosened)


def filters_of(problem: Any) -> tuple[Filter, ...]:
    """Return all that states of a problem must pass, in the order in which each is loosened."""
    out = [_rules_filter()]
    out += [_standing_filter(problem)] if problem.demands else []
    out += [_payloads_filter()]
    out += [_arms_filter()] if problem.network.scene.has_arms else []
    return (*out, *map(_limit_filter, problem.limits), *problem.filters)


Asked: TypeAlias = Limit | Filter | Resource


def parse_limits(
    given: Sequence[str | Asked] | str | Asked, scene: Scene, where: str = "limit"
) -> tuple[Asked, ...]:
    """Return limits, filters and resources that are given as such, or in words.

    Words are ``payload``, of the scene's robots, ``RESPONSE=VALUE``, SI units or a length as
    ``20um``, ``linear_range=SHARE``, or ``any`` to lift it, and names of what was registered.
    ``where``: for messages.
    """
    several = given if isinstance(given, Sequence) and not isinstance(given, str) else (given,)
    out: list[Asked] = []
    for each in several:
        if isinstance(each, Filter | Resource):
            out.append(each)
        elif not isinstance(each, str):
            out += as_limits([each])
        elif each == "payload":
            out += payload_limits(scene)
        elif "=" not in each and each in (own := registered(Filter) | registered(Resource)):
            out.append(own[each])
        else:
            out.append(_limit_of(each, where))
    size = np.ptp([brick.position for brick in scene.bricks], axis=0).max()
    size += max(max(brick.dimensions) for brick in scene.bricks)
    for limit in out:
        if isinstance(limit, Limit) and limit.response[0] == "D" and size < limit.bound < math.inf:
            raise ProblemError(
                f"{where} {limit.response}={limit.bound:g}: {limit.bound:g} m is more than the "
                f"structure's size, {length_text(float(size))}; give a length in m, or in words as "
                "20um or 0.02mm"
            )
    return tuple(out)


def _limit_of(text: str, where: str) -> Limit:
    """Return a limit from ``NAME=VALUE``."""
    (name, value), line = split_word(text), f"{where} {text}"
    if name == "payload":
        raise ProblemError(f"{line}: give payload alone, and values with --payload")
    if name == LINEAR_RANGE and value == LIFTED:
        return Limit(name, math.inf)
    if name == LINEAR_RANGE:
        try:
            return Limit(name, number_word(value, line))
        except ProblemError as error:
            hint = f"give a share of it, as 0.5, or {LIFTED} to lift it"
            raise ProblemError(f"{error}; {hint}") from None
    if name not in (*NAMES, "F_each") and not name.startswith("F_"):
        names = ("payload", *NAMES, LINEAR_RANGE)
        hint = did_you_mean(name, names)
        raise ProblemError(f"{where} {name} does not exist{hint}; give {', '.join(names)}, F_ROBOT")
    if name == TOLERANCE or UNITS.get(name[0]) == "m":
        unit = next((unit for unit in _LENGTHS if value.endswith(unit)), "")
        number = number_word(value.removesuffix(unit), line, "m, or a length as 20um or 0.02mm")
        return Limit(name, number * _LENGTHS.get(unit, 1.0))
    return Limit(name, number_word(value, line, UNITS.get(name[0], "")))


def register(*parts: Amount | Filter | Resource | Part) -> None:
    """Add amounts, filters, resources, formats and commands, asked for by name.

    Packages register theirs by entry points of the group ``seqopt.parts``.

    Parameters
    ----------
    *parts : Amount, Filter, Resource, Format or Command
        Each takes the place of one of its kind that was registered by its name before.

    Raises
    ------
    ProblemError
        If something is none of these, or has the name of something that is always there.

    Examples
    --------
    >>> import seqopt
    >>> from seqopt.problem import Amount
    >>> seqopt.register(Amount("held", lambda states: (states.nodes >= 0).sum(axis=1)))
    >>> seqopt.optimize("chain:bricks=7", "free", aim="minmax,held").objective["held"]
    26.0
    """
    for part in parts:
        if not isinstance(part, Amount | Filter | Resource | Part):
            raise ProblemError(
                f"{short(part)}: give an Amount, a Filter or a Resource of seqopt.problem, a "
                "Format of seqopt.exchange or a Command of seqopt"
            )
        taken = part.built_in if isinstance(part, Part) else (*BUILT_IN, *TAKEN)
        if part.name in taken:
            raise ProblemError(f"{part!r}: this name has a meaning already; give another one")
        ADDED[type(part), part.name] = part


def number_word(text: str, where: str, unit: str = "", *, zero: bool = False) -> float:
    """Return a positive number, or zero too; ``where``, ``unit``: for messages."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value <= LARGEST and not (zero and value == 0):
        most = f" up to {LARGEST:g}" if value > LARGEST else ""
        line = f"{text!r} is not a positive number{' or zero' * zero}{most}"
        raise ProblemError(f"{where}: {line}{f'; give a number of {unit}' if unit else ''}")
    return value


def split_word(text: str) -> tuple[str, str]:
    """Return a response, whose brackets may hold anything, and the number after ``=``, if any."""
    end = text.rfind("]") + 1
    name, _, number = text[end:].partition("=")
    return text[:end] + name, number
