"""What props hold and bear, as a judge sees it: it shares the engine alone with the search."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.engines.interface import Engine, Want
from seqopt.errors import SolverError
from seqopt.scene._props import Prop
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

_UNFELT = 1e-3  # of the mean weight of a brick, far more than forces err


def props_that_hold(scene: Scene, bricks: int, robots: int) -> list[tuple[int, Prop]]:
    """Return props by the numbers of their grips, with so many bricks and robots that hold."""
    if not robots and bricks >= len(scene.build_order):
        return []
    kinds, first, out = scene.grip_kinds, len(scene.robots), []
    stand = {node for brick in scene.placed[:bricks] for node in brick.nodes}
    for i, prop in enumerate(scene.props):
        if prop.node in stand:
            kind = int(kinds.of_robot[first + i]) if len(kinds.turns) > 1 else 0
            out.append((prop.node + kinds.span * kind, prop))
    return out


def check_props(engine: Engine, steps: Sequence[Step]) -> None:
    """Raise a `SolverError` if a prop pulls that may only push, or bears more than it may."""
    scene = engine.network.scene
    if not any(prop.direction or prop.capacity for prop in scene.props):
        return
    weight = float(np.linalg.norm(engine.network.weight, axis=1).mean())
    for step in steps:
        held = scene.grip_numbers(step.grips)
        props = props_that_hold(scene, step.bricks, len(held))
        if not props:  # as on the empty site, where a take-down ends
            continue
        grips = np.array([[*held, *(number for number, _ in props)]], dtype=np.int64)
        force = engine.solve(step.bricks, grips, Want(0)).grip_force[0, len(held) :]
        for own, (_, prop) in zip(force, props, strict=True):
            _check(prop, own, _UNFELT * (weight or 1.0), step.number)


def _check(prop: Prop, force: np.ndarray, little: float, number: int) -> None:
    size = float(np.linalg.norm(force))
    if prop.capacity is not None and size > prop.capacity + little:
        raise SolverError(
            f"step {number}: the {prop.label} bears {size:.4g} N of {prop.capacity:g} N"
        )
    if prop.direction is not None and np.dot(force, prop.direction) < -little:
        raise SolverError(f"step {number}: the {prop.label} pulls, and may only push")
