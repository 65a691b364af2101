"""The compliance of grips, and how far they are from where they should be.

A compliant grip is held at its far end: it lets its node shift and turn by a compliance for every
force and moment that it transmits. Its far end may be moved. Moments and rotations are measured by
a lever, so that they are forces and lengths.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import GripError
from seqopt.network.network import Network


@dataclass(frozen=True, eq=False, repr=False)
class GripCompliance(FrozenValue):
    """The compliance of the grips of S grip sets, and their offsets.

    ``moved`` (S, r, 3): how far each is from where it should be, m; None if none is. ``matrix`` (S,
    r, w, w): m/N, of forces, then of moments over the lever if any grip of the scene transmits any
    (w = 6, else 3), infinite on the diagonal of those that a grip does not transmit; None if all
    are rigid and transmit none. ``lever``: m.
    """

    moved: Floats | None = None
    matrix: Floats | None = None
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
        matrix = None if self.matrix is None else self.matrix[which]
        return replace(self, moved=moved, matrix=matrix)

    def offsets(self, sets: int, grips: int) -> Floats:
        """Return how far the grips are moved (S, r, 3)."""
        return np.zeros((sets, grips, 3)) if self.moved is None else self.moved

    def compliant(self, sets: int, grips: int) -> Bools:
        """Return which grips (S, r) are compliant to forces."""
        if self.matrix is None:
            return np.zeros((sets, grips), dtype=bool)
        return np.asarray(self.matrix[..., :3, :3].any(axis=(2, 3)))

    def transmits(self, sets: int, grips: int) -> Bools:
        """Return which grips (S, r) transmit moments."""
        if self.matrix is None or self.matrix.shape[3] == 3:
            return np.zeros((sets, grips), dtype=bool)
        return np.isfinite(self.matrix[..., 5, 5])

    @property
    def transmitted(self) -> Floats:
        """The compliance (S, r, w, w) to grip wrenches; grips must not all be rigid."""
        assert self.matrix is not None
        return np.where(np.isinf(self.matrix), 0.0, self.matrix)


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
    try:
        offsets = np.array(moved, dtype=float)
    except (TypeError, ValueError):
        raise GripError("moved: give lengths in meters, (sets, grips, 3)") from None
    if offsets.shape != (*columns.shape, 3):
        raise GripError(
            f"moved has shape {offsets.shape}; give lengths in meters, (sets, grips, 3), here "
            f"{(*columns.shape, 3)}"
        )
    if not np.isfinite(offsets).all():
        raise GripError("moved: a length is not finite; give meters")
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
            f"robot {name} has no posture at node {node[at]}, so the compliance of its grip is "
            "not known; move its base, or leave out joint_stiffness"
        )
    scale = np.repeat([1.0, network.lever], 3)
    matrix = known.compliance * np.outer(scale, scale)  # of each kind of grip, m/N
    if known.transmits_moment.any():
        turning = np.where(known.transmits_moment, 0.0, np.inf)
        matrix[:, [3, 4, 5], [3, 4, 5]] += turning[:, None]
    else:
        matrix = matrix[:, :3, :3]
    one = len(matrix) == 1
    every = np.broadcast_to(matrix[0], (*grips.shape, *matrix.shape[1:])) if one else matrix[kind]
    return GripCompliance(None, every, network.lever)


_RIGID = 1e-9  # compliance in a direction, over the largest, that stands for none


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
    yields, turns = compliance.compliant(1, grips)[0], compliance.transmits(1, grips)[0]
    matrix, offset = compliance.matrix[0], compliance.offsets(1, grips)[0]
    out = []
    for grip in range(grips):
        ways = [way for way in range(6) if (yields[grip] if way < 3 else turns[grip])]
        if not ways:
            continue
        scale, own = np.repeat([1.0, compliance.lever], 3)[ways], matrix[grip][np.ix_(ways, ways)]
        values, axes = np.linalg.eigh(own)
        least, even = _RIGID * values[-1], not (own - np.diag(np.diag(own))).any()
        if values[0] < least and not (even and values[0] > 0):  # too few joints give any
            own = np.asarray(axes * np.maximum(values, least) @ axes.T)
        offsets = np.pad(offset[grip], (0, 3))[ways]
        out.append(GripSpring(grip, ways, own / np.outer(scale, scale), offsets))
    return out


def _follow_bricks(
    network: Network, columns: Ints, offsets: Floats, compliance: GripCompliance
) -> None:
    """Restrict the offsets of two rigid grips on one brick to rigid motions, in place.

    It cannot become longer: along it, both nodes go halfway between.
    """
    ends = network.node_position[network.inner]
    steps = ends[:, 1] - ends[:, 0]
    axes = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    yields = compliance.compliant(*columns.shape)
    for i, j in combinations(range(columns.shape[1]), 2):
        one = columns[:, i] // 2 == columns[:, j] // 2
        both = np.flatnonzero(one & ~yields[:, i] & ~yields[:, j])
        axis = axes[columns[both, i] // 2]
        stretch = np.einsum("si,si->s", offsets[both, j] - offsets[both, i], axis)
        offsets[both, i] += 0.5 * stretch[:, None] * axis
        offsets[both, j] -= 0.5 * stretch[:, None] * axis
