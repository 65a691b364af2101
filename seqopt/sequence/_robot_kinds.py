"""Robots of a free schedule by kind: those that are interchangeable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from seqopt.arrays import Bools, FrozenValue
from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.scene._armed import within_reach
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.sequence._carrying import can_carry
from seqopt.sequence.rules import FreeRules, Newest, Payload
from seqopt.sequence.two_robots import placing_node


@dataclass(frozen=True, eq=False, repr=False)
class RobotKind(FrozenValue):
    """Robots of equal reach, force limit, and bricks that they may place."""

    robots: tuple[int, ...]  # indices of the scene's robots
    reach: Bools  # (2B,); nodes that they may hold, as in ``network.inner.ravel()``
    newest: Bools  # (2B,); at which they hold a brick when they place it, and as the newest
    places: Bools  # (B,); bricks in build order that they may place or take away: they carry them
    cap: float  # largest force of a grip, N


def sort_robots(
    network: Network,
    rules: FreeRules,
    caps: Mapping[str, float] | None = None,
    *,
    timed: bool = False,
    worlds: Sequence[Scene] = (),
) -> tuple[RobotKind, ...]:
    """Return the participating robots by kind, in the order of their first robots.

    ``caps``: force limits of grips besides payloads, by robot, N; ``timed``: whether robots of a
    kind must have equal durations; ``worlds``: scenes of scenarios, with other weights.
    """
    scene, kept = network.scene, rules.payload is Payload.KEPT
    alike: dict[tuple[object, ...], RobotKind] = {}
    for i in rules.team(scene):
        robot = scene.robots[i]
        own = {*chain.from_iterable(within_reach(scene, robot))}
        reach = np.array([node in own for node in node_numbers(network)])
        newest = reach if rules.newest is not Newest.PLACING else _placing(network, robot, reach)
        places = can_carry((scene, *worlds), i) if kept else np.ones(len(scene.placed), dtype=bool)
        places &= not rules.placers or robot.name in rules.placers
        cap = robot.payload if kept else np.inf
        cap = min(cap, (caps or {}).get(robot.name, np.inf))
        alone = (robot.arm and robot.name, scene.grip_kinds.of_robot[i], timed and robot.durations)
        key = (reach.tobytes(), newest.tobytes(), places.tobytes(), cap, *alone)
        first = alike.setdefault(key, RobotKind((), reach, newest, places, cap))
        alike[key] = replace(first, robots=(*first.robots, i))
    return tuple(alike.values())


def node_numbers(network: Network) -> list[int]:
    """Return the scene's numbers of all inner nodes (2B,), brick by brick in build order."""
    return [*network.scene.placed_nodes]


def _placing(network: Network, robot: Robot, reach: Bools) -> Bools:
    """Return the mask (2B,) of the nodes at which a robot places bricks."""
    out = np.zeros_like(reach)
    for k, brick in enumerate(network.scene.placed):
        with suppress(StepError):  # it reaches none
            out[2 * k + brick.nodes.index(placing_node(network, robot, brick))] = True
    return out
