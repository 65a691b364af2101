"""Responses of steps as a table: the columns of Tables A.1 and A.2 of Bruun et al.

Also its grips: robot, node, first and last step, and force; and whether the model was enough:
steps within the range of a linear one, and what others would change.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from itertools import chain, groupby
from operator import attrgetter, itemgetter
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from seqopt.arrays import Floats, Terse
from seqopt.contact.mortar import EPOXY, _mortar_name, _with_mortar, find_elastic_limits
from seqopt.engines.interface import (
    Engine,
    Fields,
    OpeningEngine,
    Want,
    linear_limit,
    no_sets,
    select_sets,
)
from seqopt.engines.registry import AutoEngine, _chooser_of, recipe_of, simplest
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, SceneError, SolverError
from seqopt.network.network import Network
from seqopt.responses._tolerance import misfits, tied
from seqopt.responses.quantities import (
    NO_TOLERANCE,
    RESPONSES,
    _plain,
    _prop_cells,
    _steps_in_words,
    grip_forces,
    length_text,
    lengths,
    require_finite,
    robot_response,
    support_forces,
    support_moments,
)
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import holds
from seqopt.sequence.steps import Grips, Step, StepKind, require_steps

_Columns: TypeAlias = "Mapping[str, Sequence[Any]] | pd.DataFrame"
"""A table of `analyze`, or its columns by name: where no table is needed, pandas takes long."""
_Key = tuple[int, tuple[int, ...]]  # bricks that stand, and what is held
_Held = tuple[int, int, tuple[int, ...]]
"""Number of a step, its bricks, and what is held."""
_MEASURED = Want.BRICKS | Want.JOINTS | Want.SCREEN  # limits are no sharper than six digits
_TURN = 0.1  # rad; sine and angle differ by 0.2 %, cosine and one by 0.5 %
_STRAIN = 0.1  # of a joint, over its thickness; true strain differs by 5 %
OUTSIDE = "outside the linear range"
FAR_OFF = "displacement"
REMEDY = (
    "Do not rely on numbers outside the linear range. Check sizes, densities and stiffnesses of "
    "the scene; make joints stiffer, let robots hold more or other nodes, or set a limit on D_max. "
    "Where only stress is too large, the engine discrete lets joints open and break."
)
_FEW = 100  # bricks up to which tolerances take less than a second
_KNOWN = AutoEngine, ComplianceEngine, OpeningEngine


def analyze(engine: Engine, steps: Sequence[Step]) -> pd.DataFrame:
    """Return the responses of every step, a row each, with the columns of Table A.1.

    Parameters
    ----------
    engine : Engine
        The engine that computes them.
    steps : sequence of Step
        Steps with every grip given; they need not follow each other.

    Returns
    -------
    pandas.DataFrame
        As of `seqopt.analyze`.

    Raises
    ------
    SceneError, StepError
        If an argument is not an engine, or not a list of steps; others as of `seqopt.analyze`.
    """
    return _table_of(_analyzed(engine, steps))


def analyze_builds(engine: Engine, builds: Mapping[str, Sequence[Step]]) -> dict[str, pd.DataFrame]:
    """Return the tables of `analyze` of builds by name; states that they share are solved once."""
    states = _distinct(builds.values())
    known = dict(zip(states, _each_fields(engine, states.values()), strict=True))
    each = {name: [known[step.bricks, step.grips] for step in own] for name, own in builds.items()}
    return {
        name: response_table(engine.network, zip(own, each[name], strict=True))
        for name, own in builds.items()
    }


def _analyzed(engine: Engine, steps: Sequence[Step]) -> dict[str, list[object]]:
    """Return the columns of `analyze`, with None where a robot does not grip."""
    if not isinstance(getattr(engine, "network", None), Network):
        kind = type(engine).__name__
        raise SceneError(f"a {kind} is not an engine; give make_engine('compliance', network)")
    steps = require_steps(steps)
    return _response_columns(engine.network, zip(steps, _each_fields(engine, steps), strict=True))


def _distinct(builds: Iterable[Sequence[Step]]) -> dict[tuple[int, Grips], Step]:
    """Return a step for every distinct state of builds, by ascending bricks, as engines grow."""
    states = {(step.bricks, step.grips): step for steps in builds for step in steps}
    return {state: states[state] for state in sorted(states, key=itemgetter(0))}


def response_table(network: Network, answers: Iterable[tuple[Step, Fields]]) -> pd.DataFrame:
    """Return a row of responses for every step, as `analyze` does, from the fields of each."""
    return _table_of(_response_columns(network, answers))


def _response_columns(
    network: Network, answers: Iterable[tuple[Step, Fields]]
) -> dict[str, list[object]]:
    """Return the columns of that table, with None where a robot does not grip."""
    rows = [_row(network, step, fields) for step, fields in answers]
    return {name: [row[name] for row in rows] for name in rows[0]} if rows else {}


def _table_of(columns: _Columns) -> pd.DataFrame:
    """Return a table of columns."""
    filled = {name: [pd.NA if v is None else v for v in each] for name, each in columns.items()}
    return pd.DataFrame(filled)


def _held_in_table(scene: Scene, table: _Columns) -> list[_Held]:
    """Return number, bricks and grips of every step of a table of `analyze`."""
    steps = _steps_in_table(scene, table)
    return [(s.number, s.bricks, scene.grip_numbers(s.grips, s.bricks)) for s in steps]


def _steps_in_table(scene: Scene, table: _Columns) -> list[Step]:
    """Return the steps of a table of `analyze`."""
    nodes = zip(*(table[f"{robot.name}_node"] for robot in scene.robots), strict=True)
    rows = zip(table["step"], table["type"], table["bricks"], nodes, strict=True)
    return [Step(int(n), StepKind(k), int(b), tuple(map(_node, own))) for n, k, b, own in rows]


def force_column(robot: Robot) -> str:
    """Return the column of a table that holds the force of a robot's grip, N."""
    return f"{robot_response(robot.name)}_N"


