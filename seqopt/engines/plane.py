"""The plane that a structure lies in, if it does: three unknowns per brick are then enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.basis import Basis
from seqopt.network.network import GROUND, Network

FLAT = 1e-9  # distance from the plane that counts as none, over the size of the structure


@dataclass(frozen=True, eq=False, repr=False)
class Plane(FrozenValue):
    """A plane that mirrors a structure onto itself, as far as forces in it are concerned.

    Attributes
    ----------
    point : (3,) float
        m.
    normal : (3,) float
    axes : (2, 3) float
        Unit vectors in the plane.
    """

    point: Floats
    normal: Floats
    axes: Floats

    @property
    def basis(self) -> Basis:
        """The forces and the moment that stay in the plane."""
        return Basis(self.axes, self.normal[None])

    def distance(self, points: Floats) -> Floats:
        """Return how far points lie from the plane.

        Parameters
        ----------
        points : (..., 3) float
            m.

        Returns
        -------
        (...) float
            m.
        """
        return np.asarray(np.abs((points - self.point) @ self.normal))


@dataclass(frozen=True)
class NoPlane:
    """That a structure lies in no plane.

    Attributes
    ----------
    reason : str
        What lies outside, a clause that goes into a sentence.
    """

    reason: str


def find_plane(network: Network) -> Plane | NoPlane:
    """Return the plane of a structure: bricks, springs and gravity lie in it, springs along it.

    Bricks may be of any width: their nodes need not lie in the plane, their centroids must.
    """
    springs = network.springs
    points = np.vstack([network.centroid, springs.position, springs.anchor])
    normal = _normal(network, points - points.mean(axis=0))
    plane = Plane(points.mean(axis=0), normal, _spanned(normal))
    outside = _points_outside(network, plane) or _turned_springs(network, normal)
    return NoPlane(outside) if outside else plane


def off_plane(network: Network, plane: Plane, columns: Ints) -> Floats:
    """Return how far grips lie from a plane.

    Parameters
    ----------
    network : Network
    plane : Plane
    columns : (S, r) int
        Grips as indices into ``network.inner.ravel()``.

    Returns
    -------
    (S, r) float
        m; zero where a grip lies in the plane to within rounding.
    """
    inner = network.node_position[network.inner.ravel()]
    away = plane.distance(inner)
    away[away <= FLAT * np.ptp(inner, axis=0).max()] = 0.0
    return np.asarray(away[columns])


def _normal(network: Network, spread: Floats) -> Floats:
    """Return the horizontal direction in which points (P, 3) about their middle spread least.

    Where they all stand above each other, a horizontal axis of the first spring.
    """
    up = np.array(network.scene.up)
    flat = spread - np.outer(spread @ up, up)
    if np.abs(flat).max() <= FLAT * np.abs(spread).max():
        flat = network.springs.axes[0] - np.outer(network.springs.axes[0] @ up, up)
        flat = flat[np.linalg.norm(flat, axis=1).argmax()][None]
    longest = np.linalg.svd(flat, full_matrices=False)[2][0]
    normal = np.cross(up, longest)
    return np.asarray(normal / np.linalg.norm(normal))


def _spanned(normal: Floats) -> Floats:
    """Return two unit vectors (2, 3) at right angles to a normal and to each other."""
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first)])


def _points_outside(network: Network, plane: Plane) -> str:
    """Return which brick, spring or fixed point lies outside; empty if none does."""
    scene = network.scene
    size = float(np.ptp(network.centroid, axis=0).max()) or max(scene.placed[0].dimensions)
    away = plane.distance(network.centroid)
    outside = "outside the scene's middle plane"
    if away.max() > FLAT * size:
        brick = scene.placed[int(away.argmax())].name
        return f"brick {brick}: its centroid lies {1e3 * away.max():.3g} mm {outside}"
    springs = network.springs
    away = np.maximum(plane.distance(springs.position), plane.distance(springs.anchor))
    if away.max() > FLAT * size:
        name = _spring(network, int(away.argmax()))
        return f"{name}: it lies {1e3 * away.max():.3g} mm {outside}"
    return ""


def _turned_springs(network: Network, normal: Floats) -> str:
    """Return which spring answers a motion in the plane by a force across; empty if none does."""
    springs = network.springs
    for stiffness in (springs.translational_stiffness, springs.rotational_stiffness):
        pull = np.einsum("sij,si,si->sj", springs.axes, stiffness, springs.axes @ normal)
        across = pull - (pull @ normal)[:, None] * normal
        turned = np.linalg.norm(across, axis=1) > FLAT * stiffness.max(axis=1)
        if turned.any():
            name = _spring(network, int(turned.argmax()))
            return f"{name}: its axes are turned out of the scene's plane"
    return ""


def _spring(network: Network, index: int) -> str:
    """Return a spring's name for a message."""
    placed = network.scene.placed
    first, second = network.springs.bodies[index]
    if first == GROUND:
        return f"ground end of brick {placed[second].name}"
    return f"joint {placed[first].name}-{placed[second].name}"
