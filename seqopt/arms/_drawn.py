"""Arms in postures, as pictures show them: the line from base to tip of the tool, and bodies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from seqopt.arms._model import ArmModel
from seqopt.arrays import Floats
from seqopt.scene.arm import Arm

_SAME = 1e-6  # m; points that are closer are one
_AROUND = 12  # points around each end of a tool

_model = lru_cache(maxsize=16)(ArmModel)


@dataclass(frozen=True, eq=False)
class PosedArm:
    """An arm in a posture: its joints, and NaN for those that others have beside.

    ``holds``: whether it does; nobody knows where one is that does not, and of it there is the
    foot.
    """

    arm: Arm
    joints: Floats
    holds: bool = True

    @cached_property
    def line(self) -> Floats:
        """Its points, (k, 3), m: base, joints, flange, and last the node it holds.

        Of the foot the last point is there twice: there is no tool.
        """
        import pinocchio as pin  # noqa: PLC0415  # an extra

        model = _model(self.arm)
        axes, flange = model.flange_pose(self._own)
        data, root = model.data, model.base.translation
        pin.forwardKinematics(model.model, data, self._own)
        joints = [model.base.act(data.oMi[j].translation) for j in range(1, model.model.njoints)]
        points = [root, *joints, flange, flange + self.arm.tool_length * axes[:, 2]]
        apart = (p for i, p in enumerate(points) if not i or not _close(p, points[i - 1]))
        found = np.array([*apart])
        return found if self.holds else found[[0, 1, 1]]

    @cached_property
    def bodies(self) -> tuple[Floats, ...]:
        """Corners (m, 3), m, of convex bodies: those of links, and last the tool.

        Of the foot, those that do not move.
        """
        model = _model(self.arm)
        out = [
            (body.points @ body.rotation.T + body.shift) @ model.base.rotation.T
            + model.base.translation
            for body in model.fixed
        ]
        if not self.holds:
            return tuple(out)
        placed = model.placed(self._own[None], np.array([self.arm.tool_length]))
        local = [*(body.points for body in model.moving), _tool(self.arm)]
        moved = zip(local, placed.rotation[0], placed.shift[0], strict=True)
        return (*out, *(points @ turn.T + shift for points, turn, shift in moved))

    @property
    def _own(self) -> Floats:
        return np.asarray(self.joints)[: _model(self.arm).joints]


def _close(one: Floats, two: Floats) -> bool:
    return bool(np.linalg.norm(one - two) <= _SAME)


def _tool(arm: Arm) -> Floats:
    """Return points of a tool around its middle, (m, 3), m."""
    angles = np.linspace(0.0, 2 * np.pi, _AROUND, endpoint=False)
    ring = arm.tool_radius * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    end = np.array([0.0, 0.0, 0.5 * arm.tool_length])
    return np.concatenate([ring - end, ring + end])


def idle_arm(arm: Arm) -> PosedArm:
    """Return what there is of an arm that holds nothing."""
    return PosedArm(arm, np.zeros(_model(arm).joints), holds=False)
