"""The model of an arm: its links as convex bodies, in postures and pictures, and its Jacobian.

Pinocchio reads the URDF and computes where frames are; bodies are convex hulls of the meshes that
the URDF gives for collisions, or, of links without, of those that it shows. It needs the extra
``arms``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from seqopt._files import read_bytes
from seqopt._registry import Later
from seqopt.arms._arm import Arm
from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import ExtraError, FileError, SceneError
from seqopt.scene.scene import Scene

_Link = ElementTree.Element
_MACRO = re.compile(r"\$[({]")  # begins what xacro puts in


@dataclass(frozen=True)
class Urdf:
    """A URDF: its ``text``; the links whose ``visual`` shapes are taken for collisions.

    ``bare``: links of no shape at all that have a mass, or a joint at a distance: there is a body.
    """

    text: str
    visual: tuple[str, ...]
    bare: tuple[str, ...]

    def __str__(self) -> str:
        lines = []
        if self.visual:
            lines.append(f"no <collision> of {', '.join(self.visual)}: <visual> is checked instead")
        if self.bare:
            lines.append(f"no shape at all of {', '.join(self.bare)}: nothing says what it hits")
        return "; ".join(lines)


def model_path(arm: Arm) -> Path:
    """Return where the URDF of an arm is; a `SceneError` says that there is none."""
    if not arm.in_package:
        path = Path(arm.urdf)
        if not path.is_file():
            raise SceneError(f"arm: there is no file {arm.urdf}; give a URDF, or package:path")
        return path
    package, _, rest = arm.urdf.partition(":")
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise SceneError(f"arm: package {package} is not installed; pip install {package}")
    for path in (Path(root, rest) for root in spec.submodule_search_locations):
        if path.is_file():
            return path
    raise SceneError(f"arm: package {package} has no file {rest}")


def read_urdf(path: Path) -> Urdf:
    """Return a URDF. Raises `SceneError` if it is none, or xacro, which a URDF is made from."""
    content = read_bytes(path)
    try:
        robot = ElementTree.fromstring(content)
        xacro = any("xacro" in each.tag or _MACRO.search(str(each.attrib)) for each in robot.iter())
    except ElementTree.ParseError as error:
        xacro = b"<xacro:" in content
        if not xacro:
            raise SceneError(f"arm: {path} cannot be read ({error}); give a URDF") from error
    if xacro:
        made = f"{path.stem.removesuffix('.urdf')}.urdf"
        raise SceneError(
            f"arm: {path} is xacro, from which a URDF is made: run `xacro {path.name} > {made}` "
            f"and give {made}"
        )
    visual, bare = [], []
    bodies = {*_followed(robot)}
    for link in robot.findall("link"):
        name = str(link.get("name"))
        if link.find("collision/geometry") is not None:
            continue
        mass = link.find("inertial/mass")
        shown = [each for each in link.findall("visual") if each.find("geometry") is not None]
        for each in shown:
            shape = ElementTree.SubElement(link, "collision")
            shape.extend(deepcopy(part) for part in each if part.tag in ("origin", "geometry"))
        if shown:
            visual.append(name)
        elif name in bodies or (mass is not None and _number(str(mass.get("value"))) > 0):
            bare.append(name)
    return Urdf(ElementTree.tostring(robot, encoding="unicode"), tuple(visual), tuple(bare))


def shape_notes(scene: Scene) -> tuple[str, ...]:
    """Return which links of arms have no shapes for collisions, a line for each arm with some.

    A model that cannot be read has no note: reading it for postures raises the error.
    """
    found = []
    for robot in scene.robots:
        if robot.arm is not None:
            with suppress(SceneError, FileError):
                found.append((robot.name, str(read_urdf(model_path(robot.arm)))))
    return tuple(f"robot {name}: its arm has {text}" for name, text in found if text)


def unread_models(scene: Scene) -> tuple[str, ...]:
    """Return whose arm has a model that is not there or cannot be read, and why."""
    out = []
    for robot in scene.robots:
        try:
            _ = None if robot.arm is None else read_urdf(model_path(robot.arm))
        except (SceneError, FileError) as error:
            out.append(f"robot {robot.name}: {str(error).removeprefix('arm: ')}")
    return tuple(out)


def _followed(robot: _Link) -> list[str]:
    """Return the links except the root that have a joint at a distance from their own."""
    joints = [each for each in robot.findall("joint") if each.find("child") is not None]
    moved = {each.find("child").get("link") for each in joints}  # type: ignore[union-attr]
    out = []
    for each in joints:
        parent, origin = each.find("parent"), each.find("origin")
        name = "" if parent is None else str(parent.get("link"))
        shift = "0" if origin is None else str(origin.get("xyz", "0"))
        if name in moved and any(_number(part) for part in shift.split()):
            out.append(name)
    return out


def _number(text: str) -> float:
    """Return a number; 0 where it is none, which pinocchio refuses."""
    try:
        return float(text)
    except ValueError:
        return 0.0


coal, pin = Later("coal"), Later("pinocchio")  # an extra

UP = 4  # folders above a URDF in which packages that it names are looked for
_SAME = 1e-6  # m; points that are closer are one
SAYS = "…"  # in the name of a body: what it does
_DRAWN = 2_000  # postures from which the reach of an arm is known


@dataclass(frozen=True, eq=False)
class Body:
    """A convex body of an arm.

    ``name``: of its link; ``joint``: that moves it, 0 for none; ``shape``: as coal has it;
    ``rotation``, ``shift``: where it is from that joint; ``points`` (m, 3): corners, from there.
    """

    name: str
    joint: int
    shape: Any
    rotation: Floats
    shift: Floats
    points: Floats


@dataclass(frozen=True, eq=False)
class Placed:
    """Where moving bodies are in postures, in the axes of the scene.

    ``rotation`` (P, L, 3, 3); ``shift`` (P, L, 3), m; ``low``, ``high`` (P, L, 3): boxes around
    them, m; ``tools`` (P,): how long the body of the tool, the last one, is, m.
    """

    rotation: Floats
    shift: Floats
    low: Floats
    high: Floats
    tools: Floats

    def rows(self, rows: Ints | Bools) -> Placed:
        """Return those of some postures."""
        parts = (self.rotation, self.shift, self.low, self.high, self.tools)
        return Placed(*(part[rows] for part in parts))


class ArmModel:
    """An arm as pinocchio and coal have it, with its base where it stands."""

    def __init__(self, arm: Arm) -> None:
        if not (find_spec("pinocchio") and find_spec("coal")):
            raise ExtraError("arms need pinocchio and coal: pip install 'seqopt[arms]'")
        self.arm, path = arm, model_path(arm)
        self.model, geometry = _read(path, arm)
        self.data, self.joints = self.model.createData(), int(self.model.nq)
        self.flange = self.model.getFrameId(flange_of(self.model, arm))
        # from every joint, and first the root, to the next one, and last to the flange, m
        ends = [*[*self.model.jointPlacements][1:], self.model.frames[self.flange].placement]
        self._lengths = [float(np.linalg.norm(end.translation)) for end in ends]
        x, y = np.array(arm.x_axis), np.array(arm.y_axis)
        self.base = pin.SE3(np.column_stack([x, y, np.cross(x, y)]), np.array(arm.position))
        bodies = [*_bodies(self.model, geometry)]
        self.fixed = [body for body in bodies if body.joint == 0]
        self.moving = [body for body in bodies if body.joint > 0]
        lower, upper = self.model.lowerPositionLimit, self.model.upperPositionLimit
        kinds = (joint.shortname() for joint in [*self.model.joints][1:])
        self.turns: Bools = np.array([kind.startswith("JointModelR") for kind in kinds])
        self.above = sum(body.joint == 1 for body in self.moving)  # what turns about the base
        self.low: Floats = np.where(self.turns, np.maximum(lower, -np.pi), lower)
        self.high: Floats = np.where(self.turns, np.minimum(upper, np.pi), upper)
        self._require_shapes(path)
        known = len(arm.joint_stiffness)
        if known not in (0, self.joints):
            raise SceneError(
                f"arm: {known} joint stiffnesses for {self.joints} joints; give one each"
            )

    def _require_shapes(self, path: Path) -> None:
        """Raise a `SceneError` if links that are one rigid body with a length have no shape."""
        seen = {body.joint for body in (*self.fixed, *self.moving)}
        slides = [*~self.turns, False]
        for joint, (length, slide) in enumerate(zip(self._lengths, slides, strict=True)):
            if joint not in seen and (slide or length > _SAME):
                own = (each for each in self.model.frames if each.parentJoint == joint)
                names = [each.name for each in own if each.type.name == "BODY"]
                raise SceneError(
                    f"arm: {path} has no shape of {', '.join(names)}, neither <collision> nor "
                    "<visual>, so nothing says what it hits; give it one"
                )

    @cached_property
    def span(self) -> float:
        """No flange is farther from the root of the model than this, m."""
        slides = np.maximum(np.abs(self.low), np.abs(self.high))[~self.turns].sum()
        return float(sum(self._lengths) + slides)

    @cached_property
    def reach(self) -> float:
        """How far the flange gets from the root of the model, m, as postures drawn at random do."""
        flanges = (self.flange_pose(q)[1] for q in self.draw(np.random.default_rng(0), _DRAWN))
        return float(max(np.linalg.norm(at - self.base.translation) for at in flanges))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Bodies in words: fixed ones, moving ones, and last the tool; `SAYS` is what they do.

        Links beyond the flange count as the tool, and their names give the remedy.
        """
        frames, bodies = self.model.frames, (*self.fixed, *self.moving)
        after = {self.flange}
        for i, frame in enumerate(frames):  # parents come first
            after |= {i} if frame.parentFrame in after else set()
        parents, shaped = {frame.parentFrame for frame in frames}, {body.name for body in bodies}
        beyond = {frames[i].name for i in after - {self.flange}}
        tips = (frames[i].name for i in sorted(after - parents, reverse=True))
        flange = next((tip for tip in tips if tip in beyond - shaped), "the frame at its tip")
        tool = (
            f"; it comes after the flange {frames[self.flange].name}, so the model has the tool: "
            f"give flange={flange}, and tool_length from there"
        )
        return (
            *(f"link {b.name} {SAYS}{tool * (b.name in beyond)}" for b in bodies),
            f"tool {SAYS}",
        )

    def draw(self, draws: np.random.Generator, count: int) -> Floats:
        """Return postures (count, joints) within its limits, drawn at random."""
        return self.low + draws.random((count, self.joints)) * (self.high - self.low)

    def flange_pose(self, posture: Floats) -> tuple[Floats, Floats]:
        """Return the axes (3, 3), as columns, and the place (3,) of the flange in the scene."""
        pin.forwardKinematics(self.model, self.data, posture)
        found = self.base * pin.updateFramePlacement(self.model, self.data, self.flange)
        return found.rotation, found.translation

    def jacobian(self, posture: Floats) -> Floats:
        """Return how the node that is held moves and turns with joints, (6, joints).

        Translation first, then rotation, in the axes of the scene.
        """
        axes, _ = self.flange_pose(posture)
        pin.computeJointJacobians(self.model, self.data, posture)
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        found = pin.getFrameJacobian(self.model, self.data, self.flange, frame)
        own = np.asarray(found).reshape(6, self.joints)  # of one joint it has one axis
        turned = np.vstack([self.base.rotation @ own[:3], self.base.rotation @ own[3:]])
        away = self.arm.tool_length * axes[:, 2]
        turned[:3] += np.cross(turned[3:], away, axis=0)
        return np.asarray(turned)

    def placed(self, postures: Floats, tools: Floats) -> Placed:
        """Return where moving bodies are in postures (P, joints).

        ``tools`` (P,): how long the body of the tool is in each, m.
        """
        count, links = len(postures), len(self.moving) + 1
        rotation, shift = np.zeros((count, links, 3, 3)), np.zeros((count, links, 3))
        for i, posture in enumerate(postures):
            pin.forwardKinematics(self.model, self.data, posture)
            for k, body in enumerate(self.moving):
                at = self.data.oMi[body.joint]
                rotation[i, k] = at.rotation @ body.rotation
                shift[i, k] = at.rotation @ body.shift + at.translation
            end = pin.updateFramePlacement(self.model, self.data, self.flange)
            rotation[i, -1] = end.rotation
            shift[i, -1] = end.translation + 0.5 * tools[i] * end.rotation[:, 2]
        rotation = self.base.rotation @ rotation
        shift = shift @ self.base.rotation.T + self.base.translation
        low, high = np.zeros(shift.shape), np.zeros(shift.shape)  # of bodies, from where they are
        for k, body in enumerate(self.moving):
            points = np.einsum("pij,mj->pmi", rotation[:, k], body.points)
            low[:, k], high[:, k] = points.min(axis=1), points.max(axis=1)
        axis = rotation[:, -1, :, 2]
        half = 0.5 * tools[:, None] * np.abs(axis)
        half += self.arm.tool_radius * np.sqrt(np.clip(1 - axis**2, 0.0, None))
        low[:, -1], high[:, -1] = -half, half
        return Placed(rotation, shift, low + shift, high + shift, tools)


