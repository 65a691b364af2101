"""Cases of one assembly, solved and proven without trusting the solver.

A pull sideways is survived or not: the pulls that are survived form a convex set: forces for two
pulls mix to forces for what lies between them. So what is survived in a few directions bounds from
below what is in all others.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Vector, frozen
from seqopt.contact.assembly import Assembly
from seqopt.stability.limit_analysis import (
    ATTEMPTS,
    CAP,
    EXACT,
    GAP,
    Answer,
    Case,
    Claim,
    Compile,
    Sense,
    bound,
    is_finite,
    limits,
    violation,
)

_HANDS = frozen(np.vstack([np.eye(3), -np.ones(3)]))


@dataclass(frozen=True, eq=False, repr=False)
class Proven(FrozenValue):
    """A number with its two proofs.

    ``value``: z of the case; inf if it is proven that none up to
    `seqopt.stability.limit_analysis.CAP` will do, NaN if nothing is proven. ``bound``: what the
    motion alone proves: no smaller z will do, or of a largest z no larger one. ``held``: what
    forces alone prove: a z that will do; NaN if nothing. ``answer``: what it rests on: forces and
    motion.
    """

    value: float
    bound: float
    held: float
    answer: Answer


class Prover:
    """Solves cases of one assembly and proves the answers; counts what the solver claims.

    ``claims``: how the solver ended by its own account, over all cases; ``unproven``: cases of
    which nothing was proven.
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


DIRECTIONS = 8  # in which an assembly is pulled sideways, evenly spread
FINE = 8 * DIRECTIONS  # where these leave open what a grip set survives
_ROUNDED = 1e-9  # share of half a turn that is rounding
_MORE = 8  # directions at most that are added where the bound for all others is least
NEAR = 5e-3  # share of the least pull by which the bound may fall short before any is added


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


def hulls(angles: Floats, pulls: Floats) -> tuple[Floats, Floats]:
    """Return the pull that is survived in every direction, by what is in some, and its angle.

    ``angles`` (F,), ``pulls`` (S, F): directions, rad, and what is survived there; NaN where that
    is not known. Results (S,), (S,): the least, and where it is; NaN if those known leave half of
    all directions out.

    Examples
    --------
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
