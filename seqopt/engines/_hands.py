"""What hands of robots do to the nodes that they hold, beside keeping them still."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import GripError
from seqopt.network.network import Network


@dataclass(frozen=True, eq=False, repr=False)
class Hands(FrozenValue):
    """Where the hands of S grip sets are.

    ``moved`` (S, r, d): how far each is from where it should be, m.
    """

    moved: Floats

    def of(self, which: Bools | Ints | slice) -> Hands:
        """Return those of some sets."""
        return replace(self, moved=self.moved[which])

    def within(self, force: Floats) -> Hands:
        """Return them in some directions, unit vectors (d, 3) of forces."""
        return replace(self, moved=self.moved @ force.T)


def read_hands(network: Network, columns: Ints, moved: ArrayLike | None) -> Hands | None:
    """Return the hands of grip sets (S, r), as `grip_columns` gives them; None if they keep still.

    ``moved`` (S, r, 3): as `seqopt.engines.interface.Engine.solve` takes it. Raises `GripError` if
    it is something else.
    """
    if moved is None:
        return None
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
    _follow_bricks(network, columns, far)
    return Hands(far)


def _follow_bricks(network: Network, columns: Ints, moved: Floats) -> None:
    """Let what two hands on one brick ask of it be what a rigid brick can do, in place.

    It cannot become longer: along it, both nodes go halfway between.
    """
    ends = network.node_position[network.inner]
    steps = ends[:, 1] - ends[:, 0]
    axes = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    for i, j in combinations(range(columns.shape[1]), 2):
        both = np.flatnonzero(columns[:, i] // 2 == columns[:, j] // 2)
        axis = axes[columns[both, i] // 2]
        stretch = np.einsum("si,si->s", moved[both, j] - moved[both, i], axis)
        moved[both, i] += 0.5 * stretch[:, None] * axis
        moved[both, j] -= 0.5 * stretch[:, None] * axis
