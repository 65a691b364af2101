"""Plans as a table and as JSON: absent, placed or held, by block and step. Tables of boxes."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from seqopt._files import harmless, read_table
from seqopt.errors import SceneError
from seqopt.exchange._content import LARGEST, MOST_BLOCKS, Content, FileBlock
from seqopt.scene._checks import short
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind


class BlockState(Enum):
    """The state of a block in a step."""

    ABSENT = "absent"
    PLACED = "placed"
    HELD = "held"  # placed, and held by a robot


@dataclass(frozen=True)
class StepStates:
    """A step by its blocks."""

    step: Step
    new: tuple[int, ...]  # names of the bricks that this step places
    holds: dict[str, tuple[int, int]]  # node and brick, by the robots' names
    states: dict[int, BlockState]  # of all bricks by name, in build order


def step_states(scene: Scene, steps: Sequence[Step]) -> Iterator[StepStates]:
    """Yield what becomes of every block in every step of a checked plan for the scene."""
    begins = any(step.kind is StepKind.REMOVE for step in steps)
    before = steps[0].bricks if begins else 0  # of a take-down nothing is placed
    names = [brick.name for brick in scene.placed]
    for step in steps:
        holds = {
            robot.name: (node, scene.brick_of_node[node].name)
            for robot, node in zip(scene.robots, step.grips, strict=True)
            if node is not None
        }
        states = dict.fromkeys(names, BlockState.ABSENT)
        states |= dict.fromkeys(names[: step.bricks], BlockState.PLACED)
        states |= {brick: BlockState.HELD for _, brick in holds.values()}
        yield StepStates(step, tuple(names[before : step.bricks]), holds, states)
        before = step.bricks


def plan_csv(scene: Scene, steps: Sequence[Step]) -> str:
    """Return a plan as CSV, a row per step.

    Its columns are ``step``, ``type``, ``bricks``, the ``placed`` bricks, what every robot holds as
    ``NAME_node`` and ``NAME_brick``, and ``block_N`` for every brick in build order.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    robots = [robot.name for robot in scene.robots]
    grips = [harmless(f"{name}_{what}") for name in robots for what in ("node", "brick")]
    blocks = [f"block_{brick.name}" for brick in scene.placed]
    writer.writerow(["step", "type", "bricks", "placed", *grips, *blocks])
    for row in step_states(scene, steps):
        held = [cell for name in robots for cell in row.holds.get(name, ("", ""))]
        step, placed = row.step, " ".join(map(str, row.new))
        states = [state.value for state in row.states.values()]
        writer.writerow([step.number, step.kind.value, step.bricks, placed, *held, *states])
    return out.getvalue()


def plan_json(scene: Scene, steps: Sequence[Step]) -> str:
    """Return a plan as JSON.

    It has ``blocks``, the names of all bricks in build order; and ``steps``, each with its
    ``type``, the bricks that are ``placed``, what robots hold as ``holds``, and the ``states`` of
    all blocks in their order.
    """
    rows = [
        {
            "step": row.step.number,
            "type": row.step.kind.value,
            "placed": list(row.new),
            "holds": {
                name: {"node": node, "block": brick} for name, (node, brick) in row.holds.items()
            },
            "states": [state.value for state in row.states.values()],
        }
        for row in step_states(scene, steps)
    ]
    whole = {
        "format": "seqopt-plan",
        "version": 1,
        "scene": scene.name,
        "blocks": [brick.name for brick in scene.placed],
        "robots": [robot.name for robot in scene.robots],
        "steps": rows,
    }
    return json.dumps(whole, ensure_ascii=False) + "\n"


_NEEDED = ("x", "y", "z", "length", "width", "height")
_TURNS = ("roll", "pitch", "yaw")
_COLUMNS = (*_NEEDED, *_TURNS, "name", "support", "density", "mass", "course")
_YES, _NO = ("1", "true", "yes"), ("", "0", "false", "no")


def read_boxes(text: str, source: str) -> Content:
    """Return the boxes of a table with the columns `_NEEDED`, the centroid and sizes.

    Others of `_COLUMNS` may be there: turns are in degrees about x, then y, then z.
    """
    names, found = read_table(text, source, SceneError)
    rows = [row for _, row in found]
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        raise SceneError(f"{source}: column {missing[0]} is missing; give {', '.join(_NEEDED)}")
    for name in names:
        if name not in _COLUMNS or names.count(name) > 1:
            why = "occurs twice" if name in _COLUMNS else "is not known"
            raise SceneError(f"{source}: column {short(name)} {why}; give {', '.join(_COLUMNS)}")
    if not rows or len(rows) > MOST_BLOCKS:
        raise SceneError(f"{source}: {len(rows)} rows; give 1 to {MOST_BLOCKS} boxes")
    return Content(
        tuple(_box(f"{source}, row {i}", str(i), row) for i, row in enumerate(rows, start=1)),
        said=("a table of boxes: no faces",),
    )


def _box(where: str, key: str, row: dict[str, str]) -> FileBlock:
    center = np.array([_number(where, row, name) for name in "xyz"])
    size = np.array([_number(where, row, name) for name in ("length", "width", "height")])
    if not size.min() > 0:
        raise SceneError(f"{where}: its sizes are {size.tolist()}; give positive ones")
    angles = [_number(where, row, name, "0") for name in _TURNS]
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  # slow to import

    frame = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    optional = (_number(where, row, name, "nan") for name in ("density", "mass", "course"))
    density, mass, course = (None if math.isnan(value) else value for value in optional)
    if mass is not None and not mass > 0:
        raise SceneError(f"{where}: mass is {mass:g}; give a positive number of kg")
    text = (row.get("support") or "").strip().lower()
    if text not in (*_YES, *_NO):
        raise SceneError(f"{where}: support is {short(text)}; give 1 or 0")
    return FileBlock(
        row.get("name", "").strip() or key,
        center + 0.5 * (BOX_CORNERS * size) @ frame.T,
        BOX_FACES,
        support=text in _YES,
        density=density,
        mass=mass,
        course=course,
    )


def _number(where: str, row: dict[str, str], name: str, otherwise: str = "") -> float:
    text = (row.get(name) or "").strip()
    try:
        value = float(text or otherwise)
    except ValueError:
        value = math.inf
    if abs(value) > LARGEST or (text and math.isnan(value)):
        raise SceneError(f"{where}: {name} is {short(text)}; give a number")
    return value
