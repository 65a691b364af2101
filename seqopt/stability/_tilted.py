"""How far grip sets of one partial structure can be tilted: in which directions they are asked.

The sideways pulls that a structure survives are a convex set. What is between pulls that it
survives, it survives, so the least distance of their hull from no pull is survived in every
direction; the largest pull in any direction is survived by no more. One program for every direction
answers for every tilt, and a direction is asked where the hull is nearest.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, Vector
from seqopt.contact.assembly import Assembly
from seqopt.contact.mortar import Mortar
from seqopt.stability._held_states import CompileHeld, HeldStates
from seqopt.stability._prover import FINE, in_every_direction, sideways
from seqopt.stability.assessment import bonded
from seqopt.stability.limit_analysis import CAP, GAP

_FIRST = tuple(range(0, FINE, FINE // 4))
_FAR = 1.5  # times the pull that must be survived: what is survived by so much is far enough
_TURN = 2 * np.pi / FINE
_ANGLES: Floats = 2 * np.pi * np.linspace(0.0, 1.0, FINE, endpoint=False)


class TiltedStates:
    """One structure with a mortar, pulled sideways.

    ``assembly``: its grips are all that may ever be held; ``up``: unit vector against gravity.
    """

    def __init__(
        self, assembly: Assembly, mortar: Mortar, up: Vector, compiled: CompileHeld
    ) -> None:
        self._assembly, self._compile = assembly, compiled
        self._cases = sideways(bonded(assembly, mortar).fixed(), up, FINE)
        self._states: dict[int, HeldStates] = {}
        self._fell = np.zeros(FINE, dtype=np.int64)  # how many sets by each direction

    @property
    def solved(self) -> int:
        """How many linear programs were solved."""
        return sum(states.solved for states in self._states.values())

    def known(self, pull: float, places: Ints, payload: Floats) -> tuple[Bools, Bools]:
        """Return which grip sets are known to survive a pull in all directions, and which to fall.

        ``pull``: over gravity; ``places``, ``payload`` (S, r): as of `HeldStates.bracket`.
        """
        survived, least = self._brackets(places, payload)
        stands = np.array([_hull(row)[0] >= pull for row in survived], dtype=bool)
        return stands, least < pull

    def survive(self, pull: float, places: Ints, payload: Floats) -> tuple[Bools, Bools]:
        """Return the same, of sets that stand without a pull, asking what is not known."""
        stands, falls = self.known(pull, places, payload)
        asked = np.zeros((len(places), FINE), dtype=bool)
        while True:
            survived, _ = self._brackets(places, payload)
            rows = np.flatnonzero(~stands & ~falls)
            ways = np.array([self._next(survived[i], asked[i]) for i in rows], dtype=np.int64)
            rows, ways = rows[ways >= 0], ways[ways >= 0]
            if not len(rows):
                return stands, falls
            for way in np.unique(ways).tolist():
                own = rows[ways == way]
                asked[own, way] = True
                self._ask(way, pull, places[own], payload[own])
            found = self.known(pull, places[rows], payload[rows])
            stands[rows], falls[rows] = found

    def _next(self, survived: Floats, asked: Bools) -> int:
        """Return the direction to ask next of a set, -1 if there is none that would help."""
        first = [way for way in _FIRST if not asked[way]]
        if first:
            return max(first, key=lambda way: (self._fell[way], -way))
        angle = _hull(survived)[1]
        if np.isnan(angle):
            return -1
        off = np.abs((np.arange(FINE) - angle / _TURN + FINE / 2) % FINE - FINE / 2)
        off[asked] = np.inf
        way = int(np.argmin(off))
        return way if off[way] <= 1.0 else -1

    def _ask(self, way: int, pull: float, places: Ints, payload: Floats) -> None:
        if way not in self._states:
            case = self._cases[way]
            self._states[way] = HeldStates(self._assembly, case, self._compile)
        found = self._states[way].bracket(places, payload, partial(_settled, pull), pull)
        self._fell[way] += int((found[:, 1] < pull).sum())

    def _brackets(self, places: Ints, payload: Floats) -> tuple[Floats, Floats]:
        """Return what is survived by direction (S, F), NaN where unknown, and the least bound."""
        survived, least = np.full((len(places), FINE), np.nan), np.full(len(places), np.inf)
        for way, states in self._states.items():
            low, high = states.known(places, payload).T
            survived[:, way] = np.where(low >= 0, low, np.nan)
            least = np.minimum(least, high)
        return survived, least


def _settled(pull: float, bracket: Floats) -> Bools:
    """Return which brackets (S, 2) of what is survived are narrow enough, or far from a pull."""
    low, high = bracket.T
    narrow = high - low <= GAP * np.maximum(1e-2, high)
    return np.asarray((high < pull) | (low >= _FAR * pull) | narrow | (low >= CAP))


def _hull(survived: Floats) -> tuple[float, float]:
    """Return what is survived in every direction, and where it is least; NaN if that is unknown."""
    return in_every_direction(_ANGLES, survived)
