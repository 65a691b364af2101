"""Robots of a free schedule by kind: those that could change places."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from seqopt.arms._permits import within_reach
from seqopt.arrays import Bools, FrozenValue
from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.scene.parts import Robot
from seqopt.sequence.rules import FreeRules, Newest, Payload
from seqopt.sequence.two_robots import placing_node


@dataclass(frozen=True, eq=False, repr=False)
class RobotKind(FrozenValue):
    """Robots that reach the same nodes, may carry as much, and may place or not."""

    robots: tuple[int, ...]  # indices of the scene's robots
    reach: Bools  # (2B,); nodes that they may hold, as in ``network.inner.ravel()``
    newest: Bools  # (2B,); at which they hold a brick when they place it, and as the newest
    places: bool  # whether they may place
    cap: float  # largest force of a grip, N


def sort_robots(
    network: Network,
    rules: FreeRules,
    caps: Mapping[str, float] | None = None,
    *,
    timed: bool = False,
) -> tuple[RobotKind, ...]:
    """Return the robots that take part, by kind, in the order of their first robots.

    ``caps``: largest force of a robot's grip beside its payload, by its name, N; ``timed``: whether
    those of a kind must take as long.
    """
    scene = network.scene
    alike: dict[tuple[object, ...], RobotKind] = {}
    for i in rules.team(scene):
        robot = scene.robots[i]
        own = {*chain.from_iterable(within_reach(scene, robot))}
        reach = np.array([node in own for node in node_numbers(network)])
        newest = reach if rules.newest is not Newest.PLACING else _placing(network, robot, reach)
        places = not rules.placers or robot.name in rules.placers
        cap = robot.payload if rules.payload is Payload.KEPT else np.inf
        cap = min(cap, (caps or {}).get(robot.name, np.inf))
        alone = (robot.arm and robot.name, scene.grip_kinds.of_robot[i], timed and robot.durations)
        key = (reach.tobytes(), newest.tobytes(), places, cap, *alone)
        first = alike.setdefault(key, RobotKind((), reach, newest, places, cap))
        alike[key] = replace(first, robots=(*first.robots, i))
    return tuple(alike.values())


def node_numbers(network: Network) -> list[int]:
    """Return the scene's numbers of all inner nodes (2B,), brick by brick in build order."""
    return [node for brick in network.scene.placed for node in brick.nodes]


def _placing(network: Network, robot: Robot, reach: Bools) -> Bools:
    """Return at which node a robot places every brick."""
    out = np.zeros_like(reach)
    for k, brick in enumerate(network.scene.placed):
        with suppress(StepError):  # it reaches none
            out[2 * k + brick.nodes.index(placing_node(network, robot, brick))] = True
    return out
