"""How far blocks move in one second, by LMGC90: how to ask, and the program that is asked.

Non-smooth contact dynamics with Coulomb's cone. LMGC90 simulates once per process, ends it where a
mesh is wrong and prints much, hence the files: ``python witness_lmgc90.py scene.json result.json``.
The scene has ``blocks`` (vertices, faces, support) and a friction; the result has the ``verdict``
("stands", "does not stand", "undecided") and ``moved``, over the smallest block's diagonal.

Collapse is a motion beyond a tenth, or one that has passed a thousandth and keeps growing as a fall
does; rest is less than a fiftieth, and slow.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

GRAVITY = 9.81  # LMGC90's own
STEP = 1e-3
STEPS = 1000
LIMIT = 300.0  # s
FAR, VISIBLE, NEAR = 0.1, 1e-3, 0.02  # of the smallest block's diagonal
SLOW = 0.05  # of the speed of a fall through that diagonal


def python_with_lmgc90(python: str) -> str | None:
    """Return the full path of a Python if it has LMGC90."""
    found = shutil.which(python)
    look = "import sys, importlib.util as u; sys.exit(u.find_spec('compas_lmgc90') is None)"
    if found is None or subprocess.run([found, "-c", look], check=False).returncode:
        return None
    return str(Path(found).absolute())


def moved_by(python: str, scene: Any, friction: float) -> str:
    """Return the verdict of LMGC90, in another Python; undecided if it breaks off."""
    blocks = [
        {"vertices": x.vertex.tolist(), "faces": x.faces, "support": i in scene.supports}
        for i, x in enumerate(scene.solids)
    ]
    with tempfile.TemporaryDirectory() as folder:
        shown, said = Path(folder) / "scene.json", Path(folder) / "result.json"
        shown.write_text(json.dumps({"blocks": blocks, "friction": friction}), encoding="utf-8")
        command = [python, __file__, str(shown), str(said)]
        with suppress(subprocess.TimeoutExpired):
            subprocess.run(command, cwd=folder, capture_output=True, check=False, timeout=LIMIT)
        if not said.exists():
            return "undecided"
        return str(json.loads(said.read_text("utf-8"))["verdict"])


def simulation(scene: dict[str, Any], size: float) -> Any:
    blocks = scene["blocks"]
    make = import_module("compas_lmgc90.solver").Solver
    solver = make(dt=STEP, theta=1.0, density=2000.0)
    solver.geometry_from_v_f(
        [{key: block[key] for key in ("vertices", "faces")} for block in blocks]
    )
    solver.supports = [block["support"] for block in blocks]
    for i in np.flatnonzero(solver.supports).tolist():
        solver.v_drvdof[i] = {k: np.zeros([6]) for k in range(1, 7)}
    solver.contact_law("IQS_CLB", scene["friction"], alert=0.01 * size)
    solver.preprocess()
    return solver


def history(solver: Any, far: float) -> tuple[np.ndarray, float]:
    """Return the largest displacement after every step, and the last speed, of the free blocks."""
    free = np.flatnonzero(~np.array(solver.supports))
    start = np.array([solver.init_coor[i][:3] for i in free])
    before, moved, speed = start, [], 0.0
    for _ in range(STEPS):
        bodies = solver.lmgc90.compute_one_step().bodies
        now = np.array([np.ravel(bodies[i])[:3] for i in free])
        speed = float(np.linalg.norm(now - before, axis=1).max()) / STEP
        before = now
        moved.append(float(np.linalg.norm(now - start, axis=1).max()))
        if moved[-1] > far:
            break
    return np.array(moved), speed


def verdict(moved: np.ndarray, speed: float, size: float) -> str:
    """Return what a history of displacements (m) and the last speed (m/s) say."""
    last, half = moved[-1], moved[len(moved) // 2]
    tenths = moved[:: max(1, len(moved) // 10)]
    grows = bool((np.diff(tenths) >= 0).all()) and half < 0.5 * last
    falls = grows and speed * len(moved) * STEP > last
    if last > FAR * size or (last > VISIBLE * size and falls):
        return "does not stand"
    still = speed < SLOW * np.sqrt(GRAVITY * size)
    return "stands" if last < NEAR * size and still else "undecided"


def main() -> None:
    scene = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    vertices = [np.array(block["vertices"]) for block in scene["blocks"]]
    size = min(float(np.linalg.norm(np.ptp(vertex, axis=0))) for vertex in vertices)
    moved, speed = history(simulation(scene, size), 2 * FAR * size)
    result = {"verdict": verdict(moved, speed, size), "moved": moved[-1] / size}
    Path(sys.argv[2]).write_text(json.dumps(result), encoding="utf-8")
    sys.stdout.flush()
    os._exit(0)  # LMGC90's own end may fail


if __name__ == "__main__":
    main()
