"""Which reach is enough where robots do not reach far enough: the least, which is tried."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np

from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.parts import Reach, Robot, Side, Sphere
from seqopt.scene.scene import Scene

_Make = TypeVar("_Make", bound=Callable[..., Any])
ASKS = "extend a reach"  # of errors: what says so is answered by the reach that is enough
_MM = 1000.0


def enough_reach(scene: Scene, exists: Callable[[Scene], bool]) -> Iterator[str]:
    """Yield the least reach of one robot with which something exists, else of all; in words.

    ``exists``: whether it does in a scene, which is the same save for what robots reach.
    """
    limited = [r for r in scene.robots if r.arm is None and isinstance(r.reach, Side | Sphere)]
    alone = 0
    for some in ([robot] for robot in limited):
        if more := _least(scene, some, exists):
            alone += 1
            yield _said(some[0], more)
    if not alone and len(limited) > 1 and (more := _least(scene, limited, exists)):
        yield f"a reach that is {more:.6g} m longer of every robot that does not reach everything"


def _said(robot: Robot, more: float) -> str:
    """Return the reach of a robot that is enough, in words."""
    if isinstance(robot.reach, Sphere):
        radius = math.ceil(_MM * (robot.reach.radius + more) - 1e-6) / _MM
        return f"a reach of {radius:.6g} m of {robot.name} ({robot.reach.radius:.6g} m now)"
    return f"a reach of {robot.name} that is {more:.6g} m longer"


def _least(scene: Scene, some: Sequence[Robot], exists: Callable[[Scene], bool]) -> float:
    """Return how much longer some robots have to reach at least, in whole mm; zero if it is vain.

    Only lengths at which one more node is reached make a difference.
    """
    lacks = {
        math.ceil(_MM * lack - 1e-6) / _MM
        for robot in some
        for brick in scene.placed
        for node in brick.nodes
        if (lack := _lack(robot.reach, brick.node_position(node))) > 0
    }
    steps = sorted(lacks)
    if not steps or not exists(_longer(scene, some, steps[-1])):
        return 0.0
    low, high = -1, len(steps) - 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if exists(_longer(scene, some, steps[middle])) else (middle, high)
    return steps[high]


def _lack(reach: Reach, point: Sequence[float]) -> float:
    """Return how far a point is out of reach, m."""
    if isinstance(reach, Sphere):
        return math.dist(reach.center, point) - reach.radius
    if isinstance(reach, Side):
        return float(np.dot(reach.toward, np.subtract(reach.point, point)))
    return 0.0


def _longer(scene: Scene, some: Sequence[Robot], more: float) -> Scene:

    def changed(robot: Robot) -> Robot:
        reach = robot.reach
        if robot not in some:
            return robot
        if isinstance(reach, Sphere):
            return replace(robot, reach=replace(reach, radius=reach.radius + more))
        assert isinstance(reach, Side)
        x, y, z = (p - more * t for p, t in zip(reach.point, reach.toward, strict=True))
        return replace(robot, reach=replace(reach, point=(x, y, z)))

    return scene.with_robots(*map(changed, scene.robots))


def says_reach(make: _Make) -> _Make:
    """Return a method whose error that asks for a longer reach says which one is enough."""

    @wraps(make)
    def made(network: Network | Scene, robots: int | Sequence[str] = ()) -> object:
        try:
            return make(network, robots)
        except StepError as error:
            said = str(error)
            if ASKS not in said:
                raise
            scene = network if isinstance(network, Scene) else network.scene

        def exists(other: Scene) -> bool:
            try:
                make(build_network(other), robots)
            except StepError:
                return False
            return True

        ways = " or ".join(enough_reach(scene, exists))
        raise StepError(said.replace(ASKS, f"give {ways}") if ways else said)

    return cast(_Make, made)
