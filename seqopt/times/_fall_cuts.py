"""Lower bounds of waits for mortar: motions in which states fall unless joints have bond enough.

A motion of the blocks takes up work in joints in proportion to their bonds, and in grips. Where
loads do more, the state falls: an inequality on the bonds of its joints, of all states with as many
bricks at once. A set of motions gives a lower bound of every wait.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.mortar import Mortar
from seqopt.network.network import Network
from seqopt.stability._screens import node_assembly
from seqopt.stability.assessment import bonded
from seqopt.stability.limit_analysis import EXACT, LARGEST_FORCE, contact_work, limits
from seqopt.times._curing import JointsInTime


class _Cut(NamedTuple):
    """A motion: it makes fall where loads do more work than joints and grips take up.

    ``work``: of the loads; ``taken`` (j,): by joints with full bond; ``speed`` (2 b + 1,): of nodes
    and none; ``closing``: by which contacts close, weighted; ``needed``: work that is clearly some.
    """

    work: float
    taken: Floats
    speed: Floats
    closing: float
    needed: float


class FallCuts:
    """Motions of the partial structures of a scene whose mortar cures; each is checked when added.

    ``motions``: all of them, (b, 6) in m and rad.
    """

    def __init__(self, network: Network, mortar: Mortar, joints: JointsInTime) -> None:
        self._network, self._mortar, self.joints = network, mortar, joints
        self._cuts: dict[int, list[_Cut]] = {}
        self._loads: dict[int, tuple[float, float]] = {}  # a force, and the sum of loads over it
        self._known: dict[bytes, Floats] = {}

    @property
    def motions(self) -> tuple[Floats, ...]:
        """The motions that were added and prove something."""
        return tuple(self._known.values())

    def add(self, motion: Floats) -> bool:
        """Add a motion (b, 6), m and rad; return whether it is new and makes any state fall."""
        if not np.isfinite(motion).all() or not motion.any() or motion.tobytes() in self._known:
            return False
        cut = self._cut(motion)
        if not cut.work > cut.needed:
            return False
        self._known[motion.tobytes()] = motion
        self._cuts.setdefault(len(motion), []).append(cut)
        return True

    def _cut(self, motion: Floats) -> _Cut:
        bricks = len(motion)
        assembly = node_assembly(self._network, bricks)
        case = bonded(assembly, self._mortar)
        flat = (motion * np.repeat([1.0, assembly.scales[1]], 3)).ravel()
        flat = np.ldexp(flat, -np.frexp(np.abs(flat).max())[1])
        ((full, _), (more, _)), opening = contact_work(assembly, case, flat, (0.0, 1.0))
        parting = (assembly.contact_map.T @ flat).reshape(-1, 3)
        tension, cohesion, _ = limits(assembly, case, 0.0)
        tip = cohesion / case.friction if case.friction else np.full_like(tension, np.inf)
        corner = cohesion * np.linalg.norm(parting[:, 1:], axis=1)
        corner = corner + np.minimum(tension, tip) * np.maximum(opening, 0.0)
        taken = np.zeros(len(assembly.bodies))
        np.add.at(taken, assembly.contact, corner)
        work = float(case.loads(assembly)[0] @ flat)
        speed = np.linalg.norm((assembly.grip_map.T @ flat).reshape(-1, 3), axis=1)
        force = assembly.scales[0]
        self._loads[bricks] = force, case.amounts(assembly)[0] / force
        closing = LARGEST_FORCE * float(np.maximum(-opening, 0.0).sum())
        needed = EXACT * max(more - full, 0.0)
        return _Cut(work, taken, np.append(speed, 0.0), closing, needed)

    def fall(self, bricks: int, grips: tuple[Ints, Floats], bond: Floats) -> Bools:
        """Return which states (n,) are known to fall.

        ``grips``: nodes held (n, r), as places in build order from 1, zeros for none, and the
        largest force of each, N; ``bond`` (n, j): shares of bond.
        """
        held, payload = grips
        out = np.zeros(len(held), dtype=bool)
        for cut in self._cuts.get(bricks, ()):
            force, loads = self._loads[bricks]
            own = np.where(held > 0, payload, 0.0) / force
            left = cut.work - bond @ cut.taken - (own * cut.speed[held - 1]).sum(axis=1)
            left -= cut.closing * (loads + own.sum(axis=1))
            out |= left > cut.needed
        return out

    def starts(
        self, bricks: int, grips: tuple[Ints, Floats], placed: Floats, start: Floats
    ) -> Floats:
        """Return since when, no sooner than some times (n,), s, states are not known to fall.

        ``placed`` (n, b): when bricks were in their places. Result (n,): infinite where no wait is
        enough.
        """
        out = start.copy()
        if bricks not in self._cuts or not len(start):
            return out
        rows = np.flatnonzero(self._at(bricks, grips, placed, start))
        if not len(rows):
            return out
        own, placed = (grips[0][rows], grips[1][rows]), placed[rows]
        events = np.sort(self.joints.events(bricks, placed), axis=1)
        low = (events <= start[rows, None]).sum(axis=1) - 1  # falls there
        high = np.isfinite(events).sum(axis=1)  # after the last that there is
        while (left := np.flatnonzero(high - low > 1)).size:
            middle = (low[left] + high[left]) // 2
            times = events[left, middle]
            falls = self._at(bricks, (own[0][left], own[1][left]), placed[left], times)
            low[left[falls]], high[left[~falls]] = middle[falls], middle[~falls]
        ends = np.pad(events, ((0, 0), (0, 1)), constant_values=np.inf)
        out[rows] = ends[np.arange(len(rows)), high]
        return out

    def _at(self, bricks: int, grips: tuple[Ints, Floats], placed: Floats, times: Floats) -> Bools:
        return self.fall(bricks, grips, self.joints.at(bricks, times, placed))


class CuringStates(NamedTuple):
    """What states of a build in time ask of mortar that cures.

    ``floor``: lower bound of waits, as of `FallCuts.starts`; ``bricks`` (n,): that stand; ``held``,
    ``payload`` (n, r): the grips, as of `FallCuts`; ``full`` (b,): at which age all joints that a
    brick closes have their full bond, s; ``placed`` (b,): when bricks that stand at first were in
    their places, s, zero of others.
    """

    floor: Callable[[int, tuple[Ints, Floats], Floats, Floats], Floats]
    bricks: Ints
    held: Ints
    payload: Floats
    full: Floats
    placed: Floats

    def starts(self, state: Ints, placed: Floats, start: Floats) -> Floats:
        """Return from when on, no sooner than times (k,), s, states may begin, for all known.

        ``placed`` (k, b): when bricks were in their places; that which a step places counts then.
        """
        out = start.copy()
        for bricks in np.unique(self.bricks[state]).tolist():
            rows = np.flatnonzero(self.bricks[state] == bricks)
            if bricks:
                grips = self.held[state[rows]], self.payload[state[rows]]
                out[rows] = self.floor(bricks, grips, placed[rows], start[rows])
        return out
