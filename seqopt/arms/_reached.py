"""The postures of one arm at all nodes, free of fixed obstacles, and the bricks that they hit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from seqopt._registry import Later
from seqopt.arms._arm import MOST
from seqopt.arms._collisions import (
    apart_pairs,
    convex,
    fixed_bodies,
    hits,
    obstacles,
    overlap,
    touching,
    turned,
)
from seqopt.arms._model import SAYS, ArmModel, Placed
from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SceneError
from seqopt.scene.parts import Brick, Robot
from seqopt.scene.scene import Scene

pin = Later("pinocchio")  # an extra


def diverse(node: Ints, joints: Floats, struck: Bools, most: int) -> Ints:
    """Return the rows of postures that are kept, at most so many at each node, node by node.

    Those that hit few bricks come first, and of these those that are far from what is kept already.

    ``node`` (P,): ascending; ``joints`` (P, J); ``struck`` (P, B): which bricks they hit.
    """
    out = []
    for place in np.unique(node).tolist():
        rows = np.flatnonzero(node == place)
        bad = struck[rows].sum(axis=1) / struck.shape[1]
        kept = [int(np.argmin(bad))]
        far = np.abs(joints[rows] - joints[rows[kept[0]]]).max(axis=1)
        while len(kept) < min(most, len(rows)):
            gain = np.minimum(far, np.pi) / np.pi - bad
            gain[kept] = -np.inf
            kept.append(int(np.argmax(gain)))
            far = np.minimum(far, np.abs(joints[rows] - joints[rows[kept[-1]]]).max(axis=1))
        out += rows[kept].tolist()
    return np.array(out, dtype=np.int64)


_TRIES = 10  # first postures that are drawn for a target
_STEPS = 60  # of Newton's method from each
_LONGEST = 0.4  # step of a joint, rad or m
_DAMPING = 1e-5
_CLOSE = 1e-6  # m and rad; how far a flange may be from its target
_SAME = 1e-2  # rad or m; postures closer than this are one
_AXES = {"length": 0, "width": 1, "thickness": 2}


@dataclass(frozen=True, eq=False)
class Target:
    """Where the flange has to be to grip a node.

    ``face``: from which face of the brick, as ``+width``; ``axes`` (3, 3), as columns, and
    ``place`` (3,), m: of the flange, in the scene; ``tool``: how long the tool's body is that may
    hit something, m.
    """

    face: str
    axes: Floats
    place: Floats
    tool: float


def targets(model: ArmModel, brick: Brick, node: int) -> Iterator[Target]:
    """Yield where the flange may be to grip a node: from each face, the jaws either way around.

    The tool looks into the face; the x of the flange is along the length of the brick, or along its
    width for a face across the length.
    """
    at, frame = np.array(brick.node_position(node)), brick.frame
    away = at - np.array(brick.position)
    both = (f"{sign}{face}" if face in _AXES else face for face in model.arm.faces for sign in "+-")
    for face in dict.fromkeys(both):
        axis, sign = _AXES[face[1:]], 1.0 if face[0] == "+" else -1.0
        outward = sign * frame[axis]
        depth = 0.5 * brick.dimensions[axis] - float(away @ outward)
        tool = model.arm.tool_length - depth - model.arm.fingers
        if tool <= 0:  # its flange would be in the brick, or at its face
            continue
        for turn in (1.0, -1.0):
            x = turn * frame[0 if axis else 1]
            axes = np.column_stack([x, np.cross(-outward, x), -outward])
            yield Target(face, axes, at + model.arm.tool_length * outward, tool)


def solve(model: ArmModel, target: Target, draws: np.random.Generator) -> list[Floats]:
    """Return the postures that were found for a target, each once."""
    wanted = model.base.actInv(pin.SE3(target.axes, target.place))
    found: list[Floats] = []
    if np.linalg.norm(target.place - model.base.translation) > model.span:
        return found
    for first in model.draw(draws, _TRIES):
        posture = _descend(model, wanted, first)
        if posture is None:
            continue
        wrapped = (posture + np.pi) % (2 * np.pi) - np.pi
        posture = np.where(model.turns, wrapped, posture)
        inside = ((posture >= model.low) & (posture <= model.high)).all()
        if inside and all(np.abs(posture - other).max() > _SAME for other in found):
            found.append(posture)
    return found


def _descend(model: ArmModel, wanted: object, posture: Floats) -> Floats | None:
    """Return the posture that Newton's method, damped, ends in; None if it does not arrive."""
    inner, data, flange = model.model, model.data, model.flange
    local = pin.ReferenceFrame.LOCAL
    damping = _DAMPING * np.eye(6)
    for _ in range(_STEPS):
        pin.forwardKinematics(inner, data, posture)
        at = pin.updateFramePlacement(inner, data, flange)
        error = pin.log6(at.actInv(wanted)).vector
        if np.abs(error).max() < _CLOSE:
            return posture
        jacobian = pin.computeFrameJacobian(inner, data, posture, flange, local)
        step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping, error)
        posture = posture + np.clip(step, -_LONGEST, _LONGEST)
    return None


