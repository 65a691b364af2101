"""Grips of assemblies: those of robots, and props with what they bear and along which line.

What holds both ways is a grip like that of a robot. One that only pushes bears from nothing to its
capacity along its line, and nothing across it: half the capacity is applied for good, and a grip
along the line adds as much or takes it away.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

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


def applied_rows(network: Network, bricks: int, props: PropGrips | None = None) -> Floats:
    """Return `Assembly.applied` of a partial structure, with what props apply for good."""
    applied = network.applied(bricks)
    if props is None or not len(props.applied):
        return applied if applied.any() else np.zeros((0, 6))
    return applied + props.applied


def grip_fields(network: Network, bricks: int, held: Sequence[tuple[int, float]]) -> dict[str, Any]:
    """Return the fields of an assembly that depend on its grips, by name.

    ``held``: node and payload (N) of every robot that holds one; props follow.
    """
    scene, props = network.scene, prop_grips(network, bricks, held=bool(held))
    nodes = [*(node for node, _ in held), *props.nodes]
    blocks = [scene.since[scene.brick_of_node[node].name] - 1 for node in nodes]
    return {
        "grip_block": np.array(blocks, dtype=np.int64),
        "grip_position": np.array([scene.node_position(n) for n in nodes]).reshape(-1, 3),
        "payload": np.array([*(payload for _, payload in held), *props.payload]),
        "applied": applied_rows(network, bricks, props),
        "grip_line": np.concatenate([np.zeros((len(held), 3)), props.line]),
    }
