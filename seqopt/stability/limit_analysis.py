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

The pulls sideways that are survived form a convex set: forces for two pulls mix to forces for what
lies between them. So what is survived in a few directions bounds from below what is in all others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Vector, frozen
from seqopt.contact.assembly import Assembly
from seqopt.errors import plugins

EXACT = 1e-6  # largest violation of an accepted proof, over the force scale and max(1, z)
GAP = 1e-3  # largest difference between the two proofs, relative to max(1, z)
ROUNDING = 1e-12  # work in a motion treated as zero, over the largest entry of the motion
LARGEST_FORCE = 10.0  # of a corner, over all loads and payloads: weight of motions that violate
_CLOSING = 1e-4  # by which a motion that proves may close a corner, over its largest entry
CAP = 1e5  # z is sought between 0 and this
_HANDS = frozen(np.vstack([np.eye(3), -np.ones(3)]))
DIRECTIONS = 8  # in which an assembly is pulled sideways, evenly spread
FINE = 8 * DIRECTIONS  # where these leave open what a grip set survives
_ROUNDED = 1e-9  # share of half a turn that is rounding
_MORE = 8  # directions at most that are added where the bound for all others is least
_TRIED = 8  # pulls at most, until one is near the largest that is survived beside loads
NEAR = 5e-3  # share of the least pull by which the bound may fall short before any is added


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

    Of what does not grow, contacts bear their share of bond; ``own`` (G,): payloads, N.
    """
    share = assembly.corner_area * assembly.stress_scale / assembly.scales[0]
    own = assembly.payload if own is None else own
    payload = case.payload[0] * own / assembly.scales[0] + z * case.payload[1]
    bond = assembly.bond[assembly.contact] if len(assembly.bond) else 1.0
    tension, cohesion = (bond * part[0] + z * part[1] for part in (case.tension, case.cohesion))
    return share * tension, share * cohesion, payload


def violation(assembly: Assembly, case: Case, answer: Answer, own: Floats | None = None) -> float:
    """Return by how much an answer's forces violate a case, over the force scale, or inf."""
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
    """Return whether an answer is finite and of the assembly's shapes; else it proves nothing."""
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


@dataclass(frozen=True, eq=False, repr=False)
class Proven(FrozenValue):
    """A number with its two proofs.

    ``value``: z of the case; inf if it is proven that none up to `CAP` will do, NaN if nothing is
    proven; ``bound``: what the motion alone proves: no smaller z will do, or no larger one of a
    largest z; ``held``: what forces alone prove: a z that will do, or NaN; ``answer``: both.
    """

    value: float
    bound: float
    held: float
    answer: Answer


class Prover:
    """Solves cases of one assembly and proves the answers.

    ``claims``: how the solver ended by its own account; ``unproven``: cases without proof.
    """

    def __init__(self, assembly: Assembly, compiled: Compile) -> None:
        self.assembly = assembly
        self.claims: Counter[Claim] = Counter()
        self.unproven = 0
        self._compile, self._program = compiled, compiled(assembly)

    def __call__(self, case: Case) -> Proven:
        """Return the proven answer of a case."""
        held, best = np.nan, np.fmin if case.sense is Sense.SMALLEST else np.fmax
        for attempt in range(ATTEMPTS):
            answer = self._program(case, attempt)
            self.claims[answer.claim] += 1
            size, own = max(1.0, abs(answer.value)), np.nan  # z, if forces alone prove it
            if is_finite(self.assembly, answer):
                exact = violation(self.assembly, case, answer) <= EXACT * size
                own = max(answer.value, 0.0) if exact else np.nan
            held, proven = float(best(held, own)), bound(self.assembly, case, answer)
            value = own if abs(answer.value - proven) <= GAP * size else np.nan
            if answer.claim is Claim.INFEASIBLE or not np.isnan(value):
                break
        if np.isnan(value) and case.sense is Sense.SMALLEST and answer.claim is Claim.INFEASIBLE:
            answer = self._refuted(case)
            value = proven = np.inf if answer.value > EXACT else np.nan
        self.unproven += bool(np.isnan(value))
        return Proven(value, proven, held, answer)

    def _refuted(self, case: Case) -> Answer:
        """Return the answer at the largest z, with the weakest external support of every block.

        If these are needed there, no z will do. The value is what the motion proves they must bear.
        """
        assembly = self.assembly
        blocks = len(assembly.centroid)
        payload = limits(assembly, case, CAP)[2] * assembly.scales[0]
        reach = assembly.centroid[:, None] + assembly.scales[1] * _HANDS
        helped = replace(
            assembly,
            grip_block=np.concatenate([assembly.grip_block, np.repeat(np.arange(blocks), 4)]),
            grip_position=np.concatenate([assembly.grip_position, reach.reshape(-1, 3)]),
            payload=np.concatenate([payload, np.zeros(4 * blocks)]),
        )
        strongest = replace(case.fixed(CAP), payload=(1.0, 1.0))
        answer = self._compile(helped)(strongest, 0)
        self.claims[answer.claim] += 1
        known = is_finite(helped, answer)
        return replace(answer, value=bound(helped, strongest, answer) if known else np.nan)


