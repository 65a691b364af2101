"""Rigid blocks that touch: the faces between bricks, and a step of a build as an assembly.

Faces are projected onto the plane of their joint, so what lies between them is checked: the joint's
thickness, if it says one, else at most `THICKEST` of the smallest dimension of the bricks, in the
middle of the overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, Ints, Vector, frozen, skew
from seqopt.errors import SceneError
from seqopt.network._mechanics import spread
from seqopt.network.network import GROUND, Network
from seqopt.scene._checks import frames, settle, units
from seqopt.scene.parts import THICKEST, Brick
from seqopt.scene.shape import clip, polygon_moments

_OVERLAP = 0.05  # by which bricks may interpenetrate, over their smallest dimension
_BESIDE = 0.5  # by which a joint's position may lie beside the faces, over the same
_SLIVER = 1e-6  # smallest overlap of two faces, as a share of the smaller one
_KEPT = 3000  # bricks in all partial structures that are kept, some 5 kB each


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Assembly(FrozenValue):
    """Rigid blocks, the faces where they touch, and the grips that hold them.

    Parameters
    ----------
    block_name : tuple of int
    centroid, weight : (B, 3) float
        m, N.
    contact_name : tuple of str
    bodies : (C, 2) int
        The two blocks of a contact; the ground is -1 and comes first.
    normal : (C, 3) float
        Unit vectors from the first body into the second.
    corner : (K, 3) float
        Corners of all contact faces, each face once around, m.
    contact : (K,) int
        The contact of every corner.
    grip_block : (G,) int
    grip_position : (G, 3) float
        m.
    payload : (G,) float
        Largest force that each grip can exert, in any direction, N.
    applied : (B, 6) float
        Forces and moments about the centroids that act on the blocks beside their weights, N and
        N m; no rows by default: none do.
    grip_line : (L, 3) float
        Of the first grips: unit vectors along which alone they exert forces, both ways; zero for
        one in any direction, as all others are.
    bond : (C,) float
        Share of the mortar's bond that every contact has; no entries by default: all of it.

    Raises
    ------
    SceneError
        If a number is not finite, an index is out of range or a face has no area.
    """

    block_name: tuple[int, ...]
    centroid: Floats
    weight: Floats
    contact_name: tuple[str, ...]
    bodies: Ints
    normal: Floats
    corner: Floats
    contact: Ints
    grip_block: Ints
    grip_position: Floats
    payload: Floats
    applied: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    grip_line: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    bond: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray) and not np.isfinite(values).all():
                raise SceneError(f"assembly: {name} holds a number that is not finite")
        blocks = len(self.centroid)
        if not blocks or ((self.bodies < GROUND) | (self.bodies >= blocks)).any():
            raise SceneError(f"assembly: bodies name blocks beyond 0 to {blocks - 1}")
        if (self.bodies[:, 1] == GROUND).any():
            raise SceneError("assembly: the ground is a contact's second body; name it first")
        flat = np.flatnonzero(~(self.area > 0))
        if len(flat):
            raise SceneError(f"contact {self.contact_name[flat[0]]}: its face has no area")

    def with_bond(self, shares: Floats) -> Assembly:
        """Return a copy with other shares of the mortar's bond, (C,); cached values are kept."""
        out = copy(self)
        settle(out, bond=frozen(np.array(shares, dtype=float)))
        return out

    @cached_property
    def corner_area(self) -> Floats:
        """Area of the face that each corner represents, (K,) m².

        Half of the two triangles between the face's centroid and the edges that meet in the corner,
        so that one more corner on an edge changes no sum.
        """
        corners = np.bincount(self.contact, minlength=len(self.bodies))
        mean = self._sums(self.corner) / np.maximum(corners, 1)[:, None]
        spoke, follows, triangle = self._triangles(mean)
        middle = self._sums(triangle[:, None] * (spoke + spoke[follows]) / 3)
        area = self._sums(triangle[:, None])
        centroid = mean + np.divide(middle, area, out=np.zeros_like(middle), where=area > 0)
        _, follows, triangle = self._triangles(centroid)
        out = np.asarray(0.5 * triangle)
        np.add.at(out, follows, 0.5 * triangle)
        return frozen(out)

    def _triangles(self, middle: Floats) -> tuple[Floats, Ints, Floats]:
        """Return spokes from points (C, 3) to the corners, the next corners, and areas between."""
        corners = np.bincount(self.contact, minlength=len(self.bodies))
        after = np.cumsum(corners)
        follows = np.arange(1, len(self.contact) + 1)
        follows[after[corners > 0] - 1] = (after - corners)[corners > 0]
        spoke = self.corner - middle[self.contact]
        return spoke, follows, 0.5 * np.linalg.norm(np.cross(spoke, spoke[follows]), axis=1)

    def _sums(self, values: Floats) -> Floats:
        """Return the sums over the corners (K, m) of every contact, (C, m)."""
        out = np.zeros((len(self.bodies), values.shape[1]))
        np.add.at(out, self.contact, values)
        return out

    @cached_property
    def area(self) -> Floats:
        """Area of every contact face, (C,) m²."""
        return frozen(self._sums(self.corner_area[:, None])[:, 0])

    @cached_property
    def axes(self) -> Floats:
        """Normal and two tangents of every contact, (C, 3, 3), rows are unit vectors."""
        first = np.cross(self.normal, np.eye(3)[np.abs(self.normal).argmin(axis=1)])
        return frozen(frames(self.normal, units(first)))

    @cached_property
    def levers(self) -> Floats:
        """The longer distance of every corner from the centroids of its blocks, (K,) m."""
        out = np.zeros(len(self.corner))
        for body in self.bodies[self.contact].T:
            real = body != GROUND
            arm = self.corner[real] - self.centroid[body[real]]
            out[real] = np.maximum(out[real], np.linalg.norm(arm, axis=1))
        return frozen(out)

    @cached_property
    def scales(self) -> tuple[float, float]:
        """A force (N) and a length (m) to compare in: the heaviest block, the longest lever."""
        force = float(np.linalg.norm(self.weight, axis=1).max())
        grips = np.linalg.norm(self.grip_position - self.centroid[self.grip_block], axis=1)
        return force or 1.0, float(max(self.levers.max(initial=0.0), grips.max(initial=0.0))) or 1.0

    @cached_property
    def stress_scale(self) -> float:
        """The heaviest block's weight over the mean contact area, Pa."""
        area = float(self.area.mean()) if len(self.area) else self.scales[1] ** 2
        return self.scales[0] / area

    @cached_property
    def contact_map(self) -> sparse.csr_array:
        """Wrenches on the blocks from corner forces on contacts' second bodies, (6B, 3K).

        Forces have a normal part (compression positive) and two tangential ones; wrenches are about
        the centroids, their moments over the length scale.
        """
        axes = self.axes[self.contact]
        first, second = self.bodies[self.contact].T
        on_first = self._wrenches(first, self.corner, -axes)
        return frozen(sparse.csr_array(on_first + self._wrenches(second, self.corner, axes)))

    @cached_property
    def grip_map(self) -> sparse.csr_array:
        """Wrenches on the blocks from grip forces, (6B, 3G); as `contact_map`."""
        axes = np.tile(np.eye(3), (len(self.payload), 1, 1))
        for i in np.flatnonzero(self.grip_line.any(axis=1)).tolist():
            axes[i] = 0.0
            axes[i, 0] = self.grip_line[i]
        return frozen(self._wrenches(self.grip_block, self.grip_position, axes))

    def _wrenches(self, block: Ints, point: Floats, axes: Floats) -> sparse.csr_array:
        """Return the wrenches (6B, 3M) of unit forces along the rows of axes (M, 3, 3)."""
        real = np.flatnonzero(block != GROUND)
        arm = (point[real] - self.centroid[block[real]]) / self.scales[1]
        force = axes[real].transpose(0, 2, 1)
        values = np.concatenate([force, skew(arm) @ force], axis=1)
        return spread(block[real], real, values, (len(self.centroid), len(block)))

    def load(self, direction: Vector | None = None) -> Floats:
        """Return weights, or as much along a direction, as wrenches (6B,) over the force scale."""
        pull = self.weight
        if direction is not None:
            pull = np.linalg.norm(self.weight, axis=1, keepdims=True) * np.array(direction)
        out = np.zeros((len(pull), 6))
        out[:, :3] = pull / self.scales[0]
        return out.ravel()

    @cached_property
    def applied_load(self) -> Floats:
        """What is applied beside the weights, as of `load`."""
        out = np.zeros((len(self.centroid), 6))
        out[: len(self.applied)] = self.applied
        return frozen((out / self.scales[0] / np.repeat([1.0, self.scales[1]], 3)).ravel())

    @cached_property
    def amounts(self) -> tuple[float, float]:
        """The sizes of all weights in sum, and of all that is applied beside them, N."""
        applied = np.linalg.norm(self.applied_load.reshape(-1, 2, 3), axis=2).sum()
        weight = np.linalg.norm(self.weight, axis=1).sum()
        return float(weight), float(applied * self.scales[0])