def flange_of(model: Any, arm: Arm) -> str:
    """Return the name of the frame that carries the tool."""
    names = [frame.name for frame in model.frames]
    name = arm.flange or ("tool0" if "tool0" in names else names[-1])
    if name not in names:
        raise SceneError(f"arm: the model has no frame {name}; give one of {', '.join(names)}")
    return name


def _read(path: Path, arm: Arm) -> tuple[Any, Any]:
    """Return the model of a URDF, joints locked that do not move the flange, and its bodies."""
    folders = [str(folder) for folder in [*path.resolve().parents][:UP]]
    text = read_urdf(path).text
    try:
        model = pin.buildModelFromXML(text)
        geometry = pin.buildGeomFromUrdfString(
            model, text, pin.GeometryType.COLLISION, package_dirs=folders
        )
    except (ValueError, RuntimeError) as error:
        why = str(error).strip().splitlines()[0]
        raise SceneError(f"arm: {path} cannot be read ({why}); give a URDF with meshes") from error
    end = model.frames[model.getFrameId(flange_of(model, arm))].parentJoint
    moves = {*model.supports[end]}
    still = [joint for joint in range(1, model.njoints) if joint not in moves]
    if still:
        model, geometry = pin.buildReducedModel(model, geometry, still, pin.neutral(model))
    if not model.nq:
        raise SceneError(f"arm: no joint of {path} moves its flange; name another flange")
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    limited = np.isfinite(low) & np.isfinite(high) & (low < high)
    named = zip([*model.names][1:], [*model.joints][1:], strict=True)
    endless = [name for name, j in named if j.nq != j.nv or not limited[j.idx_q]]
    if endless:
        raise SceneError(
            f"arm: {path} has no limits of joint {', '.join(endless)}; give <limit> with lower < "
            "upper, and type revolute in place of continuous"
        )
    return model, geometry


