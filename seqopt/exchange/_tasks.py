"""What each robot does in every step, for those who program robots: frames of blocks and tools.

In a step of placing, a robot picks a block from where the yard has it and places it; in one of
repositioning it takes a standing block; in one of releasing it lets go; in one of removing it takes
a block that it holds out of the structure and stores it. All others hold on.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache

import numpy as np
import pandas as pd

from seqopt._files import csv_text
from seqopt.arms._plan_postures import plan_postures
from seqopt.arms._postures import PostureTable
from seqopt.arrays import Floats
from seqopt.errors import StepError
from seqopt.exchange._grip_frames import (
    Document,
    Frame,
    Held,
    brick_frame,
    compas_frame,
    hold,
    mesh_data,
    typed,
)
from seqopt.scene._armed import PlanPostures
from seqopt.scene._checks import finite, positive, rows, short
from seqopt.scene.boxes import as_vector, vertices_of
from seqopt.scene.parts import Brick, Robot, Sphere
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step, StepKind

Postures = Mapping[tuple[str, int], Sequence[float]]
"""Joint values of arms by the names of robots and by nodes."""
_Key = tuple[str, int]


class Action(Enum):
    """What a robot does."""

    PICK = "pick"  # it takes the next block, wherever this is kept
    PLACE = "place"  # it brings it to its place, and holds on
    REPOSITION = "reposition"  # it takes hold of a block that stands
    HOLD = "hold"  # it goes on holding
    RELEASE = "release"  # it lets go
    REMOVE = "remove"  # it takes the block that it holds out of the structure
    STORE = "store"  # it puts this away, wherever it is kept


@dataclass(frozen=True)
class Task:
    """What one robot does in one step; frames are of the scene, m.

    ``grip`` is the frame of the tool, with its tip at the node and its third axis into the block,
    and ``grip_in_block`` the same from the block. A block is picked and stored where the reader
    keeps it, so tasks of this have no other frame. ``built``: how many blocks stand once the step
    is done.
    """

    step: int
    kind: StepKind
    action: Action
    robot: str
    block: int
    node: int
    built: int
    grip_in_block: Frame
    depth: float  # of the node behind the face through which the tool looks, m
    block_frame: Frame | None = None
    grip: Frame | None = None
    approach: Frame | None = None  # of the tool, before
    retreat: Frame | None = None  # of the tool, after
    posture: tuple[float, ...] | None = None  # values of the arm's joints


_SAID = ("robot", "block", "node", "built")
_DIGITS = 9  # of numbers in a table: a micrometer in a kilometer
FRAMES = ("block_frame", "grip", "approach", "retreat", "grip_in_block")


def plan_tasks(
    scene: Scene,
    steps: Sequence[Step],
    distance: float | None = None,
    postures: Postures | None = None,
) -> Iterator[Task]:
    """Yield what robots do in a checked plan, step by step.

    Parameters
    ----------
    scene, steps
        A scene, and a checked plan for it.
    distance
        From a grip to where a tool comes from, and goes to, m; by default a block's longest side.
    postures
        Joint values of arms by robot and node, where they are known.

    Yields
    ------
    Task
        What a step changes comes first, then who holds on, in the order of the robots.

    Raises
    ------
    SceneError
        If the distance is not positive, or a posture is of no numbers.
    StepError
        If postures name no robot or node of the scene.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> steps = seqopt.sequential(seqopt.build_network(scene))
    >>> second = [task for task in plan_tasks(scene, steps) if task.step == 2]
    >>> [(task.robot, task.action.value, task.block) for task in second]
    [('rob2', 'pick', 2), ('rob2', 'place', 2), ('rob1', 'hold', 1)]
    """
    far = None if distance is None else positive("distance", distance, "m")
    known = _checked(scene, postures or {})

    @cache
    def found(robot: Robot, node: int) -> _Grip:
        brick = scene.brick_of_node[node]
        away = max(brick.dimensions) if far is None else far
        posture = known.get((robot.name, node))
        return _Grip(robot.name, node, brick.name, hold(scene, robot, node), away, posture)

    last: Grips = (None,) * len(scene.robots)
    for step in steps:
        tasks = []
        for robot, old, new in zip(scene.robots, last, step.grips, strict=True):
            node = old if new is None else new
            if node is not None:
                grip = found(robot, node)
                tasks += [_task(step, action, grip) for action in _actions(step, old, new)]
        yield from sorted(tasks, key=lambda task: task.action is Action.HOLD)
        last = step.grips


@dataclass(frozen=True)
class _Grip:
    """A node in a robot's hand."""

    robot: str
    node: int
    block: int
    held: Held
    far: float  # m; from the grip to where the tool comes from
    posture: tuple[float, ...] | None


