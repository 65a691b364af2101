"""Which choices of a step the arms of robots can be in."""

from __future__ import annotations

import numpy as np

from seqopt.arms._permits import permits
from seqopt.arrays import Bools, Ints
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import OpenStep


def for_arms(scene: Scene, step: OpenStep, rows: Ints) -> Bools:
    """Return which choices (P,) of a step arms can be in.

    ``rows`` (P, r): nodes held, by the robots that hold any, in their order.
    """
    known = permits(scene)
    if known is None:
        return np.ones(len(rows), dtype=bool)
    nodes = [node for brick in scene.placed for node in brick.nodes]
    order = np.argsort(nodes)
    held = np.zeros((len(rows), len(scene.robots)), dtype=np.int64)
    robots = [robot for robot, grip in enumerate(step.grips) if grip is not None]
    held[:, robots] = 1 + order[np.searchsorted(nodes, rows, sorter=order)]
    return known.allowed(step.bricks, held)
