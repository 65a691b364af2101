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
from seqopt.stability._prover import FINE, hulls, sideways
from seqopt.stability.assessment import bonded
from seqopt.stability.limit_analysis import CAP, GAP

_FIRST = tuple(range(0, FINE, FINE // 4))
_FAR = 1.5  # times the pull that must be survived: what is survived by so much is far enough
_TURN = 2 * np.pi / FINE
_ANGLES: Floats = _TURN * np.arange(FINE, dtype=float)


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
        return hulls(_ANGLES, survived)[0] >= pull, least < pull

    def survive(self, pull: float, places: Ints, payload: Floats) -> tuple[Bools, Bools]:
        """Return the same, of sets that stand without a pull, asking what is not known."""
        survived, least = self._brackets(places, payload)
        asked = np.zeros(survived.shape, dtype=bool)
        rows = np.arange(len(places))
        while True:
            safe, angle = hulls(_ANGLES, survived[rows])
            open_ = ~(safe >= pull) & (least[rows] >= pull)
            rows, ways = rows[open_], self._next(angle[open_], asked[rows[open_]])
            rows, ways = rows[ways >= 0], ways[ways >= 0]
            if not len(rows):
                return hulls(_ANGLES, survived)[0] >= pull, least < pull
            for way in np.unique(ways).tolist():
                own = rows[ways == way]
                found = self._ask(way, pull, places[own], payload[own])
                asked[own, way] = True
                survived[own, way] = np.where(found[:, 0] >= 0, found[:, 0], np.nan)
                least[own] = np.minimum(least[own], found[:, 1])

    def _next(self, angle: Floats, asked: Bools) -> Ints:
        """Return the directions to ask next, (S,): -1 where there is none that would help.

        ``angle`` (S,): where their hulls are nearest; ``asked`` (S, F).
        """
        off = np.abs((np.arange(FINE) - angle[:, None] / _TURN + FINE / 2) % FINE - FINE / 2)
        off = np.where(asked | np.isnan(off), np.inf, off)
        near = off.argmin(axis=1)
        out = np.where(off.min(axis=1, initial=np.inf) <= 1.0, near, -1)
        for way in sorted(_FIRST, key=lambda way: (self._fell[way], -way)):
            out[~asked[:, way]] = way  # the one that most fell by comes last, and stays
        return out

    def _ask(self, way: int, pull: float, places: Ints, payload: Floats) -> Floats:
        """Return brackets (S, 2) of the critical pull in a direction."""
        if way not in self._states:
            case = self._cases[way]
            self._states[way] = HeldStates(self._assembly, case, self._compile)
        found = self._states[way].bracket(places, payload, partial(_settled, pull), pull)
        self._fell[way] += int((found[:, 1] < pull).sum())
        return found

    def _brackets(self, places: Ints, payload: Floats) -> tuple[Floats, Floats]:
        """Return what is survived by direction (S, F), NaN where unknown, and the least bound."""
        survived, least = np.full((len(places), FINE), np.nan), np.full(len(places), np.inf)
        for way, states in self._states.items():
            low, high = states.known(places, payload).T
            survived[:, way] = np.where(low >= 0, low, np.nan)
            least = np.minimum(least, high)
        return survived, least


def _settled(pull: float, bracket: Floats) -> Bools:
    """Return converged brackets (S, 2) of the critical pull, and those far from a given pull."""
    low, high = bracket.T
    narrow = high - low <= GAP * np.maximum(1e-2, high)
    return np.asarray((high < pull) | (low >= _FAR * pull) | narrow | (low >= CAP))
