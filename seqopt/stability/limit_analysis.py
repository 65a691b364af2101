"""Equilibrium with contact: what is asked of a solver, and the check of what it answers.

A case asks for the smallest or largest number z for which forces exist with::

    E f + G g + w + z w' = 0                          every block in equilibrium
    f_n + a (s + z s') >= 0                           tension cut-off at every corner
    |f_t| <= m f_n + a (c + z c')                     Coulomb with cohesion
    |g| <= p + z p'                                   robots' payloads

Forces that satisfy this prove one side. A motion of the blocks proves the other: where no contact
closes or slides without opening m times as fast, the load must not do more work than the contacts
and robots can take up (the kinematic theorem of limit analysis). Both are evaluated here, from
the assembly's own data; a solver's status is never the verdict.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Vector
from seqopt.contact.assembly import Assembly
from seqopt.errors import plugins

EXACT = 1e-6  # largest violation of an accepted proof, over the force scale and max(1, z)
GAP = 1e-3  # largest difference between the two proofs, relative to max(1, z)
ROUNDING = 1e-12  # work in a motion treated as zero, over the largest entry of the motion
LARGEST_FORCE = 10.0  # of a corner, over all loads and payloads: weight of motions that violate
_CLOSING = 1e-4  # by which a motion that proves may close a corner, over its largest entry
CAP = 1e5  # z is sought between 0 and this


class Sense(Enum):
    """Whether the smallest or the largest z is sought."""

    SMALLEST = 1.0
    LARGEST = -1.0


@dataclass(frozen=True, kw_only=True)
class Case:
    """The numbers of one question; strengths over the stress scale, forces over the force scale.

    ``tension``, ``cohesion``, ``payload``: value at z = 0 and growth with z. A payload is a
    multiple of every grip's own and an amount that all have in common; ``pull``: acceleration that
    grows with z, over that of gravity; ``applied``: multiple of what the assembly has applied
    beside the weights at z = 0, and its growth.
    """

    sense: Sense
    friction: float
    tension: tuple[float, float]
    cohesion: tuple[float, float]
    payload: tuple[float, float] = (1.0, 0.0)
    pull: Vector = (0.0, 0.0, 0.0)
    applied: tuple[float, float] = (1.0, 0.0)

    def loads(self, assembly: Assembly) -> tuple[Floats, Floats]:
        """Return all loads at z = 0 and their growth with z, (6B,), as of `Assembly.load`."""
        start, growth = assembly.load(), assembly.load(self.pull)
        if len(assembly.applied):
            start = start + self.applied[0] * assembly.applied_load
            growth = growth + self.applied[1] * assembly.applied_load
        return start, growth

    def amounts(self, assembly: Assembly) -> tuple[float, float]:
        """Return the sizes of all loads in sum at z = 0, and the growth of applied loads, N."""
        weight, applied = assembly.amounts
        return weight + self.applied[0] * applied, self.applied[1] * applied

    def fixed(self, z: float = 0.0) -> Case:
        """Return the case with strengths as they are at a z, which do not grow."""
        tension, cohesion = (part[0] + z * part[1] for part in (self.tension, self.cohesion))
        return replace(self, tension=(tension, 0.0), cohesion=(cohesion, 0.0))


class Claim(Enum):
    """How a solver says that it ended."""

    SOLVED = "solved"
    ALMOST = "almost solved"
    INFEASIBLE = "infeasible"
    STALLED = "stalled"


@dataclass(frozen=True, eq=False, repr=False)
class Answer(FrozenValue):
    """What a solver returns for a case.

    ``value``: z; NaN if there is none. ``contact_force`` (K, 3): normal part, compression positive,
    and tangential parts, over the force scale. ``grip_force`` (G, 3): over the force scale.
    ``motion`` (B, 6): of the blocks: translation and rotation times the length scale, of any size.
    """

    claim: Claim
    value: float
    contact_force: Floats
    grip_force: Floats
    motion: Floats


ATTEMPTS = 2  # of a case, with other settings of the solver each time, until one is proven

Program = Callable[[Case, int], Answer]
"""The cases of one assembly, solved one by one; the number of the attempt counts from 0."""

Compile = Callable[[Assembly], Program]
"""Makes the program of an assembly."""


def compile_equilibrium(assembly: Assembly) -> Program:
    """Return the registered program of an assembly (entry points ``seqopt.limit_analysis``)."""
    compiled: Compile = plugins("seqopt.limit_analysis")["socp"].load()
    return compiled(assembly)


def limits(
    assembly: Assembly, case: Case, z: float, own: Floats | None = None
) -> tuple[Floats, Floats, Floats]:
    """Return tension and cohesion (K,) and payloads (G,) borne at a z, over the force scale.

    Of what does not grow with z, contacts bear the share that they have of the mortar's bond.

    ``own`` (G,): payload of every grip, N; by default the assembly's.
    """
    share = assembly.corner_area * assembly.stress_scale / assembly.scales[0]
    own = assembly.payload if own is None else own
    payload = case.payload[0] * own / assembly.scales[0] + z * case.payload[1]
    bond = assembly.bond[assembly.contact] if len(assembly.bond) else 1.0
    tension, cohesion = (bond * part[0] + z * part[1] for part in (case.tension, case.cohesion))
    return share * tension, share * cohesion, payload


def violation(assembly: Assembly, case: Case, answer: Answer, own: Floats | None = None) -> float:
    """Return by how much the forces of an answer violate a case at most, over the force scale.

    Infinite where the answer is not finite, or of other shapes. ``own``: as of `limits`.
    """
    z, force, grip = answer.value, answer.contact_force, answer.grip_force
    if (force.shape, grip.shape) != ((len(assembly.corner), 3), (len(assembly.payload), 3)):
        return np.inf
    residual = assembly.contact_map @ force.ravel() + assembly.grip_map @ grip.ravel()
    start, growth = case.loads(assembly)
    residual += start + z * growth
    tension, cohesion, payload = limits(assembly, case, z, own)
    excess = (
        np.abs(residual),
        -force[:, 0] - tension,
        np.linalg.norm(force[:, 1:], axis=1) - case.friction * force[:, 0] - cohesion,
        np.linalg.norm(grip, axis=1) - payload,
    )
    worst = max(part.max(initial=0.0) for part in excess)
    return float(worst) if np.isfinite(worst) else np.inf


def is_finite(assembly: Assembly, answer: Answer) -> bool:
    """Return whether all numbers of an answer are finite, and as many as the assembly needs.

    What is not finite proves nothing: no comparison holds against it.
    """
    parts = answer.contact_force, answer.grip_force, answer.motion
    shapes = [(len(assembly.corner), 3), (len(assembly.payload), 3), (len(assembly.centroid), 6)]
    right = [part.shape for part in parts] == shapes
    return right and all(np.isfinite(part).all() for part in (answer.value, *parts))


def bound(assembly: Assembly, case: Case, answer: Answer) -> float:
    """Return the z that an answer's motion proves: none below (smallest) or above (largest) exists.

    A motion proves nothing, 0 or `CAP`, if the load does less work in it than is taken up, or if
    a corner closes by more than `_CLOSING`. Less than that is charged with a corner force of
    `LARGEST_FORCE` times the sum of weights, applied loads and payloads.
    """
    nothing = 0.0 if case.sense is Sense.SMALLEST else CAP
    if not is_finite(assembly, answer):
        return nothing
    size = np.frexp(np.abs(answer.motion).max())[1]  # a power of two: scaling by it is exact
    motion = np.ldexp(answer.motion, -size).ravel()
    at_grip = np.linalg.norm((assembly.grip_map.T @ motion).reshape(-1, 3), axis=1)
    contact, opening = contact_work(assembly, case, motion, (answer.value, 0.0, 1.0))
    loads, more = case.amounts(assembly)
    most = LARGEST_FORCE if -opening.min(initial=0.0) <= _CLOSING else np.inf
    closed = np.maximum(-opening, 0).sum()
    closing = most * (loads + assembly.payload.sum()) / assembly.scales[0] * closed
    _, low, high = (float(work + payload @ at_grip + closing) for work, payload in contact)
    by_load, by_growth = (float(load @ motion) for load in case.loads(assembly))
    start = by_load - low
    growth = by_growth - (high - low) - (most * more / assembly.scales[0] * closed if more else 0.0)
    if case.sense is Sense.SMALLEST:
        if not start > ROUNDING:
            return nothing
        return min(start / -growth, CAP) if growth < 0 else CAP
    return min(max(-start / growth, 0.0), CAP) if growth > 0 else nothing


def contact_work(
    assembly: Assembly, case: Case, motion: Floats, levels: tuple[float, ...]
) -> tuple[list[tuple[float, Floats]], Floats]:
    """Return the most work that contacts take up in a motion (6B,), for several z, with payloads.

    The share of the tension cut-off and of the cone's tip is the one that is best for the first.
    Beside it, by how much more than its sliding asks for every corner opens (K,).
    """
    parting = (assembly.contact_map.T @ motion).reshape(-1, 3)
    sliding = np.linalg.norm(parting[:, 1:], axis=1)
    opening = parting[:, 0] - case.friction * sliding
    borne = [limits(assembly, case, z) for z in levels]
    tip = case.friction * borne[0][0] > borne[0][1]
    taken = []
    for tension, cohesion, payload in borne:
        cut = np.where(tip, cohesion / (case.friction or 1.0), tension)
        taken.append((float(cohesion @ sliding + cut @ np.maximum(opening, 0)), payload))
    return taken, opening
