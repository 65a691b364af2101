"""Props as grips of assemblies: what they bear, and along which line.

What holds both ways is a grip like that of a robot. One that only pushes bears from nothing to its
capacity along its line, and nothing across it: half the capacity is applied for good, and a grip
along the line adds as much or takes it away.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats
from seqopt.network.network import Network
from seqopt.scene._props import Prop


class PropGrips(NamedTuple):
    """The grips of props on a partial structure.

    ``payload`` (p,): N; ``line`` (p, 3): unit vectors, zero where any direction will do;
    ``applied`` (B, 6): as of `seqopt.contact.assembly.Assembly`, no rows where none push.
    """

    props: tuple[Prop, ...]
    payload: Floats
    line: Floats
    applied: Floats

    @property
    def nodes(self) -> tuple[int, ...]:
        """The nodes that they hold."""
        return tuple(prop.node for prop in self.props)


def prop_grips(network: Network, bricks: int, *, held: bool) -> PropGrips:
    """Return the grips of the props that hold. ``held``: whether a robot holds any.

    One without a capacity bears up to the weight of the whole, with what is applied beside it.
    """
    scene = network.scene
    props = scene.standing_props(bricks, held=held)
    whole = np.linalg.norm(network.weight, axis=1).sum()
    whole += np.linalg.norm(network.applied(len(scene.placed))[:, :3], axis=1).sum()
    most = [float(whole) if prop.capacity is None else prop.capacity for prop in props]
    line = np.array([prop.direction or (0.0, 0.0, 0.0) for prop in props]).reshape(-1, 3)
    pushes = line.any(axis=1)
    payload = np.array(most) * np.where(pushes, 0.5, 1.0)
    applied = np.zeros((bricks if pushes.any() else 0, 6))
    for i in np.flatnonzero(pushes).tolist():
        brick = scene.brick_of_node[props[i].node]
        arm = np.subtract(scene.node_position(props[i].node), brick.position)
        force = payload[i] * line[i]
        applied[scene.since[brick.name] - 1] += np.concatenate([force, np.cross(arm, force)])
    return PropGrips(props, payload, line, applied)


def added(one: Floats, other: Floats) -> Floats:
    """Return what two parts apply, (B, 6), either of which may have no rows."""
    return one + other if len(one) and len(other) else one if len(one) else other
