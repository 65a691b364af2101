"""Robots of a free schedule sorted by kind: of one kind are those that could change places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, FrozenValue
from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.scene.parts import Robot
from seqopt.sequence.free_rules import FreeRules, Newest, Payload
from seqopt.sequence.two_robots import placing_node


@dataclass(frozen=True, eq=False, repr=False)
class RobotKind(FrozenValue):
    """Robots that reach the same nodes, may carry as much, and may place or not.

    Nodes are counted as in ``network.inner.ravel()``: brick by brick in build order.

    Attributes
    ----------
    robots : tuple of int
        Indices of the scene's robots.
    reach : (2B,) bool
        Nodes that they may hold: within reach and not blocked.
    newest : (2B,) bool
        Nodes at which they hold a brick when they place it, and as the newest one.
    places : bool
        Whether they may place.
    cap : float
        Largest force of a grip, N.
    """

    robots: tuple[int, ...]
    reach: Bools
    newest: Bools
    places: bool
    cap: float


def sort_robots(
    network: Network, rules: FreeRules, caps: Mapping[str, float] | None = None
) -> tuple[RobotKind, ...]:
    """Return the robots that take part, sorted by kind.

    Parameters
    ----------
    network : Network
    rules : FreeRules
    caps : mapping of str to float, optional
        Largest force of a robot's grip beside its payload, by its name, N.

    Returns
    -------
    tuple of RobotKind
        In the order of their first robots.

    Raises
    ------
    StepError
        As `FreeRules.team` does.
    """
    alike: dict[tuple[object, ...], list[int]] = {}
    parts: dict[tuple[object, ...], RobotKind] = {}
    for i in rules.team(network.scene):
        robot = network.scene.robots[i]
        reach = reached(network, robot)
        newest = reach if rules.newest is not Newest.PLACING else _placing(network, robot, reach)
        places = not rules.placers or robot.name in rules.placers
        cap = robot.payload if rules.payload is Payload.KEPT else np.inf
        cap = min(cap, (caps or {}).get(robot.name, np.inf))
        key = (reach.tobytes(), newest.tobytes(), places, cap)
        alike.setdefault(key, []).append(i)
        parts.setdefault(key, RobotKind((), reach, newest, places, cap))
    return tuple(
        RobotKind(tuple(robots), parts[key].reach, parts[key].newest, parts[key].places, key[3])  # type: ignore[arg-type]
        for key, robots in alike.items()
    )


def node_numbers(network: Network) -> list[int]:
    """Return the scene's numbers of all inner nodes, brick by brick in build order.

    Returns
    -------
    list of int
        (2B,)
    """
    return [node for brick in network.scene.placed for node in brick.nodes]


def reached(network: Network, robot: Robot) -> Bools:
    """Return which nodes a robot may hold: within its reach and not blocked.

    Returns
    -------
    (2B,) bool
    """
    scene = network.scene
    return np.array(
        [
            node not in scene.blocked_nodes and robot.reach.covers(brick.node_position(node))
            for brick in scene.placed
            for node in brick.nodes
        ]
    )


def _placing(network: Network, robot: Robot, reach: Bools) -> Bools:
    """Return at which node a robot places every brick."""
    out = np.zeros_like(reach)
    for k, brick in enumerate(network.scene.placed):
        try:
            out[2 * k + brick.nodes.index(placing_node(network, robot, brick))] = True
        except StepError:  # it reaches none
            continue
    return out
