"""Whether steps keep the linear range, as a judge sees it: by how bricks move as rigid bodies.

A second route to the limit on ``D_max``: its length and the motions of nodes are found here anew.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.engines.interface import Engine, Want
from seqopt.errors import SolverError
from seqopt.judge._prop_rules import props_that_hold
from seqopt.problem.requirements import LINEAR_RANGE, Limit
from seqopt.sequence.steps import Step

_TENTH = 0.1  # of the smallest side of any brick
_LITTLE = 1e-6  # by which a motion may be larger, over its limit


def check_shape(engine: Engine, steps: Sequence[Step], limits: Sequence[Limit]) -> None:
    """Raise a `SolverError` if a node moves farther than a limit of the linear range allows."""
    shares = [limit.shown(limit.bound) for limit in limits if limit.label == LINEAR_RANGE]
    scene = engine.network.scene
    most = min(shares, default=np.inf) * _TENTH * min(min(b.dimensions) for b in scene.bricks)
    for step in steps if shares else ():
        if step.bricks:
            moved = _farthest(engine, step)
            if not moved <= most * (1 + _LITTLE):
                raise SolverError(
                    f"step {step.number}: a node moves {moved:.4g} m, and the linear range ends at "
                    f"{most:.4g} m"
                )


def _farthest(engine: Engine, step: Step) -> float:
    """Return how far a node of any brick moves, m, by the motions of the bricks."""
    scene = engine.network.scene
    held = scene.grip_numbers(step.grips)
    props = (number for number, _ in props_that_hold(scene, step.bricks, len(held)))
    grips = np.array([[*held, *props]], dtype=np.int64)
    twist = engine.solve(step.bricks, grips, Want.BRICKS).brick_twist[0]
    stand = scene.placed[: step.bricks]
    at = np.array([[brick.node_position(node) for node in brick.nodes] for brick in stand])
    lever = at - np.array([brick.position for brick in stand])[:, None]
    moved = twist[:, None, :3] + np.cross(twist[:, None, 3:], lever)
    return float(np.linalg.norm(moved, axis=2).max())
