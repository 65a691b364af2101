"""Model sufficiency: whether a more detailed model would change results, and neglected effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import chain

import numpy as np

from seqopt.arrays import Terse
from seqopt.contact.mortar import _mortar_name, _with_mortar
from seqopt.engines.interface import OpeningEngine
from seqopt.engines.registry import AutoEngine, recipe_of, simplest
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.responses._tolerance import each_tolerance
from seqopt.responses.quantities import RESPONSES, _plain, length_text
from seqopt.responses.table import LinearRange, _Columns, _node, force_column, held_in_table

_FEW = 100  # bricks up to which tolerances take less than a second
_KNOWN = AutoEngine, ComplianceEngine, OpeningEngine


@dataclass(frozen=True, repr=False)
class Enough(Terse):
    """The model of the steps of builds, and the estimated effect of other models.

    ``engine``: its name; ``others``: what more detailed ones would change here, in words;
    ``joint``, ``step``: which joint comes closest to its elastic limits, and where; empty where
    that is not known; ``below_limit``: its margin to these, Pa; negative beyond them;
    ``left_out``: of the model.
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
        others = unknown + unchecked
    elif below >= 0:
        close = f"{where} comes closest to its elastic limits, {below / 1e6:.3g} MPa below them"
        own = f" {_with_mortar(_mortar_name(within.mortar))}"  # whose limits they are
        own = "" if isinstance(engine, AutoEngine) else own
        others = f"discrete elements{own} would change nothing in these steps: {close}"
    elif isinstance(engine, AutoEngine):
        others = "discrete elements were taken where joints open, elsewhere they change nothing"
    else:
        others = f"{unknown}{where} leaves its limits; the engine discrete says it"
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
    scene = within.engine.network.scene
    linear = isinstance(within.engine, AutoEngine | ComplianceEngine)
    if not linear or len(scene.bricks) > _FEW:
        return ""
    carried = (
        (robot, table[force_column(robot)]) for table in builds.values() for robot in scene.robots
    )
    if any((np.abs(np.asarray(force)) > robot.payload).any() for robot, force in carried):
        return ""
    held = {name: held_in_table(scene, table) for name, table in builds.items()}
    found = each_tolerance(within.engine, [*chain.from_iterable(held.values())], within.offs)
    at = int(found.argmin())
    if not 0 < found[at] < np.inf:  # two rigid grips on one brick have no tolerance
        return ""
    places = [(name, step) for name, steps in held.items() for step, *_ in steps]
    where = f"step {places[at][1]}{f' of {places[at][0]}' if len(builds) > 1 else ''}"
    return f" (rigid grips {length_text(found[at])} off exceed a payload: {where})"
