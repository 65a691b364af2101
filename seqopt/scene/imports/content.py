"""What a file says about an assembly, and what the user has to add."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from seqopt.arrays import Floats
from seqopt.scene.library.common import JointLaw
from seqopt.work.progress import Tell

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}  # m
UPS = ("z", "y")
_Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # (x, y, z) to (x, -z, y)
MOST_BLOCKS = 20_000
MOST_CORNERS = 2_000_000  # of all faces of all blocks


@dataclass(frozen=True)
class FileBlock:
    """A block as a file has it."""

    key: str  # what the file calls it
    vertices: Floats  # (V, 3); in the file's unit of length
    faces: Sequence[Sequence[int]]  # places among the vertices
    support: bool = False  # whether it is fixed
    density: float | None = None  # kg/m³
    course: float | None = None  # its place in the build; lower ones come first


@dataclass(frozen=True)
class FileFace:
    """Where two blocks touch, as a file has it."""

    blocks: tuple[int, int]  # places among the blocks
    corners: Floats  # (m, 3); once around, in the file's unit of length


@dataclass(frozen=True)
class FileJoint:
    """A joint that has a place and no face. Where its blocks touch over faces, these count.

    ``blocks``: places among the blocks; -1 first for the ground. ``position``, ``along`` (3,): in
    the file's unit of length; a direction. ``side``: of the square over which the law of joints is
    taken, in the file's unit of length. ``translational``, ``rotational``: N/m, N m/rad, along and
    across; in place of the law's.
    """

    blocks: tuple[int, int]
    position: Floats
    along: Floats
    side: float
    translational: tuple[float, float, float] | None = None
    rotational: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Content:
    """What a file says about an assembly."""

    blocks: tuple[FileBlock, ...]
    faces: tuple[FileFace, ...] = ()  # empty where the file has none
    joints: tuple[FileJoint, ...] = ()  # of frames and of beams that run into each other
    unit: str | None = None  # unit of length, one of `UNITS`, if the file says it
    law: JointLaw | None = None  # if the file has stiffnesses
    said: tuple[str, ...] = field(default=())  # what was read, left out or assumed

    def scaled(self, factor: float) -> Content:
        """Return the content with all lengths times a factor."""
        return replace(
            self,
            blocks=tuple(replace(b, vertices=factor * b.vertices) for b in self.blocks),
            faces=tuple(replace(f, corners=factor * f.corners) for f in self.faces),
            joints=tuple(
                replace(j, position=factor * j.position, side=factor * j.side) for j in self.joints
            ),
        )

    def turned(self) -> Content:
        """Return the content of a file whose y is up, with z up."""
        return replace(
            self,
            blocks=tuple(replace(b, vertices=b.vertices @ _Y_TO_Z) for b in self.blocks),
            faces=tuple(replace(f, corners=f.corners @ _Y_TO_Z) for f in self.faces),
            joints=tuple(
                replace(j, position=j.position @ _Y_TO_Z, along=j.along @ _Y_TO_Z)
                for j in self.joints
            ),
        )


@dataclass(frozen=True, kw_only=True)
class Given:
    """What the user adds if a file does not say it.

    ``unit``: unit of length of the file, one of `UNITS`; ``up``: which axis of the file points up,
    ``z`` or ``y``; ``density``: of blocks for which the file has none, kg/m³; ``supports``: keys of
    blocks that are fixed, in place of those of the file; ``law``: stiffness of joints by area, in
    place of that of the file; ``gap``: most that may lie between faces that touch, m; ``detect``:
    whether to look for faces although the file has some; ``robots``: how many mobile robots the
    scene gets; ``name``: of the scene; ``progress``: told how far it is to find faces, which takes
    long of many blocks.
    """

    unit: str | None = None
    up: str = "z"
    density: float | None = None
    supports: Sequence[str] | None = None
    law: JointLaw | None = None
    gap: float | None = None
    detect: bool = False
    robots: int = 3
    name: str | None = None
    progress: Tell | None = None
