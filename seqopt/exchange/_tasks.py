"""What each robot does in every step, for those who program robots: frames of blocks and tools.

In a step of placing, a robot picks a block from where the yard has it and places it; in one of
repositioning it takes a standing block; in one of releasing it lets go; in one of removing it takes
a block that it holds out of the structure and stores it. All others hold on.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache

import numpy as np
import pandas as pd

from seqopt._registry import Later
from seqopt.arms._kept import PlanPostures, plan_postures
from seqopt.errors import ExtraError, SceneError
from seqopt.exchange._compas_shapes import compas_frame, mesh_data
from seqopt.exchange._files import csv_text
from seqopt.exchange._grip_frames import Frame, Held, hold
from seqopt.scene._checks import as_vector, positive
from seqopt.scene.boxes import vertices_of
from seqopt.scene.parts import Robot, Sphere
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step, StepKind

transform = Later("scipy.spatial.transform")  # slow to import


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


_DOES = {  # whose grip changes, by the kind of the step and whether it ends without one
    (StepKind.PLACE, False): (Action.PICK, Action.PLACE),
    (StepKind.REMOVE, True): (Action.REMOVE, Action.STORE),
}
_SAID = ("robot", "block", "node", "built")
_DIGITS = 9  # of numbers in a table: a micrometer in a kilometer
_FARTHEST = 10.0  # m; from a grip to where a tool comes from
FRAMES = ("block_frame", "grip", "approach", "retreat", "grip_in_block")


def plan_tasks(
    scene: Scene,
    steps: Sequence[Step],
    distance: float | None = None,
    postures: PlanPostures | None = None,
) -> Iterator[Task]:
    """Yield what robots do in a checked plan, step by step.

    Parameters
    ----------
    scene, steps
        A scene, and a checked plan for it.
    distance
        From a grip to where a tool comes from, and goes to, m; by default a block's longest side.
    postures
        Of the arms in every step; without them, grips are proposals.

    Yields
    ------
    Task
        What a step changes comes first, then who holds on, in the order of the robots.

    Raises
    ------
    SceneError
        If the distance is not positive, or longer than an arm.

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
    if far is not None and far > _FARTHEST:
        raise SceneError(f"distance is {far:g} m; give at most {_FARTHEST:g}, in meters")
    found = cache(lambda robot, node: hold(scene, robot, node))
    last: Grips = (None,) * len(scene.robots)
    for step in steps:
        tasks = []
        for r, (robot, old, new) in enumerate(zip(scene.robots, last, step.grips, strict=True)):
            node = old if new is None else new
            if node is None:
                continue
            other = Action.RELEASE if new is None else Action.REPOSITION
            actions = _DOES.get((step.kind, new is None), (other,))
            for action in actions if old != new else (Action.HOLD,):
                held, joints = found(robot, node), None
                at = step.number - 1 - (action is Action.RELEASE)  # it lets go as it held
                row = None if postures is None else postures.steps[at][r]
                if postures is not None and row is not None:
                    brick, axes = scene.brick_of_node[node], postures.table.axes[row]
                    tool = Frame(held.grip.point, as_vector(axes[:, 0]), as_vector(axes[:, 1]))
                    out = -tool.axes[2]
                    half = 0.5 * float(np.abs(brick.frame @ out) @ np.array(brick.dimensions))
                    depth = half - float(np.subtract(tool.point, brick.position) @ out)
                    held = replace(held, grip=tool, depth=depth)
                    own = postures.table.joints[row]
                    joints = tuple(own[np.isfinite(own)].tolist())
                tasks.append(_task(scene, step, action, (robot, node, held), far, joints))
        yield from sorted(tasks, key=lambda task: task.action is Action.HOLD)
        last = step.grips


def tasks_in_postures(
    scene: Scene, steps: Sequence[Step], distance: float | None = None
) -> Iterator[Task]:
    """Yield tasks of a plan as `plan_tasks`, in postures of arms where these can be computed."""
    try:
        found = plan_postures(scene, steps)
    except (ExtraError, SceneError):
        found = None
    return plan_tasks(scene, steps, distance, found)


def _task(
    scene: Scene,
    step: Step,
    action: Action,
    grip: tuple[Robot, int, Held],
    far: float | None,
    joints: tuple[float, ...] | None,
) -> Task:
    """Return what a robot does, with the frames that this has; a block comes along its own way."""
    robot, node, held = grip
    there, tool = action not in (Action.PICK, Action.STORE), held.grip
    brick = scene.brick_of_node[node]
    gone = max(brick.dimensions) if far is None else far
    back, away = tool.moved(-tool.axes[2], gone), tool.moved(np.array(held.away), gone)
    return Task(
        step=step.number,
        kind=step.kind,
        action=action,
        robot=robot.name,
        block=brick.name,
        node=node,
        built=step.bricks,
        grip_in_block=tool.inside(held.block),
        depth=held.depth,
        block_frame=held.block if there else None,
        grip=tool if there else None,
        approach={Action.PLACE: away, Action.REPOSITION: back}.get(action),
        retreat={Action.RELEASE: back, Action.REMOVE: away}.get(action),
        posture=joints if there else None,
    )


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
                "frame": compas_frame(Frame(brick.position, brick.length_axis, brick.width_axis)),
                "shape": {
                    "dtype": "compas.datastructures/Mesh",
                    "data": mesh_data(*vertices_of(brick)),
                },
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
        "tasks": [
            {
                "step": task.step,
                "type": task.kind.value,
                "action": task.action.value,
                **{name: getattr(task, name) for name in _SAID},
                **{name: compas_frame(getattr(task, name)) for name in FRAMES},
                "depth": round(task.depth, _DIGITS),
                "posture": task.posture,
            }
            for task in tasks
        ],
    }
    return json.dumps(whole, ensure_ascii=False) + "\n"


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
    rows = [dict(enumerate(task.posture or (), start=1)) for task in held]
    joints = pd.DataFrame(rows, dtype=float).add_prefix("joint_")
    return csv_text(pd.concat([table, *parts, joints], axis=1), _DIGITS)


def _places(name: str, frames: Sequence[Frame | None]) -> pd.DataFrame:
    """Return frames as columns: places, and quaternions whose first number is not negative."""
    out = np.full((len(frames), 7), np.nan)
    known = [i for i, frame in enumerate(frames) if frame is not None]
    held = [frame for frame in frames if frame is not None]
    if held:
        axes = np.array([frame.axes for frame in held])
        turned = transform.Rotation.from_matrix(axes.transpose(0, 2, 1)).as_quat(canonical=True)
        out[known, :3] = [frame.point for frame in held]
        out[known, 3:] = turned[:, [3, 0, 1, 2]]
    ends = ("x", "y", "z", "qw", "qx", "qy", "qz")
    return pd.DataFrame(out.round(9) + 0.0, columns=[f"{name}_{end}" for end in ends])
