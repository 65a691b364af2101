"""The content of a file with an assembly, the user's additions, and strict JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from seqopt._files import parse_json
from seqopt.arrays import Floats
from seqopt.errors import ProblemError, SceneError
from seqopt.problem.requirements import number_word
from seqopt.scene._checks import as_float, short
from seqopt.scene.library.common import JointLaw
from seqopt.work import Tell

Entry = dict[str, Any]
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}  # m
UPS = ("z", "y")
_Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # (x, y, z) to (x, -z, y)
GROUND = -1  # stands for the ground where the place of a block is expected
LARGEST = 1e15  # number: products of coordinates beyond lose all digits
MOST_BLOCKS = 20_000
MOST_CORNERS = 2_000_000  # of all faces of all blocks


@dataclass(frozen=True)
class FileBlock:
    """A block as a file has it.

    Parameters
    ----------
    key
        What the file calls it.
    vertices
        (V, 3), in the file's unit of length.
    faces
        Places among the vertices, a sequence for every face.
    support
        Whether it is fixed.
    density, mass
        kg/m³ and kg, if the file says them.
    course
        Its place in the build; lower ones come first.
    """

    key: str
    vertices: Floats
    faces: Sequence[Sequence[int]]
    support: bool = False
    density: float | None = None
    mass: float | None = None
    course: float | None = None


@dataclass(frozen=True)
class Content:
    """What a file says about an assembly.

    Parameters
    ----------
    blocks
        What is built.
    unit
        Unit of length, one of `UNITS`, if the file says it.
    said
        What was read, left out or assumed.
    """

    blocks: tuple[FileBlock, ...]
    unit: str | None = None
    said: tuple[str, ...] = ()

    def placed(self, unit: float, up: str) -> Content:
        """Return the content in m, with z up. ``unit``: of its lengths, m; ``up``: one of `UPS`."""
        turn = _Y_TO_Z if up == "y" else np.eye(3)
        blocks = (replace(b, vertices=unit * b.vertices @ turn) for b in self.blocks)
        return replace(self, blocks=tuple(blocks))


def _law(text: str) -> JointLaw:
    """Return a joint law from a text: its stiffness along the normal, and across it."""
    pair, where = text.split(","), f"--stiffness {text}"
    if len(pair) != 2:
        raise ProblemError(f"{where}: give two numbers, as 1.5e9,1.5e8")
    along, across = (number_word(number, where) for number in pair)
    return JointLaw(translational=(along, across, across))


@dataclass(frozen=True, kw_only=True)
class Given:
    """What the user adds if a file does not say it.

    Parameters
    ----------
    unit : str, optional
        Unit of length, where the file has none.
    up : str, optional
        Axis of the file that points up, ``z`` or ``y``; by default ``z``.
    density : float, optional
        Of blocks for which the file has none, kg/m³.
    supports : sequence of str or str, optional
        Blocks that are the ground, by their keys in the file (default: those that it marks,
        else what stands at the lowest level).
    law : JointLaw, optional
        Of joints by area, N/m³ (default: 1.5e9,1.5e8).
    gap : float, optional
        Most that may lie between faces that touch, m (default: a twentieth of the thinnest block).
    accept_overlaps : bool, optional
        Import blocks that interpenetrate by more than faces tolerate.
    robots : int, optional
        How many there are, mobile ones that reach all (default: those of the file, else 3).
    name : str, optional
        Of the scene (default: that of the file).
    progress : callable, optional
        Called with how far the search for faces is, which takes long of many blocks.
    """

    unit: Annotated[str | None, ("choices", UNITS)] = None
    up: Annotated[str | None, ("choices", UPS)] = None
    density: Annotated[float | None, ("value", "KG/M3")] = None
    supports: Annotated[Sequence[str] | str | None, ("value", "KEY,KEY")] = None
    law: Annotated[JointLaw | None, ("value", "NORMAL,TANGENTIAL"), ("parse", _law)] = None
    gap: Annotated[float | None, ("value", "M")] = None
    accept_overlaps: bool = False
    robots: Annotated[int | None, ("value", "N"), ("most", 100)] = None
    name: str | None = None
    progress: Tell | None = None


def assembly_json(text: str, source: str) -> Any:
    """Return the JSON document of an assembly, whose numbers are finite."""

    def refuse(name: str) -> float:
        raise SceneError(f"{source}: {name} stands where a number should; give finite numbers")

    return parse_json(text, source, SceneError, parse_constant=refuse)


def mapping(where: str, value: object) -> Entry:
    """Return an object of a document."""
    if not isinstance(value, dict):
        raise SceneError(f"{where} is {short(value)}; an object is expected")
    return value


def entry(where: str, holder: object, *keys: str) -> Any:
    """Return the value in an object under the first of some keys that exists."""
    found = mapping(where, holder)
    for key in keys:
        if key in found:
            return found[key]
    raise SceneError(f"{where}: {' or '.join(keys)} is missing")


def listing(where: str, value: object) -> list[Any]:
    """Return a list of a document."""
    if not isinstance(value, list):
        raise SceneError(f"{where} is {short(value)}; a list is expected")
    return value


def number(where: str, value: object) -> float:
    """Return a finite number of a document, up to `LARGEST`."""
    found = as_float(value)
    if not abs(found) <= LARGEST or isinstance(value, bool):
        raise SceneError(
            f"{where} is {short(value)}; a finite number up to {LARGEST:g} is expected"
        )
    return found


def point(where: str, value: object) -> Floats:
    """Return a point (3,) of a document: three numbers, as they are or in an object of COMPAS."""
    plain = value
    while isinstance(plain, dict):
        plain = entry(where, plain, "data", "value", "point")
    row = listing(where, plain)
    if len(row) != 3:
        raise SceneError(f"{where} is {short(value)}; three numbers are expected")
    return np.array([number(where, x) for x in row])
