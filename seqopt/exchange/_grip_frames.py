"""Where and how a tool holds a brick: a frame at the node that looks in through a free face.

The scene says where robots hold, not how a gripper is turned. This follows from the brick: a tool
comes square to a face from which the node is seen, that touches no other brick, and that looks to
the robot, or up where the robot may be anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seqopt.arrays import Floats, Vector
from seqopt.scene._checks import as_vector, frames
from seqopt.scene.boxes import vertices_of
from seqopt.scene.parts import Brick, Ground, Joint, Robot, Side, Sphere
from seqopt.scene.scene import Scene
from seqopt.scene.shape import fans

_SQUARE = 0.9  # cosine from which on a joint lies on a face
_NEVER, _LATER = 4.0, 2.0  # what a face costs that a joint lies on, now or once more bricks stand
_UP = 0.1  # weight of looking up beside looking to the robot
_EDGE = 1e-6  # how far beside a face its edge is, over the size of the brick
_PARALLEL = 0.95  # cosine from which on an axis of the brick is along the tool


@dataclass(frozen=True)
class Frame:
    """A right-handed frame as COMPAS has it, m: its third axis is the product of the two."""

    point: Vector
    xaxis: Vector
    yaxis: Vector

    @cached_property
    def axes(self) -> Floats:
        """Its axes as rows, (3, 3)."""
        return frames(np.array(self.xaxis), np.array(self.yaxis))

    def moved(self, along: Floats, distance: float) -> Frame:
        """Return the frame shifted along a unit vector (3,) of the scene, m."""
        return Frame(as_vector(self.point + distance * along), self.xaxis, self.yaxis)

    def inside(self, other: Frame) -> Frame:
        """Return the frame in the coordinates of another one."""
        point = other.axes @ (np.array(self.point) - np.array(other.point))
        first, second = (other.axes @ axis for axis in self.axes[:2])
        return Frame(as_vector(point), as_vector(first), as_vector(second))


@dataclass(frozen=True)
class Held:
    """How a robot holds a node."""

    block: Frame  # of the brick: its centroid, its length, its width
    grip: Frame  # of the tool: its tip at the node, its third axis into the brick
    depth: float  # of the node behind the face, m
    away: Vector  # unit vector along which the brick comes free of what stands when it is placed


def hold(scene: Scene, robot: Robot, node: int) -> Held:
    """Return how a robot holds one of the scene's nodes."""
    brick = scene.brick_of_node[node]
    at = np.array(brick.node_position(node))
    normals, depths = _faces_seen(brick, at)
    now, later = _joint_normals(scene, brick)
    reach, toward = robot.reach, np.array(scene.up)  # up where the robot may be anywhere
    if isinstance(reach, Side):
        toward = np.array(reach.toward)
    if isinstance(reach, Sphere) and reach.center != tuple(at):
        toward = np.array(reach.center) - at
    score = normals @ (toward / np.linalg.norm(toward) + _UP * np.array(scene.up))
    for joints, cost in ((now, _NEVER), (later, _LATER)):
        score -= cost * (normals @ joints.T > _SQUARE).any(axis=1)
    best = int(score.argmax())
    # a tool comes square to the face, its first axis along the brick
    along = next(axis for axis in brick.frame if abs(axis @ normals[best]) < _PARALLEL)
    first = along - (along @ normals[best]) * normals[best]
    first /= np.linalg.norm(first)
    second = np.cross(-normals[best], first)
    grip = Frame(as_vector(at), as_vector(first), as_vector(second))
    tried = np.vstack([normals[best], scene.up, normals])
    mean = -now.sum(axis=0)  # away from all that the brick touches
    if np.linalg.norm(mean) > 1e-9:
        tried = np.vstack([mean / np.linalg.norm(mean), tried])
    worst = (-tried @ now.T).min(axis=1, initial=1.0)
    away = tried[int((worst >= worst.max() - 1e-9).argmax())]
    block = Frame(brick.position, brick.length_axis, brick.width_axis)
    return Held(block, grip, float(depths[best]), as_vector(away))


def _faces_seen(brick: Brick, at: Floats) -> tuple[Floats, Floats]:
    """Return the outward normals of faces that a point sees squarely, and how deep it is, m.

    Of all faces in front of it, where it sees none so.
    """
    points, faces = vertices_of(brick)
    corners = points[fans(faces)]
    owner = np.repeat(np.arange(len(faces)), [len(face) - 2 for face in faces])
    signed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.stack([np.bincount(owner, column) for column in signed.T], axis=1)
    normals = total / np.linalg.norm(total, axis=1, keepdims=True)
    depths = np.einsum("fi,fi->f", points[[face[0] for face in faces]] - at, normals)
    slack = _EDGE * float(np.ptp(points, axis=0).max())
    sign = np.sign(np.einsum("ti,ti->t", signed, normals[owner]))
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = np.maximum(np.linalg.norm(edges, axis=2), slack)
    inward = np.einsum("tki,ti->tk", np.cross(edges, at - corners), normals[owner]) / lengths
    within = np.asarray(sign * (sign[:, None] * inward >= -slack).all(axis=1))
    seen = (depths > 0) & (np.bincount(owner, within) > 0.5)
    kept = seen if seen.any() else depths > 0
    return (normals[kept], depths[kept]) if kept.any() else (normals, depths)


def _joint_normals(scene: Scene, brick: Brick) -> tuple[Floats, Floats]:
    """Return the outward normals (k, 3) of a brick's joints with what stands when it is placed.

    Then those of its joints with bricks that come later.
    """
    springs: list[Joint | Ground] = [*scene.joints, *scene.grounds]
    sides: tuple[list[Floats], list[Floats]] = ([], [])
    for spring in springs:
        if brick.name in spring.ends:
            along = np.array(spring.along)
            out = (np.array(spring.position) - np.array(brick.position)) @ along >= 0
            comes = any(scene.since[end] > scene.since[brick.name] for end in spring.ends)
            sides[comes].append(along if out else -along)
    now, later = (np.array(normals).reshape(-1, 3) for normals in sides)
    return now, later
