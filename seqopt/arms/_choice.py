"""Which postures are kept of many, and which one of a robot at a node plans are made with."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Bools, Floats, Ints

_SWEEPS = 50  # over all robots and nodes, each given its best posture beside those of the others


def diverse(node: Ints, joints: Floats, struck: Bools, most: int) -> Ints:
    """Return the rows of postures that are kept, at most so many at each node, node by node.

    Those that hit few bricks come first, and of these those that are far from what is kept already.

    ``node`` (P,): ascending; ``joints`` (P, J); ``struck`` (P, B): which bricks they hit.
    """
    out = []
    for place in np.unique(node).tolist():
        rows = np.flatnonzero(node == place)
        bad = struck[rows].sum(axis=1) / struck.shape[1]
        kept = [int(np.argmin(bad))]
        far = np.abs(joints[rows] - joints[rows[kept[0]]]).max(axis=1)
        while len(kept) < min(most, len(rows)):
            gain = np.minimum(far, np.pi) / np.pi - bad
            gain[kept] = -np.inf
            kept.append(int(np.argmax(gain)))
            far = np.minimum(far, np.abs(joints[rows] - joints[rows[kept[-1]]]).max(axis=1))
        out += rows[kept].tolist()
    return np.array(out, dtype=np.int64)


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
