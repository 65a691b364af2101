"""What hands of robots do to the nodes that they hold, beside keeping them still.

A hand gives way: held at its far end, it lets a node shift and turn by a compliance for every force
and moment that it bears. Its far end may be moved. Moments and rotations are measured by a lever,
so that they are forces and lengths.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import GripError
from seqopt.network.network import Network

if TYPE_CHECKING:
    from seqopt.engines.interface import Basis


@dataclass(frozen=True, eq=False, repr=False)
class Hands(FrozenValue):
    """The hands of S grip sets; a first axis of one holds for all sets, a second for all grips.

    ``moved`` (S, r, d): how far each is from where it should be, m; None if they are not.
    ``give`` (S, r, w, w): how each gives way, m/N, first of forces in d directions, then of
    moments over the lever if any hand of the scene bears any; None if all are rigid and turn.
    ``turns`` (S, r): which bear moments; None if none of the scene does. ``lever``: m.
    """

    moved: Floats | None = None
    give: Floats | None = None
    turns: Bools | None = None
    lever: float = 1.0
    directions: int = 3  # of forces, d

    def of(self, which: Bools | Ints | slice) -> Hands:
        """Return those of some sets."""
        moved = None if self.moved is None else self.moved[which]
        give = self.give if self.give is None or len(self.give) == 1 else self.give[which]
        turns = self.turns if self.turns is None or len(self.turns) == 1 else self.turns[which]
        return replace(self, moved=moved, give=give, turns=turns)

    def within(self, basis: Basis) -> Hands:
        """Return them in the directions of a basis."""
        moved = None if self.moved is None else self.moved @ basis.force.T
        give, count = self.give, len(basis.force)
        if give is not None:
            ways = basis.force if self.turns is None else basis.wrench
            give = ways @ give @ ways.T
        return replace(self, moved=moved, give=give, directions=count)

    def far(self, sets: int, grips: int) -> Floats:
        """Return how far the hands are moved (S, r, 3), in space."""
        return np.zeros((sets, grips, 3)) if self.moved is None else self.moved

    def soft(self, sets: int, grips: int) -> Bools:
        """Return which hands (S, r) give way to forces."""
        if self.give is None:
            return np.zeros((sets, grips), dtype=bool)
        d = self.directions
        return np.broadcast_to(self.give[..., :d, :d].any(axis=(2, 3)), (sets, grips))

    def each_give(self, sets: int, grips: int) -> Floats:
        """Return ``give`` of every hand; it must not be none."""
        assert self.give is not None
        return np.broadcast_to(self.give, (sets, grips, *self.give.shape[2:]))

    def each_turns(self, sets: int, grips: int) -> Bools:
        """Return ``turns`` of every hand; false where none of the scene does."""
        turns = np.zeros((1, 1), dtype=bool) if self.turns is None else self.turns
        return np.broadcast_to(turns, (sets, grips))


def lever_of(network: Network) -> float:
    """Return the length of the longest inner edge, by which moments are measured, m."""
    ends = network.node_position[network.inner]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max())


def read_hands(
    network: Network, columns: Ints, grips: ArrayLike, moved: ArrayLike | None
) -> Hands | None:
    """Return the hands of grip sets (S, r), as `grip_columns` gives them; None if they keep still.

    ``grips``, ``moved``: as `seqopt.engines.interface.Engine.solve` takes them. Raises `GripError`
    if ``moved`` is something else.
    """
    kinds = network.scene.grip_kinds
    if moved is None and kinds.rigid:
        return None
    hands = Hands()
    if not kinds.rigid:
        hands = _giving(network, grips)
    if moved is None:
        return hands
    far = _lengths(columns, moved)
    _follow_bricks(network, columns, far, hands)
    return replace(hands, moved=far)


def _giving(network: Network, grips: ArrayLike) -> Hands:
    """Return hands that give way as their kinds do, and are not moved."""
    kinds, lever = network.scene.grip_kinds, lever_of(network)
    scale = np.repeat([1.0, lever], 3)
    give = kinds.compliance * np.outer(scale, scale)
    turns = kinds.turns if kinds.turns.any() else None
    if turns is None:
        give = give[:, :3, :3]
    which = np.zeros((1, 1), dtype=np.int64)
    if len(give) > 1:
        _, which = kinds.split(np.asarray(grips))
    return Hands(None, give[which], None if turns is None else turns[which], lever)


def _lengths(columns: Ints, moved: ArrayLike) -> Floats:
    """Return lengths (S, r, 3) that hands are moved, if that is what they are."""
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


def _follow_bricks(network: Network, columns: Ints, moved: Floats, hands: Hands) -> None:
    """Let what two rigid hands on one brick ask of it be what it can do, in place.

    It cannot become longer: along it, both nodes go halfway between.
    """
    ends = network.node_position[network.inner]
    steps = ends[:, 1] - ends[:, 0]
    axes = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    soft = hands.soft(*columns.shape)
    for i, j in combinations(range(columns.shape[1]), 2):
        one = columns[:, i] // 2 == columns[:, j] // 2
        both = np.flatnonzero(one & ~soft[:, i] & ~soft[:, j])
        axis = axes[columns[both, i] // 2]
        stretch = np.einsum("si,si->s", moved[both, j] - moved[both, i], axis)
        moved[both, i] += 0.5 * stretch[:, None] * axis
        moved[both, j] -= 0.5 * stretch[:, None] * axis
