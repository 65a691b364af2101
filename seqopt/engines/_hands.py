"""What hands of robots do to the nodes that they hold, beside keeping them still.

A hand gives way: held at its far end, it lets a node shift and turn by a compliance for every force
and moment that it bears. Its far end may be moved. Moments and rotations are measured by a lever,
so that they are forces and lengths.
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
from seqopt.scene._armed import held_postures
from seqopt.scene.scene import Scene

_Number = TypeVar("_Number", np.float64, np.bool_)


@dataclass(frozen=True, eq=False, repr=False)
class Hands(FrozenValue):
    """The hands of S grip sets.

    ``moved`` (S, r, d): how far each is from where it should be, m; None if they are not.
    ``give`` (K, w, w): how hands of each kind give way, m/N, first of forces in d directions, then
    of moments over the lever if any hand of the scene bears any; None if all are rigid and turn.
    ``turns`` (K,): which kinds bear moments; None if none of the scene does. ``kind`` (S, r): of
    every hand; (1, 1) if all are of one: that of its robot, or of its robot at its node where it
    has an arm whose joints give way. ``lever``: m. ``directions``: of forces, d.
    """

    moved: Floats | None = None
    give: Floats | None = None
    turns: Bools | None = None
    kind: Ints = field(default_factory=lambda: np.zeros((1, 1), dtype=np.int64))
    lever: float = 1.0
    directions: int = 3

    def of(self, which: Bools | Ints | slice) -> Hands:
        """Return those of some sets."""
        moved = None if self.moved is None else self.moved[which]
        kind = self.kind if self.alike else self.kind[which]
        return replace(self, moved=moved, kind=kind)

    @property
    def alike(self) -> bool:
        """Whether all are of one kind."""
        return self.give is None or len(self.give) == 1

    def within(self, force: Floats, wrench: Floats) -> Hands:
        """Return them in the directions of a `Basis`: a plane's, or all."""
        give, count = self.give, len(force)
        if count == self.directions:
            return self
        if give is not None:
            ways = force if self.turns is None else wrench
            give = ways @ give @ ways.T
        moved = None if self.moved is None else self.moved @ force.T
        return replace(self, moved=moved, give=give, directions=count)

    def far(self, sets: int, grips: int) -> Floats:
        """Return how far the hands are moved (S, r, 3), in space."""
        return np.zeros((sets, grips, 3)) if self.moved is None else self.moved

    def soft(self, sets: int, grips: int) -> Bools:
        """Return which hands (S, r) give way to forces."""
        if self.give is None:
            return np.zeros((sets, grips), dtype=bool)
        d = self.directions
        return self._each(np.asarray(self.give[:, :d, :d].any(axis=(1, 2))), sets, grips)

    def each_give(self, sets: int, grips: int) -> Floats:
        """Return how every hand gives way, (S, r, w, w); they must not all be rigid."""
        assert self.give is not None
        return self._each(self.give, sets, grips)

    def each_turns(self, sets: int, grips: int) -> Bools:
        """Return which hands (S, r) bear moments."""
        if self.turns is None:
            return np.zeros((sets, grips), dtype=bool)
        return self._each(self.turns, sets, grips)

    def _each(self, of_kind: NDArray[_Number], sets: int, grips: int) -> NDArray[_Number]:
        """Return what kinds have (K, ...) of every hand, (S, r, ...)."""
        return np.broadcast_to(of_kind[self.kind], (sets, grips, *of_kind.shape[1:]))


def _lever_of(network: Network) -> float:
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
    kinds, lever = network.scene.grip_kinds, _lever_of(network)
    scale = np.repeat([1.0, lever], 3)
    kind, compliance, bears = np.zeros((1, 1), dtype=np.int64), kinds.compliance, kinds.turns
    if kinds.arms.any():
        kind, found = _of_arms(network.scene, np.asarray(grips))
        compliance, bears = found.compliance, found.turns
    elif len(compliance) > 1:
        _, kind = kinds.split(np.asarray(grips))
    give = compliance * np.outer(scale, scale)
    turns = bears if bears.any() else None
    if turns is None:
        give = give[:, :3, :3]
    return Hands(None, give, turns, kind, lever)


class _ArmGrips(NamedTuple):
    """How hands of a scene give way where joints of arms do, M ways in all.

    ``compliance`` (M, 6, 6); ``turns`` (M,); ``kind`` (K, N): which of these each kind of the
    scene's has at each node, -1 where an arm has no posture; ``nodes`` (N,): ascending.
    """

    compliance: Floats
    turns: Bools
    kind: Ints
    nodes: Ints


_KEY = "_arm_grips"  # of what is kept with a scene


def _arm_grips(scene: Scene) -> _ArmGrips:
    """Return how hands give way beside, or before, the joints of arms."""
    held, (of, known) = held_postures(scene), vars(scene).get(_KEY, (None, None))
    assert held is not None
    if of is held and isinstance(known, _ArmGrips):
        return known
    kinds = scene.grip_kinds
    compliance, turns = [kinds.compliance], [kinds.turns]
    kind = np.repeat(np.arange(len(kinds.turns))[:, None], len(held.nodes), axis=1)
    count = len(kinds.turns)
    for robot, rows, joints in zip(held.robots, held.rows, held.compliance(scene), strict=True):
        own, there = kinds.of_robot[robot], rows >= 0
        kind[own] = -1
        kind[own, there] = count + np.arange(there.sum())
        compliance.append(kinds.compliance[own] + joints[there])
        turns.append(np.repeat(kinds.turns[own], there.sum()))
        count += int(there.sum())
    found = _ArmGrips(np.concatenate(compliance), np.concatenate(turns), kind, held.nodes)
    vars(scene)[_KEY] = held, found
    return found


def _of_arms(scene: Scene, grips: Ints) -> tuple[Ints, _ArmGrips]:
    """Return which way (S, r) each hand of a scene with such arms gives way.

    Raises `GripError` if an arm has no posture at a node.
    """
    found, (node, kind) = _arm_grips(scene), scene.grip_kinds.split(grips)
    ways = found.kind[kind, np.searchsorted(found.nodes, node)]
    if (ways < 0).any():
        at = tuple(np.argwhere(ways < 0)[0])
        name = scene.robots[[*scene.grip_kinds.of_robot].index(kind[at])].name
        raise GripError(
            f"robot {name} has no posture at node {node[at]}, so nobody knows how its grip gives "
            "way; move its base, or leave out joint_stiffness"
        )
    return ways, found


_RIGID = 1e-9  # compliance of a hand in a direction, over its largest, that stands for none


def invertible(give: Floats) -> Floats:
    """Return how a hand gives way, (w, w), by a little also where too few joints of an arm move it.

    For those who need its inverse. Hands that give way along each axis by itself stay as they are.
    """
    values, axes = np.linalg.eigh(give)
    least = _RIGID * values[-1]
    if values[0] >= least or (values[0] > 0 and not (give - np.diag(np.diag(give))).any()):
        return give
    return np.asarray(axes * np.maximum(values, least) @ axes.T)


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
