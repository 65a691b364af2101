"""Tasks of arms whose postures are known: their joints, and frames of the tool that agree."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from seqopt.arms.table import PostureTable
from seqopt.arrays import Floats
from seqopt.scene.boxes import as_vector
from seqopt.scene.parts import Brick
from seqopt.scene.scene import Scene
from seqopt.sequence._postures import PlanPostures, plan_postures
from seqopt.sequence.exports._grip_frames import Frame, brick_frame
from seqopt.sequence.exports._tasks import Action, Postures, Task, plan_tasks
from seqopt.sequence.steps import Step


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
    out = replace(task, grip_in_block=tool.inside(block), depth=_depth(brick, tool))
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


def _depth(brick: Brick, tool: Frame) -> float:
    """Return how far a node is behind the face that its tool looks through, m."""
    out = -tool.axes[2]
    half = 0.5 * float(np.abs(brick.frame @ out) @ np.array(brick.dimensions))
    return half - float(np.subtract(tool.point, brick.position) @ out)