def support_columns(scene: Scene) -> list[tuple[str, str]]:
    """Return the columns for the force, N, and the moment, N m, of a scene's ground ends.

    They are named after the end's brick, counted from its second end on; none for one end.

    Examples
    --------
    >>> import seqopt
    >>> support_columns(seqopt.load_scene("arch25"))
    [('F_sup_1_N', 'M_sup_1_Nm'), ('F_sup_25_N', 'M_sup_25_Nm')]
    """
    bricks = [ground.brick for ground in scene.grounds]
    if len(bricks) == 1:
        return []
    before = [bricks[:i].count(brick) for i, brick in enumerate(bricks)]
    names = [f"{b}_{n + 1}" if n else f"{b}" for b, n in zip(bricks, before, strict=True)]
    return [(f"F_sup_{name}_N", f"M_sup_{name}_Nm") for name in names]


def step_fields(engine: Engine, step: Step, want: Want = Want.RESPONSES) -> Fields:
    """Return the full fields of one step, of one grip set; errors of the engine name the step."""
    if not step.bricks:  # where a take-down ends
        return no_sets(engine.network, 0, 0, sets=1)
    with step_named(step):
        held = engine.network.scene.grip_numbers(step.grips, step.bricks)
        return engine.solve(step.bricks, np.array(held, dtype=np.int64).reshape(1, -1), want)


def _each_fields(
    engine: Engine, steps: Iterable[Step], want: Want = Want.RESPONSES
) -> Iterator[Fields]:
    """Yield the full fields of every step; those with equal bricks in a row as one batch."""
    scene = engine.network.scene
    for bricks, same in groupby(steps, attrgetter("bricks")):
        near = [*same]
        keys = [(bricks, scene.grip_numbers(step.grips, bricks)) for step in near]
        found = dict[_Key, Fields]()
        with suppress(MechanismError, SolverError):  # which step it is, each alone says
            for alike, fields in _solved_alike(engine, keys, want):
                rows = (select_sets(fields, np.array([i])) for i in range(len(alike)))
                found |= zip(alike, rows, strict=True)
        for key, step in zip(keys, near, strict=True):
            yield found.get(key) or step_fields(engine, step, want)


def _solved_alike(
    engine: Engine, keys: Iterable[_Key], want: Want
) -> Iterator[tuple[list[_Key], Fields]]:
    """Yield distinct states and their fields, solved in batches of equal bricks and grips.

    By ascending brick counts, as engines grow with the build, and by descending numbers of grips,
    as more grips include the bricks of fewer. The empty site is not solved.
    """
    same = defaultdict[tuple[int, int], dict[_Key, None]](dict)
    for key in keys:
        if key[0]:
            same[key[0], len(key[1])][key] = None
    for (bricks, count), alike in sorted(same.items(), key=lambda item: (item[0][0], -item[0][1])):
        sets = np.array([held for _, held in alike], dtype=np.int64).reshape(len(alike), count)
        yield [*alike], engine.solve(bricks, sets, want)


