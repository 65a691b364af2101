"""Rigid blocks that are not bricks of a scene: textbook structures and outside assemblies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly
from seqopt.network.network import GROUND

BOX = ((0, 1, 2, 3), (7, 6, 5, 4), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))


@dataclass(frozen=True)
class Contact:
    """Two blocks (or the ground, -1, first) and the corners (m, 3) of the face between them."""

    bodies: tuple[int, int]
    corner: Floats


@dataclass(frozen=True)
class Blocks:
    """Eight-cornered blocks (B, 8, 3), bottom face first, and their contacts."""

    vertex: Floats
    contacts: tuple[Contact, ...]

    def assembly(self, density: float, gravity: float = 9.81) -> Assembly:
        """Return the assembly of blocks of one density (kg/m³)."""
        parts = [_tetrahedra(block) for block in self.vertex]
        volume = np.array([sizes.sum() for sizes, _ in parts])
        centroid = np.array([sizes @ middle / sizes.sum() for sizes, middle in parts])
        weight = np.outer(np.abs(volume), [0.0, 0.0, -density * gravity])
        return touching(centroid, weight, self.contacts)


def touching(centroid: Floats, weight: Floats, contacts: Sequence[Contact]) -> Assembly:
    """Return an assembly without grips from centroids, weights (N) and contacts."""
    faces = [contact.corner for contact in contacts]
    bodies = np.array([contact.bodies for contact in contacts])
    fans = [np.cross(face[1:-1] - face[0], face[2:] - face[0]).sum(axis=0) for face in faces]
    normals = np.array([fan / np.linalg.norm(fan) for fan in fans])
    middle = np.array([face.mean(axis=0) for face in faces])
    ends = bodies.tolist()
    # the ground lies behind its face
    start = np.where((bodies[:, 0] == GROUND)[:, None], middle, centroid[bodies[:, 0]])
    turned = np.einsum("ci,ci->c", normals, centroid[bodies[:, 1]] - start) < 0
    normals[turned] *= -1
    return Assembly(
        block_name=tuple(range(1, len(centroid) + 1)),
        centroid=centroid,
        weight=weight,
        contact_name=tuple(f"{'ground' if a == GROUND else a + 1}-{b + 1}" for a, b in ends),
        bodies=bodies,
        normal=normals,
        corner=np.concatenate(faces),
        contact=np.repeat(np.arange(len(faces)), [len(face) for face in faces]),
        grip_block=np.empty(0, dtype=np.int64),
        grip_position=np.empty((0, 3)),
        payload=np.empty(0),
    )


def stack(offsets: Sequence[float], size: Sequence[float] = (1.0, 1.0, 1.0)) -> Blocks:
    """Return boxes on the ground, one on another, each shifted along x against the one below."""
    length, width, height = size
    return courses([[(x, length)] for x in np.cumsum([0.0, *offsets])], height, width)


def courses(
    rows: Sequence[Sequence[tuple[float, float]]], height: float, depth: float = 1.0
) -> Blocks:
    """Return boxes in courses from the ground up, each by its left end and its length."""
    boxes = [(x, x + long, row) for row, course in enumerate(rows) for x, long in course]
    vertex, contacts = [], []
    for i, (left, right, row) in enumerate(boxes):
        base = _level(left, right, row * height, depth)
        vertex.append(np.concatenate([base, base + np.array([0, 0, height])]))
        if row == 0:
            contacts.append(Contact((GROUND, i), base))
        for k, (start, end, below) in enumerate(boxes[:i]):
            low, high = max(left, start), min(right, end)
            if row - below == 1 and low < high:
                contacts.append(Contact((k, i), _level(low, high, row * height, depth)))
            if row == below and np.isclose(end, left):
                contacts.append(Contact((k, i), vertex[i][[0, 3, 7, 4]]))
    return Blocks(np.array(vertex), tuple(contacts))


def _level(left: float, right: float, z: float, depth: float) -> Floats:
    """Return the corners of a level face."""
    return np.array([[left, 0, z], [right, 0, z], [right, depth, z], [left, depth, z]])


def voussoirs(section: Floats, width: Floats | float = 1.0) -> Blocks:
    """Return the blocks of an arch that stands on the ground at both ends.

    ``section`` (n + 1, 2, 2): inner and outer points of the joints in x and z; ``width``: there.
    """
    half = np.multiply.outer(np.broadcast_to(width, section.shape[:2]) / 2, [0.0, 1.0, 0.0])
    middle = np.insert(section, 1, 0.0, axis=2)
    faces = np.concatenate([middle - half, (middle + half)[:, ::-1]], axis=1)
    last = len(faces) - 1
    contacts = [Contact((i - 1, i), faces[i]) for i in range(1, last)]
    ends = [Contact((GROUND, 0), faces[0]), Contact((GROUND, last - 1), faces[-1])]
    return Blocks(np.concatenate([faces[:-1], faces[1:]], axis=1), (*ends, *contacts))


def ring(blocks: int, radius: float, thickness: float, half_angle: float = np.pi / 2) -> Blocks:
    """Return a circular arch of equal wedge blocks with radial joints, 1 m deep.

    The radius is that of the middle line; the half angle is measured from the crown.
    """
    angle = np.linspace(-half_angle, half_angle, blocks + 1)
    size = [radius - thickness / 2, radius + thickness / 2]
    return voussoirs(np.einsum("s,dn->nsd", size, [np.sin(angle), np.cos(angle)]))


def _tetrahedra(block: Floats) -> tuple[Floats, Floats]:
    """Return signed volumes and centroids of tetrahedra over the block's faces."""
    triangles = [(a, b, c) for a, b, c, _ in BOX] + [(a, c, d) for a, _, c, d in BOX]
    middle = block.mean(axis=0)
    corners = block[np.array(triangles)] - middle
    volume = np.linalg.det(corners) / 6
    return volume, corners.sum(axis=1) / 4 + middle
