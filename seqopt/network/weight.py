"""The weight of a brick as forces at its two inner nodes."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.parts import Brick

OFF_PLANE = 1e-9  # lever of a weight about the line of its nodes treated as zero, over the brick


def shared_weight(brick: Brick, weight: Floats) -> Floats:
    """Return forces at a brick's two inner nodes that act on it as its weight does.

    Parameters
    ----------
    brick : Brick
        With nodes of its own.
    weight : (3,) float
        At the centroid, N.

    Returns
    -------
    (2, 3) float
        N.

    Raises
    ------
    SceneError
        If the weight turns the brick about the line through its nodes: two forces there cannot.
    """
    first, second = (np.subtract(brick.node_position(node), brick.position) for node in brick.nodes)
    span, middle = 0.5 * (second - first), 0.5 * (first + second)
    moment = -np.cross(middle, weight)  # of the weight about the middle between the nodes
    along = abs(float(moment @ span)) / float(np.linalg.norm(span))
    if along > OFF_PLANE * max(brick.dimensions) * float(np.linalg.norm(weight)):
        raise SceneError(
            f"brick {brick.name}: its weight turns it about the line through its nodes "
            f"{list(brick.nodes)}; give nodes above, below or on either side of the centroid"
        )
    shift = np.cross(moment, span) / (2 * span @ span)
    return np.stack([0.5 * weight - shift, 0.5 * weight + shift])
