"""The URDF of an arm as text, in which links without shapes for collisions take those they show."""

from __future__ import annotations

import re
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

from seqopt._files import read_bytes
from seqopt.errors import FileError, SceneError
from seqopt.scene.arm import Arm
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
        said = []
        if self.visual:
            said.append(f"no <collision> of {', '.join(self.visual)}: <visual> is checked instead")
        if self.bare:
            said.append(f"no shape at all of {', '.join(self.bare)}: nothing says what it hits")
        return "; ".join(said)


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
    return tuple(f"robot {name}: its arm has {said}" for name, said in found if said)


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