def sideways(fixed: Case, up: Vector, count: int = DIRECTIONS) -> list[Case]:
    """Return the cases of the largest sideways acceleration in directions, evenly spread.

    ``fixed``: whose strengths do not grow with z; ``up``: unit vector against gravity.
    """
    return [_pulled(fixed, up, angle) for angle in 2 * np.pi * np.arange(count) / count]


def safe_pull(prove: Prover, fixed: Case, up: Vector) -> tuple[list[Proven], float]:
    """Return the largest sideways accelerations, and one that is survived in every direction.

    Where the bound is least a direction is added, until it falls short of the least pull found by
    no more than `NEAR`, or `_MORE` have been. Results: ``pulls``: of `sideways`, then of the
    directions added; ``worst``: NaN if forces prove too few.
    """
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    pulls = [prove(case) for case in sideways(fixed, up)]
    while True:
        held = np.array([pull.held for pull in pulls])
        (worst,), (angle,) = (each.tolist() for each in hulls(angles, held[None]))
        short = worst < (1 - NEAR) * np.fmin.reduce(held)
        if not short or len(pulls) == DIRECTIONS + _MORE or np.isnan(held[DIRECTIONS:]).any():
            return pulls, worst
        angles = np.append(angles, angle)
        pulls.append(prove(_pulled(fixed, up, angle)))


def turned(fixed: Case, pull: float) -> Case:
    """Return the loads of a turn by atan(pull), over the share of gravity that is left upright.

    Loads beside gravity do not turn: they count as much more as that share is less.
    """
    return replace(fixed, applied=(float(np.hypot(1.0, pull)), 0.0))


def safe_turn(prove: Prover, fixed: Case, up: Vector) -> tuple[list[Proven], float]:
    """Return what `safe_pull` does, and beside loads a pull that is survived as a `turned` case.

    Its value is sought between those that are survived so and those that are not.
    """
    pulls, worst = safe_pull(prove, fixed, up)
    if np.isnan(worst) or not len(prove.assembly.applied):
        return pulls, worst
    safe, value = 0.0, worst
    for _ in range(_TRIED):
        _, again = safe_pull(prove, turned(fixed, value), up)
        safe = value if again >= value else safe
        if value <= again <= (1 + GAP) * value:
            break
        value = again if again > safe else float(np.tan(0.5 * np.arctan([safe, value]).sum()))
    return pulls, safe


def hulls(angles: Floats, pulls: Floats) -> tuple[Floats, Floats]:
    """Return the pull that is survived in every direction, by what is in some, and its angle.

    ``angles`` (F,), ``pulls`` (S, F): directions, rad, and what is survived there, or NaN. Results
    (S,), (S,): the least, and where; NaN if those known leave half of all directions out.

    >>> pull, angle = hulls(np.pi / 2 * np.arange(4), np.array([[1.0, 1, 3, 3]]))
    >>> round(float(pull[0]), 4), round(float(angle[0]), 4)
    (0.7071, 0.7854)
    """
    order, count = np.argsort(angles), len(angles)
    angles, pulls = angles[order], pulls[:, order]
    known, way = np.isfinite(pulls), np.arange(count)
    after = np.where(np.hstack([known, known]), np.arange(2 * count), 2 * count)
    after = np.minimum.accumulate(after[:, ::-1], axis=1)[:, ::-1][:, 1 : count + 1]
    ends = np.where(known, pulls, 0.0)[..., None] * np.stack([np.cos(angles), np.sin(angles)], 1)
    along = np.take_along_axis(ends, (after % count)[..., None], axis=1) - ends
    size = np.maximum(np.square(along).sum(axis=2), np.finfo(float).tiny)
    nearest = ends + np.clip(-(ends * along).sum(axis=2) / size, 0.0, 1.0)[..., None] * along
    distance = np.where(known, np.linalg.norm(nearest, axis=2), np.inf)
    worst = distance.argmin(axis=1)[:, None]
    turn = angles[after % count] + 2 * np.pi * (after >= count) - angles[way]
    half = np.where(known, turn, 0.0).max(axis=1, initial=0.0) >= np.pi * (1 - _ROUNDED)
    unsure = half | (known.sum(axis=1) < 3)
    x, y = np.take_along_axis(nearest, worst[..., None], axis=1)[:, 0].T
    least = np.take_along_axis(distance, worst, axis=1)[:, 0]
    where = np.arctan2(y, x) % (2 * np.pi)
    return np.where(unsure, np.nan, least), np.where(unsure, np.nan, where)


def horizontal(up: Vector, angle: float) -> Floats:
    """Return the unit vector (3,) at right angles to one in a direction, rad."""
    axis = np.array(up)
    first = np.eye(3)[np.abs(axis).argmin()]
    first = first - axis * (axis @ first)
    first /= np.linalg.norm(first)
    return np.asarray(np.cos(angle) * first + np.sin(angle) * np.cross(axis, first))


def _pulled(fixed: Case, up: Vector, angle: float) -> Case:
    """Return the case of the largest acceleration in a direction."""
    x, y, z = horizontal(up, angle).tolist()
    return replace(fixed, sense=Sense.LARGEST, pull=(x, y, z))
