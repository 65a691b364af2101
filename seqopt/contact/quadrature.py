"""Faces as beds of points, and how the wrench of a joint acts on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.contact.assembly import Assembly
from seqopt.network.kinematics import point_motion

CUTS = 2  # times that each triangle of a face is cut into four


@dataclass(frozen=True, eq=False, repr=False)
class Quadrature(FrozenValue):
    """Points that stand for faces; a face is a contact of an assembly.

    Attributes
    ----------
    point : (P, 3) float
        m.
    face : (P,) int
    area : (P,) float
        Share of its face that a point stands for, m².
    """

    point: Floats
    face: Ints
    area: Floats


def face_quadrature(assembly: Assembly, cuts: int = CUTS) -> Quadrature:
    """Return the bed of all contacts.

    Faces are cut into triangles, each into four ``cuts`` times; the middles of a triangle's edges
    with a third of its area each integrate squares exactly.

    Returns
    -------
    Quadrature
        Faces in ascending order.
    """
    triangles, face = [], []
    for c in range(len(assembly.bodies)):
        corner = assembly.corner[assembly.contact == c]
        fan = [np.array([corner[0], corner[i], corner[i + 1]]) for i in range(1, len(corner) - 1)]
        for _ in range(cuts):
            fan = [part for triangle in fan for part in _quarters(triangle)]
        triangles += fan
        face += [c] * len(fan)
    corners = np.array(triangles).reshape(-1, 3, 3)
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(sides, axis=1) / 6  # a third of the triangle
    middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
    return Quadrature(
        middles.reshape(-1, 3), np.repeat(np.array(face, np.int64), 3), np.repeat(area, 3)
    )


def _quarters(triangle: Floats) -> list[Floats]:
    a, b, c = triangle
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    return [np.array(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]


def opening_maps(assembly: Assembly, points: Floats, face: Ints, center: Floats) -> Floats:
    """Return the motions of points for unit twists of their faces' second bodies.

    Parameters
    ----------
    assembly : Assembly
    points : (P, 3) float
        m.
    face : (P,) int
        The contact of every point.
    center : (C, 3) float
        Where the twists of the C faces are taken, m; their axes are the scene's.

    Returns
    -------
    (P, 3, 6) float
        Normal part first, then two tangential ones (`Assembly.axes`).
    """
    axes = assembly.axes[face]
    return np.asarray(axes @ point_motion(points - center[face]))


def quadrature_stiffness(bed: Quadrature, maps: Floats, moduli: Floats) -> Floats:
    """Return the stiffness of the beds of C faces at their centers.

    Parameters
    ----------
    bed : Quadrature
        Its faces in ascending order.
    maps : (P, 3, 6) float
        From `opening_maps`.
    moduli : (C, 2) float
        Normal and tangential, N/m³.

    Returns
    -------
    (C, 6, 6) float
        N/m and N m/rad.
    """
    slope = bed.area[:, None] * moduli[bed.face][:, [0, 1, 1]]
    each = np.einsum("pij,pi,pik->pjk", maps, slope, maps)
    return np.asarray(np.add.reduceat(each, first_points(bed.face, len(moduli)), axis=0))


def first_points(face: Ints, faces: int) -> Ints:
    """Return the first point of every face.

    Parameters
    ----------
    face : (P,) int
        The face of every point, ascending.
    faces : int
        How many there are.

    Returns
    -------
    (faces,) int
    """
    return np.searchsorted(face, np.arange(faces))
