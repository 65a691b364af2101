"""The planar engine: three unknowns per brick, for structures held and loaded in their own plane.

If bricks, springs, gravity and loads lie in one plane and every grip holds a node in it, nothing
moves or turns out of the plane, and forces across it are zero. Half of the unknowns are then not
needed. This is exact, not an approximation. Motions out of the plane are not considered.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.engines._grip_compliance import GripCompliance
from seqopt.engines.interface import Basis
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import GripError, SceneError
from seqopt.network.build import network_of
from seqopt.network.network import GROUND, Network
from seqopt.scene.scene import Scene
from seqopt.scene.shape import plane_axes

_FLAT = 1e-9  # distance from the plane that counts as none, over the size of the structure


@dataclass(frozen=True, eq=False, repr=False)
class _Plane(FrozenValue):
    """A plane that mirrors a structure onto itself, as far as forces in it are concerned."""

    point: Floats  # (3,); m
    normal: Floats  # (3,)
    axes: Floats  # (2, 3); unit vectors in the plane

    @property
    def basis(self) -> Basis:
        """The forces and the moment that stay in the plane."""
        return Basis(self.axes, self.normal[None])

    def distance(self, points: Floats) -> Floats:
        """Return how far points (..., 3) lie from the plane, (...), m."""
        return np.asarray(np.abs((points - self.point) @ self.normal))


def find_plane(network: Network) -> _Plane | str:
    """Return the plane of a structure: bricks, springs and gravity lie in it, springs along it.

    It is upright: its normal is the horizontal direction in which centroids and springs spread
    least, or, where all stand above each other, a horizontal axis of the first spring. Bricks may
    be of any width: their nodes need not lie in the plane, their centroids must. Where there is no
    plane, the result is what lies outside, a clause that goes into a sentence.
    """
    springs, up = network.springs, np.array(network.scene.up)
    points = np.vstack([network.centroid, springs.position, springs.anchor])
    spread = points - points.mean(axis=0)
    flat = spread - np.outer(spread @ up, up)
    if np.abs(flat).max() <= _FLAT * np.abs(spread).max():
        flat = springs.axes[0] - np.outer(springs.axes[0] @ up, up)
        flat = flat[np.linalg.norm(flat, axis=1).argmax()][None]
    normal = np.cross(up, np.linalg.svd(flat, full_matrices=False)[2][0])
    normal = np.asarray(normal / np.linalg.norm(normal))
    pulled = any(network.scene.gravity)  # otherwise up may stand on the plane
    axes = np.array([np.cross(up, normal), up]) if pulled else plane_axes(normal)[1:]
    plane = _Plane(points.mean(axis=0), normal, axes)
    outside = _points_outside(network, plane) or _turned_springs(network, normal)
    return outside or _pulled_outside(network, normal) or plane


def off_plane(network: Network, plane: _Plane) -> Floats:
    """Return how far inner nodes (2B,) lie from a plane, m; zero if it is within rounding."""
    inner = network.node_position[network.inner.ravel()]
    away = plane.distance(inner)
    away[away <= _FLAT * np.ptp(inner, axis=0).max()] = 0.0
    return away


def _leaves_plane(plane: _Plane, compliance: GripCompliance, columns: Ints) -> Bools:
    """Return the grips of which sets (S,) are moved, or compliant, out of a plane."""
    out = np.zeros(len(columns), dtype=bool)
    if compliance.moved is not None:
        away = np.abs(compliance.moved @ plane.normal).max(axis=1, initial=0.0)
        size = np.linalg.norm(compliance.moved, axis=2).max(axis=1, initial=0.0)
        out |= away > _FLAT * size
    if compliance.matrix is not None:
        out |= _mixes(plane, compliance.matrices(*columns.shape)).any(axis=1)
    return out


def _mixes(plane: _Plane, compliance: Floats) -> Bools:
    """Return which compliances (..., w, w) answer forces in a plane by motions out of it."""
    across = Basis(plane.normal[None], plane.axes)
    turned = compliance.shape[-1] > 3
    ways = [basis.wrench if turned else basis.force for basis in (plane.basis, across)]
    mixed = np.abs(ways[0] @ compliance @ ways[1].T).max(axis=(-2, -1))
    return np.asarray(mixed > _FLAT * np.abs(compliance).max(axis=(-2, -1)))


def _points_outside(network: Network, plane: _Plane) -> str:
    """Return which brick, spring or fixed point lies outside; empty if none does."""
    scene, springs = network.scene, network.springs
    size = float(np.ptp(network.centroid, axis=0).max()) or max(scene.placed[0].dimensions)
    away = plane.distance(network.centroid)
    outside = "outside the scene's middle plane"
    if away.max() > _FLAT * size:
        brick = scene.placed[int(away.argmax())].name
        return f"brick {brick}: its centroid lies {1e3 * away.max():.3g} mm {outside}"
    away = np.maximum(plane.distance(springs.position), plane.distance(springs.anchor))
    if away.max() > _FLAT * size:
        name = _spring(network, int(away.argmax()))
        return f"{name}: it lies {1e3 * away.max():.3g} mm {outside}"
    return ""


def _turned_springs(network: Network, normal: Floats) -> str:
    """Return which spring answers a motion in the plane by a force across; empty if none does."""
    springs = network.springs
    for stiffness in (springs.translational_stiffness, springs.rotational_stiffness):
        pull = np.einsum("sij,si,si->sj", springs.axes, stiffness, springs.axes @ normal)
        across = pull - (pull @ normal)[:, None] * normal
        turned = np.linalg.norm(across, axis=1) > _FLAT * stiffness.max(axis=1)
        if turned.any():
            name = _spring(network, int(turned.argmax()))
            return f"{name}: its axes are turned out of the scene's plane"
    return ""


def _pulled_outside(network: Network, normal: Floats) -> str:
    """Return which load or movement of the ground leaves the plane; empty if none does."""
    placed, (brick, _, pull) = network.scene.placed, network.loads
    length = max(max(each.dimensions) for each in placed)
    out = _leaves(pull * np.repeat([length, 1.0], 3), normal)
    if out.any():
        name = placed[brick[out.argmax()]].name
        return f"brick {name}: a load on it or the wind is not in the scene's middle plane"
    out = _leaves(network.springs.movement * np.repeat([1.0, length], 3), normal)
    if out.any():
        return f"{_spring(network, int(out.argmax()))}: it moves out of the scene's middle plane"
    return ""


def _leaves(both: Floats, normal: Floats) -> Bools:
    """Return which forces with moments, or shifts with turns (n, 6), leave a plane."""
    shift, turn = both[:, :3], both[:, 3:]
    across = np.linalg.norm(turn - np.outer(turn @ normal, normal), axis=1)
    return np.asarray(np.abs(shift @ normal) + across > _FLAT * np.linalg.norm(both, axis=1))


def _spring(network: Network, index: int) -> str:
    """Return a spring's name for a message."""
    placed = network.scene.placed
    first, second = network.springs.bodies[index]
    if first == GROUND:
        return f"ground end of brick {placed[second].name}"
    return f"joint {placed[first].name}-{placed[second].name}"


