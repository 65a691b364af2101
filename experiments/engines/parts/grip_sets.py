"""Random sets of grips."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Ints
from seqopt.network.network import Network


def grip_sets(net: Network, bricks: int, count: int) -> Ints:
    """Return random sets of three different free nodes."""
    blocked = net.scene.blocked_nodes
    free = [n for b in net.scene.placed[:bricks] for n in b.nodes if n not in blocked]
    rng = np.random.default_rng(0)
    return np.array([rng.choice(free, 3, replace=False) for _ in range(count)])
