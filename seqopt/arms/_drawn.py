"""The line of an arm in a posture, as pictures show it: base, joints, flange, tip of the tool."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from seqopt.arms._model import ArmModel
from seqopt.arrays import Floats
from seqopt.scene.arm import Arm

_SAME = 1e-6  # m; points that are closer are one

_model = lru_cache(maxsize=16)(ArmModel)


def _arm_line(arm: Arm, posture: Floats) -> Floats:
    """Return the points of an arm in a posture, (k, 3), m; the last one is the node it holds.

    ``posture``: its joints, and NaN for those that others have beside.
    """
    import pinocchio as pin  # noqa: PLC0415  # an extra

    model = _model(arm)
    axes, flange = model.flange_pose(np.asarray(posture)[: model.joints])
    data, root = model.data, model.base.translation
    pin.forwardKinematics(model.model, data, np.asarray(posture)[: model.joints])
    joints = [model.base.act(data.oMi[j].translation) for j in range(1, model.model.njoints)]
    points = [root, *joints, flange, flange + arm.tool_length * axes[:, 2]]
    return np.array(
        [p for i, p in enumerate(points) if not i or np.linalg.norm(p - points[i - 1]) > _SAME]
    )


def _idle_line(arm: Arm) -> Floats:
    """Return what is drawn of an arm that holds nothing, (3, 3), m: its foot, as nobody knows more.

    The last point is there twice: there is no tool.
    """
    return _arm_line(arm, np.zeros(_model(arm).joints))[[0, 1, 1]]
