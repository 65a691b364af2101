"""The requirements on a plan: a criterion, limits, what these need, and which steps exceed them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real
from typing import Protocol

import numpy as np

from seqopt.arrays import Bools, Floats
from seqopt.engines.interface import Engine, linear_limit
from seqopt.engines.registry import recipe_of
from seqopt.errors import MechanismError, ProblemError, StepError
from seqopt.network.network import Network
from seqopt.responses._tolerance import is_tolerance, misfits_along
from seqopt.responses.quantities import (
    EXCESS_COLUMN,
    NO_TOLERANCE,
    OFFERED,
    PROP_EXCESS,
    RESPONSES,
    TOLERANCE,
    _steps_in_words,
    length_text,
    robot_response,
)
from seqopt.responses.table import _analyzed, _Columns, _steps_in_table, force_column
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import Schedule, carried, loads
from seqopt.sequence.steps import AnyStep

LEVEL = 1e-9  # heights this close, over the height of the structure, are equal
NEVER = math.inf  # the brick count of a crown that is never reached
OWN = " over payload, weight and size"  # what it is named after where no fixed method gives scales
SCALED = ("F_largest", "M_sup", "T_max", "D_max")  # responses to which fixed methods give scales
ROUNDED = (
    ("F", 0.0278513762761887),
    ("T", 0.0278513762761887),
    ("C", 0.0278513762761887),
    ("M", 0.11321697673247444),
    ("D", 8.531988813508194),
)
"""What ranks round responses to, by first letter, in the units of `Units`.

About a thirty-sixth of a brick's weight, a ninth of it at a brick's length, and eight times
what a joint gives way under it: 1 N, 1 N m and 1e-6 m on the arch of Bruun et al., whose published
choices speak for such a rounding.
"""
LARGEST = 1e100  # number: products of larger ones overflow
CHOICE_RESPONSES = (*OFFERED, "F_move", "F_largest")  # of choices, and one per robot
NAMES = (*CHOICE_RESPONSES, TOLERANCE)
UNITS = {"F": "N", "T": "N", "C": "N", "M": "N m", "D": "m", "position": "m"}
"""Units of numbers, by what they are of, or by the first letter of a response."""
_LENGTHS = {"mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9, "m": 1.0}


@dataclass(frozen=True, eq=False, repr=False)
class Units:
    """A force, a moment and a displacement that grow as a scene's responses do."""

    force: float  # N; the mean weight of a brick
    moment: float  # N m; that weight at the mean length of a brick
    displacement: float  # m; that weight over the median translational stiffness of the joints

    def of(self, response: str) -> float:
        """Return the unit of a response, by its first letter: N, N m or m."""
        return {"M": self.moment, "D": self.displacement}.get(response[0], self.force)


def crown(scene: Scene) -> float:
    """Return how many bricks are placed when a build reaches its crown.

    The crown is the first of the highest bricks, by their centroids, if the build rises to it and
    comes down again after it: `NEVER` where the build ends at its highest level, as that of a wall.
    """
    height = np.array([brick.position for brick in scene.placed]) @ np.array(scene.up)
    level = LEVEL * max(float(np.ptp(height)), *scene.placed[0].dimensions)
    low = height < height.max() - level
    top = int(np.argmin(low))
    return top + 1 if low[0] and low[top:].any() else NEVER


@dataclass(frozen=True, eq=False, repr=False)
class SceneFacts:
    """Numbers of a scene that criteria use, each computed when it is first needed."""

    engine: Engine

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the scene's robots."""
        return tuple(robot.name for robot in self.engine.network.scene.robots)

    @cached_property
    def crown(self) -> float:
        """See `crown`."""
        return crown(self.engine.network.scene)

    @cached_property
    def units(self) -> Units:
        """The units of the scene, each 1 where it has no weight or no stiffness."""
        network = self.engine.network
        weight = float(np.linalg.norm(network.weight, axis=1).mean()) or 1.0
        length = float(np.mean([max(brick.dimensions) for brick in network.scene.bricks]))
        stiffness = network.springs.translational_stiffness
        middle = float(np.median(stiffness[stiffness > 0])) if stiffness.any() else 1.0
        return Units(weight, weight * length, weight / middle)

    @property
    def reference(self) -> Mapping[str, float]:
        """The least that any fixed method reaches of each response's largest value, SI units.

        Where no fixed method can build the scene, or none stands on the way: `own_scales`.
        """
        if not self._reached:
            return self.own_scales
        return {name: min(values[name] for values in self._reached) for name in SCALED}

    @property
    def own_scales(self) -> Mapping[str, float]:
        """Scales that every scene has, SI units, for one that no fixed method builds.

        Of grip forces it is the smallest payload; of ``T_max`` the weight of the structure, of
        ``M_sup`` this at its size, of ``D_max`` what it moves a chain of a joint for every brick.
        """
        scene = self.engine.network.scene
        size = np.ptp([brick.position for brick in scene.bricks], axis=0).max()
        size += max(max(brick.dimensions) for brick in scene.bricks)
        weight = len(scene.bricks) * self.units.force
        names = [*map(robot_response, self.robots), "F_largest"]
        return dict.fromkeys(names, min(robot.payload for robot in scene.robots)) | {
            "T_max": weight,
            "M_sup": weight * float(size),
            "D_max": len(scene.bricks) ** 2 * self.units.displacement,
        }

    @property
    def basis(self) -> str:
        """What is added to the name of a criterion where no fixed method gives scales."""
        return "" if self._reached else OWN

    @cached_property
    def _reached(self) -> list[dict[str, float]]:
        """The largest responses of every fixed method that can build the scene without props."""
        engine, found, recipe = self.engine, [], recipe_of(self.engine)
        if recipe is not None and engine.network.scene.props:
            engine = recipe.make(engine.network.scene.with_props())
        network = engine.network
        for method in METHODS.values():
            with suppress(StepError, MechanismError):
                table = _analyzed(engine, method(network))
                along = ((name, _response_along(network.scene, table, name)) for name in SCALED)
                found.append({name: float(np.nanmax(values)) for name, values in along})
        return found


