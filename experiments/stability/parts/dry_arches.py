"""Arches along a catenary, and the least payload with which free robots build them dry."""

from __future__ import annotations

from math import atan

import numpy as np

from seqopt.contact.mortar import Mortar
from seqopt.engines.registry import make_engine
from seqopt.placement.free_problem import pose_free
from seqopt.placement.free_states import explore
from seqopt.placement.standing import Standing
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.sequence.free_rules import FreeRules
from seqopt.study.presets import CRITERIA

STEEPEST = 2.0  # slope of the catenary at its ends
LENGTH, WIDTH, GAP = 0.246, 0.116, 0.01  # m
MOST = 4.0  # payload over the arch's weight beyond which none is looked for
CLOSE = 1.1  # ratio to which the least payload is found
RULES = FreeRules(least_grips=0, newest="free")  # any robot may do anything at any time
Cell = tuple[int, float, float, int]  # bricks, thickness (m), friction, robots


def catenary(bricks: int, thickness: float, robots: int, payload: float) -> Scene:
    """Return an arch of bricks end to end whose line of thrust is nearly its own.

    Parameters
    ----------
    bricks : int
    thickness : float
        m.
    robots : int
        Mobile ones.
    payload : float
        N.

    Returns
    -------
    Scene
    """
    along = np.linspace(1.0, -1.0, bricks)
    shape = ArchShape(
        pitch=[atan(STEEPEST * x) for x in along.tolist()],
        pattern="VLR",
        dimensions=(LENGTH, WIDTH, thickness),
        gap=GAP,
    )
    team = [Robot(name=f"rob{i + 1}", payload=payload) for i in range(robots)]
    return arch_scene(shape, f"catenary{bricks}", robots=team)


def can_build(cell: Cell, payload: float) -> bool:
    """Return whether some free schedule builds an arch dry, every state proven to stand.

    Parameters
    ----------
    cell : tuple
        Bricks, thickness (m), friction, robots.
    payload : float
        N.

    Returns
    -------
    bool
    """
    bricks, thickness, friction, robots = cell
    engine = make_engine("compliance", catenary(bricks, thickness, robots, payload))
    standing = Standing(Mortar(friction=friction))
    problem = pose_free(engine, RULES, CRITERIA["weighted"], "steps", stands=standing)
    return explore(problem, width=50).whole or explore(problem).whole


def least_payload(cell: Cell) -> dict[str, float]:
    """Return the least payload with which an arch is built dry, within 5 %.

    Parameters
    ----------
    cell : tuple
        Bricks, thickness (m), friction, robots.

    Returns
    -------
    dict of str to float
        The cell, ``span_m``, ``weight_N``, and ``least_payload`` and ``too_little`` over that
        weight; infinite and `MOST` where none is enough.
    """
    bricks, thickness, friction, robots = cell
    scene = catenary(bricks, thickness, robots, 1.0)
    first, last = (ground.position for ground in scene.grounds)
    weight = sum(float(np.prod(b.dimensions)) * b.density * 9.81 for b in scene.bricks)
    low, high = 0.0, MOST
    if not can_build(cell, MOST * weight):
        low, high = MOST, np.inf
    while high < np.inf and high > CLOSE * low:
        middle = float(np.sqrt(low * high)) if low else high / 4
        low, high = (low, middle) if can_build(cell, middle * weight) else (middle, high)
    return {
        "bricks": bricks,
        "thickness_m": thickness,
        "friction": friction,
        "robots": robots,
        "span_m": abs(last[0] - first[0]),
        "weight_N": weight,
        "least_payload": high,
        "too_little": low,
    }
