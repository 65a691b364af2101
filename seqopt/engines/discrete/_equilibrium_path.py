"""Settle a system of bodies on beds: Newton's method, and the load in steps where bonds break."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from seqopt.arrays import Bools, Floats, FrozenValue, frozen
from seqopt.engines.discrete._system import System
from seqopt.engines.interface import FAR

_ITERATIONS = 60
_BALANCED = 1e-10  # largest force left on a body, over the heaviest body's weight
_ROUNDING = 1e-13  # relative
_HIDDEN = 1e-4  # of the heaviest body's weight, that rounding may leave: else nothing rests
LARGEST_STEP, SMALLEST_STEP = 0.1, 1e-3  # of the load, once a bond breaks
_FIRST_RESISTANCE = 1.0  # resistance to motion at first, over the stiffness
_MOVES = 120  # against a resistance
_HALVINGS = 4
_LENT_STIFFNESS = 1e-12  # lent to every motion, over its own: a loose body can come to rest


@dataclass(frozen=True, eq=False, repr=False)
class Held(FrozenValue):
    """A system and what its grips do."""

    system: System
    free: sparse.csr_array  # (6n, m); motions that the grips leave
    pads: sparse.csr_array  # (6n, 6n); stiffness of soft grips
    far: Floats  # (6n,); how grips move the bodies that they hold, all the way
    pull: Floats  # (6n,); how soft grips pull at bodies that stay, all the way

    def moved(self, motion: Floats, share: float = 1.0) -> Floats:
        """Return how bodies move (6n,). ``motion`` (m,): in the free motions; ``share``: of it."""
        return np.asarray(self.free @ motion + share * self.far)

    def reaction(self, motion: Floats, force: Floats, share: float = 1.0) -> Floats:
        """Return what is not balanced on the bodies (6n,): what the grips must take.

        ``motion`` (m,): in the free motions; ``force`` (P, 3): of the points, N; ``share``: of the
        load, and of the ways of grips.
        """
        system, moved = self.system, self.moved(motion, share)
        carried = system.gap.T @ system.bed_wrenches(force).ravel()
        given = share * (system.load + self.pull)
        return np.asarray(given + carried - (system.layers + self.pads) @ moved)

    def openings(self, motion: Floats, share: float) -> Floats:
        """Return the openings (P, 3) of the points; as of `reaction`."""
        return self.system.openings(self.across @ motion + share * self._taken, share)

    @cached_property
    def _taken(self) -> Floats:
        return frozen(np.asarray(self.system.gap @ self.far))

    def rounding(self, motion: Floats, force: Floats) -> float:
        """Return what rounding leaves of a balance between large forces, N."""
        moved = np.abs(self.moved(motion))
        return _ROUNDING * float((self._sizes @ moved).max() + np.abs(force).sum())

    @cached_property
    def _sizes(self) -> sparse.csr_array:
        return frozen(sparse.csr_array(abs(self.system.layers) + abs(self.pads)))

    def gone(self, state: Settled) -> bool:
        """Return whether a state has moved too far for the bricks to be where they were."""
        return bool(np.abs(state.motion).max(initial=0.0) > FAR * self.system.length)

    def left_faces(self, state: Settled) -> bool:
        """Return whether joints that can open let a brick move by more than its length.

        It has then left the faces it stood on, and no residual below rounding counts.
        """
        return bool(state.broken.any() and np.abs(state.motion).max(initial=0) > self.system.length)

    @cached_property
    def across(self) -> sparse.csr_array:
        """Twists across the beds for the free motions, (6J, m)."""
        return frozen(sparse.csr_array(self.system.gap @ self.free))

    @cached_property
    def _unbroken(self) -> sparse.csr_array:
        """Stiffness of layers and soft grips in the free motions, (m, m)."""
        return frozen(sparse.csr_array(self.free.T @ (self.system.layers + self.pads) @ self.free))

    def stiffness(self, slope: Floats) -> sparse.csr_array:
        """Return the stiffness (m, m) in the free motions.

        ``slope`` (P, 3, 3): how fast the forces of the points fall, N/m.
        """
        across = self.across
        return sparse.csr_array(across.T @ self.system.beds(slope) @ across + self._unbroken)

    @cached_property
    def diagonal(self) -> Floats:
        """The diagonal of the unbroken stiffness in the free motions, (m,)."""
        points = self.system.points
        none = np.zeros((len(points.area), 3))
        _, slope = points.forces(none, none[:, 1:], np.zeros(len(none), bool))
        return frozen(np.asarray(self.stiffness(slope).diagonal()))


@dataclass(frozen=True, eq=False, repr=False)
class Settled(FrozenValue):
    """A state of the bodies.

    ``motion`` (m,): in the free motions; ``force`` (P, 3): of the points on second bodies, N;
    ``slip`` (P, 2); ``broken`` (P,); ``left``: largest force not balanced, over the heaviest body's
    weight or what rounding makes of it.
    """

    motion: Floats
    force: Floats
    slip: Floats
    broken: Bools
    left: float

    @classmethod
    def start(cls, held: Held, *, broken: bool) -> Settled:
        """Return the state without load. ``broken``: whether all bonds are lost at once."""
        none = np.zeros((len(held.system.points.area), 3))
        motion = np.zeros(held.free.shape[1])
        return cls(motion, none, none[:, 1:], np.full(len(none), broken), np.inf)

    @property
    def rests(self) -> bool:
        """Whether this is an equilibrium."""
        return self.left <= _BALANCED


def settle(held: Held) -> Settled:
    """Return where a structure comes to rest within all limits, or as far as it was followed.

    Where no bond breaks under the whole load at once, none would on the way to it: the limits are
    convex. Otherwise the load grows in steps, which shrink where none is found, and a bond once
    broken stays so.
    """
    points = held.system.points
    dry = points.mortar.tensile_strength == 0 and points.mortar.cohesion == 0
    state = _balance(held, Settled.start(held, broken=dry), 1.0)
    if dry or (state.rests and not points.exceeds(state.force).any()):
        return state
    state, at, step = Settled.start(held, broken=False), 0.0, LARGEST_STEP
    while at < 1.0:
        target = min(at + step, 1.0)
        found = _after_breaking(held, state, target)
        if found.rests:
            state, at, step = found, target, min(2 * step, LARGEST_STEP)
        elif step > SMALLEST_STEP:
            step /= 2
        else:
            return found
    return state


def _after_breaking(held: Held, state: Settled, share: float) -> Settled:
    """Return the state under a share of the load once no further bond breaks."""
    while True:
        found = _balance(held, state, share)
        breaks = held.system.points.exceeds(found.force) & ~found.broken
        if not found.rests or not breaks.any():
            return found
        state = replace(found, broken=found.broken | breaks)


def _balance(held: Held, state: Settled, share: float) -> Settled:
    """Return where a state moves to under a share of the load with the bonds it has.

    By Newton at once; else by letting the structure move against a resistance that fades
    (pseudo-transient continuation, Kelley and Keyes 1998), friction keeping track of every slip.
    """
    found = _newton(held, state, share, 0.0)
    state = replace(state, left=np.inf)
    resistance = _FIRST_RESISTANCE
    for _ in range(_MOVES):
        if found is not None and (found.rests or held.gone(found)):
            return replace(found, left=np.inf) if held.left_faces(found) else found
        found = _newton(held, state, share, resistance)
        if found is None:
            resistance *= 8
        else:
            state, resistance = found, resistance / 2
    return state


def _newton(held: Held, state: Settled, share: float, resistance: float) -> Settled | None:
    """Return where a state moves to against a resistance, over the stiffness of every motion."""
    system, motion, shorter = held.system, state.motion, 0
    drag = np.maximum(resistance, _LENT_STIFFNESS) * held.diagonal
    step, best = np.zeros_like(motion), np.inf
    for _ in range(_ITERATIONS):
        opening = held.openings(motion, share)
        force, slope = system.points.forces(opening, state.slip, state.broken)
        left = held.free.T @ held.reaction(motion, force, share)
        missing = left - resistance * held.diagonal * (motion - state.motion)
        size = np.linalg.norm(missing)
        rounding = min(held.rounding(motion, force), _HIDDEN * system.scale)
        unit = max(system.scale, rounding / _BALANCED)
        if np.abs(missing).max() <= _BALANCED * unit:
            slip = system.points.slipped(opening, force)
            return Settled(motion, force, slip, state.broken, float(np.abs(left).max() / unit))
        if size >= best and shorter < _HALVINGS:
            step *= 0.5
            motion, shorter = motion - step, shorter + 1
            continue
        best, shorter = float(size), 0
        step = splu((held.stiffness(slope) + sparse.diags_array(drag)).tocsc()).solve(missing)
        motion = motion + step
    return None