def _node(cell: object) -> int | None:
    """Return the node that a cell of a table names, None if it is empty."""
    known = isinstance(cell, float | int | np.number) and not np.isnan(cell)
    return int(cell) if known else None  # type: ignore[call-overload]


@contextmanager
def step_named(step: Step) -> Iterator[None]:
    """Let errors of an engine name the step."""
    try:
        yield
    except MechanismError as error:
        raise MechanismError(f"step {step.number}: {error}", error.mode) from error
    except SolverError as error:
        raise SolverError(f"step {step.number}: {error}") from error


def _held_cells(scene: Scene, step: Step) -> dict[str, object]:
    """Return the cells of a step that need no responses."""
    row: dict[str, object] = {"step": step.number, "type": step.kind.value, "bricks": step.bricks}
    for robot, node in zip(scene.robots, step.grips, strict=True):
        row[f"{robot.name}_brick"] = None if node is None else scene.brick_of_node[node].name
        row[f"{robot.name}_node"] = node
    return row


def _row(network: Network, step: Step, fields: Fields) -> dict[str, object]:
    scene, row = network.scene, _held_cells(network.scene, step)
    forces = iter(require_finite("grip force", grip_forces(network, fields), step.bricks)[0])
    for robot, node in zip(scene.robots, step.grips, strict=True):
        row[force_column(robot)] = np.nan if node is None else next(forces)
    for response in RESPONSES.values():
        row[response.column] = 0.0
        if step.bricks:
            values = require_finite(response.name, response.of(network, fields), step.bricks)
            row[response.column] = values[0] * response.scale
    row |= _prop_cells(scene, step, fields.grip_force[0, len(step.held) :])
    acts = network.springs.since[network.springs.support] <= step.bricks
    carried = np.array([support_forces(network, fields)[0], support_moments(fields)[0]])
    cells = np.where(acts, carried, np.nan).T  # of ground ends; NaN where one does not act yet
    for columns, values in zip(support_columns(scene), cells, strict=False):  # none of a single one
        row |= dict(zip(columns, values, strict=True))
    return row


def grips_table(scene: Scene, steps: Sequence[Step], responses: pd.DataFrame) -> pd.DataFrame:
    """Return a row for every grip of a build, by first step, from the responses of `analyze`.

    ``places`` says whether the robot places the brick with it, ``at_step`` when its force is
    ``largest_force_N``.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> engine = seqopt.make_engine("compliance", seqopt.build_network(scene))
    >>> steps = seqopt.sequential(engine.network)
    >>> table = grips_table(scene, steps, seqopt.analyze(engine, steps))
    >>> print(table.loc[:1, ["robot", "from_step", "to_step", "brick", "node", "places"]])
      robot  from_step  to_step  brick  node  places
    0  rob1          1        2      1     1    True
    1  rob2          2        4      2     2    True
    """
    rows = []
    for hold in sorted(holds(scene, steps), key=lambda hold: (hold.first, hold.robot)):
        assert hold.node is not None  # steps have no open grips
        robot = scene.robots[hold.robot]
        before = steps[0].number - 1
        forces = responses[force_column(robot)].to_numpy(float)
        own = forces[hold.first - 1 - before : hold.last - before]
        row = {
            "robot": robot.name,
            "from_step": hold.first,
            "to_step": hold.last,
            "brick": scene.brick_of_node[hold.node].name,
            "node": hold.node,
            "places": hold.places is not None,
            "largest_force_N": float(own.max()),
            "at_step": hold.first + int(own.argmax()),
        }
        rows.append(row)
    return pd.DataFrame(rows)


@dataclass(frozen=True)
class Departure:
    """A limit of the linear range that some steps exceed."""

    what: str  # what is too large, in a word or two
    said: str  # the largest value, the limit, and why it is one
    steps: tuple[int, ...]  # numbers of the steps

    def __str__(self) -> str:
        return f"{self.what} of up to {self.said} ({_steps_in_words(self.steps)})"


