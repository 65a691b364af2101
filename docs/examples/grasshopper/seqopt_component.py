#! python 3
# r: compas
"""Plan a build from Grasshopper, and show one step of it: a script component of Rhino 8.

Inputs: ``blocks`` (meshes, as a list), ``command`` (the path of seqopt), ``folder`` (for what it
writes), ``assume`` and ``words`` (options of `seqopt import` and of `seqopt optimize`), ``run``
(a button), ``step`` (a slider).

Outputs: ``built``, ``placed``, ``held`` (meshes), ``tools`` (planes), ``says`` (text).
"""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path

import compas
from compas.geometry import Scale

try:
    import Rhino
    from compas_rhino import conversions
except ImportError:  # outside Rhino, where the functions below work as well
    Rhino = None

HIDDEN = getattr(subprocess, "CREATE_NO_WINDOW", 0)  # no console on Windows


def write_blocks(blocks, path, per_meter=1.0):
    """Write meshes of COMPAS in m, numbered from 1; ``per_meter``: their units in 1 m."""
    scale = Scale.from_factors([1.0 / per_meter] * 3)
    numbered = {str(i): block.transformed(scale) for i, block in enumerate(blocks, start=1)}
    compas.json_dump(numbered, str(path))


def call(command, *words):
    """Return what seqopt prints; raise what it says where it refuses."""
    own = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(
        [str(command), *map(str, words)],
        capture_output=True,
        encoding="utf-8",
        env={**own, "PYTHONUTF8": "1"},  # not Rhino's Python
        creationflags=HIDDEN,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(done.stderr.strip() or f"seqopt ended with {done.returncode}")
    return done.stdout.strip()


def make_plan(blocks, folder, command, assume, words="", per_meter=1.0):
    """Plan the build of meshes of COMPAS; return what seqopt read, assumed and found."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    written, scene = place / "blocks.json", place / "scene.json"
    write_blocks(blocks, written, per_meter)
    read = call(
        command, "import", written, "--unit", "m", *shlex.split(assume or ""), "--out", scene
    )
    found = call(command, "optimize", scene, *shlex.split(words or ""), "--out", place / "plan")
    return f"{read}\n\n{found}"


def read_plan(folder):
    """Return the plan of a folder; None if there is none yet."""
    path = Path(folder) / "plan" / "tasks.json"
    return compas.json_load(str(path)) if path.exists() else None


def last_step(plan):
    """Return the number of the last step of a plan."""
    return max(task["step"] for task in plan["tasks"])


def show_step(plan, step, per_meter=1.0):
    """Return what stands after a step, what it places, what robots hold, and their tools."""
    step = min(max(int(step), 1), last_step(plan))
    tasks = [task for task in plan["tasks"] if task["step"] == step]
    scale = Scale.from_factors([per_meter] * 3)
    standing = {block["block"]: block for block in plan["blocks"][: tasks[0]["built"]]}
    meshes = {number: block["shape"].transformed(scale) for number, block in standing.items()}
    placed = {task["block"] for task in tasks if task["action"] == "place"}
    holds = [task for task in tasks if task["action"] in ("place", "hold", "reposition")]
    held = {task["block"] for task in holds} - placed
    said = [f"step {step} of {last_step(plan)}"]
    said += [f"{task['robot']}: {task['action']} {task['block']}" for task in tasks]
    return {
        "built": [mesh for number, mesh in meshes.items() if number not in placed | held],
        "placed": [meshes[number] for number in sorted(placed)],
        "held": [meshes[number] for number in sorted(held)],
        "tools": [task["grip"].transformed(scale) for task in holds if task["grip"]],
        "says": "\n".join(said),
    }


if Rhino is not None:
    meter, unit = Rhino.UnitSystem.Meters, Rhino.RhinoDoc.ActiveDoc.ModelUnitSystem
    per_meter = Rhino.RhinoMath.UnitScale(meter, unit)
    if run:  # noqa: F821  # inputs of the component
        meshes = [conversions.mesh_to_compas(mesh) for mesh in blocks]  # noqa: F821
        print(make_plan(meshes, folder, command, assume, words, per_meter))  # noqa: F821
    plan = read_plan(folder)  # noqa: F821
    if plan is None:
        says = "no plan yet: press run"
    else:
        shown = show_step(plan, step, per_meter)  # noqa: F821
        built, placed, held = (
            [conversions.mesh_to_rhino(mesh) for mesh in shown[key]]
            for key in ("built", "placed", "held")
        )
        tools = [conversions.frame_to_rhino_plane(frame) for frame in shown["tools"]]
        says = shown["says"]
