"""Builds whose mortar cures: bond of joints over time, and from when on a state stands.

A joint's age counts from the end of the step that places the brick which closes it. Bonds only
grow, so a state that stands with what its joints have when it begins stands while it lasts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.assembly import PartialAssemblies, _contact_at
from seqopt.contact.mortar import Mortar
from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.sequence.steps import AnyStep, Grips, Step, StepKind
from seqopt.stability._screens import node_assembly
from seqopt.stability._steps import VerdictChain
from seqopt.stability.assessment import _verdict_of, bonded
from seqopt.stability.limit_analysis import EXACT, LARGEST_FORCE, contact_work, limits
from seqopt.stability.standing import Standing
from seqopt.stability.verdict import Verdict
from seqopt.times._curing_law import Curing

SLACK = 1e-9  # of a time: ages this much short of a point count as there


class JointsInTime:
    """The joints of a scene, and which share of its bond each has when.

    ``names`` (J,): in the order of contacts; ``closing`` (J,): index, in build order, of the brick
    that closes it; ``ages``, ``shares`` (k,): what is reached when; ``full`` (b,): at which age all
    joints that a brick closes have their full bond, s.
    """

    def __init__(self, network: Network, curing: Curing) -> None:
        springs = network.springs
        self.names = tuple(
            _contact_at(network, i)[0] for i in springs.acting(len(network.inner)).tolist()
        )
        self.closing = np.asarray(springs.since[springs.acting(len(network.inner))] - 1)
        self.ages, self.shares = np.array(curing.points).reshape(-1, 2).T
        self.full = np.zeros(len(network.inner))
        self.full[self.closing] = self.ages.max(initial=0.0)

    def count(self, bricks: int) -> int:
        """Return how many joints so many bricks have."""
        return int(np.searchsorted(self.closing, bricks))

    def at(self, bricks: int, time: Floats, placed: Floats) -> Floats:
        """Return the shares of bond (n, j) that joints have at times (n,), s.

        ``placed`` (n, b): when bricks were in their places; that which a step places counts as
        placed with it.
        """
        count = self.count(bricks)
        since = placed[:, self.closing[:count]]
        age = np.maximum(time[:, None] - since, 0.0) + SLACK * np.abs(time[:, None])
        reached = (age[:, :, None] >= self.ages).sum(axis=2)
        return np.asarray(np.append(0.0, self.shares)[reached])

    def events(self, bricks: int, placed: Floats) -> Floats:
        """Return when joints reach points, (n, j * k), s; see `at`."""
        count = self.count(bricks)
        since = placed[:, self.closing[:count]]
        return np.asarray((since[:, :, None] + self.ages).reshape(len(placed), -1))


Waits = Callable[[AnyStep, Sequence[float], float], tuple[float, str]]
"""Says from when on, no sooner than a time, a step may be done after bricks were in their places at
some times, and for which joint it waits; empty if for none."""


class CuringBuilds:
    """Proven earliest times at which states stand with the bonds that their joints then have."""

    def __init__(self, network: Network, mortar: Mortar, curing: Curing) -> None:
        self.network, self.joints = network, JointsInTime(network, curing)
        self._parts = PartialAssemblies(network, len(network.inner))
        self._bond = np.zeros(0)
        self._chain = VerdictChain(
            lambda bricks, grips: self._parts(bricks, grips).with_bond(self._bond), mortar
        )
        self._found: dict[tuple[int, Grips, bytes], tuple[Verdict, Floats | None]] = {}

    def verdict(self, bricks: int, grips: Grips, bond: Floats) -> tuple[Verdict, Floats | None]:
        """Return whether a state stands with shares of bond (j,), and in which motion it falls.

        The motion (b, 6) is in m and rad; None where it does not fall.
        """
        key = bricks, grips, bond.tobytes()
        if key not in self._found:
            self._bond = bond
            assembly, proven, _ = self._chain(bricks, grips)
            found, motion = _verdict_of(proven), None
            if found is Verdict.FALLS:
                scales = np.repeat([1.0, assembly.scales[1]], 3)
                motion = np.asarray(proven.answer.motion / scales)
            self._found[key] = found, motion
        return self._found[key]

    def waits(self, step: AnyStep, placed: Sequence[float], start: float) -> tuple[float, str]:
        """Return from when on the state of a step stands, no sooner than at a time, s.

        ``placed``: when bricks were in their places, in build order. Beside it the joint whose bond
        was the last that was missing, empty if none was; never, if no wait is enough. Raises
        `StepError` if the step takes a brick away.
        """
        if step.kind is StepKind.REMOVE:
            raise StepError(f"step {step.number} takes a brick away: curing is of builds alone")
        bricks, rows = step.bricks, np.full((1, step.bricks), np.inf)
        rows[0, : len(placed[:bricks])] = placed[:bricks]
        if self._stands(step, start, rows):
            return start, ""
        events = self.joints.events(bricks, rows)[0]
        times = np.unique(events[np.isfinite(events) & (events > start)])
        low, high = -1, len(times)
        if high and self._stands(step, float(times[-1]), rows):
            high -= 1
        while high - low > 1 and high < len(times):
            middle = (low + high) // 2
            low, high = (low, middle) if self._stands(step, times[middle], rows) else (middle, high)
        if high == len(times):
            return np.inf, ""
        joint = int(np.flatnonzero(events == times[high])[0]) // len(self.joints.ages)
        return float(times[high]), self.joints.names[joint]

    @property
    def motions(self) -> tuple[Floats, ...]:
        """The motions (b, 6) in which states were found to fall, m and rad."""
        return tuple(motion for _, motion in self._found.values() if motion is not None)

    def _stands(self, step: AnyStep, time: float, placed: Floats) -> bool:
        bond = self.joints.at(step.bricks, np.array([time]), placed)[0]
        assert isinstance(step, Step)  # of a plan: no grip is open
        return self.verdict(step.bricks, step.grips, bond)[0] is Verdict.STANDS


def mortar_waits(network: Network, standing: Standing | None) -> Waits | None:
    """Return the waits of steps for mortar, as a function; None where none cures."""
    if standing is None or standing.curing is None:
        return None
    return CuringBuilds(network, standing.mortar, standing.curing).waits


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
