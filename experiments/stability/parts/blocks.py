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
    normals = np.array([_normal(face) for face in faces])
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
    at = np.concatenate([[0.0], np.cumsum(offsets)])
    flat = np.array([[0, 0, 0], [length, 0, 0], [length, width, 0], [0, width, 0]])
    up = np.array([0, 0, height])
    vertex, contacts = [], []
    for i, x in enumerate(at):
        base = flat + np.array([x, 0, i * height])
        vertex.append(np.concatenate([base, base + up]))
        before = at[i - 1] if i else x
        low, high, z = max(x, before), min(x, before) + length, i * height
        face = np.array([[low, 0, z], [high, 0, z], [high, width, z], [low, width, z]])
        contacts.append(Contact((i - 1, i) if i else (GROUND, 0), face))
    return Blocks(np.array(vertex), tuple(contacts))


def ring(blocks: int, radius: float, thickness: float, half_angle: float = np.pi / 2) -> Blocks:
    """Return a circular arch of equal wedge blocks with radial joints, 1 m deep.

    The radius is that of the middle line; the half angle is measured from the crown.
    """
    angle = np.linspace(-half_angle, half_angle, blocks + 1)
    out = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=1)
    inner, outer = (radius - thickness / 2) * out, (radius + thickness / 2) * out
    depth = np.array([0.0, 1.0, 0.0])
    faces = np.stack([inner, outer, outer + depth, inner + depth], axis=1)
    contacts = [Contact((i - 1, i), faces[i]) for i in range(1, blocks)]
    ends = [Contact((GROUND, 0), faces[0]), Contact((GROUND, blocks - 1), faces[-1])]
    return Blocks(np.concatenate([faces[:-1], faces[1:]], axis=1), (*ends, *contacts))


def _normal(face: Floats) -> Floats:
    """Return the unit normal of a flat polygon (m, 3)."""
    fan = np.cross(face[1:-1] - face[0], face[2:] - face[0]).sum(axis=0)
    return np.asarray(fan / np.linalg.norm(fan))


def _tetrahedra(block: Floats) -> tuple[Floats, Floats]:
    """Return signed volumes and centroids of tetrahedra over the block's faces."""
    triangles = [(a, b, c) for a, b, c, _ in BOX] + [(a, c, d) for a, _, c, d in BOX]
    middle = block.mean(axis=0)
    corners = block[np.array(triangles)] - middle
    volume = np.linalg.det(corners) / 6
    return volume, corners.sum(axis=1) / 4 + middle
