"""Margins of grip sets, many at a time: least bond, least friction, tilt survived, least payload.

Every margin is a bracket: what forces prove on one side, a motion on the other, as in
`seqopt.stability._held_states`. Where the solver's answers leave it wide it is wide, and still
proven.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import Contacts
from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.stability._held_states import CompileHeld, HeldStates, compile_held, node_assembly
from seqopt.stability._prover import DIRECTIONS, FINE, NEAR, in_every_direction, sideways
from seqopt.stability._screens import FALLS, STANDS, Screen, held_places
from seqopt.stability.assessment import ROUGHEST, bonded
from seqopt.stability.limit_analysis import CAP, GAP, Case

_Cases = Callable[[Assembly], list[Case]]


class Margins:
    """Brackets of the margins of grip sets; the parameters of its methods are those of `Screen`.

    Parameters
    ----------
    network : Network or Scene
    mortar : Mortar or str
        Of all joints; or its name.
    compiled : callable, optional
        Makes the programs to solve; the registered one by default.

    Attributes
    ----------
    screens : dict of float to Screen
        By the coefficient of friction, as far as they were needed.

    Examples
    --------
    >>> import seqopt
    >>> margins = Margins(seqopt.load_scene("arch25"), seqopt.DRY)
    >>> margins.bond(5, [[10, 7], [10, 0]]).round()  # Pa
    array([[  0.,   0.],
           [778., 778.]])
    """

    def __init__(
        self, network: Network | Scene, mortar: Mortar | str, compiled: CompileHeld = compile_held
    ) -> None:
        self.network = network_of(network)
        self.mortar = find_mortar(mortar)
        self._compile = compiled
        self._contacts = Contacts(self.network)
        self._levels: dict[tuple[str, int], tuple[HeldStates, ...]] = {}
        self.screens = {self.mortar.friction: Screen(self.network, self.mortar, 0.0, compiled)}

    @property
    def solved(self) -> int:
        """How many linear programs were solved."""
        own = sum(states.solved for level in self._levels.values() for states in level)
        return own + sum(screen.solved for screen in self.screens.values())

    def bond(self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None) -> Floats:
        """Return the least bond of grip sets at the mortar's friction.

        ``bricks``: how many bricks stand, in build order. ``held`` (S, r): nodes held, as places in
        build order counted from 1; zero for none. ``payload`` (r,), (S, r): N. Result (S, 2):
        between which values the strength lies, Pa, in tension and at once in shear; infinite if
        none is enough.
        """
        bare = Mortar(friction=self.mortar.friction)

        def cases(assembly: Assembly) -> list[Case]:
            return [bonded(assembly, bare)]

        (bracket,) = self._brackets("bond", cases, bricks, (held, payload))
        level = self._levels["bond", bricks][0]
        return _or_inf(bracket) * level.assembly.stress_scale

    def grip(self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None) -> Floats:
        """Return the least payload, the same for all who hold, with the mortar.

        ``bricks``: how many bricks stand, in build order. ``held`` (S, r): nodes held, as places in
        build order counted from 1; zero for none. ``payload`` (r,), (S, r): N; counts only in what
        a motion's rounding is charged with. Result (S, 2): between which values it lies, N;
        infinite if none is enough.
        """

        def cases(assembly: Assembly) -> list[Case]:
            return [replace(self._fixed(assembly), payload=(0.0, 1.0))]

        (bracket,) = self._brackets("grip", cases, bricks, (held, payload))
        level = self._levels["grip", bricks][0]
        return _or_inf(bracket) * level.assembly.scales[0]

    def tilt(self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None) -> Floats:
        """Return the tilt that grip sets survive in every direction.

        ``bricks``: how many bricks stand, in build order. ``held`` (S, r): nodes held, as places in
        build order counted from 1; zero for none. ``payload`` (r,), (S, r): N. Result (S, 2):
        between which values it lies, rad; NaN where it is not proven that the structure stands. As
        `seqopt.stability.assessment.Stability.tilt`.
        """
        screen = self.screens[self.mortar.friction]
        out = np.full((len(np.asarray(held)), 2), np.nan)
        rows = np.flatnonzero(screen.stands(bricks, held, payload) == STANDS)
        if len(rows):
            out[rows] = self._tilts(DIRECTIONS, bricks, held, payload, rows)
            rows = rows[out[rows, 0] < (1 - NEAR) * out[rows, 1]]
        if len(rows):
            out[rows] = self._tilts(FINE, bricks, held, payload, rows)
        return out

    def _tilts(
        self, count: int, bricks: int, held: ArrayLike, payload: ArrayLike | None, rows: Ints
    ) -> Floats:
        """Return brackets (n, 2) of the tilt of some grip sets, by a number of directions."""

        def pulls(assembly: Assembly) -> list[Case]:
            return sideways(self._fixed(assembly), self.network.scene.up, count)

        grips = np.asarray(held)[rows], _of_rows(payload, rows)
        brackets = np.array(self._brackets(f"tilt {count}", pulls, bricks, grips))
        angles = 2 * np.pi * np.arange(count) / count
        known = np.where(np.isfinite(brackets[..., 0]), np.maximum(brackets[..., 0], 0.0), np.nan)
        least = [np.nan_to_num(in_every_direction(angles, row)[0]) for row in known.T]
        most = np.maximum(brackets[..., 1].min(axis=0), 0.0)
        return np.asarray(np.arctan(np.stack([np.array(least), most], axis=1)))

    def friction(
        self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None, step: float = 2.0**-7
    ) -> Floats:
        """Return the least coefficient of friction at the mortar's bond, by halving intervals.

        ``bricks``: how many bricks stand, in build order. ``held`` (S, r): nodes held, as places in
        build order counted from 1; zero for none. ``payload`` (r,), (S, r): N. ``step``: how narrow
        the brackets shall be. Result (S, 2): between which values it lies; infinite above where
        none up to `ROUGHEST` is proven to be enough.
        """
        sets = np.asarray(held)
        out = np.tile([0.0, np.inf], (len(sets), 1))
        open_ = np.ones(len(sets), dtype=bool)
        for friction in (0.0, 1.0, ROUGHEST):
            self._narrow(out, open_, friction, (bricks, sets, payload))
        while True:
            open_ &= (out[:, 1] - out[:, 0] > step) & np.isfinite(out[:, 1])
            if not open_.any():
                return out
            middle = out.mean(axis=1)
            for friction in np.unique(middle[open_]).tolist():
                rows = open_ & (middle == friction)
                before = out[rows]
                self._narrow(out, rows, friction, (bricks, sets, payload))
                open_[rows] = (out[rows] != before).any(axis=1)

    def _narrow(
        self,
        out: Floats,
        which: Bools,
        friction: float,
        question: tuple[int, ArrayLike, ArrayLike | None],
    ) -> None:
        """Narrow some brackets by whether sets stand with a friction, in place."""
        bricks, held, payload = question
        if friction not in self.screens:
            mortar = replace(self.mortar, friction=friction)
            self.screens[friction] = Screen(self.network, mortar, 0.0, self._compile)
        rows = np.flatnonzero(which)
        loads = _of_rows(payload, rows)
        found = self.screens[friction].stands(bricks, np.asarray(held)[rows], loads)
        stand, fall = rows[found == STANDS], rows[found == FALLS]
        out[stand, 1] = np.minimum(out[stand, 1], friction)
        out[fall, 0] = np.maximum(out[fall, 0], friction)

    def _fixed(self, assembly: Assembly) -> Case:
        case = bonded(assembly, self.mortar)
        return replace(case, tension=(case.tension[0], 0.0), cohesion=(case.cohesion[0], 0.0))

    def _brackets(
        self, name: str, cases: _Cases, bricks: int, grips: tuple[ArrayLike, ArrayLike | None]
    ) -> list[Floats]:
        """Return the brackets (S, 2) of z of every case."""
        places, loads = held_places(self.network, bricks, *grips)
        if (name, bricks) not in self._levels:
            assembly = node_assembly(self.network, bricks, self._contacts)
            self._levels[name, bricks] = tuple(
                HeldStates(assembly, case, self._compile) for case in cases(assembly)
            )
        level = self._levels[name, bricks]
        return [states.bracket(places, loads, narrow) for states in level]


def narrow(bracket: Floats) -> Bools:
    """Return which brackets are as narrow as proofs of a margin have to be.

    ``bracket`` (S, 2). Result (S,).
    """
    scale = np.maximum(1.0, np.where(np.isfinite(bracket[:, 0]), np.abs(bracket[:, 0]), 0.0))
    gap = bracket[:, 1] - bracket[:, 0] <= GAP * scale
    return np.asarray(gap | (bracket[:, 0] >= CAP))


def _of_rows(payload: ArrayLike | None, rows: Ints) -> ArrayLike | None:
    """Return the payloads of some grip sets."""
    if payload is None or np.ndim(payload) < 2:
        return payload
    return np.asarray(payload)[rows]


def _or_inf(bracket: Floats) -> Floats:
    """Return brackets of a least z; infinite where none up to `CAP` is enough."""
    return np.where(bracket[:, [0]] >= CAP, np.inf, bracket)