ChoiceResponses = Mapping[str, Floats]


class Criterion(Protocol):
    """What a step costs."""

    @property
    def name(self) -> str:
        """What the criterion is called."""

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs of a move.

        Parameters
        ----------
        bricks : int
            Bricks placed when the move is made.

        Returns
        -------
        tuple of str
            Names of responses.
        """

    @property
    def settings(self) -> Mapping[str, object]:
        """The numbers that the criterion uses, for the summary, ready for JSON."""

    def for_scene(self, facts: SceneFacts) -> Criterion:
        """Return the criterion with everything that it takes from a scene filled in.

        Parameters
        ----------
        facts : SceneFacts
            Robots, crown, units and scales of the scene.

        Returns
        -------
        Criterion
            With ``F_each`` spelled out for the robots, and no number left open.
        """

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the costs of all choices in one step.

        Parameters
        ----------
        responses : mapping of str to (C,) or (C, D) float
            SI units; NaN where a choice is impossible, all NaN where a robot does not grip.
        bricks : int
            Bricks that stand in the step; of ranks, at the move that decides it: the later of two.
        choices : int
            How many candidates that move has.

        Returns
        -------
        (C,) or (C, D) float
            NaN where a choice is impossible.
        """


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
    return {
        limit.label: limit.shown(limit.bound) if math.isfinite(limit.bound) else LIFTED
        for limit in limits
    }


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


def state_costs(
    criterion: Criterion, found: Mapping[str, Floats], bricks: int, possible: Bools
) -> Floats:
    """Return costs of states (n,), infinite where they are infeasible (n,).

    Steps can be added to a plan, so none that counts may cost less than nothing. ``found`` has
    responses (n,), SI units.
    """
    costs = np.where(possible, criterion.costs(found, bricks, len(possible)), np.inf)
    if (costs < 0).any():
        raise ProblemError(
            f"criterion {criterion.name}: a step costs {costs.min():.6g} at {bricks} bricks; none "
            "may cost less than zero: add a constant"
        )
    return costs


def require_parts(engine: Engine, moves: Schedule | FreeRules, criterion: Criterion) -> None:
    """Raise a `ProblemError` if a part of a problem is none."""
    wanted = (
        (engine, isinstance(getattr(engine, "network", None), Network), "engine", "make_engine"),
        (moves, isinstance(moves, Schedule | FreeRules), "schedule", "three_robot_loop"),
        (criterion, hasattr(criterion, "for_scene"), "criterion", "CRITERIA"),
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
        own, load = [each for each in every if each.robot == r], loads(scene, robot)
        weighed = [(float(load[scene.since[each.brick] - 1]), each) for each in own]
        over = [(load, each) for load, each in weighed if limit.exceeded(np.array(load))]
        if over:
            numbers = tuple(sorted(each.step for _, each in over))
            most, worst = max(over)
            out.append(Excess(limit, numbers, most, robot.name, worst.brick))
    return tuple(out)


def _prop_faults(scene: Scene, table: _Columns) -> tuple[Excess, ...]:
    """Return in which steps props bear more than they may; see `_excesses`."""
    return _excesses(scene, table, _prop_limits(scene))


def _response_along(scene: Scene, table: _Columns, name: str) -> np.ndarray:
    """Return a response of every step (steps,) as limits name it, but ``F_move``.

    They are in SI units, sizes without sign, NaN where the robot does not grip.
    """
    if name == "C_max":
        least = np.asarray(table[RESPONSES["F_min"].column], dtype=float)
        return np.asarray(np.maximum(-least, 0.0))
    if is_tolerance(name):
        return misfits_along(table)
    if name == PROP_EXCESS:
        return np.asarray(table[EXCESS_COLUMN], dtype=float)
    if name in RESPONSES:
        response = RESPONSES[name]
        return np.asarray(table[response.column], dtype=float) / response.scale
    columns = {robot_response(robot.name): force_column(robot) for robot in scene.robots}
    asked = columns.values() if name == "F_largest" else [columns[name]]
    forces = np.abs([np.asarray(table[column], dtype=float) for column in asked])
    return np.asarray(np.fmax.reduce(forces))


def number_word(text: str, where: str, unit: str = "", *, zero: bool = False) -> float:
    """Return a positive number, or zero too; ``where``, ``unit``: for messages."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value <= LARGEST and not (zero and value == 0):
        most = f" up to {LARGEST:g}" if value > LARGEST else ""
        said = f"{text!r} is not a positive number{' or zero' * zero}{most}"
        raise ProblemError(f"{where}: {said}{f'; give a number of {unit}' if unit else ''}")
    return value


def length_word(text: str, where: str) -> float:
    """Return a positive length, m, from words such as ``0.4mm``; ``where``: for messages."""
    unit = next((unit for unit in _LENGTHS if text.endswith(unit)), "")
    return number_word(text.removesuffix(unit), where) * _LENGTHS.get(unit, 1.0)


def split_word(text: str) -> tuple[str, str]:
    """Return a response, whose brackets may hold anything, and the number after ``=``, if any."""
    end = text.rfind("]") + 1
    name, _, number = text[end:].partition("=")
    return text[:end] + name, number
