"""What robots can hold and carry: those of a free schedule that are interchangeable, and loads.

Joints and other grips share the weight of a placed brick. During transport the robot carries all
of it, and its tool.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue
from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.scene._armed import within_reach
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FreeRules, Newest, Payload
from seqopt.sequence.schedule import holds
from seqopt.sequence.steps import AnyStep, StepKind
from seqopt.sequence.two_robots import placing_node

_ROUNDING = 1e-9  # over a payload, by which a load may exceed it


class Carried(NamedTuple):
    """A brick that a robot places or removes."""

    step: int  # its number
    robot: int  # index among the scene's robots
    brick: int  # its name


def carried(scene: Scene, steps: Sequence[AnyStep]) -> Iterator[Carried]:
    """Yield robot and brick of every transport in steps, whose grips may be open.

    The robot that removes a brick held it before: unknown if the first step removes one.
    """
    removals = {step.number - 1: step for step in steps if step.kind is StepKind.REMOVE}
    for hold in holds(scene, steps):
        if hold.places is not None:
            yield Carried(hold.first, hold.robot, hold.places)
        if (step := removals.get(hold.last)) is not None:  # in which nobody else lets go
            yield Carried(step.number, hold.robot, scene.placed[step.bricks].name)


def loads(scene: Scene, robot: Robot) -> Floats:
    """Return the load of a robot with every brick in build order, its tool included, (B,), N."""
    tool = 0.0 if robot.arm is None else robot.arm.tool_mass
    gravity = scene.weight_factor * float(np.linalg.norm(scene.gravity))
    return gravity * (np.array([brick.mass for brick in scene.placed]) + tool)


def can_carry(scenes: Sequence[Scene], robot: int) -> Bools:
    """Return whether a robot can carry each brick in build order in all scenes, (B,)."""
    pairs = [(scene, scene.robots[robot]) for scene in scenes]
    within = [loads(scene, own) <= own.payload * (1 + _ROUNDING) for scene, own in pairs]
    return np.asarray(np.all(within, axis=0))


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
