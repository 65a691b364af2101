"""A plan for compas_fab: blocks as rigid bodies of a robot cell, frames as targets of the tool.

JSON as `compas.json_load` reads it where compas_fab is installed, written without it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable

from seqopt.scene.boxes import vertices_of
from seqopt.scene.parts import Brick
from seqopt.scene.scene import Scene
from seqopt.sequence.exports._compas_values import Document, compas_frame, mesh_data, typed
from seqopt.sequence.exports._grip_frames import Frame, brick_frame
from seqopt.sequence.exports._tasks import Task

_WORLD = Frame((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
_REVOLUTE = 0  # the type of a joint that turns


def fab_json(scene: Scene, tasks: Iterable[Task]) -> str:
    """Return tasks for compas_fab.

    ``cell`` is a ``RobotCell`` without a robot, with every block as a ``RigidBody`` in its own
    frame; ``states`` has a ``RigidBodyState`` of each where it is built; ``tasks`` has a row for
    each task, with its ``approach``, ``grip`` and ``retreat`` as ``FrameTarget`` of the tool, the
    ``attachment`` frame of the block in the tool's, and the ``posture`` as ``ConfigurationTarget``.
    """
    cell = {
        "robot_model": None,
        "robot_semantics": None,
        "tool_models": {},
        "rigid_body_models": {_name(brick.name): _body(brick) for brick in scene.placed},
    }
    whole = {
        "format": "seqopt-compas_fab",
        "version": 1,
        "scene": scene.name,
        "cell": typed("compas_fab.robots/RobotCell", cell),
        "states": {_name(brick.name): _state(brick) for brick in scene.placed},
        "tasks": [_task(task) for task in tasks],
    }
    return json.dumps(whole, ensure_ascii=False) + "\n"


def _name(block: int) -> str:
    return f"block_{block}"


def _body(brick: Brick) -> Document:
    """Return what a rigid body holds: the mesh of a block in its own frame."""
    points, faces = vertices_of(brick)
    own = (points - brick.position) @ brick.frame.T
    mesh = typed("compas.datastructures/Mesh", mesh_data(own, faces))
    return {"visual_meshes": [mesh], "collision_meshes": [mesh], "native_scale": 1.0}


def _state(brick: Brick) -> Document:
    """Return a block where it is built."""
    data: Document = {
        "frame": compas_frame(brick_frame(brick)),
        "attached_to_link": None,
        "attached_to_tool": None,
        "touch_links": [],
        "touch_bodies": [],
        "attachment_frame": None,
        "is_hidden": False,
    }
    return typed("compas_fab.robots/RigidBodyState", data)


def _task(task: Task) -> Document:
    """Return a task with targets for a tool; what there is not is null."""
    said = f"{task.robot}, step {task.step}: {task.action.value} {_name(task.block)}"
    targets = {
        name: _target(f"{said}, {name}", getattr(task, name))
        for name in ("approach", "grip", "retreat")
    }
    return {
        "step": task.step,
        "type": task.kind.value,
        "action": task.action.value,
        "robot": task.robot,
        "block": _name(task.block),
        "node": task.node,
        "built": task.built,
        **targets,
        "attachment": compas_frame(_WORLD.inside(task.grip_in_block)),
        "posture": _configuration(said, task.posture),
    }


def _target(said: str, frame: Frame | None) -> Document | None:
    if frame is None:
        return None
    data = {
        "target_frame": compas_frame(frame),
        "target_mode": "TOOL",
        "native_scale": 1.0,
        "tolerance_position": None,
        "tolerance_orientation": None,
        "name": said,
    }
    return typed("compas_fab.robots/FrameTarget", data)


def _configuration(said: str, posture: tuple[float, ...] | None) -> Document | None:
    """Return a posture of joints that turn."""
    if posture is None:
        return None
    joints = {
        "joint_values": list(posture),
        "joint_types": [_REVOLUTE] * len(posture),
        "joint_names": [],
    }
    data = {
        "target_configuration": typed("compas_robots/Configuration", joints),
        "tolerance_above": None,
        "tolerance_below": None,
        "name": said,
    }
    return typed("compas_fab.robots/ConfigurationTarget", data)