def _bodies(model: Any, geometry: Any) -> Iterator[Body]:
    for each in geometry.geometryObjects:
        shape = each.geometry
        if isinstance(shape, coal.BVHModelBase):
            shape.buildConvexHull(True, "Qt")  # noqa: FBT003  # coal's own
            shape = shape.convex
        if hasattr(shape, "num_points"):
            points = np.array([shape.point(i) for i in range(shape.num_points)]).reshape(-1, 3)
        else:  # a box around it
            shape.computeLocalAABB()
            low, high = shape.aabb_local.min_, shape.aabb_local.max_
            points = np.array([*product(*zip(low, high, strict=True))])
        at, link = each.placement, model.frames[each.parentFrame].name
        yield Body(link, each.parentJoint, shape, at.rotation, at.translation, points)


_AROUND = 12  # points around each end of a tool

arm_model = lru_cache(maxsize=16)(ArmModel)


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
        model = arm_model(self.arm)
        own = np.asarray(self.joints)[: model.joints]
        axes, flange = model.flange_pose(own)
        data, root = model.data, model.base.translation
        pin.forwardKinematics(model.model, data, own)
        joints = [model.base.act(data.oMi[j].translation) for j in range(1, model.model.njoints)]
        points = [root, *joints, flange, flange + self.arm.tool_length * axes[:, 2]]
        far = np.linalg.norm(np.diff(points, axis=0), axis=1) > _SAME
        found = np.array(points)[[True, *far]]
        return found if self.holds else found[[0, 1, 1]]

    @cached_property
    def bodies(self) -> tuple[Floats, ...]:
        """Corners (m, 3), m, of convex bodies: those of links, and last the tool.

        Of the foot, those that do not move.
        """
        model = arm_model(self.arm)
        out = [
            (body.points @ body.rotation.T + body.shift) @ model.base.rotation.T
            + model.base.translation
            for body in model.fixed
        ]
        if not self.holds:
            return tuple(out)
        own = np.asarray(self.joints)[None, : model.joints]
        placed = model.placed(own, np.array([self.arm.tool_length]))
        angles = np.linspace(0.0, 2 * np.pi, _AROUND, endpoint=False)
        ring = self.arm.tool_radius * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
        end = np.array([0.0, 0.0, 0.5 * self.arm.tool_length])
        local = [*(body.points for body in model.moving), np.concatenate([ring - end, ring + end])]
        moved = zip(local, placed.rotation[0], placed.shift[0], strict=True)
        return (*out, *(points @ turn.T + shift for points, turn, shift in moved))


def idle_arm(arm: Arm) -> PosedArm:
    """Return the shapes of an arm that holds nothing."""
    return PosedArm(arm, np.zeros(arm_model(arm).joints), holds=False)
