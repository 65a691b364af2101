"""How a grip gives way in a posture, by the stiffnesses of the joints of the arm."""

from __future__ import annotations

import numpy as np

from seqopt.arms._model import ArmModel
from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.arm import Arm


def grip_compliance(arm: Arm, posture: Floats) -> Floats:
    """Return how a grip gives way in a posture: J diag(1/k) Jᵀ, of the node that is held.

    Links and tool are rigid here; joints alone give way, each by its own stiffness.

    Parameters
    ----------
    arm : Arm
        With a stiffness for every joint.
    posture : (J,) float
        Joint by joint, rad or m.

    Returns
    -------
    (6, 6) float
        Motion by force: translations first, then rotations, in the axes of the scene; m/N, rad/N,
        m/(N m) and rad/(N m).

    Raises
    ------
    ExtraError
        If pinocchio and coal are not installed.
    SceneError
        If the arm does not give a stiffness for every joint.
    """
    return _compliance(ArmModel(arm), posture)


def _compliance(model: ArmModel, posture: Floats) -> Floats:
    stiffness = np.array(model.arm.joint_stiffness)
    if not len(stiffness):
        raise SceneError("arm: its joints have no stiffness; give joint_stiffness")
    jacobian = model.jacobian(posture)
    return np.asarray(jacobian / stiffness @ jacobian.T)