_KEPT = 64  # robots of which postures are kept, the last ones that were asked for
_BY_POSTURE = ("node", "joints", "axes", "place", "strikes")
_SEED = 4600  # with the number of the node, of what is drawn for it


@dataclass(frozen=True)
class Site:
    """Everything postures depend on: bricks, nodes, arms and the vertical; not the build order.

    Nor on how stiff anything is.

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
            replace(
                robot,
                payload=1.0,
                stiffness=None,
                rotational_stiffness=None,
                arm=replace(robot.arm, postures=MOST, joint_stiffness=()),
            )
            for robot in scene.robots
            if robot.arm is not None
        )
        return cls(bricks, robots, tuple(sorted(scene.blocked_nodes)), scene.up)

    def alone(self, robot: int) -> Site:
        """Return the site of one of the robots alone, equal for robots that differ in name only."""
        own = self.robots[robot]
        arm = own.arm and replace(own.arm, keeps_apart=True)
        return replace(self, robots=(replace(own, name="alone", arm=arm),))

    def together(self, one: int, two: int) -> bool:
        """Return whether two robots must keep apart."""
        arms = (self.robots[one].arm, self.robots[two].arm)
        return all(arm is not None and arm.keeps_apart for arm in arms)

    @property
    def nodes(self) -> tuple[int, ...]:
        """All nodes, brick by brick."""
        return tuple(node for brick in self.bricks for node in brick.nodes)


@dataclass(frozen=True, eq=False)
class Reached:
    """The postures of one robot at all nodes, as a table has them, and where its bodies are.

    ``strikes`` (P, B): which body of the arm, by its names, hits each brick, -1 for none; ``found``
    (N,): how many there are at each node, before all but some are left out; ``why``: by node, why
    there is none.
    """

    model: ArmModel
    node: Ints
    joints: Floats
    axes: Floats
    place: Floats
    strikes: Ints
    placed: Placed
    found: Ints
    why: dict[int, str]


_Fault = tuple[int, int, str]  # the check that is not passed, by order; which body, the tool last


def _blame(
    faults: list[_Fault | None],
    found: Bools,
    words: Sequence[str],
    check: int,
    rows: Ints | None = None,
) -> None:
    """Record, in place, the first fault found of postures that have none yet.

    ``found`` (n, k); ``words``: of the k faults; ``rows`` (n,): of which postures, if not all.
    """
    for row, own in zip(range(len(faults)) if rows is None else rows.tolist(), found, strict=True):
        if faults[row] is None and own.any():
            body = int(own.argmax())
            faults[row] = (check, body, words[body])


def _lacking(node: Ints, faults: Sequence[_Fault | None]) -> dict[int, str]:
    """Return why there is no posture at nodes (P,): what stops the one that passes the most."""
    at: dict[int, list[_Fault | None]] = {}
    for place, fault in zip(node.tolist(), faults, strict=True):
        at.setdefault(place, []).append(fault)
    return {n: max(filter(None, own))[-1] for n, own in at.items() if None not in own}


@lru_cache(maxsize=_KEPT)
def reached_alone(site: Site, most: int) -> Reached:
    """Return the postures of the one robot of a site at all nodes: at most so many at each.

    They touch neither the ground, which is level with the lower one of its base and of the lowest
    brick, nor the arm itself, nor, except by its tool, the brick that is gripped.
    """
    (robot,) = site.robots
    assert robot.arm is not None
    model, corners = ArmModel(robot.arm), [_corners(brick) for brick in site.bricks]
    bricks = obstacles(
        [(convex(c - c.mean(axis=0)), turned(np.eye(3), c.mean(axis=0))) for c in corners], corners
    )
    inside = overlap(fixed_bodies(model), bricks).any(axis=0)
    if inside.any():
        name = site.bricks[int(inside.argmax())].name
        raise SceneError(f"robot {robot.name}: the base of its arm hits brick {name}; move it")
    places, joints, flanges, why = _solved(site, model)
    placed = model.placed(joints, np.array([each.tool for each in flanges]))
    up = np.array(site.up)
    ground = min(float(model.base.translation @ up), *(float((c @ up).min()) for c in corners))
    faults: list[_Fault | None] = [None] * len(joints)
    _blame_itself(model, faults, placed, (up, ground))
    rows = np.flatnonzero([fault is None for fault in faults])
    struck = hits(model, placed.rows(rows), bricks)
    held = places[rows] // 2  # the tool goes around the brick that it grips, the arm does not
    at = np.arange(len(rows))
    struck[at, -1, held] = False
    moving = model.names[len(model.fixed) :]
    lines = [name.replace(SAYS, "hits the brick that it grips") for name in moving]
    _blame(faults, struck[at, :, held], lines, 3, rows)
    some = np.flatnonzero([faults[row] is None for row in rows])
    hit = np.asarray(struck.any(axis=1))
    counts = np.bincount(places[rows[some]], minlength=len(site.nodes))
    some = some[diverse(places[rows[some]], joints[rows[some]], hit[some], most)]
    kept = rows[some]
    return Reached(
        model=model,
        node=places[kept],
        joints=joints[kept],
        axes=np.array([flanges[i].axes for i in kept]).reshape(-1, 3, 3),
        place=np.array([flanges[i].place for i in kept]).reshape(-1, 3),
        strikes=np.where(hit, struck.argmax(axis=1) + len(model.fixed), -1)[some],
        placed=placed.rows(kept),
        found=counts,
        why=why | _lacking(places, faults),
    )


def _blame_itself(
    model: ArmModel, faults: list[_Fault | None], placed: Placed, ground: tuple[Floats, float]
) -> None:
    """Find postures in which an arm touches itself or the ground, by what is up and how high."""
    pairs, names, (up, height) = apart_pairs(model), model.names, ground
    both = [names[j].replace(SAYS, f"touches {names[i].split(f' {SAYS}')[0]}") for i, j in pairs]
    above = names[len(model.fixed) + model.above :]
    low = [name.replace(SAYS, "touches the ground") for name in above]
    _blame(faults, touching(model, placed, pairs), both, 1)
    lowest = placed.shift @ up  # point of each moving body, (P, L)
    for k, body in enumerate(model.moving):
        turned = placed.rotation[:, k].transpose(0, 2, 1) @ up
        lowest[:, k] += (turned @ body.points.T).min(axis=1)
    lean = placed.rotation[:, -1, :, 2] @ up
    lowest[:, -1] -= 0.5 * placed.tools * np.abs(lean)
    lowest[:, -1] -= model.arm.tool_radius * np.sqrt(np.clip(1.0 - lean**2, 0.0, None))
    _blame(faults, lowest[:, model.above :] <= height, low, 2)


def beside_others(site: Site, alone: Sequence[Reached]) -> list[Reached]:
    """Return the postures of robots that touch no base of another one; bases stand apart."""
    bases = [fixed_bodies(each.model) for each in alone]
    out = []
    for i, own in enumerate(alone):
        faults: list[_Fault | None] = [None] * len(own.node)
        names = own.model.names[len(own.model.fixed) :]
        for j in (j for j in range(len(alone)) if j != i and site.together(i, j)):
            one, two = (site.robots[k].name for k in (i, j))
            if overlap(bases[i], bases[j]).any():
                raise SceneError(f"robot {one}: the base of its arm hits that of {two}; move one")
            lines = [name.replace(SAYS, f"hits the base of {two}") for name in names]
            struck = np.asarray(hits(own.model, own.placed, bases[j]).any(axis=2))
            _blame(faults, struck, lines, 4)
        rows = np.flatnonzero([fault is None for fault in faults])
        parts = {name: getattr(own, name)[rows] for name in _BY_POSTURE}
        why = own.why | _lacking(own.node, faults)
        out.append(replace(own, placed=own.placed.rows(rows), why=why, **parts))
    return out


def _solved(site: Site, model: ArmModel) -> tuple[Ints, Floats, list[Target], dict[int, str]]:
    """Return the nodes, as places, the joints and the targets of all postures of a robot.

    And by place why there is none.
    """
    reach = site.robots[0].reach
    nodes, joints, flanges, why = [], [], [], {}
    for place, node in enumerate(site.nodes):
        brick = site.bricks[place // 2]
        if node in site.blocked or not reach.covers(brick.node_position(node)):
            why[place] = "it lies outside the reach that the scene gives, or nobody may hold it"
            continue
        draws = np.random.default_rng((_SEED, place))
        aims = [*targets(model, brick, node)]
        found = [(posture, aim) for aim in aims for posture in solve(model, aim, draws)]
        nodes += [place] * len(found)
        joints += [posture for posture, _ in found]
        flanges += [aim for _, aim in found]
        far = [np.linalg.norm(aim.place - model.base.translation) for aim in aims]
        if not aims:
            why[place] = (
                "the tool is too short: the flange would be in the brick, give a longer tool_length"
            )
        elif not found and min(far) > model.reach:
            why[place] = f"too far: its flange gets about {model.reach:.2g} m from its base"
        elif not found:
            why[place] = (
                "no posture was found within joint limits with the tool square to a face of the "
                "brick"
            )
    rows = np.array(joints).reshape(-1, model.joints)
    return np.array(nodes, dtype=np.int64), rows, flanges, why


def _corners(brick: Brick) -> Floats:
    """Return the corners of a brick (m, 3), m."""
    if brick.shape is not None:
        return np.array(brick.position) + brick.shape.points
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.asarray(brick.position + 0.5 * signs * np.array(brick.dimensions) @ brick.frame)
