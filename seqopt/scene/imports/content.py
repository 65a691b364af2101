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
Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # (x, y, z) to (x, -z, y)
MOST_BLOCKS = 20_000
MOST_CORNERS = 2_000_000  # of all faces of all blocks


@dataclass(frozen=True)
class FileBlock:
    """A block as a file has it.

    Attributes
    ----------
    key : str
        What the file calls it.
    vertices : (V, 3) float
        In the file's unit of length.
    faces : sequence of sequence of int
        Places among the vertices.
    support : bool
        Whether it is fixed.
    density : float, optional
        kg/m³.
    course : float, optional
        Its place in the build; lower ones come first.
    """

    key: str
    vertices: Floats
    faces: Sequence[Sequence[int]]
    support: bool = False
    density: float | None = None
    course: float | None = None


@dataclass(frozen=True)
class FileFace:
    """Where two blocks touch, as a file has it.

    Attributes
    ----------
    blocks : tuple of 2 int
        Places among the blocks.
    corners : (m, 3) float
        Once around, in the file's unit of length.
    """

    blocks: tuple[int, int]
    corners: Floats


@dataclass(frozen=True)
class FileJoint:
    """A joint that has a place and no face. Where its blocks touch over faces, these count.

    Attributes
    ----------
    blocks : tuple of 2 int
        Places among the blocks; -1 first for the ground.
    position, along : (3,) float
        In the file's unit of length; a direction.
    side : float
        Of the square over which the law of joints is taken, in the file's unit of length.
    translational, rotational : tuple of 3 float, optional
        N/m, N m/rad, along and across; in place of the law's.
    """

    blocks: tuple[int, int]
    position: Floats
    along: Floats
    side: float
    translational: tuple[float, float, float] | None = None
    rotational: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Content:
    """What a file says about an assembly.

    Attributes
    ----------
    blocks : tuple of FileBlock
    faces : tuple of FileFace
        Empty where the file has none.
    joints : tuple of FileJoint
        Of frames and of beams that run into each other.
    unit : str, optional
        Unit of length, one of `UNITS`, if the file says it.
    law : JointLaw, optional
        If the file has stiffnesses.
    said : tuple of str
        What was read, left out or assumed.
    """

    blocks: tuple[FileBlock, ...]
    faces: tuple[FileFace, ...] = ()
    joints: tuple[FileJoint, ...] = ()
    unit: str | None = None
    law: JointLaw | None = None
    said: tuple[str, ...] = field(default=())

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
            blocks=tuple(replace(b, vertices=b.vertices @ Y_TO_Z) for b in self.blocks),
            faces=tuple(replace(f, corners=f.corners @ Y_TO_Z) for f in self.faces),
            joints=tuple(
                replace(j, position=j.position @ Y_TO_Z, along=j.along @ Y_TO_Z)
                for j in self.joints
            ),
        )


@dataclass(frozen=True, kw_only=True)
class Given:
    """What the user adds if a file does not say it.

    Parameters
    ----------
    unit : str, optional
        Unit of length of the file, one of `UNITS`.
    up : str, optional
        Which axis of the file points up, ``z`` or ``y``.
    density : float, optional
        Of blocks for which the file has none, kg/m³.
    supports : sequence of str, optional
        Keys of blocks that are fixed, in place of those of the file.
    law : JointLaw, optional
        Stiffness of joints by area, in place of that of the file.
    gap : float, optional
        Most that may lie between faces that touch, m.
    detect : bool, optional
        Whether to look for faces although the file has some.
    robots : int, optional
        How many mobile robots the scene gets.
    name : str, optional
        Of the scene.
    progress : callable, optional
        Told how far it is to find faces, which takes long of many blocks.
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


def mean_place(blocks: Sequence[FileBlock]) -> Floats:
    """Return the middles of blocks' vertices.

    Returns
    -------
    (B, 3) float
    """
    return np.array([block.vertices.mean(axis=0) for block in blocks]).reshape(-1, 3)