def _actions(step: Step, old: int | None, new: int | None) -> tuple[Action, ...]:
    """Return what a robot does whose grip a step changes from one node to another, or leaves."""
    if old == new:
        return (Action.HOLD,)
    if new is None:
        away = (Action.REMOVE, Action.STORE)
        return away if step.kind is StepKind.REMOVE else (Action.RELEASE,)
    return (Action.PICK, Action.PLACE) if step.kind is StepKind.PLACE else (Action.REPOSITION,)


def _task(step: Step, action: Action, grip: _Grip) -> Task:
    """Return what a robot does, with the frames that this has."""
    held, there = grip.held, action not in (Action.PICK, Action.STORE)
    block, tool = held.block, held.grip
    back = tool.moved(-tool.axes[2], grip.far)
    away = tool.moved(np.array(held.away), grip.far)
    approach = {Action.PLACE: away, Action.REPOSITION: back}
    retreat = {Action.RELEASE: back, Action.REMOVE: away}
    return Task(
        step=step.number,
        kind=step.kind,
        action=action,
        robot=grip.robot,
        block=grip.block,
        node=grip.node,
        built=step.bricks,
        grip_in_block=tool.inside(block),
        depth=held.depth,
        block_frame=block if there else None,
        grip=tool if there else None,
        approach=approach.get(action),
        retreat=retreat.get(action),
        posture=grip.posture if there else None,
    )


def _checked(scene: Scene, postures: Postures) -> dict[_Key, tuple[float, ...]]:
    """Return joint values if each is of a robot and a node of the scene."""
    named = {(robot.name, node) for robot in scene.robots for node in scene.brick_of_node}
    out: dict[_Key, tuple[float, ...]] = {}
    for key, values in postures.items():
        if key not in named:
            raise StepError(f"posture of {short(key)}: give the name of a robot, and a node")
        where = f"posture of {key[0]} at node {key[1]}"
        out[key] = tuple(finite(where, value) for value in rows(where, values, "numbers"))
    if len(counts := {len(values) for values in out.values()}) > 1:
        raise StepError(f"postures have {min(counts)} to {max(counts)} values; give as many each")
    return out


def tasks_json(scene: Scene, tasks: Iterable[Task]) -> str:
    """Return tasks as JSON that `compas.json_load` opens: frames and shapes are those of COMPAS.

    ``blocks`` has the shape and the frame of every block in build order, ``robots`` what is known
    of each, with the base of one that stands in the middle of its reach, ``tasks`` a row for each
    `Task`.
    """
    whole = {
        "format": "seqopt-tasks",
        "version": 1,
        "scene": scene.name,
        "unit": "m",
        "blocks": [
            {
                "block": brick.name,
                "mass": brick.mass,
                "frame": compas_frame(brick_frame(brick)),
                "shape": typed("compas.datastructures/Mesh", mesh_data(*vertices_of(brick))),
            }
            for brick in scene.placed
        ],
        "robots": [
            {
                "robot": robot.name,
                "payload": robot.payload,
                "base": robot.reach.center if isinstance(robot.reach, Sphere) else None,
            }
            for robot in scene.robots
        ],
        "tasks": [_row(task) for task in tasks],
    }
    return json.dumps(whole, ensure_ascii=False) + "\n"


def _row(task: Task) -> Document:
    """Return a task with the frames of COMPAS; what there is not is null."""
    said: Document = {name: getattr(task, name) for name in _SAID}
    said |= {name: compas_frame(getattr(task, name)) for name in FRAMES}
    return {
        "step": task.step,
        "type": task.kind.value,
        "action": task.action.value,
        **said,
        "depth": round(task.depth, 9),
        "posture": task.posture,
    }