class LinearRange:
    """Checks the steps of builds against the linear range of an engine.

    ``mortar``: with the elastic limits of joints; ``unchecked``: why stresses in joints are not
    checked, or empty; ``far``: the limit of displacements, m; ``offs``: cached tolerances, m.
    """

    def __init__(self, engine: Engine) -> None:
        self.engine, self._network = engine, engine.network
        self._breaks = isinstance(engine, AutoEngine | OpeningEngine)
        self._engine = engine.rigid if isinstance(engine, AutoEngine) else engine
        self.far = linear_limit(engine.network.scene)
        self._known: dict[_Key, Floats] = {}
        self.offs: dict[_Key, float] = {}
        thickness = engine.network.springs.thickness
        self._thickness = np.where(np.isnan(thickness) | self._breaks, np.inf, thickness)
        self.unchecked: tuple[str, ...] = ()
        chooser = engine if isinstance(engine, AutoEngine) else _chooser_of(engine)
        self.mortar = EPOXY if chooser is None else chooser.mortar
        self._limits = None if chooser is None else chooser.limits
        try:
            if self._limits is None and not self._breaks:
                self._limits = find_elastic_limits(engine.network, self.mortar)
        except SceneError as error:
            self.unchecked = (f"stresses in joints are not checked: {error}",)

    def departures(self, table: _Columns) -> tuple[Departure, ...]:
        """Return the limits that the steps of a build exceed, by their table of `seqopt.analyze`.

        Examples
        --------
        >>> import seqopt
        >>> from seqopt.responses.table import LinearRange
        >>> engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
        >>> table = seqopt.analyze(engine, seqopt.sequential(engine.network))
        >>> LinearRange(engine).departures(table)
        ()
        """
        shift, far = RESPONSES["D_max"], self.far
        moved = np.asarray(table[shift.column], dtype=float) / shift.scale
        turned, strained, stressed = self._measured(table)[:, :3].T
        stressed = np.where(self._breaks, -np.inf, stressed)
        steps = np.asarray(table["step"], dtype=int)
        within = f", more than {length_text(far)}, a tenth of the smallest side of a brick"
        deformed = f"{{:.3g}} times its thickness, more than {_STRAIN:g} times".format
        mortar = self.mortar
        strength = (
            f"{{:.3g}} MPa beyond what {_mortar_name(mortar)} holds, "
            f"{mortar.tensile_strength / 1e6:g} MPa in tension, {mortar.cohesion / 1e6:g} MPa and "
            "friction in shear"
        ).format
        found = (
            (FAR_OFF, moved, far, lambda most: length_text(most) + within),
            ("rotation", turned, _TURN, f"{{:.3g}} rad, more than {_TURN:g} rad".format),
            ("deformation of a joint", strained, _STRAIN, deformed),
            ("stress in a joint", stressed, 0.0, lambda most: strength(most / 1e6)),
        )
        return tuple(
            Departure(what, say(float(values[over].max())), tuple(steps[over].tolist()))
            for what, values, most, say in found
            if (over := ~(values <= most)).any()  # what is not a number is not within
        )

    def seen(self, step: Step, fields: Fields) -> Fields:
        """Return all fields of a step, and cache its measures."""
        (found,) = self._of(fields)
        if not (self._breaks and found[2] > 0):  # else others than those of rigid bricks
            numbers = self._network.scene.grip_numbers(step.grips, step.bricks)
            self._known[step.bricks, numbers] = found
        return fields

    def of_builds(self, tables: Mapping[str, _Columns]) -> dict[str, tuple[Departure, ...]]:
        """Return the limits that builds exceed, for those that exceed any, by name."""
        self._measured(*tables.values())
        return {name: left for name, each in tables.items() if (left := self.departures(each))}

    def closest(self, table: _Columns) -> tuple[float, str, int]:
        """Return margin, Pa, name and step of the joint closest to its limits; NaN if unknown."""
        excess, joint = self._measured(table)[:, 2:].T
        at = int(excess.argmax())
        if self._limits is None or not np.isfinite(excess[at]):
            return np.nan, "", 0
        name = self._limits.assembly.contact_name[int(joint[at])]
        return -float(excess[at]), f"joint {name}", int(np.asarray(table["step"])[at])

    def _measured(self, *tables: _Columns) -> Floats:
        """Return rotation, strain, excess of stress and in which joint, of every step, (n, 4)."""
        every = [_held_in_table(self._network.scene, table) for table in tables]
        keys = [(bricks, held) for _, bricks, held in chain.from_iterable(every)]
        if isinstance(self._engine, OpeningEngine):
            return np.full((len(keys), 4), -np.inf)  # far motions are unstable
        new = [key for key in keys if key not in self._known]
        self._known |= {key: np.array([0.0, 0.0, -np.inf, 0.0]) for key in new if not key[0]}
        for alike, fields in _solved_alike(self._engine, new, _MEASURED):
            self._known.update(zip(alike, self._of(fields), strict=True))
        return np.array([self._known[key] for key in keys])

    def _of(self, fields: Fields) -> Floats:
        """Return rotation, rad, strain, excess over elastic limits, Pa, and joint index, (S, 4)."""
        springs, bricks = self._network.springs, fields.brick_twist.shape[1]
        acting = max(1, int(np.searchsorted(springs.since, bricks, side="right")))
        joints = fields.joint_wrench[:, :acting]  # others bear nothing
        wrench = joints.reshape(*joints.shape[:2], 2, 3) @ springs.axes[:acting].transpose(0, 2, 1)
        stiffness = springs.stiffness[:acting].reshape(-1, 2, 3)
        given = np.divide(wrench, stiffness, out=np.zeros_like(wrench), where=stiffness > 0)
        shift, turn = lengths(given).transpose(2, 0, 1)
        turned = np.hstack([turn, lengths(fields.brick_twist[..., 3:])]).max(axis=1)
        if self._limits is None:
            strain, none = shift / self._thickness[:acting], np.zeros(len(turned))
            return np.column_stack([turned, strain.max(axis=1), none - np.inf, none])
        assembly = self._limits.assembly
        corners = int(np.searchsorted(assembly.contact, acting))
        face = assembly.contact[:corners]
        lever = lengths(assembly.corner[:corners] - springs.position[face])
        strain = (shift[:, face] + turn[:, face] * lever) / self._thickness[face]
        excess = self._limits.excess(joints)
        most = excess.max(axis=1, keepdims=True)
        first = np.isclose(excess, most, rtol=1e-9, atol=0.0).argmax(axis=1)  # of those that tie
        return np.column_stack([turned, strain.max(axis=1), most[:, 0], first])


