"""Which choices of a step the arms of robots can be in."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Bools, Ints
from seqopt.scene._armed import go_together
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import OpenStep


def for_arms(scene: Scene, step: OpenStep, rows: Ints) -> Bools:
    """Return which choices (P,) of a step arms can be in.

    ``rows`` (P, r): nodes held, by the robots that hold any, in their order.
    """
    if not scene.has_arms:
        return np.ones(len(rows), dtype=bool)
    nodes = scene.placed_nodes
    order = np.argsort(nodes)
    held = np.zeros((len(rows), len(scene.robots)), dtype=np.int64)
    robots = [robot for robot, grip in enumerate(step.grips) if grip is not None]
    held[:, robots] = 1 + order[np.searchsorted(nodes, rows, sorter=order)]
    return go_together(scene, step.bricks, held)
