"""The compliance of grips, and how far they are from where they should be.

A soft grip is held at its far end: it lets its node shift and turn by a compliance for every force
and moment that it transmits. Its far end may be moved. Moments and rotations are measured by a
lever, so that they are forces and lengths.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import GripError
from seqopt.network.network import Network

_Number = TypeVar("_Number", np.float64, np.bool_)


@dataclass(frozen=True, eq=False, repr=False)
class GripCompliance(FrozenValue):
    """The compliance of the grips of S grip sets, and their offsets.

    ``moved`` (S, r, 3): how far each is from where it should be, m; None if none is. ``matrix``
    (K, w, w): compliance of each kind of grip, m/N, first of forces, then of
    moments over the lever if any grip of the scene transmits any; None if all are rigid and
    transmit none. ``transmits_moment`` (K,): which kinds do; None if none of the scene does.
    ``kind`` (S, r): of every grip; (1, 1) if all are of one: that of its robot, or of its robot at
    its node where it has an arm with compliant joints. ``lever``: m.
    """

    moved: Floats | None = None
    matrix: Floats | None = None
    transmits_moment: Bools | None = None
    kind: Ints = field(default_factory=lambda: np.zeros((1, 1), dtype=np.int64))
    lever: float = 1.0

    @property
    def rigid(self) -> bool:
        """Whether all grips are rigid, in their places, and transmit no moment."""
        return self.matrix is None and self.moved is None

    def select(self, which: Bools | Ints | slice) -> GripCompliance:
        """Select grip sets."""
        if self.rigid:
            return self
        moved = None if self.moved is None else self.moved[which]
        kind = self.kind if self.alike else self.kind[which]
        return replace(self, moved=moved, kind=kind)

    @property
    def alike(self) -> bool:
        """Whether all grips are of one kind."""
        return self.matrix is None or len(self.matrix) == 1

    def offsets(self, sets: int, grips: int) -> Floats:
        """Return how far the grips are moved (S, r, 3), in space."""
        return np.zeros((sets, grips, 3)) if self.moved is None else self.moved

    def soft(self, sets: int, grips: int) -> Bools:
        """Return which grips (S, r) are compliant to forces."""
        if self.matrix is None:
            return np.zeros((sets, grips), dtype=bool)
        return self._each(np.asarray(self.matrix[:, :3, :3].any(axis=(1, 2))), sets, grips)

    def matrices(self, sets: int, grips: int) -> Floats:
        """Return the compliance of every grip, (S, r, w, w); they must not all be rigid."""
        assert self.matrix is not None
        return self._each(self.matrix, sets, grips)

    def transmit_moments(self, sets: int, grips: int) -> Bools:
        """Return which grips (S, r) transmit moments."""
        if self.transmits_moment is None:
            return np.zeros((sets, grips), dtype=bool)
        return self._each(self.transmits_moment, sets, grips)

    def _each(self, of_kind: NDArray[_Number], sets: int, grips: int) -> NDArray[_Number]:
        """Return what kinds have (K, ...) for every grip, (S, r, ...)."""
        return np.broadcast_to(of_kind[self.kind], (sets, grips, *of_kind.shape[1:]))


RIGID = GripCompliance()
"""Of rigid grips in their places."""


def read_compliance(
    network: Network, columns: Ints, grips: ArrayLike, moved: ArrayLike | None
) -> GripCompliance:
    """Return the compliance of grip sets (S, r), as `grip_columns` gives them.

    ``grips``, ``moved``: as `seqopt.engines.interface.Engine.solve` takes them. Raises `GripError`
    if ``moved`` is not as many lengths.
    """
    found = _in_place(network, np.asarray(grips))
    if moved is None:
        return found
    offsets = _lengths(columns, moved)
    _follow_bricks(network, columns, offsets, found)
    return replace(found, moved=offsets)


def _in_place(network: Network, grips: Ints) -> GripCompliance:
    """Return the compliance of grips (S, r) in their places.

    Raises `GripError` if the compliance of one is not known: the posture of an arm is missing.
    """
    if network.scene.grip_kinds.rigid:
        return RIGID
    scene, known = network.scene, network.compliances
    node, of_robot = scene.grip_kinds.split(grips)
    kind = known.at(node, of_robot)
    if (kind < 0).any():
        at = tuple(np.argwhere(kind < 0)[0])
        name = scene.robots[[*scene.grip_kinds.of_robot].index(of_robot[at])].name
        raise GripError(
            f"robot {name} has no posture at node {node[at]}, so nobody knows how its grip gives "
            "way; move its base, or leave out joint_stiffness"
        )
    bears = known.transmits_moment if known.transmits_moment.any() else None
    return GripCompliance(None, compliance_by_kind(network), bears, kind, network.lever)


def compliance_by_kind(network: Network) -> Floats:
    """Return the compliance (M, w, w) of each kind of grip, m/N, as of `GripCompliance`."""
    known, scale = network.compliances, np.repeat([1.0, network.lever], 3)
    matrix = known.compliance * np.outer(scale, scale)
    return matrix if known.transmits_moment.any() else matrix[:, :3, :3]


_RIGID = 1e-9  # compliance in a direction, over the largest, that stands for none


def invertible(matrix: Floats) -> Floats:
    """Return a compliance (w, w) with an inverse, also where too few joints of an arm give any.

    Grips that are compliant along each axis by itself stay as they are.
    """
    values, axes = np.linalg.eigh(matrix)
    least = _RIGID * values[-1]
    if values[0] >= least or (values[0] > 0 and not (matrix - np.diag(np.diag(matrix))).any()):
        return matrix
    return np.asarray(axes * np.maximum(values, least) @ axes.T)


class GripSpring(NamedTuple):
    """A compliant grip as a spring between its node and its far end.

    ``ways`` (w,): in which of three shifts and three turns; ``compliance`` (w, w): m and rad for N
    and N m, with an inverse; ``offset`` (w,): of the far end, m.
    """

    grip: int
    ways: list[int]
    compliance: Floats
    offset: Floats


def grip_springs(compliance: GripCompliance, grips: int) -> list[GripSpring]:
    """Return the compliant ones of the grips of one set, in space."""
    if compliance.matrix is None:
        return []
    soft, turns = compliance.soft(1, grips)[0], compliance.transmit_moments(1, grips)[0]
    matrix, offset = compliance.matrices(1, grips)[0], compliance.offsets(1, grips)[0]
    out = []
    for grip in range(grips):
        ways = [way for way in range(6) if (soft[grip] if way < 3 else turns[grip])]
        if ways:
            scale = np.repeat([1.0, compliance.lever], 3)[ways]
            own = invertible(matrix[grip][np.ix_(ways, ways)]) / np.outer(scale, scale)
            out.append(GripSpring(grip, ways, own, np.pad(offset[grip], (0, 3))[ways]))
    return out


def _lengths(columns: Ints, moved: ArrayLike) -> Floats:
    """Return offsets (S, r, 3) of grips, if that is what they are."""
    try:
        far = np.array(moved, dtype=float)
    except (TypeError, ValueError):
        raise GripError("moved: give lengths in meters, (sets, grips, 3)") from None
    if far.shape != (*columns.shape, 3):
        raise GripError(
            f"moved has shape {far.shape}; give lengths in meters, (sets, grips, 3), here "
            f"{(*columns.shape, 3)}"
        )
    if not np.isfinite(far).all():
        raise GripError("moved: a length is not finite; give meters")
    return far


def _follow_bricks(
    network: Network, columns: Ints, offsets: Floats, compliance: GripCompliance
) -> None:
    """Restrict the offsets of two rigid grips on one brick to what it can follow, in place.

    It cannot become longer: along it, both nodes go halfway between.
    """
    ends = network.node_position[network.inner]
    steps = ends[:, 1] - ends[:, 0]
    axes = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    soft = compliance.soft(*columns.shape)
    for i, j in combinations(range(columns.shape[1]), 2):
        one = columns[:, i] // 2 == columns[:, j] // 2
        both = np.flatnonzero(one & ~soft[:, i] & ~soft[:, j])
        axis = axes[columns[both, i] // 2]
        stretch = np.einsum("si,si->s", offsets[both, j] - offsets[both, i], axis)
        offsets[both, i] += 0.5 * stretch[:, None] * axis
        offsets[both, j] -= 0.5 * stretch[:, None] * axis
