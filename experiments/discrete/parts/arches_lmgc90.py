"""The paper's four partial arches on elastic joints, by LMGC90: an outside witness for our engine.

`witness` puts a partial arch, its last brick between two pads (``arch_pads.py``), to LMGC90
(``springs_lmgc90.py``, in another Python), to the same springs at corners by a linear solve and to
our discrete-element engine, and holds all against the double-cross model. LMGC90 gives each of the
four corners of a face a quarter of its area.
"""

import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import ConvexHull

from experiments.discrete.parts import arch_pads
from experiments.discrete.parts.arch_pads import (
    SPREADS,
    Across,
    AtCorners,
    PaddedEngine,
    Pinch,
    padded,
    posed,
)
from experiments.harness import lmgc90
from experiments.harness.lmgc90 import python_with_lmgc90
from experiments.harness.yardstick import error, inner_nodes, moved
from seqopt import EPOXY, Step
from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly
from seqopt.contact.mortar import BedStiffness
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network._mechanics import node_motion
from seqopt.network.network import GROUND, Network
from seqopt.study.published import STUDY_BED, STUDY_PADS

PAD = 0.02  # m, side of the square that a pad touches: not printed
THICK = 0.02  # m, of pads and ground; they are fixed and have no weight
STEP, STEPS = 1e-4, 7000  # s: at 3e-4 the blocks are 2 % off, at 1e-3 8 %
LIMIT = 900.0  # s
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""A quarter turn about the vertical. LMGC90 derives tangents from a normal's second and third
parts; with a normal along the first axis they jump from step to step and shear is forgotten."""


def scene_for(assembly: Assembly, bed: BedStiffness) -> dict[str, Any]:
    """Return what LMGC90 is shown: the hulls of the blocks' joint faces, then the fixed blocks.

    Joints look at each other without gaps, whatever the shape of the bricks: between rigid bodies
    only faces, weights and centroids matter.
    """
    corner, centroid = assembly.corner @ TURN.T, assembly.centroid @ TURN.T
    blocks = []
    for b, weight in enumerate(assembly.weight):
        own = (assembly.bodies == b).any(axis=1)[assembly.contact]
        blocks.append(_hull(corner[own], centroid[b], -float(weight[2])))
    for i, c in enumerate(np.flatnonzero(assembly.bodies[:, 0] == GROUND)):
        face = corner[assembly.contact == c]
        # LMGC90 ends where two bodies share a centroid
        points = np.vstack([face, face - THICK * (1 + 0.1 * i) * (TURN @ assembly.normal[c])])
        blocks.append(_hull(points, points.mean(axis=0), 0.0))
    return {"blocks": blocks, **_terms(bed)}


def _terms(bed: BedStiffness) -> dict[str, float]:
    return {"normal": bed.normal, "tangential": bed.tangential, "step": STEP, "steps": STEPS}


def _hull(points: Floats, centroid: Floats, weight: float) -> dict[str, Any]:
    """Return the convex hull of points (n, 3) as a block; without a weight it is fixed."""
    points = np.unique(points, axis=0)
    hull = ConvexHull(points)
    faces = []
    for face, plane in zip(hull.simplices, hull.equations, strict=True):
        outward = np.linalg.det([*(points[face[1:]] - points[face[0]]), plane[:3]]) > 0
        faces.append(face if outward else face[::-1])
    used, index = np.unique(np.array(faces), return_inverse=True)
    row = {"vertices": points[used].tolist(), "faces": index.reshape(-1, 3).tolist()}
    return row | {"centroid": centroid.tolist(), "weight": weight, "fixed": weight == 0.0}


def asked(python: str, scene: dict[str, Any]) -> dict[str, Any] | None:
    """Return what LMGC90 says in another Python, in our axes, or None if it breaks off."""
    program = str(Path(__file__).with_name("springs_lmgc90.py"))
    result = lmgc90.asked(python, program, scene, LIMIT)
    if result is None:
        return None
    twist = np.array(result["twist"]).reshape(-1, 2, 3) @ TURN
    row = {**result, "twist": twist.reshape(-1, 6), "force": np.array(result["force"]) @ TURN}
    return row | {"pair": np.array(result["pair"])}


def on_ground(result: dict[str, Any], blocks: int) -> Floats:
    """Return the forces (F, 3) of the fixed blocks on the others, N."""
    pair, force = result["pair"], result["force"]
    out = np.zeros((int(pair.max()) + 1 - blocks, 3))
    for side, sign in ((0, 1.0), (1, -1.0)):
        fixed = pair[:, side] >= blocks
        np.add.at(out, pair[fixed, side] - blocks, -sign * force[fixed])
    return out


def moved_by_twists(network: Network, step: Step, twist: Floats) -> Floats:
    """Return how far the inner nodes move with twists (B, 6) of the bricks, m."""
    every = (node_motion(network, step.bricks) @ twist.ravel()).reshape(-1, 3)
    return np.asarray(np.linalg.norm(every[inner_nodes(network, step)], axis=1))


def spread_engine(network: Network, pinch: Pinch, spread: str) -> PaddedEngine:
    """Return our discrete elements with faces that are even beds or springs at corners."""
    if spread == "corners":
        return AtCorners(network, bed=STUDY_BED, pinch=arch_pads.pads_at_corners(pinch))
    return PaddedEngine(network, bed=STUDY_BED, pinch=pinch)


def compared(
    engine: ComplianceEngine, step: Step, python: str, across: Across, spread: str
) -> dict[str, object] | None:
    """Return a row on one reading of a step, or None if LMGC90 breaks off."""
    network, pinch = engine.network, Pinch(across, STUDY_PADS, side=PAD)
    assembly, bed = posed(padded(network, step, pinch, spread), spread)
    twist, corner_force = arch_pads.bed_at_corners(assembly, bed)
    result = asked(python, scene_for(assembly, bed))
    if result is None or len(result["pair"]) != len(assembly.corner):
        return None
    own, ours = moved(engine, step), moved(spread_engine(network, pinch, spread), step)
    same = moved_by_twists(network, step, twist)
    theirs = moved_by_twists(network, step, result["twist"][: step.bricks])
    return {
        "bricks": step.bricks,
        "pads": across.name.lower(),
        "side_mm": 1e3 * PAD,
        "spread": spread,
        "lmgc90_error_pct": error(own, theirs),
        "same_pads_error_pct": error(own, same),
        "engine_error_pct": error(own, ours),
        "same_pads_off_pct": error(same, theirs),
        "same_pads_farthest_pct": 100 * float(np.abs(same - theirs).max() / theirs.max()),
        "engine_off_pct": error(ours, theirs),
        "lmgc90_max_1e-3mm": 1e6 * theirs.max(),
        "engine_max_1e-3mm": 1e6 * ours.max(),
        **_reactions(assembly, corner_force, result, bed.normal / STUDY_BED.normal),
        "sway_pct": 100 * result["sway"],
    }


def _reactions(
    assembly: Assembly, corner_force: Floats, result: dict[str, Any], factor: float
) -> dict[str, float]:
    """Return forces at base and pads by both, N, and the largest stresses by LMGC90."""
    ours = arch_pads.ground_forces(assembly, corner_force)
    theirs = on_ground(result, len(assembly.centroid))
    weight = assembly.weight.sum(axis=0)
    tension, shear = stresses(result, len(assembly.centroid), factor)
    return {
        "base_N": float(np.linalg.norm(theirs[0])),
        "same_base_N": float(np.linalg.norm(ours[0])),
        "pads_N": float(np.linalg.norm(theirs[1:].sum(axis=0))),
        "same_pads_N": float(np.linalg.norm(ours[1:].sum(axis=0))),
        "unbalanced_pct": 100 * float(np.linalg.norm(theirs.sum(axis=0) + weight) / -weight[2]),
        "tension_MPa": tension / 1e6,
        "shear_used": shear,
    }


def stresses(result: dict[str, Any], blocks: int, factor: float) -> tuple[float, float]:
    """Return the largest tension (Pa) and shear over what the paper's epoxy allows, by LMGC90.

    In all joints but those of the pads. The factor says how many times a face was made smaller.
    """
    joint = result["pair"].max(axis=1) <= blocks
    force, area = np.array(result["local"])[joint], np.array(result["area"])[joint]
    shear, normal, other = force.T / (factor * area)
    allowed = EPOXY.cohesion + EPOXY.friction * normal
    return float(-normal.min()), float((np.hypot(shear, other) / allowed).max())


def settlement(python: str, *, upright: bool) -> tuple[float, float]:
    """Return how far one brick moves (m) on the ground or beside a wall, by LMGC90 and as it must.

    Its weight over the stiffness of the face, normal to the ground or along the wall; where it
    hangs, it also turns about the face's corners, which lie half its height away.
    """
    high, wide, thick, weight = 0.246, 0.116, 0.053, 35.9
    y, z = 0.5 * wide, 0.5 * high
    face = np.array([[-y, 0.0, -z], [y, 0.0, -z], [y, 0.0, z], [-y, 0.0, z]])
    middle, into = np.array([0.0, 0.5 * thick, 0.0]), np.array([0.0, thick, 0.0])
    expected = weight / (STUDY_BED.tangential * high * wide)
    expected += weight * middle[1] ** 2 / (STUDY_BED.normal * high * wide * z**2)
    if upright:
        swap = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
        face, middle, into = face @ swap.T, swap @ middle, swap @ into
        expected = weight / (STUDY_BED.normal * high * wide)
    free = _hull(np.vstack([face, face + into]), middle, weight)
    fixed = _hull(np.vstack([face, face - into]), -middle, 0.0)
    result = asked(python, {"blocks": [free, fixed], **_terms(STUDY_BED)})
    return (np.nan if result is None else -float(result["twist"][0, 2])), expected


READINGS = tuple(product(Across, SPREADS))


def witness(
    engine: ComplianceEngine,
    step: Step,
    python: str = sys.executable,
    readings: tuple[tuple[Across, str], ...] = READINGS,
) -> pd.DataFrame | None:
    """Return a row per reading (pads, spread) of a step, or None without LMGC90 in that Python.

    A reading at which LMGC90 breaks off is left out.
    """
    found = python_with_lmgc90(python)
    if found is None:
        return None
    rows = [compared(engine, step, found, across, spread) for across, spread in readings]
    return pd.DataFrame([row for row in rows if row is not None])
