"""Which bodies touch: boxes around them first, then coal for the pairs that are left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from seqopt._registry import Later
from seqopt.arms._model import ArmModel, Placed
from seqopt.arrays import Bools, Floats, Ints

coal = Later("coal")  # an extra

_SAMPLES = 200  # postures from which it is known which links always touch
_ALWAYS = 0.95  # share of them
_PAIRS = 2_000_000  # of boxes that are compared at once
_Turned = tuple[Any, Any]  # a shape of coal, and where it is


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Convex bodies that stand still.

    ``bodies``: as coal has them; ``low``, ``high`` (k, 3): boxes around them, m.
    """

    bodies: tuple[_Turned, ...]
    low: Floats
    high: Floats


def turned(rotation: Floats, shift: Floats) -> Any:
    """Return where a body is, as coal has it."""
    return coal.Transform3s(rotation, shift)


class _Collider:
    """Asks coal, with one request for all questions."""

    def __init__(self) -> None:
        self._collide: Callable[..., int] = coal.collide
        self._request, self._result = coal.CollisionRequest(), coal.CollisionResult()

    def __call__(self, first: _Turned, second: _Turned) -> bool:
        self._result.clear()
        return self._collide(*first, *second, self._request, self._result) > 0


class _Bodies:
    """The moving bodies of postures as coal has them, each made when it is first asked for."""

    def __init__(self, model: ArmModel, placed: Placed) -> None:
        self._model, self._placed = model, placed
        self._made: dict[tuple[int, int], _Turned] = {}
        self._tools: dict[float, Any] = {}

    def __call__(self, posture: int, link: int) -> _Turned:
        key, moving, long = (posture, link), self._model.moving, float(self._placed.tools[posture])
        if key not in self._made:
            at = turned(self._placed.rotation[key], self._placed.shift[key])
            if link == len(moving) and long not in self._tools:
                self._tools[long] = coal.Cylinder(self._model.arm.tool_radius, long)
            self._made[key] = (moving[link].shape if link < len(moving) else self._tools[long], at)
        return self._made[key]


def fixed_bodies(model: ArmModel) -> Obstacles:
    """Return the bodies of an arm that do not move, where they stand."""
    bodies, boxes = [], []
    for body in model.fixed:
        rotation = model.base.rotation @ body.rotation
        shift = model.base.rotation @ body.shift + model.base.translation
        bodies.append((body.shape, turned(rotation, shift)))
        boxes.append(body.points @ rotation.T + shift)
    return obstacles(bodies, boxes)


def obstacles(bodies: Sequence[_Turned], corners: Sequence[Floats]) -> Obstacles:
    """Return bodies with boxes around them. ``corners`` (m, 3) of each, in the scene."""
    low = np.array([points.min(axis=0) for points in corners]).reshape(-1, 3)
    high = np.array([points.max(axis=0) for points in corners]).reshape(-1, 3)
    return Obstacles(tuple(bodies), low, high)


def hits(model: ArmModel, placed: Placed, among: Obstacles) -> Bools:
    """Return which moving bodies of postures hit which obstacles, (P, L, k)."""
    out = np.zeros((*placed.shift.shape[:2], len(among.bodies)), dtype=bool)
    if not out.size:
        return out
    collide, bodies = _Collider(), _Bodies(model, placed)
    apart = (placed.low[:, :, None] > among.high) | (placed.high[:, :, None] < among.low)
    for i, link, k in np.argwhere(~apart.any(axis=-1)).tolist():
        out[i, link, k] = collide(bodies(i, link), among.bodies[k])
    return out


def overlap(first: Obstacles, second: Obstacles) -> Bools:
    """Return which of some standing bodies hit which of others, (m, k)."""
    collide = _Collider()
    out = np.zeros((len(first.bodies), len(second.bodies)), dtype=bool)
    for i, one in enumerate(first.bodies):
        for k, other in enumerate(second.bodies):
            out[i, k] = collide(one, other)
    return out


def touching(model: ArmModel, placed: Placed, pairs: Sequence[tuple[int, int]]) -> Bools:
    """Return which pairs of an arm's own bodies touch in postures, (P, pairs).

    ``pairs``: of fixed bodies first, then moving ones, the tool last.
    """
    collide, bodies = _Collider(), _Bodies(model, placed)
    still, first = fixed_bodies(model), len(model.fixed)
    count = len(placed.tools)
    low = np.concatenate([np.broadcast_to(still.low, (count, first, 3)), placed.low], axis=1)
    high = np.concatenate([np.broadcast_to(still.high, (count, first, 3)), placed.high], axis=1)
    one, two = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    near = ((low[:, one] <= high[:, two]) & (low[:, two] <= high[:, one])).all(axis=-1)
    out = np.zeros(near.shape, dtype=bool)

    def body(posture: int, link: int) -> _Turned:
        return still.bodies[link] if link < first else bodies(posture, link - first)

    for i, k in np.argwhere(near).tolist():
        out[i, k] = collide(body(i, pairs[k][0]), body(i, pairs[k][1]))
    return out


def collide_pairs(
    models: tuple[ArmModel, ArmModel], first: Placed, second: Placed, rows: tuple[Ints, Ints]
) -> Bools:
    """Return which pairs of postures of two arms collide, (n,).

    ``rows``: of the first and of the second, (n,) each.
    """
    collide = _Collider()
    ours, theirs = _Bodies(models[0], first), _Bodies(models[1], second)
    out = np.zeros(len(rows[0]), dtype=bool)
    links = first.low.shape[1] * second.low.shape[1]
    block = max(1, _PAIRS // links)
    for start in range(0, len(out), block):
        one, two = (part[start : start + block] for part in rows)
        low, high = first.low[one][:, :, None], first.high[one][:, :, None]
        far = (low > second.high[two][:, None]) | (high < second.low[two][:, None])
        near = np.argwhere(~far.any(axis=-1))
        for n, a, b in near.tolist():
            if not out[start + n]:
                out[start + n] = collide(ours(int(one[n]), a), theirs(int(two[n]), b))
    return out


def convex(points: Floats) -> Any:
    """Return the convex hull of points (m, 3) as coal has it."""
    cloud = coal.StdVec_Vec3s()
    for point in points:
        cloud.append(point)
    return coal.ConvexBase.convexHull(cloud, False, "Qt")  # noqa: FBT003  # coal's own


def apart_pairs(model: ArmModel) -> tuple[tuple[int, int], ...]:
    """Return the pairs of an arm's own bodies that must not touch, as of `touching`.

    Left out are neighbors, and what touches in nearly all postures.
    """
    owner = [body.joint for body in (*model.fixed, *model.moving)]
    owner.append(model.model.frames[model.flange].parentJoint)
    parent = model.model.parents

    def near(i: int, j: int) -> bool:
        return bool(owner[i] == owner[j] or parent[owner[j]] == owner[i])

    pairs = [(i, j) for j in range(len(owner)) for i in range(j) if not near(i, j)]
    drawn = model.draw(np.random.default_rng(0), _SAMPLES)
    placed = model.placed(drawn, np.full(_SAMPLES, model.arm.tool_length))
    share = touching(model, placed, pairs).mean(axis=0)
    return tuple(pair for pair, often in zip(pairs, share, strict=True) if often < _ALWAYS)
