"""What an engine is asked and what it answers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Flag, auto
from itertools import combinations
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Floats, Ints
from seqopt.errors import GripError
from seqopt.network.network import Network


class Want(Flag):
    """Which fields are evaluated; grip forces always are."""

    EDGES = auto()
    DISPLACEMENTS = auto()
    SUPPORT = auto()
    JOINTS = auto()
    BRICKS = auto()
    TABLE = EDGES | DISPLACEMENTS | SUPPORT  # what the columns of Table A.1 need
    ALL = TABLE | JOINTS | BRICKS


@dataclass(frozen=True)
class Fields:
    """Full fields of S grip sets on one partial structure; arrays run over sets first.

    A field that was not asked for has no entries along its second axis.

    Attributes
    ----------
    edge_force : (S, E) float
        Axial force of every network edge, tension positive, N.
    displacement : (S, N, 3) float
        Of every network node, m.
    grip_force : (S, r, 3) float
        Force of every grip on the structure, N.
    support : (S, 6) float
        Reaction on the structure at the first ground end, N, and its moment about the fixed
        point, N m.
    joint_wrench : (S, J, 6) float
        Force and moment, about its position, of every spring of the network on its second body
        (`Springs.bodies`), N and N m; zero where it does not act.
    brick_twist : (S, b, 6) float
        Translation of every brick's centroid and its rotation, m and rad.
    """

    edge_force: Floats
    displacement: Floats
    grip_force: Floats
    support: Floats
    joint_wrench: Floats
    brick_twist: Floats


class Engine(Protocol):
    """Solves partial structures of one scene: linear, from scratch, all weight at once."""

    @property
    def network(self) -> Network:
        """The network whose nodes and edges the fields follow."""

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.TABLE) -> Fields:
        """Return the fields of the first ``bricks`` bricks for grip sets (S, r) of node numbers.

        Raises
        ------
        GripError
            If a grip set names an unknown, blocked, unplaced or repeated node.
        MechanismError
            If bricks, joints and grips leave a motion that nothing resists.
        SolverError
            If the numerical method fails.
        """


FLAGS = {
    "edge_force": Want.EDGES,
    "displacement": Want.DISPLACEMENTS,
    "support": Want.SUPPORT,
    "joint_wrench": Want.JOINTS,
    "brick_twist": Want.BRICKS,
}


def keep_wanted(fields: Fields, want: Want) -> Fields:
    """Return fields without what is not asked for."""
    dropped = [name for name, flag in FLAGS.items() if not want & flag]
    return replace(fields, **{name: getattr(fields, name)[:, :0] for name in dropped})


def select_sets(fields: Fields, which: np.ndarray) -> Fields:
    """Return the fields of some grip sets, (S,) bool or int."""
    return Fields(*(getattr(fields, name)[which] for name in Fields.__dataclass_fields__))


def merge_sets(which: np.ndarray, inside: Fields, outside: Fields) -> Fields:
    """Return the fields of grip sets of which ``which`` (S,) come from the first, in order."""
    out = []
    for name in Fields.__dataclass_fields__:
        first, second = getattr(inside, name), getattr(outside, name)
        whole = np.empty((len(which), *first.shape[1:]))
        whole[which], whole[~which] = first, second
        out.append(whole)
    return Fields(*out)


def grip_columns(network: Network, bricks: int, grips: ArrayLike) -> Ints:
    """Return the grips (S, r) as places in ``network.inner.ravel()``, checked."""
    total = len(network.inner)
    if not 1 <= bricks <= total:
        raise GripError(f"brick count {bricks}: the scene has 1 to {total} bricks")
    numbers = np.asarray(grips)
    if numbers.ndim != 2 or (numbers.size and not np.issubdtype(numbers.dtype, np.integer)):
        raise GripError(
            f"grips have shape {numbers.shape}; give integer node numbers, (sets, grips)"
        )
    known, place = network.place_of_grip
    at = np.searchsorted(known, numbers).clip(max=len(known) - 1)
    columns = place[at]
    wrong = (known[at] != numbers) | (columns >= 2 * bricks)
    if wrong.any():
        raise GripError(
            f"grip on node {numbers[wrong][0]}: with {bricks} bricks the free nodes are "
            f"{known[place < 2 * bricks].tolist()}"
        )
    for i, j in combinations(range(columns.shape[1]), 2):
        twice = columns[:, i] == columns[:, j]
        if twice.any():
            raise GripError(
                f"grip set {numbers[twice][0].tolist()}: a node is held twice; name it once"
            )
    return np.asarray(columns, dtype=np.int64)