def builds_in_words(departures: Mapping[str, Sequence[Departure]]) -> tuple[str, ...]:
    """Describe the builds that exceed the linear range, and their limits: one line, or none.

    Examples
    --------
    >>> builds_in_words({"a": [Departure("rotation", "1 rad, more than 0.1 rad", (3,))], "b": ()})
    ('a (rotation)',)
    """
    left = [name for name, each in departures.items() if each]
    what = dict.fromkeys(one.what for each in departures.values() for one in each)
    return (f"{', '.join(left)} ({', '.join(what)})",) if left else ()


@dataclass(frozen=True, repr=False)
class Enough(Terse):
    """The model of the steps of builds, and the estimated effect of other models.

    ``others``: what more detailed ones would change here, in words; ``joint``, ``step``: which
    comes closest to its elastic limits, and where; empty if not known; ``below_limit``: its margin
    to these, Pa, negative beyond them; ``left_out``: of the model.
    """

    engine: str
    others: str
    joint: str
    step: str
    below_limit: float | None
    left_out: tuple[str, ...]

    def facts(self) -> dict[str, object]:
        """Return the fields, ready for JSON."""
        said = asdict(self)
        return said | {"below_limit_Pa": said.pop("below_limit")}

    @property
    def lines(self) -> tuple[str, str]:
        """The sufficient model and its neglected effects, a line each."""
        first = "taken" if "not known" in self.others else "enough"
        return f"{first}: {self.engine}; {self.others}", f"left out: {'; '.join(self.left_out)}"