def _require_touching(
    name: str, bricks: Sequence[Brick], ends: tuple[float, float], beside: float, thickness: float
) -> None:
    """Require bricks, one on the ground or two, that touch through a joint.

    ``ends``: their faces along the joint's normal, from its plane; ``beside``: its position from
    the overlap, negative inside; ``thickness``: as the scene says, else NaN; all in m.
    """
    size = min(min(brick.dimensions) for brick in bricks)
    apart, slack = ends[1] - ends[0], _OVERLAP * size
    thickest = THICKEST * size if np.isnan(thickness) else thickness + slack
    inside, far = max(ends[0], -ends[1]), _BESIDE * size
    closer = "move the bricks together or give the joint its thickness"
    for found, most, wrong in (
        (-apart, slack, "its bricks interpenetrate by {}, more than {}; move them apart"),
        (inside, slack, "its plane lies {} inside a brick; move its position between the faces"),
        (apart, thickest, f"there are {{}} between its faces, more than {{}}; {closer}"),
        (beside, far, "its position lies {} beside the faces that it joins; move it between them"),
    ):
        if found > most:
            numbers = (f"{1e3 * length:.3g} mm" for length in (found, most))
            raise SceneError(f"joint {name}: {wrong.format(*numbers)}")


def _face_distance(brick: Brick, normal: Floats, point: Floats) -> float:
    """Return how far from a point the face of a brick lies along a normal into it, m."""
    frame = brick.frame
    i = int(np.abs(frame @ normal).argmax())
    outward = -np.sign(frame[i] @ normal) * frame[i]
    face = np.array(brick.position) + 0.5 * brick.dimensions[i] * outward
    return float((face - point) @ outward / (normal @ outward))


