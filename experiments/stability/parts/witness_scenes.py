"""Solids of any shape that touch: what all witnesses are shown, and how we read it."""

from dataclasses import dataclass, field, replace

import numpy as np

from experiments.stability.parts.blocks import BOX, Blocks, Contact, ring, stack, touching
from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly
from seqopt.network.network import GROUND

SLOPE = np.pi / 6
VOUSSOIRS = 24


@dataclass(frozen=True)
class Solid:
    """A closed polyhedron: vertices (V, 3) and faces, counterclockwise from outside."""

    vertex: Floats
    faces: tuple[tuple[int, ...], ...]

    @property
    def mass(self) -> tuple[float, Floats]:
        """Volume and centroid; every face is a fan of triangles around its middle."""
        corner = self.vertex - self.vertex.mean(axis=0)
        parts = []
        for fan in (corner[list(face)] for face in self.faces):
            middle = np.broadcast_to(fan.mean(axis=0), fan.shape)
            parts.append(np.stack([fan, np.roll(fan, -1, axis=0), middle], 1))
        triangles = np.concatenate(parts)
        volume = np.linalg.det(triangles) / 6
        total = float(volume.sum())
        return total, (volume @ triangles.sum(axis=1) / 4 / total) + self.vertex.mean(axis=0)

    @property
    def convex(self) -> bool:
        """Whether no vertex lies before a face, but for a ten-thousandth of the size."""
        for face in self.faces:
            middle = self.vertex[list(face)].mean(axis=0)
            spoke = self.vertex[list(face)] - middle
            normal = np.cross(spoke, np.roll(spoke, -1, axis=0)).sum(axis=0)
            height = (self.vertex - middle) @ normal
            if height.max() > 1e-4 * np.linalg.norm(normal) * np.ptp(self.vertex, axis=0).max():
                return False
        return True


@dataclass(frozen=True)
class Touch:
    """A face between two solids: its corners (m, 3), and two axes whose cross product is normal.

    The normal points from the first solid into the second.
    """

    pair: tuple[int, int]
    corner: Floats
    axes: Floats

    @property
    def normal(self) -> Floats:
        """Unit vector from the first solid into the second."""
        return np.asarray(np.cross(self.axes[0], self.axes[1]))


@dataclass(frozen=True)
class Scene:
    """Solids, some of them supports, and the faces where they touch."""

    solids: tuple[Solid, ...]
    supports: frozenset[int]
    touches: tuple[Touch, ...] = field(default=())

    @property
    def free(self) -> list[int]:
        """The solids that are no supports."""
        return [i for i in range(len(self.solids)) if i not in self.supports]

    @property
    def volume(self) -> float:
        """Volume of the solids that are no supports."""
        return float(sum(self.solids[i].mass[0] for i in self.free))

    def assembly(self, density: float = 1.0) -> Assembly:
        """Return the free solids under a gravity of 1; the supports are the ground."""
        number = {block: i for i, block in enumerate(self.free)}
        masses = [self.solids[i].mass for i in self.free]
        weight = np.array([[0.0, 0.0, -density * volume] for volume, _ in masses])
        contacts, normals = [], []
        for touch in self.touches:
            a, b = (number.get(block, GROUND) for block in touch.pair)
            turned = b == GROUND
            contacts.append(Contact((b, a) if turned else (a, b), touch.corner))
            normals.append(-touch.normal if turned else touch.normal)
        plain = touching(np.array([middle for _, middle in masses]), weight, contacts)
        return replace(plain, normal=np.array(normals))


def scene_of(blocks: Blocks, supports: set[int]) -> Scene:
    """Return the scene of eight-cornered blocks, some of them supports."""
    solids = []
    for vertex in blocks.vertex:
        solid = Solid(vertex, BOX)
        inward = solid.mass[0] < 0
        solids.append(Solid(vertex, tuple(face[::-1] for face in BOX)) if inward else solid)
    touches = []
    for contact in blocks.contacts:
        a, b = contact.bodies
        if a == GROUND or {a, b} <= supports:
            continue
        first = contact.corner[1] - contact.corner[0]
        normal = np.cross(first, contact.corner[-1] - contact.corner[0])
        if normal @ (solids[b].mass[1] - solids[a].mass[1]) < 0:
            normal = -normal
        axes = np.array([first, np.cross(normal, first)])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        touches.append(Touch((a, b), contact.corner, axes))
    return Scene(tuple(solids), frozenset(supports), tuple(touches))


def arch(ratio: float) -> Scene:
    """Return a semicircular arch of a thickness over radius, between two fixed springers."""
    count = VOUSSOIRS + 2
    return scene_of(ring(count, 5.0, 5.0 * ratio, 0.5 * np.pi * count / VOUSSOIRS), {0, count - 1})


def incline(turn: float = 0.0) -> Scene:
    """Return a cube on another one, both turned in plan and then tilted by the slope."""
    c, s = np.cos(turn), np.sin(turn)
    plan = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = np.cos(SLOPE), np.sin(SLOPE)
    tilt: Floats = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ plan
    flat = stack([0.0])
    contacts = tuple(Contact(x.bodies, x.corner @ tilt.T) for x in flat.contacts)
    return scene_of(Blocks(flat.vertex @ tilt.T, contacts), {0})