def what_was_enough(within: LinearRange, builds: Mapping[str, _Columns]) -> Enough:
    """Return the sufficient model of builds by their tables; ``within``: their engine's range."""
    engine = within.engine
    each = [(*within.closest(table), name) for name, table in builds.items()]
    below, joint, number, build = min(each, key=lambda one: np.nan_to_num(one[0], nan=np.inf))
    known = not np.isnan(below)
    step = f"step {number}{f' of {build}' if len(builds) > 1 else ''}" if known else ""
    where, unknown = f"{joint} in {step}", "what discrete elements would change is not known: "
    if isinstance(engine, OpeningEngine):
        others = "none is more detailed"
    elif not isinstance(engine, _KNOWN):
        others = "what another one would change is not known"
    elif not known:
        unchecked = "; ".join(within.unchecked) or str(getattr(engine, "unchecked", ""))
        others = unknown + (unchecked or "joints bear nothing that could be compared")
    elif below >= 0:
        close = f"{where} comes closest to its elastic limits, {below / 1e6:.3g} MPa below them"
        own = f" {_with_mortar(_mortar_name(within.mortar))}"  # whose limits they are
        own = "" if isinstance(engine, AutoEngine) else own
        others = f"discrete elements{own} would change nothing in these steps: {close}"
    elif isinstance(engine, AutoEngine):
        others = "discrete elements were taken where joints open, elsewhere they change nothing"
    else:
        others = f"{unknown}{where} leaves its limits; the engine discrete says it"
    if "not known" not in others and within.of_builds(builds):
        others = f"{unknown.removesuffix(': ')} {OUTSIDE}"
    recipe = recipe_of(simplest(engine) if below >= 0 else engine)
    name = type(engine).__name__ if recipe is None else recipe.name
    left_out = tuple(_left_out(within, builds))
    margin = below if known else None
    return Enough(name, others, joint if known else "", step, margin, left_out)


def _left_out(within: LinearRange, builds: Mapping[str, _Columns]) -> Iterator[str]:
    """Yield effects that the model neglects and that may matter in these builds."""
    every, moved = within.engine.network.scene.robots, RESPONSES["D_max"]
    kinds = within.engine.network.scene.grip_kinds
    rigid = ~kinds.gives[kinds.of_robot[: len(every)]]  # props come after robots
    robots = [robot for robot, is_rigid in zip(every, rigid, strict=True) if is_rigid]
    tables = builds.values()
    cells = (cell for t in tables for r in robots for cell in t[f"{r.name}_node"])
    if any(_node(cell) is not None for cell in cells):
        yield f"compliance of robots{_off(within, builds)}"
    props = within.engine.network.scene.props
    if any(prop.stiffness is None for prop in props):
        yield "compliance of props"
    if any(prop.direction for prop in props):
        yield "that props lift off which only push (plans in which one would pull are not allowed)"
    if any(len(table["step"]) > 1 for table in tables):
        yield "what earlier steps lock in"
    if not isinstance(within.engine, OpeningEngine):
        most = max(float(np.max(t[moved.column])) / moved.scale for t in tables) / within.far
        yield f"change of shape (bricks move by up to {_plain(100 * most, 2)} % of its limit)"
    yield "motion in time"


def _off(within: LinearRange, builds: Mapping[str, _Columns]) -> str:
    """Describe the tolerance of grips, in parentheses.

    Empty if the engine is not linear, there are many bricks, or a payload is exceeded anyway.
    """
    scene, known = within.engine.network.scene, within.offs
    linear = isinstance(within.engine, AutoEngine | ComplianceEngine)
    if not linear or len(scene.bricks) > _FEW:
        return ""
    carried = (
        (robot, table[force_column(robot)]) for table in builds.values() for robot in scene.robots
    )
    if any((np.abs(np.asarray(force)) > robot.payload).any() for robot, force in carried):
        return ""
    places = [(name, *one) for name, each in builds.items() for one in _held_in_table(scene, each)]
    every = ((bricks, np.array([held], dtype=np.int64)) for *_, bricks, held in places if bricks)
    if any(tied(within.engine, *one).any() for one in every):
        return ""  # two rigid grips on one brick have no tolerance
    new = {(bricks, len(held), held) for *_, bricks, held in places if (bricks, held) not in known}
    for (bricks, count), same in groupby(sorted(new), key=itemgetter(0, 1)):
        sets = [held for *_, held in same]
        grips = np.array(sets, dtype=np.int64).reshape(len(sets), count)
        for held, misfit in zip(sets, misfits(within.engine, bricks, grips).tolist(), strict=True):
            off = np.inf if misfit == 0 else 0.0 if misfit >= NO_TOLERANCE else 1 / misfit
            known[bricks, held] = off
    name, step, bricks, held = min(places, key=lambda place: known[place[2], place[3]])
    off = known[bricks, held]
    if not 0 < off < np.inf:
        return ""
    where = f"step {step}{f' of {name}' if len(builds) > 1 else ''}"
    return f" (rigid grips {length_text(off)} off exceed a payload: {where})"
