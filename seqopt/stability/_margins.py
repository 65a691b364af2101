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
from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.errors import SceneError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.stability._held_states import HeldStates, compile_held, node_assembly
from seqopt.stability._prover import DIRECTIONS, FINE, NEAR, hulls, sideways
from seqopt.stability._screens import FALLS, STANDS, Part, Screen, held_parts
from seqopt.stability.assessment import ROUGHEST, bonded
from seqopt.stability.limit_analysis import CAP, GAP, Case

_Cases = Callable[[Assembly], list[Case]]
_PUSHED = "the least payload is not found where props only push"
_Grips = tuple[ArrayLike, ArrayLike | None]  # held, payload


class Margins:
    """Brackets of the margins of grip sets; the parameters of its methods are those of `Screen`.

    Parameters
    ----------
    network : Network or Scene
    mortar : Mortar or str
        Of all joints; or its name.

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

    def __init__(self, network: Network | Scene, mortar: Mortar | str) -> None:
        self.network, self.mortar = network_of(network), find_mortar(mortar)
        self._levels: dict[tuple[str, Part], tuple[HeldStates, ...]] = {}
        self.screens = {self.mortar.friction: Screen(self.network, self.mortar)}

    @property
    def solved(self) -> int:
        """How many linear programs were solved."""
        own = sum(states.solved for level in self._levels.values() for states in level)
        return own + sum(screen.solved for screen in self.screens.values())

    def bond(self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None) -> Floats:
        """Return the least bond of grip sets at the mortar's friction.

        Result (S, 2): between which values the strength lies, Pa, in tension and at once in shear;
        infinite if none is enough.
        """
        bare = Mortar(friction=self.mortar.friction)
        bracket = self._least("bond", lambda each: [bonded(each, bare)], bricks, (held, payload))
        return bracket * self._bare(bricks).stress_scale

    def grip(self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None) -> Floats:
        """Return the least payload, the same for all who hold, with the mortar.

        ``payload`` counts only in what a motion's rounding is charged with. Result (S, 2): between
        which values it lies, N; infinite if none is enough. Not where props only push.
        """
        if any(prop.direction for prop in self.network.scene.props):
            raise SceneError(f"{_PUSHED}; leave payloads out of the margins")

        def cases(assembly: Assembly) -> list[Case]:
            return [replace(bonded(assembly, self.mortar).fixed(), payload=(0.0, 1.0))]

        bracket = self._least("grip", cases, bricks, (held, payload))
        return bracket * self._bare(bricks).scales[0]

    def _bare(self, bricks: int) -> Assembly:
        """Return a structure with the scales of all in which as many bricks stand."""
        known = (level for (_, part), level in self._levels.items() if part[0] == bricks)
        return next(known)[0].assembly

    def tilt(self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None) -> Floats:
        """Return the tilt that grip sets survive in every direction.

        Result (S, 2): between which values it lies, rad; NaN where it is not proven that the
        structure stands. As `seqopt.stability.assessment.Stability.tilt`.
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
            return sideways(bonded(assembly, self.mortar).fixed(), self.network.scene.up, count)

        grips = np.asarray(held)[rows], _of_rows(payload, rows)
        brackets = np.array(self._brackets(f"tilt {count}", pulls, bricks, grips))
        angles = 2 * np.pi * np.arange(count) / count
        known = np.where(np.isfinite(brackets[..., 0]), np.maximum(brackets[..., 0], 0.0), np.nan)
        least = np.nan_to_num(hulls(angles, known.T)[0])
        most = np.maximum(brackets[..., 1].min(axis=0), 0.0)
        return np.asarray(np.arctan(np.stack([least, most], axis=1)))

    def friction(
        self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None, step: float = 2.0**-7
    ) -> Floats:
        """Return the least coefficient of friction at the mortar's bond, by halving intervals.

        ``step``: how narrow the brackets shall be. Result (S, 2): between which values it lies;
        infinite above where none up to `ROUGHEST` is proven to be enough.
        """
        sets = np.asarray(held)
        out = np.tile([0.0, np.inf], (len(sets), 1))
        open_ = np.ones(len(sets), dtype=bool)

        def narrow_by(friction: float, rows: Ints) -> None:
            """Narrow the brackets of rows by verdicts at a friction."""
            if friction not in self.screens:
                mortar = replace(self.mortar, friction=friction)
                self.screens[friction] = Screen(self.network, mortar)
            found = self.screens[friction].stands(bricks, sets[rows], _of_rows(payload, rows))
            stand, fall = rows[found == STANDS], rows[found == FALLS]
            out[stand, 1] = np.minimum(out[stand, 1], friction)
            out[fall, 0] = np.maximum(out[fall, 0], friction)

        for friction in (0.0, 1.0, ROUGHEST):
            narrow_by(friction, np.arange(len(sets)))
        while True:
            open_ &= (out[:, 1] - out[:, 0] > step) & np.isfinite(out[:, 1])
            if not open_.any():
                return out
            middle = out.mean(axis=1)
            for friction in np.unique(middle[open_]).tolist():
                rows = np.flatnonzero(open_ & (middle == friction))
                before = out[rows]
                narrow_by(friction, rows)
                open_[rows] = (out[rows] != before).any(axis=1)

    def _least(self, name: str, cases: _Cases, bricks: int, grips: _Grips) -> Floats:
        """Return the brackets (S, 2) of a least z; infinite where none up to `CAP` is enough."""
        (bracket,) = self._brackets(name, cases, bricks, grips)
        return np.where(bracket[:, [0]] >= CAP, np.inf, bracket)

    def _brackets(self, name: str, cases: _Cases, bricks: int, grips: _Grips) -> list[Floats]:
        """Return the brackets (S, 2) of z of every case."""
        out: list[Floats] = []
        for rows, part, places, loads in held_parts(self.network, bricks, *grips):
            if (name, part) not in self._levels:
                assembly = node_assembly(self.network, bricks, held=part[1])
                self._levels[name, part] = tuple(
                    HeldStates(assembly, case, compile_held) for case in cases(assembly)
                )
            states = self._levels[name, part]
            out = out or [np.zeros((len(np.asarray(grips[0])), 2)) for _ in states]
            for each, own in zip(out, states, strict=True):
                each[rows] = own.bracket(places, loads, _narrow)
        return out


def _narrow(bracket: Floats) -> Bools:
    """Return which brackets (S, 2) of a margin have converged."""
    scale = np.maximum(1.0, np.where(np.isfinite(bracket[:, 0]), np.abs(bracket[:, 0]), 0.0))
    near = bracket[:, 1] - bracket[:, 0] <= GAP * scale
    return np.asarray(near | (bracket[:, 0] >= CAP))


def _of_rows(payload: ArrayLike | None, rows: Ints) -> ArrayLike | None:
    """Select the payloads of grip sets."""
    if payload is None or np.ndim(payload) < 2:
        return payload
    return np.asarray(payload)[rows]
