"""What verdicts say of ground that moves: rigid bricks follow, and balance as they did."""

from __future__ import annotations

import numpy as np

from seqopt.scene.scene import Scene

_SMALL = 0.1  # of the smallest side of a brick: what turns and shifts no more changes no balance


def _settlement_said(scene: Scene) -> str:
    """Return that movements of ground ends enter no verdict, in words; empty where none moves."""
    every = (ground.movement for ground in scene.grounds)
    moved = [np.reshape(each, (2, 3)) for each in every if each is not None and any(each)]
    if not moved:
        return ""
    side = min(min(brick.dimensions) for brick in scene.bricks)
    lever = max(max(brick.dimensions) for brick in scene.bricks)
    most = max(float(np.linalg.norm(s) + lever * np.linalg.norm(t)) for s, t in moved)
    many = "s" * (len(moved) > 1)
    ends = f"the movement of {len(moved)} ground end{many}, up to {1e3 * most:.4g} mm,"
    if most > _SMALL * side:
        return (
            f"{ends} enters no verdict, and is not small beside a brick's {1e3 * side:.4g} mm: "
            "verdicts are of the structure where it is planned, not where it moves to"
        )
    return (
        f"{ends} enters no verdict: rigid bricks follow it without strain, and one so small leaves "
        "their balance as it is; where it opens joints, ask: analyze --engine discrete"
    )
