"""Inverse kinematics: the postures of an arm in which its flange is where a grip needs it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from seqopt.arms._model import ArmModel
from seqopt.arrays import Floats
from seqopt.scene.parts import Brick

_TRIES = 10  # first postures that are drawn for a target
_STEPS = 60  # of Newton's method from each
_LONGEST = 0.4  # step of a joint, rad or m
_DAMPING = 1e-5
_CLOSE = 1e-6  # m and rad; how far a flange may be from its target
WAY = 4  # points of the way to a node at which an arm is checked
_JUMP = 0.7  # rad or m; by which a joint goes at most from one of these to the next
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
    for face in _signed(model.arm.faces):
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


def _signed(faces: tuple[str, ...]) -> tuple[str, ...]:
    """Return faces by their signs, each once."""
    both = (f"{sign}{face}" if face in _AXES else face for face in faces for sign in "+-")
    return tuple(dict.fromkeys(both))


def solve(model: ArmModel, target: Target, draws: np.random.Generator) -> list[Floats]:
    """Return the postures that were found for a target, each once."""
    import pinocchio as pin  # noqa: PLC0415  # an extra

    wanted = model.base.actInv(pin.SE3(target.axes, target.place))
    found: list[Floats] = []
    if np.linalg.norm(target.place - model.base.translation) > model.span:
        return found
    for first in model.draw(draws, _TRIES):
        posture = _descend(pin, model, wanted, first)
        if posture is None:
            continue
        wrapped = (posture + np.pi) % (2 * np.pi) - np.pi
        posture = np.where(model.turns, wrapped, posture)
        inside = ((posture >= model.low) & (posture <= model.high)).all()
        if inside and all(np.abs(posture - other).max() > _SAME for other in found):
            found.append(posture)
    return found


def way(model: ArmModel, target: Target, posture: Floats) -> Floats | None:
    """Return postures at points of the way straight back from a target, (k, joints), the far last.

    None if it cannot be gone without a jump: where a joint ends, or the arm does.
    """
    import pinocchio as pin  # noqa: PLC0415  # an extra

    out, last = [], posture
    for share in np.linspace(0.0, 1.0, WAY + 1)[1:]:
        place = target.place - share * model.arm.approach * target.axes[:, 2]
        found = _descend(pin, model, model.base.actInv(pin.SE3(target.axes, place)), last)
        if found is None or np.abs(found - last).max() > _JUMP:
            return None
        if not ((found >= model.low) & (found <= model.high)).all():
            return None
        out.append(found)
        last = found
    return np.array(out)


def _descend(pin: object, model: ArmModel, wanted: object, posture: Floats) -> Floats | None:
    """Return the posture that Newton's method, damped, ends in; None if it does not arrive."""
    inner, data, flange = model.model, model.data, model.flange
    local = pin.ReferenceFrame.LOCAL  # type: ignore[attr-defined]
    damping = _DAMPING * np.eye(6)
    for _ in range(_STEPS):
        pin.forwardKinematics(inner, data, posture)  # type: ignore[attr-defined]
        at = pin.updateFramePlacement(inner, data, flange)  # type: ignore[attr-defined]
        error = pin.log6(at.actInv(wanted)).vector  # type: ignore[attr-defined]
        if np.abs(error).max() < _CLOSE:
            return posture
        jacobian = pin.computeFrameJacobian(inner, data, posture, flange, local)  # type: ignore[attr-defined]
        step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping, error)
        posture = posture + np.clip(step, -_LONGEST, _LONGEST)
    return None
