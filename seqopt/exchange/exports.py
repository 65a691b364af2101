"""Formats in which a plan can be written, and reading the folder of a plan.

Those of COMPAS are JSON as `compas.json_load` reads it, written without COMPAS.
"""

from __future__ import annotations

import csv
import io
import json
import warnings
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import read_text
from seqopt.arrays import Floats
from seqopt.errors import FileError, StepError
from seqopt.exchange._building import block_numbers
from seqopt.exchange._compas_models import assembly_graph
from seqopt.exchange._content import assembly_json, entry
from seqopt.exchange._grip_frames import (
    Document,
    Frame,
    brick_frame,
    compas_frame,
    mesh_data,
    typed,
)
from seqopt.exchange._tables import plan_csv, plan_json, step_states
from seqopt.exchange._tasks import Postures, Task, _known_tasks, tasks_csv, tasks_json
from seqopt.exchange.imports import read_content
from seqopt.scene._checks import short
from seqopt.scene.boxes import vertices_of
from seqopt.scene.parts import Brick
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.schedule_file import read_plan
from seqopt.sequence.steps import Step


def _boxes_csv(scene: Scene) -> str:
    """Return bricks as the table of boxes that ``import`` reads, in m and degrees.

    A brick of another shape is as long, wide and high as it extends.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    turns, sizes = ("roll", "pitch", "yaw"), ("length", "width", "height")
    writer.writerow(["name", "x", "y", "z", *sizes, *turns, "density", "course"])
    for brick in scene.bricks:
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  # slow to import

        turn = Rotation.from_matrix(brick.frame.T)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of many angles for a turn one is enough
            angles = turn.as_euler("xyz", degrees=True).tolist()
        numbers = [*brick.position, *brick.dimensions, *angles, brick.density]
        writer.writerow([brick.name, *map(repr, numbers), scene.since[brick.name]])
    return out.getvalue()


def _blocks_obj(scene: Scene) -> str:
    """Return bricks as a mesh each, in m: objects of an OBJ file, called as the bricks are."""
    lines, first = list[str](), 1
    for brick in scene.bricks:
        points, faces = vertices_of(brick)
        lines.append(f"o {brick.name}")
        lines += ["v " + " ".join(map(repr, row)) for row in np.asarray(points).tolist()]
        lines += ["f " + " ".join(str(first + i) for i in face) for face in faces]
        first += len(points)
    return "\n".join(lines) + "\n"


_ASSEMBLY = "compas_assembly"
_WORLD = Frame((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
_REVOLUTE = 0  # the type of a joint that turns


def _fab_json(scene: Scene, tasks: Iterable[Task]) -> str:
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


def _read_source(scene: Scene, path: Path) -> tuple[Document, dict[int, str]]:
    """Return the assembly from which a scene was imported, and the keys of its nodes by brick."""
    keys = [block.key for block in read_content(path, _ASSEMBLY).blocks]
    found = dict(zip(block_numbers(keys), keys, strict=True))
    lost = [brick.name for brick in scene.bricks if brick.name not in found]
    if lost:
        raise StepError(f"the source has no block {lost[0]}; give the file that was imported")
    return assembly_json(read_text(path), str(path)), found


def _assembly_with_plan(scene: Scene, steps: Sequence[Step], source: Path | None = None) -> str:
    """Return an assembly of compas_assembly with the plan as attributes, JSON.

    A source stays as it is, with attributes added; otherwise blocks and faces are those of the
    scene. Every node of a block that is built has ``order``, its place in the build, ``place_step``
    and ``held``, a list of step, robot and node; the graph has ``plan``, a list of steps.
    """
    keys = {brick.name: str(brick.name) for brick in scene.bricks}
    whole, keys = (_assembly(scene), keys) if source is None else _read_source(scene, source)
    graph = assembly_graph(whole, "source")[0]
    found = entry("source", graph, "node", "vertex")
    nodes = {brick.name: found[keys[brick.name]] for brick in scene.bricks}
    for i, brick in enumerate(scene.placed):
        nodes[brick.name].update(order=i, place_step=None, held=[])
    plan = graph.setdefault("attributes", {})["plan"] = []
    for row in step_states(scene, steps):
        number = row.step.number
        for name in row.new:
            nodes[name]["place_step"] = number
        for robot, (node, name) in row.holds.items():
            nodes[name]["held"].append([number, robot, node])
        holds = {robot: list(held) for robot, held in row.holds.items()}
        kind = row.step.kind.value
        plan.append({"step": number, "type": kind, "placed": list(row.new), "holds": holds})
    return json.dumps(whole) + "\n"


def _assembly(scene: Scene) -> Document:
    """Return the blocks of a scene and the faces between them as an assembly.

    Faces on the ground make a support of their own, a surface: a block that is not closed.
    """
    nodes: dict[str, Document] = {
        str(brick.name): {"block": _block(*vertices_of(brick))} for brick in scene.bricks
    }
    faces = [(joint.bricks, joint.corners) for joint in scene.joints]
    most = max(brick.name for brick in scene.bricks)
    stands = [end for end in scene.grounds if end.corners is not None]
    if stands:
        most += 1
        polygons = [end.corners for end in stands if end.corners is not None]
        ends = np.cumsum([0, *map(len, polygons)]).tolist()
        sheet = _block(np.concatenate(polygons), [range(a, b) for a, b in pairwise(ends)])
        nodes[str(most)] = {"block": sheet, "is_support": True}
        faces += [((most, end.brick), end.corners) for end in stands]
    edges: dict[str, dict[str, Any]] = {name: {} for name in nodes}
    for (a, b), corners in faces:
        if corners is not None:
            edge = edges[str(a)].setdefault(str(b), {"interfaces": []})
            points = {"points": [list(corner) for corner in corners]}
            edge["interfaces"].append(typed("compas_assembly.datastructures/Interface", points))
    graph = {
        "attributes": {"name": scene.name},
        "default_node_attributes": {"block": None, "is_support": False},
        "default_edge_attributes": {"interfaces": None},
        "node": nodes,
        "edge": edges,
        "max_node": most,
    }
    data = {
        "attributes": {"name": scene.name},
        "graph": typed("compas.datastructures/Graph", graph),
    }
    return typed("compas_assembly.datastructures/Assembly", data)


def _block(points: Floats, faces: Sequence[Iterable[int]]) -> Document:
    return typed("compas_assembly.datastructures/Block", mesh_data(points, faces))


_PLAIN: dict[str, Callable[[Scene, Sequence[Step]], str]] = {"csv": plan_csv, "json": plan_json}
_TASKS: dict[str, Callable[[Scene, Iterable[Task]], str]] = {
    "tasks": tasks_json,
    "tasks_csv": lambda _, tasks: tasks_csv(tasks),
    "compas_fab": _fab_json,
}
_BLOCKS: dict[str, Callable[[Scene], str]] = {"boxes": _boxes_csv, "obj": _blocks_obj}
TASKS = tuple(_TASKS)
"""Formats of what robots do, with postures where they have arms."""
EXPORTS = (*_PLAIN, *_TASKS, _ASSEMBLY, *_BLOCKS)
_NEVER = ("nodes", "joints", "ground ends", "robots", "loads")
LOST: dict[str, tuple[str, ...]] = {
    _ASSEMBLY: ("densities", *_NEVER),
    "boxes": ("shapes other than boxes", *_NEVER, "steps"),
    "obj": ("densities", "the order", *_NEVER, "steps"),
}
"""What a scene is without, once it was exported and imported again; other formats are no scenes."""


def export_plan(  # what is written, and what some formats take beside
    scene: Scene,
    steps: Sequence[Step],
    form: str,
    source: str | Path | None = None,
    distance: float | None = None,
    postures: Postures | None = None,
) -> str:
    """Return a plan for a scene in the format of another program, one of `EXPORTS`.

    Parameters
    ----------
    scene, steps
        A scene, and a checked plan for it.
    form
        One of `EXPORTS`.
    source
        The assembly that was imported, for ``compas_assembly``: the plan is added to it.
    distance, postures
        For formats of tasks, see `plan_tasks`; by default postures that the arms can have.

    Returns
    -------
    str
        The text of the file.

    Raises
    ------
    StepError
        If the format is not known or does not take what is given.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> steps = seqopt.sequential(seqopt.build_network(scene))
    >>> export_plan(scene, steps[:2], "json")[:38]
    '{"format": "seqopt-plan", "version": 1'
    """
    if form not in EXPORTS:
        raise StepError(f"format is {short(form)}; give one of {', '.join(EXPORTS)}")
    if form not in _TASKS and (distance is not None or postures):
        raise StepError(f"format {form} takes no distance or postures; {', '.join(TASKS)} do")
    if source is not None and form != _ASSEMBLY:
        raise StepError(f"format {form} takes no source; leave it out")
    if form == _ASSEMBLY:
        return _assembly_with_plan(scene, steps, None if source is None else Path(source))
    if form in _TASKS:
        return _TASKS[form](scene, _known_tasks(scene, steps, distance, postures))
    return _BLOCKS[form](scene) if form in _BLOCKS else _PLAIN[form](scene, steps)


def read_folder(folder: Path) -> tuple[Scene, tuple[Step, ...]]:
    """Return the scene and the steps of a plan's folder, as ``seqopt optimize`` writes it."""
    picked = (folder / "pick" / "plan.csv").is_file()
    give = folder / "pick" if picked else "a folder of seqopt optimize --out or pareto --pick"
    for name in ("scene.json", "plan.csv"):
        if not (folder / name).is_file():
            raise FileError(f"{folder}: it has no {name}; give {give}")
    scene = load_scene(folder / "scene.json")
    return scene, read_plan(scene, folder / "plan.csv")
