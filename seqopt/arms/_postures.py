"""The table of all postures of arms, and the choice of one for every robot and place."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from seqopt.arms._model import SAYS
from seqopt.arrays import Bools, Floats, FrozenValue, Ints, frozen

_SWEEPS = 50  # over all robots and nodes, each given its best posture beside those of the others


@dataclass(frozen=True, eq=False, repr=False)
class PostureTable(FrozenValue):
    """The postures of all arms of a scene, one a row, those of a robot at a node side by side.

    Attributes
    ----------
    robots : tuple of str
        Names of the robots that have arms.
    nodes : tuple of int
    bricks : tuple of int
        Names of the bricks, ascending.
    robot, node : (P,) int
        Whose posture it is, and at which node: places in ``robots`` and ``nodes``.
    joints : (P, J) float
        Joint by joint, rad or m; NaN for joints that an arm does not have.
    axes : (P, 3, 3) float
        Directions of the flange as columns; the third one is that from which the tool comes.
    place : (P, 3) float
        Where the flange is, m.
    tools : (P,) float
        How long the body of the tool is that may hit something, from the flange, m.
    links : tuple of str
        Bodies of all arms, in words; `SAYS` stands for what they do.
    strikes : (P, B) int
        Which of these hits each brick, the one nearest to the base; -1 for none.
    collide : (P, P) bool
        Which pairs of postures, of different robots, are in each other's way.
    found : (R, N) int
        How many postures were found, of which at most `MOST` are kept.
    why : (R, N) str
        Why there is none; empty where there are some.
    """

    robots: tuple[str, ...]
    nodes: tuple[int, ...]
    bricks: tuple[int, ...]
    robot: Ints
    node: Ints
    joints: Floats
    axes: Floats
    place: Floats
    tools: Floats
    links: tuple[str, ...]
    strikes: Ints
    collide: Bools
    found: Ints
    why: NDArray[np.str_]

    @cached_property
    def hits(self) -> Bools:
        """Which bricks an arm hits in a posture (P, B): it is usable while none of these stands."""
        return frozen(np.asarray(self.strikes >= 0))

    def rows(self, robot: str, node: int) -> Ints:
        """Return the postures of a robot at a node."""
        return self._rows.get((robot, node), np.zeros(0, dtype=np.int64))

    def why_not(self, robot: str, node: int, rows: Ints, standing: Bools) -> str:
        """Return why none of the postures of a robot at a node, as rows, is free of bricks.

        ``standing`` (B,): which bricks stand. Named is what stops the one that comes farthest;
        nothing, if one is free.
        """
        if not len(rows):
            return str(self.why[self.robots.index(robot), self.nodes.index(node)])
        hit = self.hits[rows] & standing
        if not hit.any(axis=1).all():
            return ""
        first = np.where(hit, self.strikes[rows], len(self.links))
        best = int(first.min(axis=1).argmax())
        brick = int(first[best].argmin())
        link = int(first[best, brick])
        return self.links[link].replace(SAYS, f"hits brick {self.bricks[brick]}")

    @cached_property
    def _rows(self) -> dict[tuple[str, int], Ints]:
        keys = [(self.robots[r], self.nodes[n]) for r, n in zip(self.robot, self.node, strict=True)]
        out: dict[tuple[str, int], list[int]] = {}
        for row, key in enumerate(keys):
            out.setdefault(key, []).append(row)
        return {key: np.array(rows) for key, rows in out.items()}


def choose(
    whose: tuple[Ints, Ints], usable: Floats, collide: Bools, together: Floats, robots: int
) -> Ints:
    """Return one posture of every robot at every place, (R, N), -1 where there is none.

    Robot by robot and place by place the posture is taken that can be used the longest and is in
    the way of the fewest that were taken for others, until none changes.

    ``whose`` (P,), (P,): robot and place; ``usable`` (P,): for which share of its time each can be
    used; ``collide`` (P, P); ``together`` (N, N): how much it counts that two places cannot be held
    together; ``robots``: how many there are.
    """
    robot, place = whose
    out = np.full((robots, len(together)), -1)
    groups = [np.flatnonzero((robot == r) & (place == n)) for r, n in np.ndindex(*out.shape)]
    for at, rows in enumerate(groups):
        if len(rows):
            out.flat[at] = rows[int(np.argmax(usable[rows]))]
    chosen = np.zeros(len(robot), dtype=bool)
    chosen[out[out >= 0]] = True
    for _ in range(_SWEEPS):
        known = out.copy()
        for at, rows in enumerate(groups):
            if len(rows) > 1:
                mine = together[place[rows[0]], place[chosen]]
                cost = collide[rows][:, chosen] @ mine / together.sum(axis=1).max()
                chosen[out.flat[at]] = False
                out.flat[at] = rows[int(np.argmin(cost + 1 - usable[rows]))]
                chosen[out.flat[at]] = True
        if (out == known).all():
            break
    return out
