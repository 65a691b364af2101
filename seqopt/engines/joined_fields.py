"""Fields of no grip set, of some, and of several answers joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Bools, Ints
from seqopt.engines.interface import NAMES, Fields
from seqopt.network.network import Network


def no_sets(network: Network, bricks: int, held: int) -> Fields:
    """Return the fields of no grip set at all: their shapes.

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    held : int
        How many nodes each set would hold.

    Returns
    -------
    Fields
        Arrays with a first axis of length zero.
    """
    return Fields(
        edge_force=np.empty((0, network.count_edges(bricks))),
        displacement=np.empty((0, network.count_nodes(bricks), 3)),
        grip_force=np.empty((0, held, 3)),
        support=np.empty((0, len(network.springs.support), 6)),
        joint_wrench=np.empty((0, len(network.springs.since), 6)),
        brick_twist=np.empty((0, bricks, 6)),
    )


def select_sets(answer: Fields, which: Bools | Ints) -> Fields:
    """Return the fields of some grip sets.

    Parameters
    ----------
    answer : Fields
    which : (S,) bool or (s,) int
    """
    return Fields(**{name: getattr(answer, name)[which] for name in NAMES})


def join_sets(parts: Sequence[Fields], which: Sequence[Bools | slice] | None = None) -> Fields:
    """Return the fields of the grip sets of several answers.

    Parameters
    ----------
    parts : sequence of Fields
        Alike in everything but the number of sets.
    which : sequence of ((S,) bool or slice), optional
        Which of all sets are those of each part, in their order; by default one part's come after
        another's.
    """
    after = np.cumsum([len(part.grip_force) for part in parts])
    total = int(after[-1])
    if which is None:
        which = [slice(b - len(a.grip_force), b) for a, b in zip(parts, after, strict=True)]
    whole = {name: np.empty((total, *getattr(parts[0], name).shape[1:])) for name in NAMES}
    for part, mine in zip(parts, which, strict=True):
        for name in NAMES:
            whole[name][mine] = getattr(part, name)
    return Fields(**whole)


def merge_sets(which: Bools, inside: Fields, outside: Fields) -> Fields:
    """Return the fields of grip sets, some from one answer and the rest from another.

    Parameters
    ----------
    which : (S,) bool
        The sets that the first answer is about, in their order.
    inside, outside : Fields
    """
    return join_sets([inside, outside], [which, ~which])