def tasks_csv(tasks: Iterable[Task]) -> str:
    """Return tasks as CSV, a row each: a frame is a place, m, and a quaternion.

    Its columns are ``NAME_x``, ``NAME_y``, ``NAME_z`` and ``NAME_qw``, ``NAME_qx``, ``NAME_qy``,
    ``NAME_qz`` for each of `FRAMES`; and ``joint_1`` and so on, where postures are known.
    """
    held = list(tasks)
    table = pd.DataFrame(
        {
            "step": [task.step for task in held],
            "type": [task.kind.value for task in held],
            "action": [task.action.value for task in held],
            **{name: [getattr(task, name) for task in held] for name in _SAID},
            "depth": [task.depth for task in held],
        }
    )
    parts = [_places(name, [getattr(task, name) for task in held]) for name in FRAMES]
    most = max((len(task.posture or ()) for task in held), default=0)
    joints = [
        [*own, *[np.nan] * (most - len(own))] for own in (task.posture or () for task in held)
    ]
    parts.append(pd.DataFrame(joints, columns=[f"joint_{i}" for i in range(1, most + 1)]))
    return csv_text(pd.concat([table, *parts], axis=1), _DIGITS)


def _places(name: str, frames: Sequence[Frame | None]) -> pd.DataFrame:
    """Return frames as columns: places, and quaternions whose first number is not negative."""
    out = np.full((len(frames), 7), np.nan)
    known = [i for i, frame in enumerate(frames) if frame is not None]
    held = [frame for frame in frames if frame is not None]
    if held:
        axes = np.array([frame.axes for frame in held])
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  # slow to import

        turned = Rotation.from_matrix(axes.transpose(0, 2, 1)).as_quat(canonical=True)
        out[known, :3] = [frame.point for frame in held]
        out[known, 3:] = turned[:, [3, 0, 1, 2]]
    ends = ("x", "y", "z", "qw", "qx", "qy", "qz")
    return pd.DataFrame(out.round(9) + 0.0, columns=[f"{name}_{end}" for end in ends])


def _known_tasks(
    scene: Scene,
    steps: Sequence[Step],
    distance: float | None = None,
    postures: Postures | None = None,
) -> Iterator[Task]:
    """Yield tasks of a plan as `plan_tasks` does, by default in the postures of its arms.

    Raises `ExtraError` if these have to be computed and nothing is installed that does.
    """
    tasks = plan_tasks(scene, steps, distance, postures)
    found = plan_postures(scene, steps) if postures is None else None
    return tasks if found is None else _in_postures(scene, tasks, found)


def _in_postures(scene: Scene, tasks: Iterable[Task], found: PlanPostures) -> Iterator[Task]:
    """Yield tasks of a plan with the postures of its steps; those of steps without stay.

    A robot that lets go does so in the posture in which it held, that of the step before.
    """
    places = {robot.name: i for i, robot in enumerate(scene.robots)}
    for task in tasks:
        step = task.step - 1 - (task.action is Action.RELEASE)
        row = found.steps[step][places[task.robot]]
        brick = scene.brick_of_node[task.node]
        yield task if row is None else _in_posture(task, brick, found.table, row)


def _in_posture(task: Task, brick: Brick, table: PostureTable, row: int) -> Task:
    """Return a task with the joints and the frames of a row of the table."""
    axes, block = table.axes[row], brick_frame(brick)
    tool = Frame(brick.node_position(task.node), as_vector(axes[:, 0]), as_vector(axes[:, 1]))
    outward = -tool.axes[2]
    half = 0.5 * float(np.abs(brick.frame @ outward) @ np.array(brick.dimensions))
    depth = half - float(np.subtract(tool.point, brick.position) @ outward)
    out = replace(task, grip_in_block=tool.inside(block), depth=depth)
    if task.grip is None:
        return out
    joints = table.joints[row]
    approach, retreat = (_gone(task, tool, frame) for frame in (task.approach, task.retreat))
    posture = tuple(joints[np.isfinite(joints)].tolist())
    return replace(out, grip=tool, approach=approach, retreat=retreat, posture=posture)


def _gone(task: Task, tool: Frame, frame: Frame | None) -> Frame | None:
    """Return where a tool comes from or goes to, as far from its grip as was proposed.

    A block that is placed comes along its own way; else the tool goes straight back.
    """
    if frame is None or task.grip is None:
        return None
    way: Floats = np.subtract(frame.point, task.grip.point)
    far = float(np.linalg.norm(way))
    back = way / far if task.action is Action.PLACE else -tool.axes[2]
    return tool.moved(back, far)
