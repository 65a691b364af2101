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


def choose(whose: tuple[Ints, Ints], shape: tuple[int, int], struck: Bools, collide: Bools) -> Ints:
    """Return one posture of every robot at every node, (R, N), -1 where there is none.

    Robot by robot and node by node the posture is taken that hits the fewest bricks and, of those
    chosen for other robots, the fewest others, until none changes.

    ``whose`` (P,), (P,): robot and node; ``struck`` (P, B), ``collide`` (P, P): as of a table.
    """
    robot, node = whose
    out = np.full(shape, -1)
    groups = [np.flatnonzero((robot == r) & (node == n)) for r, n in np.ndindex(*shape)]
    bad = struck.mean(axis=1) if len(struck) else np.zeros(0)
    for place, rows in enumerate(groups):
        if len(rows):
            out.flat[place] = rows[int(np.argmin(bad[rows]))]
    chosen = np.zeros(len(robot), dtype=bool)
    chosen[out[out >= 0]] = True
    for _ in range(_SWEEPS):
        before = out.copy()
        for place, rows in enumerate(groups):
            if len(rows) > 1:
                cost = bad[rows] + collide[rows][:, chosen].sum(axis=1) / shape[1]
                chosen[out.flat[place]] = False
                out.flat[place] = rows[int(np.argmin(cost))]
                chosen[out.flat[place]] = True
        if (out == before).all():
            break
    return out
