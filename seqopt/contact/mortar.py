"""Mortars: what a joint carries besides compression, and its elastic limits.

Elastic limits say whether the stress in joints is less than the strength of their mortar: the
wrench of a joint is distributed linearly over its face, force over area and moment over second
moment, and checked at the corners, where the stress is largest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.contact.assembly import Assembly, bare_assembly
from seqopt.errors import SceneError, did_you_mean
from seqopt.network._mechanics import point_motion
from seqopt.network.network import Network
from seqopt.scene._checks import check, not_negative, positive, short
from seqopt.scene.shape import fans

_CUTS = 2  # times that each triangle of a face is cut into four
ROUGHEST = 10.0  # largest coefficient of friction that is tried; more is an angle that was meant
_ASKED = 2.0  # the same of one that somebody asks for
_STRESS_MARGIN = 1e-6  # stress above a limit that counts as none, over the stress scale
_CHUNK = 1_000_000  # corners of sets whose stress is held at once


def _require_no_angle(friction: float, most: float) -> None:
    if friction > most:
        slope = f"; {friction:g}° is {math.tan(math.radians(friction)):.3g}" * (friction < 90)
        raise SceneError(f"friction {friction:g}: give a coefficient up to {most:g}{slope}")


@dataclass(frozen=True, kw_only=True)
class Mortar:
    """What a contact can carry besides compression: Mohr-Coulomb with a tension cut-off.

    Parameters
    ----------
    friction : float
        Coefficient of friction, the tangent of the friction angle; up to `ROUGHEST`.
    tensile_strength, cohesion : float
        Pa; zero for blocks laid dry.

    Raises
    ------
    SceneError
        If a number is negative or not finite, or friction is an angle in degrees.

    Examples
    --------
    >>> DRY.tensile_strength, EPOXY.tensile_strength
    (0.0, 3000000.0)
    >>> Mortar(friction=0.6, cohesion=2e5)
    Mortar(friction=0.6, tensile_strength=0.0, cohesion=200000.0)
    """

    friction: float
    tensile_strength: float = 0.0
    cohesion: float = 0.0

    def __post_init__(self) -> None:
        check(self, "mortar", friction=not_negative)
        check(self, "mortar", tensile_strength=not_negative, cohesion=not_negative)
        _require_no_angle(self.friction, ROUGHEST)


_FRICTION = math.tan(math.radians(25.0))
DRY = Mortar(friction=_FRICTION)
"""Blocks laid dry: compression and friction alone.

Examples
--------
>>> DRY.cohesion
0.0
"""
EPOXY = Mortar(friction=_FRICTION, tensile_strength=3e6, cohesion=2e6)
"""The epoxy putty of Bruun et al. (section 3.2.3: 25°, 3 MPa, and 2 MPa printed as "2 MPa/m").

Examples
--------
>>> EPOXY.tensile_strength, EPOXY.cohesion
(3000000.0, 2000000.0)
"""
MORTARS = {"epoxy": EPOXY, "dry": DRY}


def _is_as_strong(mortar: Mortar, other: Mortar) -> bool:
    """Return whether a mortar is at least as strong as another one in everything.

    Friction takes from what is carried in shear where a contact is pulled: there it must be equal.
    """
    slides, pulled = mortar.friction - other.friction, other.tensile_strength
    rough = slides == 0 or (slides > 0 and not pulled)
    return rough and mortar.tensile_strength >= pulled and mortar.cohesion >= other.cohesion


def _with_friction(mortar: Mortar, friction: float) -> Mortar:
    """Return a mortar with the coefficient of friction that somebody asks for."""
    _require_no_angle(friction, _ASKED)
    return replace(mortar, friction=friction)


def bond_mortar(strength: float, friction: float = _FRICTION) -> Mortar:
    """Return the mortar of a bond with the same strength in tension and in shear, Pa."""
    strength = not_negative("mortar: tensile_strength", strength)
    friction = not_negative("mortar: friction", friction)
    return Mortar(friction=friction, tensile_strength=strength, cohesion=strength * (1 + friction))


def find_mortar(mortar: Mortar | str, where: str = "mortar") -> Mortar:
    """Return a mortar: itself, by a name of `MORTARS`, or as ``bond=STRENGTH``, in Pa."""
    if isinstance(mortar, Mortar):
        return mortar
    if str(mortar) in MORTARS:
        return MORTARS[str(mortar)]
    name, _, strength = str(mortar).partition("=")
    try:
        return bond_mortar(float(strength if name == "bond" else ""))
    except ValueError:
        hint, known = did_you_mean(name, (*MORTARS, "bond")), ", ".join(MORTARS)
        text = short(mortar)[1:-1] if isinstance(mortar, str) else short(mortar)
        raise SceneError(
            f"{where} {text}{hint}: give {known}, or bond=STRENGTH (Pa), zero or more"
        ) from None


def _mortar_name(mortar: Mortar) -> str:
    """Return what a mortar is called: as `find_mortar` takes it, or its strengths."""
    tension, cohesion = mortar.tensile_strength, mortar.cohesion
    strengths = {(m.tensile_strength, m.cohesion): name for name, m in MORTARS.items()}
    own = f"{tension:g} Pa in tension, {cohesion:g} Pa in shear"
    if math.isclose(cohesion, tension * (1 + mortar.friction), rel_tol=1e-9):
        own = f"bond={tension:.10g}"
    rough = "" if mortar.friction == _FRICTION else f", friction {mortar.friction:.3g}"
    return f"{strengths.get((tension, cohesion), own)}{rough}"


def _with_mortar(name: str) -> str:
    """Return a mortar's name as what a structure stands with: dry, or with epoxy."""
    return name if name.partition(",")[0] == "dry" else f"with {name}"


@dataclass(frozen=True)
class BedStiffness:
    """Stiffness of a joint or pad per area, N/m³: positive numbers, or a `SceneError`."""

    normal: float
    tangential: float

    def __post_init__(self) -> None:
        each = partial(positive, unit="N/m³")
        check(self, "bed", normal=each, tangential=each)


@dataclass(frozen=True, eq=False, repr=False)
class _Quadrature(FrozenValue):
    """Points that stand for faces; a face is a contact of an assembly."""

    point: Floats  # (P, 3); m
    face: Ints  # (P,)
    area: Floats  # (P,); share of its face that a point stands for, m²


def face_quadrature(assembly: Assembly) -> _Quadrature:
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
    return _Quadrature(middles.reshape(-1, 3), np.repeat(face, 3), np.repeat(area, 3))


def opening_maps(assembly: Assembly, points: Floats, face: Ints, center: Floats) -> Floats:
    """Return the motions (P, 3, 6) of points for unit twists of their faces' second bodies.

    ``center`` (C, 3): where twists are taken, m. The parts of a motion are along `Assembly.axes`.
    """
    return np.asarray(assembly.axes[face] @ point_motion(points - center[face]))


def quadrature_stiffness(bed: _Quadrature, maps: Floats, moduli: Floats) -> Floats:
    """Return the stiffness (C, 6, 6) of the beds of faces at their centers, N/m and N m/rad.

    ``maps`` (P, 3, 6): from `opening_maps`; ``moduli`` (C, 2): normal and tangential, N/m³.
    """
    slope = bed.area[:, None] * moduli[bed.face][:, [0, 1, 1]]
    each = np.einsum("pij,pi,pik->pjk", maps, slope, maps)
    firsts = np.searchsorted(bed.face, np.arange(len(moduli)))  # faces of points ascend
    return np.asarray(np.add.reduceat(each, firsts, axis=0))


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
