"""Stability of the states of a free schedule: the requirement, and verdicts of grip sets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from math import degrees, pi, radians
from operator import le
from typing import Any

import numpy as np

from seqopt._registry import Later, required
from seqopt.arrays import Bools, Floats, Ints, KnownRows
from seqopt.contact.mortar import (
    DRY,
    Mortar,
    _mortar_name,
    _with_friction,
    _with_mortar,
    bond_mortar,
    find_mortar,
)
from seqopt.errors import ProblemError
from seqopt.network.network import Network
from seqopt.scene._checks import settle, short
from seqopt.stability.verdict import ASSESSED, FALLS, OPEN, STANDS

SCREENS = Later("seqopt.stability._screens")  # where states must stand

MARGINS = ASSESSED[:3]
"""Margins of stability that goals minimize: the least bond (Pa, in tension, with that times
1 + friction as cohesion), the least coefficient of friction, and the difference of a right angle
and the critical tilt (rad)."""
TILTS = 2048  # steps of a right angle, to which the tilt of a state is found
STEP = pi / 2 / TILTS  # rad
NARROW = 0.02
"""Relative width within which a margin is proven: of a bond, a friction, the critical tilt."""
_LEAST = {"bond": 0.0, "friction": 1e-4, "tilt": 1e-4}  # within which one is that is hardly any


@dataclass(frozen=True)
class Standing:
    """The demand that every state of a schedule is proven to stand, robots within payload.

    ``mortar``: of all joints; or its name; ``tilt``: that every state must survive in every
    direction, rad; ``curing``: which share of its bond mortar has at an age, a
    `seqopt.times.Curing` or its words, by default all at once. Where nobody asks for time, all wait
    until it has cured.

    >>> Standing("dry").described()["tilt_deg"]
    0.0
    """

    mortar: Mortar = field(default=DRY)
    tilt: float = 0.0
    curing: Any = None

    def __post_init__(self) -> None:
        settle(self, mortar=find_mortar(self.mortar))
        if self.curing is not None:  # mortar that never cures, or at once, is another mortar
            curing, mortar = required("find_curing")(self.curing), self.mortar
            mortar = mortar if curing.points else Mortar(friction=mortar.friction)
            bonded = mortar.tensile_strength or mortar.cohesion
            bonded = bonded and curing.points[:1] != ((0.0, 1.0),)  # not all of it from the first
            settle(self, mortar=mortar, curing=curing if bonded else None)
        if self.curing is not None and self.tilt:
            raise ProblemError("tilt: it is not modeled while mortar cures; leave one of them out")
        if not (isinstance(self.tilt, int | float) and 0 <= self.tilt < pi / 2):
            raise ProblemError(f"tilt {short(self.tilt)}: give an angle from 0 to below pi/2, rad")

    @classmethod
    def of(cls, given: Standing | Mortar | str | None) -> Standing | None:
        """Return a requirement that is given as such, or by its mortar."""
        return given if isinstance(given, Standing | None) else cls(find_mortar(given))

    def demanding(self, name: str, value: float) -> Standing:
        """Return the requirement of one margin alone, no worse than a value as goals count it."""
        if name == "tilt":
            return Standing(self.mortar, max(0.0, pi / 2 - value))
        if name == "friction":
            return Standing(replace(self.mortar, friction=value))
        return Standing(bond_mortar(value, self.mortar.friction))

    def _implies(self, other: Standing) -> bool:
        """Return whether this requirement implies another one."""
        stronger = map(le, astuple(self.mortar), astuple(other.mortar))
        return all(stronger) and self.tilt >= other.tilt

    @property
    def said(self) -> str:
        """The requirement in words.

        >>> Standing("dry").said, Standing("epoxy", tilt=0.05).said
        ('dry', 'with epoxy, tilted by 2.86°')
        """
        tilted = f", tilted by {degrees(self.tilt):.3g}°" if self.tilt else ""
        return f"{_with_mortar(_mortar_name(self.mortar))}{tilted}"

    def described(self) -> dict[str, float | str]:
        """Return the requirement, ready for JSON: strengths in Pa, tilt in degrees."""
        return {
            "friction": self.mortar.friction,
            "tensile_strength_Pa": self.mortar.tensile_strength,
            "cohesion_Pa": self.mortar.cohesion,
            "tilt_deg": degrees(self.tilt),
            **({} if self.curing is None else {"curing": str(self.curing)}),
        }


class StandingSets:
    """Cached verdicts and margins of the grip sets of a scene.

    ``standing``: whose mortar the margins are of; ``payloads`` (k,): all that robots may have, N;
    ``demands``: all requirements that a grip set has to meet; by default the one; ``undecided``:
    how many grip sets were neither proven to stand nor to fall.
    """

    def __init__(
        self,
        network: Network,
        standing: Standing,
        payloads: Floats,
        demands: Sequence[Standing] = (),
    ) -> None:
        self._payloads = np.unique(payloads)
        if not np.isfinite(self._payloads).all():
            raise ProblemError(
                "a robot without a largest force holds up anything, and says nothing of what "
                "stands; give it a payload, or a limit on its force, and keep payloads"
            )
        every = dict.fromkeys(demands or (standing,))
        implied = {one for one in every for other in every if other != one and other._implies(one)}
        self._demands = demands = tuple(one for one in every if one not in implied)
        self._network, self._mortar = network, standing.mortar
        self._proofs, self._others = SCREENS.Proofs(), list[StandingSets]()
        self._screens = self._screened()
        self._margins = SCREENS.Margins(network, standing.mortar)
        self._tilts_known: dict[int, Any] = {}
        self._known: Mapping[str, KnownRows] = {name: KnownRows() for name in ("", *MARGINS)}
        self._most = 1 + 2 * len(network.inner)
        self.undecided = 0

    def _screened(self) -> list[Any]:
        proofs = self._proofs
        return [
            SCREENS.Screen(self._network, demand.mortar, demand.tilt, proofs=proofs)
            for demand in self._demands
        ]

    def share(self, other: StandingSets) -> None:
        """Share proofs with other sets of the same scene, under other requirements, from now on.

        What stands with more stands with less; forces and motions of one are tried for all.
        """
        self._proofs, self._others = other._proofs, other._others
        self._others.append(self)
        self._proofs.keeps = True
        self._screens, self._tilts_known = self._screened(), {}

    @property
    def looked_at(self) -> int:
        """Number of grip sets with a verdict."""
        return self._known[""].count

    @property
    def programs(self) -> int:
        """Number of linear programs solved."""
        found: int = self._screens[0].solved + self._margins.solved
        return found

    def stand(self, bricks: int, held: Ints, payload: Floats) -> Bools:
        """Return which grip sets are proven to stand.

        ``held`` (S, r): nodes held, ascending, as places in build order counted from 1; zeros for
        none; ``payload`` (S, r): largest force of each, N. Result (S,).
        """
        return np.asarray(self._verdicts(bricks, held, payload) == STANDS)

    def may_stand(self, bricks: int, held: Ints, payload: Floats) -> Bools:
        """Return which grip sets are not proven to fall, (S,); see `stand`."""
        return np.asarray(self._verdicts(bricks, held, payload) != FALLS)

    def recalled(self, bricks: int, held: Ints, payload: Floats) -> Ints:
        """Return verdicts that known proofs imply, (S,): 1 stands, -1 falls, 0 open."""
        if not bricks:
            return np.full(len(held), STANDS)
        found = [screen.stands(bricks, held, payload, solve=False) for screen in self._screens]
        return np.asarray(np.min(found, axis=0))

    def _verdicts(self, bricks: int, held: Ints, payload: Floats) -> Floats:
        if not bricks:  # the empty site, where a take-down ends
            return np.full(len(held), float(STANDS))
        codes = self._codes(held, payload)

        def verdicts(rows: Ints) -> Floats:
            found = np.full(len(rows), np.nan)
            for other in self._others:  # what verdicts under other requirements imply
                known = other._known[""].known(bricks, codes[rows])
                for one, weaker, verdict in ((other, self, STANDS), (self, other, FALLS)):
                    if all(any(d._implies(w) for d in one._demands) for w in weaker._demands):
                        found[known == verdict] = verdict
            if len(new := np.flatnonzero(np.isnan(found))):
                grips = bricks, held[rows[new]], payload[rows[new]]
                found[new] = np.min([screen.stands(*grips) for screen in self._screens], axis=0)
            self.undecided += int(((found != STANDS) & (found != FALLS)).sum())
            return found[:, None]

        return self._known[""].of(bricks, codes, verdicts)[:, 0]

    def margins(self, name: str, bricks: int, held: Ints, payload: Floats) -> Floats:
        """Return brackets (S, 2) of the margins of grip sets, as goals count them."""

        def brackets(rows: Ints) -> Floats:
            margin = self._tilts if name == "tilt" else getattr(self._margins, name)
            return np.asarray(margin(bricks, held[rows], payload[rows]))

        return self._known[name].of(bricks, self._codes(held, payload), brackets)

    def _tilts(self, bricks: int, held: Ints, payload: Floats) -> Floats:
        """Return brackets (S, 2), rad, of a right angle less the critical tilt, by bisection."""
        low, fallen = np.full(len(held), -1), np.full(len(held), TILTS)
        ends = []
        for least in (STANDS, OPEN):  # what is proven to stand, then what may
            high = fallen.copy()
            while (left := high - low > 1).any():
                middle = np.where(low < 0, 0, (low + high) // 2)
                for step in np.unique(middle[left]).tolist():
                    rows = np.flatnonzero(left & (middle == step))
                    if step not in self._tilts_known:
                        self._tilts_known[step] = SCREENS.Screen(
                            self._network, self._mortar, step * STEP, proofs=self._proofs
                        )
                    found = self._tilts_known[step].stands(bricks, held[rows], payload[rows])
                    low[rows[found >= least]] = step
                    high[rows[found < least]] = step
                    fallen[rows[found == FALLS]] = step
            ends.append(low.copy())
        survived = np.where(ends[0] < 0, -np.inf, ends[0] * STEP)
        return np.stack([pi / 2 - fallen * STEP, pi / 2 - survived], axis=1)

    def _codes(self, held: Ints, payload: Floats) -> Ints:
        kinds = np.where(held > 0, np.searchsorted(self._payloads, payload), 0)
        codes = np.zeros(len(held), dtype=np.int64)
        for nodes, kind in zip(held.T, kinds.T, strict=True):
            codes = (codes * self._most + nodes) * len(self._payloads) + kind
        return codes


def counted(every: Iterable[StandingSets]) -> dict[str, int]:
    """Return how many verdicts were asked of grip sets, what they took, and how many are open."""
    sets, names = [*every], ("looked_at", "programs", "undecided")
    return {name: sum(getattr(each, name) for each in sets) for name in names}


def _size(name: str, value: float) -> float:
    """Return the size of one of `MARGINS`, for relative gaps: of a tilt the critical tilt."""
    return abs(pi / 2 - value if name == "tilt" else value)


def slack(name: str, value: float) -> float:
    """Return the width within which one of `MARGINS` is proven."""
    return max(NARROW * _size(name, value), _LEAST[name])


def find_standing(
    *,
    stands: str | None = None,
    friction: float | None = None,
    tilt: float | None = None,
    curing: Sequence[str] = (),
) -> Standing | None:
    """Return the demand that every state stands, None if there is none.

    Parameters
    ----------
    stands : str
        Every state must be proven to stand, robots within payload: dry, epoxy or bond=STRENGTH
        (Pa).
    friction : float
        With ``stands``: coefficient of friction.
    tilt : float
        With ``stands``: tilt that every state must survive.
    curing : sequence of str
        With ``stands``: which share of its bond mortar has at an age: 15min (in proportion, full
        then), 0s=0.005,5min=0.4,15min=1 (what is reached when), never.
        What is let go waits for it (default: full at once).
    """
    words = {"tilt": tilt, "friction": friction, "curing": curing}
    names = [name for name, value in words.items() if value not in (None, ())]
    if stands is None:
        if names:
            usual = "epoxy" if names[0] == "curing" else "dry"
            raise ProblemError(f"--{names[0]}: it goes with --stands; give --stands {usual}, say")
        return None
    mortar = find_mortar(stands, "stands")
    mortar = mortar if friction is None else _with_friction(mortar, friction)
    if tilt is not None and not tilt < 90:
        raise ProblemError(f"--tilt {tilt:g}: give an angle from 0 to below 90 degrees")
    return Standing(mortar, radians(tilt or 0.0), " ".join(curing) if curing else None)
