"""Elastic limits: whether the stress in joints is less than the strength of their mortar.

The wrench of a joint is distributed linearly over its face, force over area and moment over second
moment, and checked at the corners, where the stress is largest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import bare_assembly
from seqopt.contact.mortar import Mortar
from seqopt.network._mechanics import point_motion
from seqopt.network.network import Network
from seqopt.scene.shape import fans

_CUTS = 2  # times that each triangle of a face is cut into four


@dataclass(frozen=True, eq=False, repr=False)
class Quadrature(FrozenValue):
    """Points that stand for faces; a face is a contact of an assembly."""

    point: Floats  # (P, 3); m
    face: Ints  # (P,)
    area: Floats  # (P,); share of its face that a point stands for, m²


def face_quadrature(assembly: Assembly) -> Quadrature:
    """Return the bed of all contacts, in their order.

    The middles of edges of triangles, each cut into four twice, integrate squares exactly.
    """
    faces = [np.flatnonzero(assembly.contact == c) for c in range(len(assembly.bodies))]
    parts = fans([face.tolist() for face in faces])
    corners, face = assembly.corner[parts].reshape(-1, 3, 3), assembly.contact[parts[:, 0]]
    for _ in range(_CUTS):
        a, b, c = corners.transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        quarters = np.array([(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)])
        corners, face = quarters.transpose(2, 0, 1, 3).reshape(-1, 3, 3), np.repeat(face, 4)
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(sides, axis=1) / 6  # a third of the triangle
    middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
    return Quadrature(middles.reshape(-1, 3), np.repeat(face, 3), np.repeat(area, 3))


def opening_maps(assembly: Assembly, points: Floats, face: Ints, center: Floats) -> Floats:
    """Return the motions (P, 3, 6) of points for unit twists of their faces' second bodies.

    ``center`` (C, 3): where twists are taken, m. The parts of a motion are along `Assembly.axes`.
    """
    return np.asarray(assembly.axes[face] @ point_motion(points - center[face]))


def quadrature_stiffness(bed: Quadrature, maps: Floats, moduli: Floats) -> Floats:
    """Return the stiffness (C, 6, 6) of the beds of faces at their centers, N/m and N m/rad.

    ``maps`` (P, 3, 6): from `opening_maps`; ``moduli`` (C, 2): normal and tangential, N/m³.
    """
    slope = bed.area[:, None] * moduli[bed.face][:, [0, 1, 1]]
    each = np.einsum("pij,pi,pik->pjk", maps, slope, maps)
    firsts = np.searchsorted(bed.face, np.arange(len(moduli)))  # faces of points ascend
    return np.asarray(np.add.reduceat(each, firsts, axis=0))


_STRESS_MARGIN = 1e-6  # stress above a limit that counts as none, over the stress scale
_CHUNK = 1_000_000  # corners of sets whose stress is held at once


@dataclass(frozen=True, eq=False, repr=False)
class ElasticLimits(FrozenValue):
    """The faces of a structure and the strength of their mortar; joints in the network's order."""

    assembly: Assembly
    mortar: Mortar
    stress: Floats
    """(K, 3, 6): compression and shear at the corners for unit wrenches of their joints, Pa/N and
    Pa/(N m)."""

    def excess(self, wrench: Floats) -> Floats:
        """Return by how much wrenches (S, J, 6) of first joints exceed their limits, (S, J), Pa."""
        corners = int(np.searchsorted(self.assembly.contact, wrench.shape[1]))
        face, mortar = self.assembly.contact[:corners], self.mortar
        stress = np.einsum("kij,skj->ski", self.stress[:corners], wrench[:, face])
        shear = np.sqrt(stress[..., 1] ** 2 + stress[..., 2] ** 2)
        sliding = shear - mortar.cohesion - mortar.friction * stress[..., 0]
        beyond = np.maximum(-stress[..., 0] - mortar.tensile_strength, sliding)
        firsts = np.searchsorted(face, np.arange(wrench.shape[1]))
        most = np.maximum.reduceat(beyond, firsts, axis=1)
        return np.asarray(np.where(np.any(wrench, axis=2), most, -np.inf))

    def exceeded(self, wrench: Floats) -> Bools:
        """Return which grip sets (S,) leave the elastic limits anywhere, beyond rounding."""
        margin, size = _STRESS_MARGIN * self.assembly.stress_scale, _CHUNK // len(self.stress) + 1
        chunks = (wrench[start : start + size] for start in range(0, len(wrench), size))
        most = [self.excess(chunk).max(axis=1, initial=-np.inf) for chunk in chunks]
        return np.asarray(np.concatenate([np.zeros(0), *most]) > margin)


def find_elastic_limits(network: Network, mortar: Mortar) -> ElasticLimits:
    """Return the elastic limits of a structure whose joints all have one mortar."""
    assembly, where = bare_assembly(network, len(network.inner)), network.springs.position
    bed = face_quadrature(assembly)
    maps = opening_maps(assembly, bed.point, bed.face, where)
    evenly = quadrature_stiffness(bed, maps, np.ones((len(where), 2)))
    corner = opening_maps(assembly, assembly.corner, assembly.contact, where)
    return ElasticLimits(assembly, mortar, corner @ np.linalg.inv(evenly)[assembly.contact])