def _contact_at(network: Network, spring: int) -> tuple[str, Floats, Floats]:
    """Return name, normal (3,) and corners (m, 3) of a spring's contact; the network keeps it."""
    kept: dict[int, tuple[str, Floats, Floats]] = network.derived.setdefault("contacts", {})
    if spring not in kept:
        springs, placed = network.springs, network.scene.placed
        first, second = springs.bodies[spring]
        name = f"{'ground' if first == GROUND else placed[first].name}-{placed[second].name}"
        axes, corners = springs.axes[spring], springs.face[spring]
        if not len(corners):
            between = [placed[b] for b in (first, second) if b != GROUND]
            where, thickness = springs.position[spring], float(springs.thickness[spring])
            axes, corners = _contact(name, between, axes, where, thickness)
        kept[spring] = frozen((name, axes[0], corners))
    return kept[spring]


def step_assembly(network: Network, bricks: int, grips: Sequence[int | None]) -> Assembly:
    """Return a partial structure with the grips that hold it: blocks and their contacts.

    A joint is a contact over the face that it says. If it says none, its bricks are boxes, and the
    contact is the overlap of the two faces that look at each other, seen along the joint's normal;
    a ground end is then a contact over the whole face of its brick.

    Parameters
    ----------
    network : Network
    bricks : int
    grips : sequence of (int or None)
        Node that each of the scene's robots holds.

    Returns
    -------
    Assembly

    Raises
    ------
    SceneError
        If the bricks of a joint do not touch there: see `seqopt.contact.assembly`.
    """
    return replace(bare_assembly(network, bricks), **_grip_fields(network, bricks, grips))


