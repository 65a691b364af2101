"""The arm of a robot: which model it is, where its base stands, and how its tool grips a brick.

Lengths are in m, joint stiffnesses in N m/rad.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints, Terse, Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import (
    check,
    kind_of,
    length,
    not_negative,
    positive,
    printable,
    rows,
    settle,
    short,
    unit_axes,
    vector,
    whole_between,
)

MOST = 8  # postures of a robot at a node that are kept of those that are found
SIDES = ("length", "width", "thickness")
"""The pairs of faces of a brick, by the axis that they are across."""
_FACES = (*SIDES, *(sign + side for side in SIDES for sign in "+-"))


@dataclass(frozen=True, kw_only=True, repr=False)
class Arm(Terse):
    """An arm on a fixed base that grips bricks with a straight tool.

    Parameters
    ----------
    urdf : str or pathlib.Path
        The model: the path of a URDF, or ``package:path`` of one in an installed package.
    position : Vector
        Where the root of the model stands, m.
    tool_length, tool_radius : float
        How far the node that is held is from the flange, along the flange's z, and how thick the
        tool is, m.
    x_axis, y_axis : Vector
        Directions of the base: unit vectors at right angles.
    fingers : float
        How far the fingers stand out from the face of the brick that they grip, m: here and inside
        the brick the tool is not checked for collisions.
    faces : tuple of str
        From where the tool comes to a brick: ``length``, ``width`` or ``thickness`` for both faces
        across an axis, or with a sign for one of them.
    flange : str
        The frame of the model that carries the tool; by default ``tool0``, or the last one.
    postures : int
        With how many postures at each node plans are made: with one, every plan keeps it; of
        several, a step needs some that go together, and whether they can be kept is found after.
    keeps_apart : bool
        Whether it must not touch other arms that keep apart; False for what reach alone allows.
    tool_mass : float
        Of the tool, kg: the robot that places a brick, or takes it away, carries both.
    joint_stiffness : tuple of float
        Of every joint, N m/rad; N/m if it slides; empty for rigid joints. Where it
        is given, an arm holds each node in one posture, which makes its grip as stiff as it is.

    Examples
    --------
    >>> Arm(urdf="ur10.urdf", position=(0.0, 1.5, 0.0), tool_length=0.3, tool_radius=0.05).faces
    ('width', 'thickness')
    """

    urdf: str
    position: Vector
    tool_length: float
    tool_radius: float
    x_axis: Vector = (1.0, 0.0, 0.0)
    y_axis: Vector = (0.0, 1.0, 0.0)
    fingers: float = 0.02
    faces: tuple[str, ...] = ("width", "thickness")
    flange: str = ""
    postures: int = MOST
    keeps_apart: bool = True
    tool_mass: float = 0.0
    joint_stiffness: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.urdf, str | Path) or not str(self.urdf):
            wanted = "give the path of a URDF, or package:path"
            raise SceneError(f"arm: urdf is {short(self.urdf)}; {wanted}")
        settle(self, urdf=printable("arm: urdf", os.fspath(self.urdf)))
        wanted = f"some of {', '.join(_FACES)}"
        faces = rows("arm: faces", self.faces, wanted)
        if not faces or any(face not in _FACES for face in faces):
            raise SceneError(f"arm: faces are {short(self.faces)}; give {wanted}")
        settle(self, faces=faces)
        check(self, "arm", position=vector, flange=printable)
        unit_axes(self, "arm", "x_axis", "y_axis")
        check(self, "arm", tool_length=length, tool_radius=length, fingers=not_negative)
        check(self, "arm", tool_mass=not_negative)
        where = "arm: joint_stiffness"
        joints = rows(where, self.joint_stiffness, "numbers")
        settle(self, joint_stiffness=tuple(positive(where, each, "N m/rad") for each in joints))
        check(self, "arm", keeps_apart=partial(kind_of, kind=bool))
        check(self, "arm", postures=partial(whole_between, least=1, most=MOST))
        if not self.fingers < self.tool_length:
            raise SceneError(
                f"arm: fingers stand out {self.fingers:g} m from a brick, and the whole tool is "
                f"{self.tool_length:g} m long; give a longer tool"
            )

    @property
    def choices(self) -> int:
        """With how many postures at each node plans are made; one if joints are compliant."""
        return 1 if self.joint_stiffness else self.postures

    @property
    def in_package(self) -> bool:
        """Whether the model is one of an installed package."""
        package, colon, path = self.urdf.partition(":")
        return bool(colon and path) and len(package) > 1 and package.isidentifier()


@dataclass(frozen=True, eq=False, repr=False)
class HeldPostures(FrozenValue):
    """The postures of A arms with compliant joints, at N nodes, one of each arm at each node.

    ``robots`` (A,): indices of the scene's robots; ``nodes`` (N,): ascending; ``rows`` (A, N):
    postures of the table, -1 for none; ``jacobians``: by arm (N, 6, J), how a node moves with
    joints, m and rad, in the axes of the scene; NaN where there is no posture.
    """

    robots: Ints
    nodes: Ints
    rows: Ints
    jacobians: tuple[Floats, ...]

    def row(self, robot: int, node: int) -> int | None:
        """Return the posture of a robot at a node, -1 if there is none; None if any will do."""
        own = np.flatnonzero(self.robots == robot)
        if not len(own):
            return None
        return int(self.rows[own[0], np.searchsorted(self.nodes, node)])

    def compliance(self, arms: Sequence[Arm | None]) -> Floats:
        """Return the compliance of grips by the joints alone, (A, N, 6, 6); m and rad, N and N m.

        ``arms``: of all robots of the scene.
        """
        out = []
        for robot, jacobian in zip(self.robots.tolist(), self.jacobians, strict=True):
            arm = arms[robot]
            assert arm is not None
            stiffness = np.array(arm.joint_stiffness)
            out.append(np.einsum("nij,nkj->nik", jacobian / stiffness, jacobian))
        return np.array(out)
