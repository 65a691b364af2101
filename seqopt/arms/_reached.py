"""The postures of one arm at all nodes, free of what stands still, and the bricks that they hit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from seqopt.arms._choice import diverse
from seqopt.arms._collisions import (
    Obstacles,
    convex,
    fixed_bodies,
    hits,
    obstacles,
    overlap,
    touching,
)
from seqopt.arms._inverse import solve, targets
from seqopt.arms.model import ArmModel, Placed
from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SceneError
from seqopt.scene.arm import MOST
from seqopt.scene.parts import Brick, Robot
from seqopt.scene.scene import Scene

_SEED = 4600  # with the number of the node, of what is drawn for it


@dataclass(frozen=True)
class Site:
    """What postures depend on: bricks and nodes, arms and what is up; not the build order.

    ``bricks``: by their names, ascending; ``blocked``: nodes that nobody may hold.
    """

    bricks: tuple[Brick, ...]
    robots: tuple[Robot, ...]
    blocked: tuple[int, ...]
    up: tuple[float, float, float]

    @classmethod
    def of(cls, scene: Scene) -> Site:
        """Return that of a scene; robots without an arm are in no one's way."""
        bricks = tuple(sorted(scene.bricks, key=lambda brick: brick.name))
        robots = tuple(
            replace(robot, payload=1.0, arm=replace(robot.arm, postures=MOST))
            for robot in scene.robots
            if robot.arm is not None
        )
        return cls(bricks, robots, tuple(sorted(scene.blocked_nodes)), scene.up)

    @property
    def nodes(self) -> tuple[int, ...]:
        """All nodes, brick by brick."""
        return tuple(node for brick in self.bricks for node in brick.nodes)


@dataclass(frozen=True, eq=False)
class Reached:
    """The postures of one robot at all nodes, as a table has them, and where its bodies are.

    ``found`` (N,): how many there are at each node, before all but some are left out.
    """

    model: ArmModel
    node: Ints
    joints: Floats
    axes: Floats
    place: Floats
    hits: Bools
    placed: Placed
    found: Ints


class Around:
    """What stands still around arms: bricks, bases and the ground below the lowest of both."""

    def __init__(self, site: Site, models: list[ArmModel]) -> None:
        corners = [_corners(brick) for brick in site.bricks]
        shapes = [(convex(each - each.mean(axis=0)), _at(each.mean(axis=0))) for each in corners]
        self.models, self.bricks = models, obstacles(shapes, corners)
        self.bases = [fixed_bodies(model) for model in models]
        self.up = np.array(site.up)
        feet = [float(model.base.translation @ self.up) for model in models]
        self.ground = min([*feet, *(float((points @ self.up).min()) for points in corners)])
        for robot, base in zip(site.robots, self.bases, strict=True):
            self._require_free(site, robot, base)

    def _require_free(self, site: Site, robot: Robot, base: Obstacles) -> None:
        """Raise a `SceneError` if a base stands in a brick, or in the base of another robot."""
        inside = overlap(base, self.bricks).any(axis=0)
        if inside.any():
            name = site.bricks[int(inside.argmax())].name
            raise SceneError(f"robot {robot.name}: the base of its arm hits brick {name}; move it")
        for other, its in zip(site.robots, self.bases, strict=True):
            if other is not robot and overlap(base, its).any():
                raise SceneError(
                    f"robot {robot.name}: the base of its arm hits that of {other.name}; move one"
                )

    def others(self, own: int) -> Obstacles:
        """Return the bases of all robots but one."""
        rest = [base for i, base in enumerate(self.bases) if i != own]
        none = np.zeros((0, 3))
        bodies = tuple(body for base in rest for body in base.bodies)
        low = np.concatenate([none, *(base.low for base in rest)])
        return Obstacles(bodies, low, np.concatenate([none, *(base.high for base in rest)]))

    def clear(self, own: int, placed: Placed) -> Bools:
        """Return which postures of an arm touch neither the ground, nor bases, nor itself, (P,)."""
        model = self.models[own]
        out = ~touching(model, placed, model.apart).any(axis=1)
        out &= ~hits(model, placed, self.others(own)).any(axis=(1, 2))
        out &= (_lowest(model, placed, self.up) > self.ground)[:, model.above :].all(axis=1)
        return np.asarray(out)


def reached_by(site: Site, own: int, around: Around, most: int) -> Reached:
    """Return the postures of a robot, by its number, at all nodes: at most so many at each."""
    model = around.models[own]
    places, joints, flanges = _solved(site, own, model)
    placed = model.placed(joints, np.array([flange.tool for flange in flanges]))
    rows = np.flatnonzero(around.clear(own, placed))
    struck = hits(model, placed.rows(rows), around.bricks)
    held = places[rows] // 2  # the tool goes around the brick that it grips, the arm does not
    at = np.arange(len(rows))
    free = ~struck[at, :-1, held].any(axis=1)
    struck[at, -1, held] = False
    bricks = struck.any(axis=1)
    counts = np.bincount(places[rows[free]], minlength=len(site.nodes))
    some = np.flatnonzero(free)
    some = some[diverse(places[rows[some]], joints[rows[some]], bricks[some], most)]
    kept = rows[some]
    return Reached(
        model=model,
        node=places[kept],
        joints=joints[kept],
        axes=np.array([flanges[i].axes for i in kept]).reshape(-1, 3, 3),
        place=np.array([flanges[i].place for i in kept]).reshape(-1, 3),
        hits=bricks[some],
        placed=placed.rows(kept),
        found=counts,
    )


def _solved(site: Site, own: int, model: ArmModel) -> tuple[Ints, Floats, list[Any]]:
    """Return the nodes, as places, the joints and the targets of all postures of a robot."""
    reach = site.robots[own].reach
    nodes, joints, flanges = [], [], []
    for place, node in enumerate(site.nodes):
        brick = site.bricks[place // 2]
        if node in site.blocked or not reach.covers(brick.node_position(node)):
            continue
        draws = np.random.default_rng((_SEED, place))
        for target in targets(model, brick, node):
            for posture in solve(model, target, draws):
                nodes.append(place)
                joints.append(posture)
                flanges.append(target)
    rows = np.array(joints).reshape(-1, model.joints)
    return np.array(nodes, dtype=np.int64), rows, flanges


def _lowest(model: ArmModel, placed: Placed, up: Floats) -> Floats:
    """Return how high the lowest point of each moving body is, (P, L), m."""
    out = placed.shift @ up
    for k, body in enumerate(model.moving):
        out[:, k] += (placed.rotation[:, k].transpose(0, 2, 1) @ up @ body.points.T).min(axis=1)
    lean = placed.rotation[:, -1, :, 2] @ up
    out[:, -1] -= 0.5 * placed.tools * np.abs(lean)
    out[:, -1] -= model.arm.tool_radius * np.sqrt(np.clip(1.0 - lean**2, 0.0, None))
    return np.asarray(out)


def _at(place: Floats) -> Any:
    import coal  # noqa: PLC0415  # an extra

    return coal.Transform3s(np.eye(3), place)


def _corners(brick: Brick) -> Floats:
    """Return the corners of a brick (m, 3), m."""
    if brick.shape is not None:
        return np.array(brick.position) + brick.shape.points
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.asarray(brick.position + 0.5 * signs * np.array(brick.dimensions) @ brick.frame)