_ELSE = "use the compliance engine"


class PlanarEngine(ComplianceEngine):
    """Computes any batch of grip sets on any partial structure of a planar scene.

    Raises `SceneError` if bricks, springs, gravity, loads or movements of the ground leave the
    scene's plane.
    """

    def __init__(self, network: Network | Scene) -> None:
        found = network_of(network)
        plane = find_plane(found)
        if isinstance(plane, str):
            raise SceneError(f"{plane}; {_ELSE}")
        super().__init__(found, plane.basis)
        away = off_plane(found, plane)
        self._plane, self._away = plane, away if away.any() else None

    @cached_property
    def in_space(self) -> ComplianceEngine:
        """The same bricks and joints, free to leave the plane."""
        return ComplianceEngine(self.network)

    def _require_known(self, columns: Ints, compliance: GripCompliance) -> None:
        """Raise `GripError` if a grip lies, is moved or is compliant out of the plane."""
        if _leaves_plane(self._plane, compliance, columns).any():
            raise GripError(f"a grip is moved, or gives way, out of the scene's plane; {_ELSE}")
        if self._away is None:
            return
        away = self._away[columns]
        if away.any():
            inner = self.network.inner.ravel()[columns.ravel()[away.argmax()]]
            far = f"{1e3 * away.max():.3g} mm outside the scene's plane"
            raise GripError(f"grip on node {self.network.node_name[inner]}: it lies {far}; {_ELSE}")
