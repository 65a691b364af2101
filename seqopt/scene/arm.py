"""The arm of a robot: which model it is, where its base stands, and how its tool grips a brick.

Lengths are in m, joint stiffnesses in N m/rad. What an arm reaches is worked out in `seqopt.arms`.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._registry import offered
from seqopt.arrays import Floats, FrozenValue, Ints, Terse, Vector
from seqopt.errors import ExtraError, SceneError, did_you_mean
from seqopt.scene._checks import (
    check,
    finite,
    in_words,
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


def from_arms(name: str) -> Any:
    """Return a function of the room of arms by name. Raises `ExtraError` without the extra."""
    found = offered(name)
    if found is None:
        raise ExtraError(
            "robots have arms, and the room seqopt.arms, which knows their reach, is not there: "
            "install seqopt anew, or leave out the arms"
        )
    return found


_seconds = partial(finite, least=0.0, wanted="seconds, zero or more")
_METERS = "a positive number of m/s, or none if ways take no time"
_speed = partial(finite, least=1e-12, wanted=_METERS)


@dataclass(frozen=True, kw_only=True, repr=False)
class Durations(Terse):
    """How long a robot takes; none of these is assumed where it is not given.

    Parameters
    ----------
    fetch : float
        To take the next brick and bring it: a robot that is free does it before it places, while
        others hold and act, s.
    place : float
        To put the brick in its place; it then holds it, s.
    approach : float
        To come to a brick that stands: a robot that is free does it before it grips, s.
    grip : float
        To take hold of it, s.
    release : float
        To let go, s.
    speed : float, optional
        At which it goes from the node that it held last to the next one, in a straight line, before
        it places or grips, m/s; by default such ways take no time of their own.

    Examples
    --------
    >>> print(Durations(fetch=30.0, place=10.0, approach=10.0, grip=5.0, release=5.0))
    fetch=30,place=10,approach=10,grip=5,release=5
    """

    fetch: float
    place: float
    approach: float
    grip: float
    release: float
    speed: float | None = None

    def __post_init__(self) -> None:
        names = [name for name in _NAMES if name != "speed"]
        check(self, "durations", **dict.fromkeys(names, _seconds), speed=_speed)

    def __str__(self) -> str:
        said = [(name, getattr(self, name)) for name in _NAMES]
        return ",".join(f"{name}={value:g}" for name, value in said if value is not None)


_NAMES = tuple(field.name for field in fields(Durations))
EXAMPLE = "fetch=30,place=10,approach=10,grip=5,release=5"


def _durations_in_words(
    names: Sequence[str], given: Sequence[Durations | None], texts: Sequence[str]
) -> tuple[Durations | None, ...]:
    """Return the durations of robots as words say, those before being for all, or as given.

    ``names``: of the robots; ``given``: their own; ``texts``: as `EXAMPLE`, for one robot with its
    name and a colon before.
    """
    out = list(given)
    for text in texts:
        name, colon, words = text.partition(":") if ":" in text else ("", "", text)
        if colon and name not in names:
            hint = did_you_mean(name, names)
            raise SceneError(f"durations {text}: no robot {name!r}{hint}; give {', '.join(names)}")
        known = dict.fromkeys(_NAMES, (float, f"a number of s, as {EXAMPLE}"))
        said = in_words(f"durations {text}", words.split(","), known, f", as {EXAMPLE}")
        for index in (i for i, robot in enumerate(names) if robot == name or not colon):
            before = out[index]
            lacking = [each for each in _NAMES if each not in said and each != "speed"]
            if before is None and lacking:
                raise SceneError(
                    f"durations {text}: {', '.join(lacking)} not given, nor in the scene; give "
                    f"all, as {EXAMPLE}"
                )
            out[index] = Durations(**said) if before is None else replace(before, **said)
    return tuple(out)
