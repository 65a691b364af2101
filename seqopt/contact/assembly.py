"""Rigid blocks that touch: the data needed for equilibrium with contact."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, Ints, Vector, frozen, skew
from seqopt.errors import SceneError
from seqopt.network._mechanics import spread
from seqopt.network.network import GROUND
from seqopt.scene._checks import frames, settle, units


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Assembly(FrozenValue):
    """Rigid blocks, the faces where they touch, and the grips that hold them.

    Parameters
    ----------
    block_name : tuple of int
    centroid, weight : (B, 3) float
        m, N.
    contact_name : tuple of str
    bodies : (C, 2) int
        The two blocks of a contact; the ground is -1 and comes first.
    normal : (C, 3) float
        Unit vectors from the first body into the second.
    corner : (K, 3) float
        Corners of all contact faces, each face once around, m.
    contact : (K,) int
        The contact of every corner.
    grip_block : (G,) int
    grip_position : (G, 3) float
        m.
    payload : (G,) float
        Largest force that each grip can exert, in any direction, N.
    applied : (B, 6) float
        Forces and moments about the centroids that act on the blocks beside their weights, N and
        N m; no rows by default: none do.
    grip_line : (L, 3) float
        Of the first grips: unit vectors along which alone they exert forces, both ways; zero for
        one in any direction, as all others are.
    bond : (C,) float
        Share of the mortar's bond that every contact has; no entries by default: all of it.

    Raises
    ------
    SceneError
        If a number is not finite, an index is out of range or a face has no area.
    """

    block_name: tuple[int, ...]
    centroid: Floats
    weight: Floats
    contact_name: tuple[str, ...]
    bodies: Ints
    normal: Floats
    corner: Floats
    contact: Ints
    grip_block: Ints
    grip_position: Floats
    payload: Floats
    applied: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    grip_line: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    bond: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray) and not np.isfinite(values).all():
                raise SceneError(f"assembly: {name} holds a number that is not finite")
        blocks = len(self.centroid)
        if not blocks or ((self.bodies < GROUND) | (self.bodies >= blocks)).any():
            raise SceneError(f"assembly: bodies name blocks beyond 0 to {blocks - 1}")
        if (self.bodies[:, 1] == GROUND).any():
            raise SceneError("assembly: the ground is a contact's second body; name it first")
        flat = np.flatnonzero(~(self.area > 0))
        if len(flat):
            raise SceneError(f"contact {self.contact_name[flat[0]]}: its face has no area")

    def with_bond(self, shares: Floats) -> Assembly:
        """Return a copy with other shares of the mortar's bond, (C,); cached values are kept."""
        out = copy(self)
        settle(out, bond=frozen(np.array(shares, dtype=float)))
        return out

    @classmethod
    def cut(cls, **values: Any) -> Assembly:
        """Return a part of an assembly that was checked, with cached values that are known."""
        out = cls.__new__(cls)
        out.__setstate__(values)
        return out

    @cached_property
    def corner_area(self) -> Floats:
        """Area of the face that each corner represents, (K,) m².

        Half of the two triangles between the face's centroid and the edges that meet in the corner,
        so that one more corner on an edge changes no sum.
        """
        corners = np.bincount(self.contact, minlength=len(self.bodies))
        mean = self._sums(self.corner) / np.maximum(corners, 1)[:, None]
        spoke, follows, triangle = self._triangles(mean)
        middle = self._sums(triangle[:, None] * (spoke + spoke[follows]) / 3)
        area = self._sums(triangle[:, None])
        centroid = mean + np.divide(middle, area, out=np.zeros_like(middle), where=area > 0)
        _, follows, triangle = self._triangles(centroid)
        out = np.asarray(0.5 * triangle)
        np.add.at(out, follows, 0.5 * triangle)
        return frozen(out)

    def _triangles(self, middle: Floats) -> tuple[Floats, Ints, Floats]:
        """Return spokes from points (C, 3) to the corners, the next corners, and areas between."""
        corners = np.bincount(self.contact, minlength=len(self.bodies))
        after = np.cumsum(corners)
        follows = np.arange(1, len(self.contact) + 1)
        follows[after[corners > 0] - 1] = (after - corners)[corners > 0]
        spoke = self.corner - middle[self.contact]
        return spoke, follows, 0.5 * np.linalg.norm(np.cross(spoke, spoke[follows]), axis=1)

    def _sums(self, values: Floats) -> Floats:
        """Return the sums over the corners (K, m) of every contact, (C, m)."""
        out = np.zeros((len(self.bodies), values.shape[1]))
        np.add.at(out, self.contact, values)
        return out

    @cached_property
    def area(self) -> Floats:
        """Area of every contact face, (C,) m²."""
        return frozen(self._sums(self.corner_area[:, None])[:, 0])

    @cached_property
    def axes(self) -> Floats:
        """Normal and two tangents of every contact, (C, 3, 3), rows are unit vectors."""
        first = np.cross(self.normal, np.eye(3)[np.abs(self.normal).argmin(axis=1)])
        return frozen(frames(self.normal, units(first)))

    @cached_property
    def levers(self) -> Floats:
        """The longer distance of every corner from the centroids of its blocks, (K,) m."""
        out = np.zeros(len(self.corner))
        for body in self.bodies[self.contact].T:
            real = body != GROUND
            arm = self.corner[real] - self.centroid[body[real]]
            out[real] = np.maximum(out[real], np.linalg.norm(arm, axis=1))
        return frozen(out)

    @cached_property
    def scales(self) -> tuple[float, float]:
        """A force (N) and a length (m) to compare in: the heaviest block, the longest lever."""
        force = float(np.linalg.norm(self.weight, axis=1).max())
        grips = np.linalg.norm(self.grip_position - self.centroid[self.grip_block], axis=1)
        return force or 1.0, float(max(self.levers.max(initial=0.0), grips.max(initial=0.0))) or 1.0

    @cached_property
    def stress_scale(self) -> float:
        """The heaviest block's weight over the mean contact area, Pa."""
        area = float(self.area.mean()) if len(self.area) else self.scales[1] ** 2
        return self.scales[0] / area

    @cached_property
    def contact_map(self) -> sparse.csr_array:
        """Wrenches on the blocks from corner forces on contacts' second bodies, (6B, 3K).

        Forces have a normal part (compression positive) and two tangential ones; wrenches are about
        the centroids, their moments over the length scale.
        """
        axes = self.axes[self.contact]
        first, second = self.bodies[self.contact].T
        on_first = self._wrenches(first, self.corner, -axes)
        return frozen(sparse.csr_array(on_first + self._wrenches(second, self.corner, axes)))

    @cached_property
    def grip_map(self) -> sparse.csr_array:
        """Wrenches on the blocks from grip forces, (6B, 3G); as `contact_map`."""
        axes = np.tile(np.eye(3), (len(self.payload), 1, 1))
        for i in np.flatnonzero(self.grip_line.any(axis=1)).tolist():
            axes[i] = 0.0
            axes[i, 0] = self.grip_line[i]
        return frozen(self._wrenches(self.grip_block, self.grip_position, axes))

    def _wrenches(self, block: Ints, point: Floats, axes: Floats) -> sparse.csr_array:
        """Return the wrenches (6B, 3M) of unit forces along the rows of axes (M, 3, 3)."""
        real = np.flatnonzero(block != GROUND)
        arm = (point[real] - self.centroid[block[real]]) / self.scales[1]
        force = axes[real].transpose(0, 2, 1)
        values = np.concatenate([force, skew(arm) @ force], axis=1)
        return spread(block[real], real, values, (len(self.centroid), len(block)))

    def load(self, direction: Vector | None = None) -> Floats:
        """Return weights, or as much along a direction, as wrenches (6B,) over the force scale."""
        pull = self.weight
        if direction is not None:
            pull = np.linalg.norm(self.weight, axis=1, keepdims=True) * np.array(direction)
        out = np.zeros((len(pull), 6))
        out[:, :3] = pull / self.scales[0]
        return out.ravel()

    @cached_property
    def applied_load(self) -> Floats:
        """What is applied beside the weights, as of `load`."""
        out = np.zeros((len(self.centroid), 6))
        out[: len(self.applied)] = self.applied
        return frozen((out / self.scales[0] / np.repeat([1.0, self.scales[1]], 3)).ravel())

    @cached_property
    def amounts(self) -> tuple[float, float]:
        """The sizes of all weights in sum, and of all that is applied beside them, N."""
        applied = np.linalg.norm(self.applied_load.reshape(-1, 2, 3), axis=2).sum()
        weight = np.linalg.norm(self.weight, axis=1).sum()
        return float(weight), float(applied * self.scales[0])