def bare_assembly(network: Network, bricks: int) -> Assembly:
    """Return a partial structure that nobody holds; raises as `step_assembly`."""
    placed, acting = network.scene.placed, network.springs.acting(bricks)
    contacts = [_contact_at(network, spring) for spring in acting.tolist()]
    return Assembly(
        block_name=tuple(brick.name for brick in placed[:bricks]),
        # of the boxes, as their faces: means of inner nodes differ from them by rounding
        centroid=np.array([brick.position for brick in placed[:bricks]]),
        weight=network.weight[:bricks],
        contact_name=tuple(name for name, _, _ in contacts),
        bodies=network.springs.bodies[acting].reshape(-1, 2),
        normal=np.array([normal for _, normal, _ in contacts]).reshape(-1, 3),
        corner=np.concatenate([np.empty((0, 3)), *(face for _, _, face in contacts)]),
        contact=np.repeat(np.arange(len(contacts)), [len(face) for _, _, face in contacts]),
        grip_block=np.zeros(0, dtype=np.int64),
        grip_position=np.zeros((0, 3)),
        payload=np.zeros(0),
        applied=_applied_rows(network, bricks),
    )


def _contact(
    name: str, between: list[Brick], axes: Floats, point: Floats, thickness: float
) -> tuple[Floats, Floats]:
    """Return the axes (3, 3) of a contact of boxes, the normal into the last one, and its face."""
    for brick in between:
        if brick.shape is not None:
            wrong = f"brick {brick.name} is not a box and the joint has no face; give it one"
            raise SceneError(f"joint {name}: {wrong}")
    below = np.array(between[0].position) if len(between) > 1 else point
    sign = np.sign(axes[0] @ (np.array(between[-1].position) - below)) or 1.0
    axes = axes * np.array([[sign], [1.0], [sign]])
    flat = [_face(brick, axes, point) for brick in between]
    common = flat[0] if len(flat) == 1 else clip(*flat)
    smaller = min(map(_polygon_area, flat))
    if len(common) < 3 or not _polygon_area(common) > _SLIVER * smaller:
        raise SceneError(
            f"joint {name}: the faces of its bricks do not overlap along its normal; "
            "move the joint between them or correct its axis"
        )
    middle = point + polygon_moments(common)[1] @ axes[1:]
    before = -_face_distance(between[0], -axes[0], middle) if len(between) > 1 else 0.0
    ends = (before, _face_distance(between[-1], axes[0], middle))
    edge = np.roll(common, -1, axis=0) - common
    size = np.linalg.norm(edge, axis=1)
    real = size > 0
    out = common[real, 1] * edge[real, 0] - common[real, 0] * edge[real, 1]  # of the origin
    _require_touching(name, between, ends, float((out / size[real]).max()), thickness)
    return axes, point + common @ axes[1:]


def _face(brick: Brick, axes: Floats, point: Floats) -> Floats:
    """Return the corners (4, 2) of the face that looks at a plane, in it, counterclockwise."""
    frame, normal, center = brick.frame, axes[0], np.array(brick.position)
    half = 0.5 * np.array(brick.dimensions)[:, None] * frame
    i = int(np.abs(frame @ normal).argmax())
    middle = center + np.sign((point - center) @ normal) * np.sign(frame[i] @ normal) * half[i]
    side, other = half[i - 1], half[i - 2]
    corners = np.array([middle + a * side + b * other for a in (-1, 1) for b in (-1, 1)])
    flat = (corners - point) @ axes[1:].T
    spread = flat - flat.mean(axis=0)
    return np.asarray(flat[np.argsort(np.arctan2(spread[:, 1], spread[:, 0]))])


def _polygon_area(polygon: Floats) -> float:
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


class _PropGrips(NamedTuple):
    """The grips of props on a partial structure.

    One that only pushes bears from nothing to its capacity along its line: half the capacity is
    applied for good, and a grip along the line adds as much or takes it away.
    """

    nodes: tuple[int, ...]
    payload: Floats  # (p,); N
    line: Floats  # (p, 3); unit vectors, zero where any direction will do
    applied: Floats  # (B, 6); as of `Assembly`, no rows where none push


