"""Linear programs of one structure whose grips change: what is asked of a solver.

Forces of an assembly are those of its corners, then those of its grips. A corner has directions
along its face, in which friction acts, a grip has directions in space; all are unit vectors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.contact.assembly import Assembly
from seqopt.plugins import plugins
from seqopt.stability.limit_analysis import Answer, Case

Enough = Callable[[Answer], bool]
"""Says whether an answer proves what is asked, or the program must be refined."""

HeldProgram = Callable[[Floats, Enough], Answer]
"""A case of one assembly, solved for the payloads (N) of all its grips; none for one not held.

Where no forces exist, the answer claims that, has no value and a motion that says why.
"""

CompileHeld = Callable[[Assembly, Case], HeldProgram]
"""Makes the program of an assembly, whose grips are all that may ever be held, and a case."""


def compile_held(assembly: Assembly, case: Case) -> HeldProgram:
    """Return the registered linear program (entry points ``seqopt.limit_analysis``).

    ``assembly``: its grips are all that may ever be held.
    """
    entry = plugins("seqopt.limit_analysis")["lp"]
    compiled: CompileHeld = entry.load()
    return compiled(assembly, case)


_SIDES = 8  # of a cone to start with, the axes of its contact among them
_SPREAD = np.array([p for p in product((-1.0, 0.0, 1.0), repeat=3) if any(p)])
_GAIN = 1e-7  # least gain for which a direction joins, over the largest entry of the motion


@dataclass(frozen=True, eq=False, repr=False)
class Directions(FrozenValue):
    """Directions in which corners and grips act.

    ``owner`` (n,): corner, or grip counted on after the corners. ``unit`` (n, 3): unit vectors;
    those of a corner have no normal part.
    """

    owner: Ints
    unit: Floats

    def joined(self, other: Directions) -> Directions:
        """Return these directions and others after them."""
        return Directions(
            np.concatenate([self.owner, other.owner]), np.concatenate([self.unit, other.unit])
        )


def first_directions(corners: int, grips: int) -> Directions:
    """Return directions to start with, the same ones for every corner and for every grip.

    ``corners``, ``grips``: how many there are.

    Examples
    --------
    >>> len(first_directions(4, 1).owner)
    58
    """
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    flat = np.stack([np.zeros(_SIDES), np.cos(angle), np.sin(angle)], axis=1)
    space = _SPREAD / np.linalg.norm(_SPREAD, axis=1, keepdims=True)
    owner = np.concatenate(
        [
            np.repeat(np.arange(corners), _SIDES),
            corners + np.repeat(np.arange(grips), len(space)),
        ]
    )
    return Directions(
        owner, np.concatenate([np.tile(flat, (corners, 1)), np.tile(space, (grips, 1))])
    )


def better_directions(known: Directions, along: Floats, wanted: Bools) -> Directions:
    """Return the best directions of corners and grips where those known are not as good.

    ``along`` (m, 3): what a force of every corner or grip is worth, per component; the normal parts
    of corners are zero. ``wanted`` (m,): whose directions are asked for.
    """
    best = np.zeros(len(along))
    np.maximum.at(best, known.owner, np.einsum("ij,ij->i", known.unit, along[known.owner]))
    size = np.linalg.norm(along, axis=1)
    which = np.flatnonzero(wanted & (size - best > _GAIN))
    return Directions(which, along[which] / size[which, None])
