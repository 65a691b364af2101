"""Robots as they are drawn: a simple arm from a base to its grip, where only a reach is known.

An arm is a line of points, m: its foot, its joints, its wrist, and the tip of its tool. A robot
that may be anywhere is drawn beside the structure, at one of its ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from seqopt.arms._kept import plan_postures
from seqopt.arms._model import PosedArm, idle_arm
from seqopt.arrays import Floats
from seqopt.errors import ExtraError, SceneError
from seqopt.exchange._grip_frames import hold
from seqopt.scene.boxes import vertices_of
from seqopt.scene.parts import Prop, Robot, Side, Sphere
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

ROBOT_COLORS = ("#0b7a75", "#7b2d8b", "#ad5600", "#444444", "#1f5fa8")
_BESIDE = 0.3  # of a base from the structure, over the size of that
_APART = 0.35  # of bases on one side from each other, likewise
_HIGH = 0.12  # of a shoulder above its foot, over the reach
_SPARE = 1.02  # by which two links are longer than what they must span
_LONGEST = 0.4  # of a link, over the size of the structure
_STEEP = 0.2  # rise of a prop, over its length, from which on it stands on the ground
_TOOL = 0.5  # of a tool outside of a brick, over the longest side of the brick
_FOLDED = ((0.75, -0.45), (0.35, 0.1), (0.2, 0.1))  # elbow, wrist, tip: up and ahead, over a link

Arms = Mapping[str, Sequence[Floats | PosedArm | None]]
"""Points of arms, (k, 3), m, or arms in postures, by robots' names: an entry for every step."""


class Cell:
    """Where the robots of a scene stand, and how they hold nodes.

    ``arms``: lines that are known; others are sketched, each once. ``corners``: of all bricks,
    (k, 3), the ``level`` of the ground, that of the lowest corner, the ``size`` of the structure,
    its longest diagonal, and its ``middle`` on the ground, (3,), m.
    """

    def __init__(self, scene: Scene, arms: Arms | None = None) -> None:
        self.scene = scene
        self._sketched = dict[tuple[str, int | None], Floats]()  # points (k, 3), m
        self.up = np.array(scene.up)
        self.corners = np.vstack([vertices_of(brick)[0] for brick in scene.bricks])
        low, high = self.corners.min(axis=0), self.corners.max(axis=0)
        self.level = float((self.corners @ self.up).min())
        self.size = float(np.linalg.norm(high - low))
        self.middle = self._on_ground(0.5 * (low + high))
        first = self._away(np.eye(3)[int(np.abs(self.up).argmin())])
        self._sides = np.stack([first, np.cross(self.up, first)])  # level directions (2, 3)
        every = (arm for own in (arms or {}).values() for arm in own)
        self._known = [*{id(arm): arm for arm in every if arm is not None}.values()]

    @cached_property
    def stands(self) -> Floats:
        """Where robots stand: their feet and shoulders, (k, 3), m."""
        points = [p for at, _ in self.shoulders.values() for p in (self._on_ground(at), at)]
        points += [_line(arm)[0] for arm in self._known]
        return np.array(points).reshape(-1, 3)

    @cached_property
    def known(self) -> Floats:
        """All points of the arms that are known, in all steps, (k, 3), m."""
        lines = [_line(arm) for arm in self._known]
        bodies = [body for arm in self._known if isinstance(arm, PosedArm) for body in arm.bodies]
        return np.vstack([np.zeros((0, 3)), *lines, *bodies])

    def arms(self, step: Step, at: int, known: Arms) -> list[Floats | PosedArm | None]:
        """Return the shapes of every robot in a step, the ``at``-th of those of known arms."""
        pairs = zip(self.scene.robots, step.grips, strict=True)
        return [
            known[robot.name][at] if robot.name in known else self.arm(robot, node)
            for robot, node in pairs
        ]

    @cached_property
    def yard(self) -> Floats:
        """Corners of a level rectangle (4, 3) around the structure and the feet of robots, m."""
        flat = (np.vstack([self.corners, self.stands]) - self.middle) @ self._sides.T
        room = 0.1 * self.size
        (left, near), (right, far) = flat.min(axis=0) - room, flat.max(axis=0) + room
        around = np.array([(left, near), (right, near), (right, far), (left, far)])
        return np.asarray(self.middle + around @ self._sides)

    @cached_property
    def shoulders(self) -> dict[str, tuple[Floats, float]]:
        """The shoulder (3,) and the reach, m, of every robot, where it may be anywhere as sketched.

        Such robots stand at both ends of the structure in turn.
        """
        out, beside = dict[str, tuple[Floats, float]](), dict[str, Floats]()
        along = self._sides[np.ptp(self.corners @ self._sides.T, axis=0).argmax()]  # it is longest
        for robot in self.scene.robots:
            reach = robot.reach
            if isinstance(reach, Sphere):
                out[robot.name] = (np.array(reach.center), reach.radius)
            elif isinstance(reach, Side):
                beside[robot.name] = self._away(np.array(reach.toward))
            else:
                beside[robot.name], along = along, -along
        for name, away in beside.items():
            same = [each for each, other in beside.items() if away @ other > 0.5]
            place = same.index(name) - 0.5 * (len(same) - 1)
            out_to = float(((self.corners - self.middle) @ away).max()) + _BESIDE * self.size
            foot = self.middle + out_to * away
            foot = foot + _APART * self.size * place * np.cross(self.up, away)
            far = float(np.linalg.norm(self.corners - foot, axis=1).max())
            out[name] = (foot + _HIGH * far * self.up, far)
        return out

    def reach(self, robot: Robot) -> list[float] | None:
        """Return the middle of the circle on the ground up to which a robot reaches, and its size.

        None where only a side is known, or the robot may be anywhere.
        """
        if not isinstance(robot.reach, Sphere):
            return None
        center = np.array(robot.reach.center)
        high = float(center @ self.up) - self.level
        wide = np.sqrt(max(robot.reach.radius**2 - high**2, 0.0))
        return [*self._on_ground(center).round(4).tolist(), round(float(wide), 4)]

    def prop(self, prop: Prop) -> Floats:
        """Return the ends of a prop, its node first and its foot, (2, 3), m.

        It stands on the ground along the way in which it pushes, or is a short strut that way.
        """
        at = np.array(self.scene.node_position(prop.node))
        along = self.up if prop.direction is None else np.array(prop.direction)
        rise, height = float(along @ self.up), float(at @ self.up) - self.level
        far = height / rise if rise > _STEEP else _BESIDE * self.size
        return np.array([at, at - far * along])

    def arm(self, robot: Robot, node: int | None) -> Floats:
        """Return the points of a robot's arm that holds a node, or of one that is idle.

        Its elbow is up, and its tool comes as that of a task does; an idle one is folded over its
        base; long arms are drawn short.
        """
        if (known := self._sketched.get((robot.name, node))) is not None:
            return known
        shoulder, reach = self.shoulders[robot.name]
        foot, link = self._on_ground(shoulder), min(0.5 * reach, _LONGEST * self.size)
        if node is None:
            ahead = self._away(self.middle - shoulder)
            bent = [shoulder + link * (up * self.up + on * ahead) for up, on in _FOLDED]
            return self._sketched.setdefault((robot.name, node), np.array([foot, shoulder, *bent]))
        held, brick = hold(self.scene, robot, node), self.scene.brick_of_node[node]
        tip = np.array(held.grip.point)
        wrist = tip - (held.depth + _TOOL * max(brick.dimensions)) * held.grip.axes[2]
        span = wrist - shoulder
        size = float(np.linalg.norm(span))
        along = span / size if size > 0 else self.up
        rise = np.sqrt(max((_SPARE * max(link, 0.5 * size)) ** 2 - 0.25 * size**2, 0.0))
        across = _unit(self.up - (self.up @ along) * along)
        elbow = shoulder + 0.5 * span + rise * (self._away(along) if across is None else across)
        line = np.array([foot, shoulder, elbow, wrist, tip])
        return self._sketched.setdefault((robot.name, node), line)

    def _on_ground(self, point: Floats) -> Floats:
        return np.asarray(point - (point @ self.up - self.level) * self.up)

    def _away(self, toward: Floats) -> Floats:
        """Return the level direction to a side, (3,); any level one where a side is above."""
        flat = _unit(toward - (toward @ self.up) * self.up)
        any_ = np.cross(self.up, np.eye(3)[int(np.abs(self.up).argmin())])
        return np.asarray(any_ / np.linalg.norm(any_)) if flat is None else flat


