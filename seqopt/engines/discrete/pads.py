"""How robots hold bricks with two elastic pads instead of at a node."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from seqopt.arrays import Floats
from seqopt.engines.discrete.system import BedStiffness
from seqopt.network.kinematics import point_motion
from seqopt.network.network import Network


class Across(IntEnum):
    """Which way two pads press on a brick: along its width or its thickness."""

    WIDTH = 1
    THICKNESS = 2


@dataclass(frozen=True)
class Pinch:
    """Two square pads that hold a brick on either side of its node and do not slip.

    Parameters
    ----------
    across : Across
    stiffness : BedStiffness
        Of the pads.
    side : float
        Of a pad, m.
    """

    across: Across
    stiffness: BedStiffness
    side: float


def pad_stiffness(network: Network, index: int, node: Floats, pinch: Pinch) -> Floats:
    """Return the stiffness with which two pads beside a node hold a brick's twists.

    Parameters
    ----------
    network : Network
    index : int
        Of the brick in build order.
    node : (3,) float
        m.
    pinch : Pinch

    Returns
    -------
    (6, 6) float
        N/m and N m/rad.
    """
    brick = network.scene.placed[index]
    length, width = np.array(brick.length_axis), np.array(brick.width_axis)
    axes = np.stack([length, width, np.cross(length, width)])
    out = axes[pinch.across]
    sides = np.delete(axes, pinch.across, axis=0)
    moduli = pinch.stiffness.tangential * np.eye(3)
    moduli += (pinch.stiffness.normal - pinch.stiffness.tangential) * np.outer(out, out)
    total = np.zeros((6, 6))
    reach = pinch.side / np.sqrt(12)  # four points here have a square's second moments
    for sign in (-0.5, 0.5):
        for a, b in ((-reach, -reach), (-reach, reach), (reach, -reach), (reach, reach)):
            point = node + sign * brick.dimensions[pinch.across] * out + a * sides[0] + b * sides[1]
            moved = point_motion(point - network.centroid[index])
            total += pinch.side**2 / 4 * moved.T @ moduli @ moved
    return total
