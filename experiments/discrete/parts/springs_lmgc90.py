"""Where rigid blocks on elastic joints come to rest, by LMGC90: the program that is asked.

Non-smooth contact dynamics with an elastic contact law, IQS_EXPO_CZM_SPRING: a spring in series
with a cohesive zone, with stiffness per area. LMGC90 simulates once per process, ends it where a
mesh is wrong and prints much, hence the files: ``python springs_lmgc90.py scene.json result.json``.

The scene has ``blocks`` (vertices, faces, fixed, weight in N, centroid in m), ``normal`` and
``tangential`` (N/m³), ``step`` (s) and ``steps``. The result has ``twist`` (B, 6), mean motions of
the centroids over the last part of the time, ``sway``, the largest standard deviation of a
displacement over the largest one, and at the end per contact point ``pair``, ``force`` on the
pair's first block (N), its parts ``local`` (tangent, normal, tangent) and ``area`` (m²).

- The cohesive zone has no strength to lose and no friction. A joint then is linear: in compression
  the spring alone acts, in tension and in shear spring and zone in series, and `RIGID` and `HALVES`
  are chosen so that both come out as asked.
- LMGC90 finds the centroid of a block's mesh. Where the weight acts elsewhere, the difference is
  given as a moment, in the axes of inertia that a first, empty simulation tells.
"""

from __future__ import annotations

import json
import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

GRAVITY = 9.81  # LMGC90's own
LAW = "IQS_EXPO_CZM_SPRING"
RIGID = 1e6  # cohesive zone over spring, normal: tension as stiff as compression
HALVES = 2.0  # cohesive zone and spring, tangential: each twice as stiff as asked
UNBROKEN = (1e15, 1e15, 1e30, 1e30, 1e-3)  # strengths (Pa), energies (J/m²), residual share
EASE, REST = 0.6, 0.7  # shares of the time: all weight acts; displacements are averaged from here
OFTEN = 10  # steps between displacements that are averaged: what sways has longer periods
ALERT = 1e-3  # m, distance below which contacts are sought


def law(normal: float, tangential: float) -> list[float]:
    """Return the parameters of the law: no friction, zone, strength, spring."""
    zone = [RIGID * normal, HALVES * tangential]
    return [0.0, 0.0, *zone, *UNBROKEN, normal, HALVES * tangential]


def prepared(scene: dict[str, Any], moments: np.ndarray | None = None) -> Any:
    """Return a simulation that is ready to run, with moments (B, 3) in the axes of inertia."""
    blocks = scene["blocks"]
    solver = import_module("compas_lmgc90.solver").Solver(dt=scene["step"], theta=1.0)
    for block in blocks:
        mesh = {key: block[key] for key in ("vertices", "faces")}
        density = 1.0 if block["fixed"] else block["weight"] / GRAVITY / volume(block)
        solver.geometry_from_v_f(mesh, density=density)
    solver.supports = [block["fixed"] for block in blocks]
    for i, block in enumerate(blocks):
        if block["fixed"]:
            solver.v_drvdof[i] = {k: np.zeros(6) for k in range(1, 7)}
        elif moments is not None:
            solver.f_drvdof[i] = {3: eased(scene, block["weight"], 0.0)}
            for k in range(3):
                solver.f_drvdof[i][k + 4] = eased(scene, 0.0, moments[i, k])
    solver.contact_law(LAW, law(scene["normal"], scene["tangential"]), alert=ALERT)
    solver.preprocess()
    return solver


def eased(scene: dict[str, Any], first: float, last: float) -> np.ndarray:
    """Return times and values (2, n) of a load that goes smoothly from one value to another."""
    length = scene["step"] * scene["steps"]
    time = np.linspace(0, EASE * length, 101)
    value = first + (last - first) * 0.5 * (1 - np.cos(np.pi * time / time[-1]))
    return np.array([[*time, 2 * length], [*value, last]])


def volume(block: dict[str, Any]) -> float:
    """Return the volume of a block whose faces are triangles."""
    corner = np.array(block["vertices"])[np.array(block["faces"])]
    return float(np.einsum("fi,fi->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6)


def frames(flat: Any) -> np.ndarray:
    return np.array(flat, dtype=float).reshape(-1, 3, 3)


def lever_moments(scene: dict[str, Any]) -> np.ndarray:
    """Return the moments (B, 3) that bring the weights to the centroids, in axes of inertia."""
    solver = prepared(scene)  # a solver that is let go forgets its state
    start = solver.lmgc90.get_initial_state()
    lever = centroids(scene) - np.array(start.init_bodies)[:, :3]
    weight = np.array([block["weight"] for block in scene["blocks"]])
    moment = np.cross(lever, weight[:, None] * np.array([0.0, 0.0, -1.0]))
    return np.asarray(np.einsum("bij,bj->bi", frames(start.init_body_frames), moment))


def centroids(scene: dict[str, Any]) -> np.ndarray:
    return np.array([block["centroid"] for block in scene["blocks"]])


def twists(scene: dict[str, Any], start: Any, now: Any) -> np.ndarray:
    """Return displacements of the centroids (m) and rotations, (B, 6)."""
    place = np.array(start.init_bodies)[:, :3]
    moved = np.array(now.bodies)[:, :3] - place
    turn = np.einsum("bki,bkj->bij", frames(now.body_frames), frames(start.init_body_frames))
    turn = 0.5 * (turn - turn.transpose(0, 2, 1))
    angle = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
    return np.hstack([moved + np.cross(angle, centroids(scene) - place), angle])


def settled(scene: dict[str, Any]) -> dict[str, Any]:
    """Return where the blocks are at the end, and the forces between them."""
    solver = prepared(scene, lever_moments(scene))
    start = solver.lmgc90.get_initial_state()
    history = []
    for i in range(scene["steps"]):
        now = solver.lmgc90.compute_one_step()
        if i >= REST * scene["steps"] and i % OFTEN == 0:
            history.append(twists(scene, start, now))
    mean = np.mean(history, axis=0)
    sway = np.linalg.norm(np.std(history, axis=0)[:, :3], axis=1).max()
    return {
        "twist": mean.tolist(),
        "sway": float(sway / np.linalg.norm(mean[:, :3], axis=1).max()),
        "pair": [[b - 1 for b in pair] for pair in now.interaction_bodies],
        "force": np.array(now.interaction_force_global).tolist(),
        "local": np.array(now.interaction_rloc).tolist(),
        "area": [float(values[0]) for values in now.interaction_internals],
    }


def main() -> None:
    scene = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    Path(sys.argv[2]).write_text(json.dumps(settled(scene)), encoding="utf-8")
    sys.stdout.flush()
    os._exit(0)  # LMGC90's own end may fail


if __name__ == "__main__":
    main()