def _unit(vector: Floats) -> Floats | None:
    """Return the direction of a vector, (3,); None where there is none."""
    size = float(np.linalg.norm(vector))
    return np.asarray(vector / size) if size >= 1e-6 else None


def _line(arm: Floats | PosedArm) -> Floats:
    """Return the points of an arm that is known, (k, 3), m."""
    return arm.line if isinstance(arm, PosedArm) else np.asarray(arm)


def _known_arms(scene: Scene, steps: Sequence[Step]) -> Arms:
    """Return robots with arms in the steps of a plan, in postures that it allows.

    Where a step has no posture the grip alone is drawn; none are known where nothing computes them.
    """
    try:
        found = plan_postures(scene, steps)
        idle = {robot.name: idle_arm(robot.arm) for robot in scene.robots if robot.arm}
    except (ExtraError, SceneError):
        return {}
    if found is None:
        return {}
    cell, joints = Cell(scene), found.table.joints
    posed, out = dict[int, PosedArm](), dict[str, list[Floats | PosedArm | None]]()
    for r, robot in enumerate(scene.robots):
        for step, rows in zip(steps, found.steps, strict=True) if robot.arm else ():
            row, node = rows[r], step.grips[r]
            arm = idle[robot.name] if node is None else cell.arm(robot, node)
            if row is not None and robot.arm is not None:
                arm = posed.setdefault(row, PosedArm(robot.arm, joints[row]))
            out.setdefault(robot.name, []).append(arm)
    return out


def arm_data(cell: Cell, steps: Sequence[Step], known: Arms) -> dict[str, object]:
    """Return the arms of robots in every step, ready for JSON.

    ``lines`` are points, each line once; ``at`` has a row for every step with the place of each
    robot's among them, or -1.
    """
    places, lines, at = {id(None): -1}, list[object](), list[list[int]]()
    for s, step in enumerate(steps):
        row = cell.arms(step, s, known)
        for arm in row:
            if arm is not None and id(arm) not in places:
                places[id(arm)] = len(lines)
                lines.append(_line(arm).round(4).tolist())
        at.append([places[id(arm)] for arm in row])
    return {"lines": lines, "at": at}