def _prop_grips(network: Network, bricks: int, *, held: bool) -> _PropGrips:
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
    return _PropGrips(tuple(prop.node for prop in props), payload, line, applied)


def _applied_rows(network: Network, bricks: int, props: _PropGrips | None = None) -> Floats:
    """Return `Assembly.applied` of a partial structure, with what props apply for good."""
    applied = network.applied(bricks)
    if props is None or not len(props.applied):
        return applied if applied.any() else np.zeros((0, 6))
    return applied + props.applied


def _grip_fields(network: Network, bricks: int, grips: Sequence[int | None]) -> dict[str, Any]:
    """Return the fields of an assembly that depend on its grips, by name; props follow robots.

    Grips beyond those of the scene's robots bear what the strongest of these does.
    """
    scene = network.scene
    payload = [robot.payload for robot in scene.robots]
    payload += [max(payload, default=0.0)] * (len(grips) - len(payload))
    held = [(n, most) for n, most in zip(grips, payload, strict=True) if n is not None]
    props = _prop_grips(network, bricks, held=bool(held))
    nodes = [*(node for node, _ in held), *props.nodes]
    blocks = [scene.since[scene.brick_of_node[node].name] - 1 for node in nodes]
    return {
        "grip_block": np.array(blocks, dtype=np.int64),
        "grip_position": np.array([scene.node_position(n) for n in nodes]).reshape(-1, 3),
        "payload": np.array([*(most for _, most in held), *props.payload]),
        "applied": _applied_rows(network, bricks, props),
        "grip_line": np.concatenate([np.zeros((len(held), 3)), props.line]),
    }


class PartialAssemblies:
    """Cuts the assemblies of steps, as of `step_assembly`, from one whole.

    What stands comes first in a network, as in the whole. Only what is largest or heaviest, and
    lengths over a lever, differ: maps by rounding, all else in no bit. Raises a `SceneError` if
    bricks that share a joint do not touch, even in a step that is not asked for.
    """

    def __init__(self, network: Network, bricks: int) -> None:
        self.network, self.bricks = network, bricks
        self._whole = whole = bare_assembly(network, bricks)
        self._heaviest = np.maximum.accumulate(np.linalg.norm(whole.weight, axis=1))
        self._lever = np.maximum.accumulate(whole.levers)
        self._map = whole.contact_map.tocsc()
        self._turning = self._map.indices % 6 >= 3  # which entries are moments
        self._made: dict[tuple[int, tuple[int | None, ...]], Assembly] = {}

    def __call__(self, bricks: int, grips: Sequence[int | None]) -> Assembly:
        """Return a partial structure with the grips that hold it; those made last are kept."""
        key, whole = (bricks, (*grips,)), self._whole
        if key in self._made:
            return self._made[key]
        if len(self._made) >= max(_KEPT // bricks, 1):
            self._made.clear()
        contacts = len(self.network.springs.acting(bricks))
        corners = int(np.searchsorted(whole.contact, contacts))
        ends = (
            (bricks, ("block_name", "centroid", "weight")),
            (contacts, ("contact_name", "bodies", "normal", "area", "axes")),
            (corners, ("corner", "contact", "corner_area")),
        )
        fields = _grip_fields(self.network, bricks, grips)
        own = whole.centroid[fields["grip_block"]]
        levers = np.linalg.norm(fields["grip_position"] - own, axis=1)
        longest = max(self._lever[:corners].max(initial=0.0), levers.max(initial=0.0))
        scales = float(self._heaviest[bricks - 1]) or 1.0, float(longest) or 1.0
        columns = self._map.indptr[: 3 * corners + 1]
        kept = slice(0, int(columns[-1]))
        ratio = np.where(self._turning[kept], whole.scales[1] / scales[1], 1.0)  # of levers
        entries = self._map.data[kept] * ratio, self._map.indices[kept], columns
        part = Assembly.__new__(Assembly)  # of what was checked, with cached values that are known
        part.__setstate__(
            {name: getattr(whole, name)[:end] for end, names in ends for name in names}
            | fields
            | {"bond": np.zeros(0), "scales": scales}
            | {"contact_map": sparse.csc_array(entries, shape=(6 * bricks, 3 * corners)).tocsr()}
        )
        self._made[key] = part
        return part
