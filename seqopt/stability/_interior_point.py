"""Forces that hold an assembly, or a motion in which it falls, sought by an interior-point method.

All that contacts and grips can bear is raised by the same force t, which is made small::

    minimize    t
    subject to  E f + w = 0                        every block in equilibrium
                s = h + G f + t (1, 0, 0, 0)       a cone for what every corner and grip bears

over second-order cones of four numbers, in which the first is no less than the others' length.
Forces f hold as soon as t is not positive, and the multipliers of the first line are a motion in
which it falls as soon as they prove a positive t, so few rounds are needed: an answer is offered
after each. It proves nothing by itself.

Primal-dual method with the scaling of Nesterov and Todd and Mehrotra's predictor, as Vandenberghe
(2010) writes it down, "The CVXOPT linear and quadratic cone program solvers".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from seqopt.arrays import Bools, Floats
from seqopt.contact.assembly import Assembly
from seqopt.stability.limit_analysis import Answer, Case, Claim, limits

ROUNDS = 25  # at most; most structures need two to eight
_FLIP = np.array([1.0, -1.0, -1.0, -1.0])
_MIRROR = np.diag(_FLIP)
_SHARE = 0.95  # of the way to the edge of the cones that is gone in a round
_STUCK = 1e-3  # share of a step so small that further rounds lead nowhere
_ROUNDED = 1e-12  # share of a square by which a difference may be negative from rounding
_FARTHEST = 1e3  # share of a step that counts as no limit
_REGULAR = 1e-13  # of the largest entry, added to all on the diagonal: blocks may be loose
_DONE = 1e-8  # t that counts as none, over the force scale
_ROOM = 0.1  # by which t starts above what the first forces need, over the force scale

_Solve = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class _Point:
    """Forces f (N, 3), t, s (C, 4), the motion (6B,) and the cones' multipliers (C, 4)."""

    force: Floats
    raised: float
    slack: Floats
    motion: Floats
    press: Floats


class Part(NamedTuple):
    """What of an assembly changes: other blocks stay where they are, other corners as they press.

    ``blocks`` (B,), ``corners`` (K,), ``grips`` (G,): which; ``kept`` (K, 3): what others bear,
    over the force scale.
    """

    blocks: Bools
    corners: Bools
    grips: Bools
    kept: Floats


def _whole(assembly: Assembly) -> Part:
    counts = len(assembly.centroid), len(assembly.corner), len(assembly.payload)
    blocks, corners, grips = (np.ones(count, dtype=bool) for count in counts)
    return Part(blocks, corners, grips, np.zeros((len(corners), 3)))


def _cut(assembly: Assembly, part: Part) -> list[sparse.csr_array]:
    """Return the maps of contacts and grips, of a part alone."""
    maps = assembly.contact_map, assembly.grip_map
    if part.blocks.all() and part.corners.all():
        return [*maps]
    rows = np.flatnonzero(np.repeat(part.blocks, 6))
    pairs = zip(maps, (part.corners, part.grips), strict=True)
    return [sparse.csr_array(each)[rows][:, np.repeat(own, 3).nonzero()[0]] for each, own in pairs]


class _Cones:
    """What corners and grips bear: cones of friction and payload, then cut-offs of tension.

    ``most`` (C, 4): h; ``map`` (C, 4, 3): G, of the force of the corner or grip that owns the cone.
    The first cones are owned in order, and the cut-offs by corners. A cut-off is left out where
    the cone of friction ends before it.
    """

    def __init__(self, assembly: Assembly, case: Case, part: Part) -> None:
        tension, cohesion, payload = limits(assembly, case, 0.0)
        tension, cohesion = tension[part.corners], cohesion[part.corners]
        payload = payload[part.grips]
        corners, self.owners = len(tension), len(tension) + len(payload)
        cut = case.friction == 0 or bool((case.friction * tension < cohesion).any())
        self._cuts = corners if cut else 0
        self.owner = np.concatenate([np.arange(self.owners), np.arange(self._cuts)])
        self.most = np.zeros((len(self.owner), 4))
        self.most[:, 0] = np.concatenate([cohesion, payload, tension[: self._cuts]])
        self.map = np.zeros((len(self.owner), 4, 3))
        self.map[:corners, 0, 0] = case.friction
        self.map[:corners, [1, 2], [1, 2]] = 1.0
        self.map[corners : self.owners, [1, 2, 3], [0, 1, 2]] = 1.0
        self.map[self.owners :, 0, 0] = 1.0

    def of(self, force: Floats) -> Floats:
        """Return G f (C, 4)."""
        return _apply(self.map, force[self.owner])

    def owned(self, values: Floats) -> Floats:
        """Return the sums over the cones of every owner, (N, ...)."""
        out = values[: self.owners].copy()
        out[: self._cuts] += values[self.owners :]
        return out

    def pulled(self, values: Floats) -> Floats:
        """Return the transpose of G times values (C, 4), (N, 3)."""
        return self.owned(np.einsum("cji,cj->ci", self.map, values))


class _Balance:
    """The map E from forces to wrenches, and systems E B E^T y = r for weights B (N, 3, 3).

    Bodies that touch are numbered close together, so that such a system is a narrow band.
    """

    def __init__(self, maps: Sequence[sparse.csr_array]) -> None:
        self._map = sparse.hstack(maps, format="csr")
        self._transposed = blocks = self._map.T.tobsr((3, 6))
        bodies = blocks.shape[1] // 6
        self._owner = np.repeat(np.arange(blocks.shape[0] // 3), np.diff(blocks.indptr))
        own, each = np.arange(len(self._owner)), np.arange(bodies)
        both = np.flatnonzero(self._owner[1:] == self._owner[:-1])  # where a force has two bodies
        first, second = np.concatenate([[own, own], [both, both + 1]], axis=1)
        meet = np.ones(len(first)), (blocks.indices[first], blocks.indices[second])
        touching = sparse.csr_array(meet, shape=(bodies, bodies))
        self._order = reverse_cuthill_mckee(touching + touching.T, symmetric_mode=True)
        number = np.argsort(self._order)[blocks.indices]
        low = number[first] < number[second]  # of what is symmetric, the lower half counts
        first, second = np.where(low, second, first), np.where(low, first, second)
        place = number[first] * bodies + number[second]
        order = np.argsort(place, kind="stable")
        self._first, self._right = first[order], blocks.data[second[order]]
        self._half, self._left = np.empty((len(own), 6, 3)), np.empty((len(order), 6, 3))
        self._products = np.empty(
            (len(order), 6, 6)
        )  # written again and again: new pages cost more
        places, self._starts = np.unique(place[order], return_index=True)
        every = np.union1d(places, each * (bodies + 1))  # bodies may be loose
        self._met = np.searchsorted(every, places)
        self._blocks = len(every)
        self._diagonal = np.searchsorted(every, each * (bodies + 1))
        rows, columns = np.divmod(every, bodies)
        line = 6 * (rows - columns)[:, None, None] + np.subtract.outer(np.arange(6), np.arange(6))
        column = np.broadcast_to(6 * columns[:, None, None] + np.arange(6), line.shape)
        self._lower, self._lines = np.flatnonzero(line >= 0), int(line.max()) + 1
        self._band = (column * self._lines + line).ravel()[self._lower]

    def wrench(self, force: Floats) -> Floats:
        """Return the wrenches (6B,) of forces (N, 3)."""
        return np.asarray(self._map @ force.ravel())

    def parting(self, motion: Floats) -> Floats:
        """Return what a motion (6B,) does where forces act, (N, 3)."""
        return np.asarray(self._transposed @ motion).reshape(-1, 3)

    def solver(self, weight: Floats) -> _Solve:
        """Return the solution of systems with weights; raises an error if there is none.

        It is that of a system with a larger diagonal, corrected once.
        """
        across = self._transposed.data.transpose(0, 2, 1)
        np.matmul(across, weight[self._owner], out=self._half)
        np.take(self._half, self._first, axis=0, out=self._left, mode="clip")
        np.matmul(self._left, self._right, out=self._products)
        block = np.zeros((self._blocks, 6, 6))
        block[self._met] = np.add.reduceat(self._products, self._starts)
        regular = _REGULAR * np.abs(block).max()
        block[self._diagonal] += regular * np.eye(6)
        lines, bodies = self._lines, len(self._order)
        flat = np.zeros(6 * bodies * lines)
        flat[self._band] = block.ravel()[self._lower]
        band = flat.reshape(6 * bodies, lines).T
        factor = linalg.cholesky_banded(band, lower=True, check_finite=False), True

        def solution(right: Floats) -> Floats:
            given = right.reshape(-1, 6)[self._order].ravel()
            found = linalg.cho_solve_banded(factor, given, check_finite=False)
            left = given - linalg.blas.dsbmv(lines - 1, 1.0, band, found, lower=1)
            found += linalg.cho_solve_banded(factor, left + regular * found, check_finite=False)
            out = np.empty((bodies, 6))
            out[self._order] = found.reshape(-1, 6)
            return out.ravel()

        return solution


class _Search:
    def __init__(self, assembly: Assembly, case: Case, part: Part) -> None:
        self._part, self._corners = part, np.count_nonzero(part.corners)
        load = case.loads(assembly)[0] + assembly.contact_map @ part.kept.ravel()
        self._load = load.reshape(-1, 6)[part.blocks].ravel()
        self._balance = _Balance(_cut(assembly, part))
        self._cones = _Cones(assembly, case, part)

    @np.errstate(all="ignore")
    def start(self, force: Floats, level: Floats) -> tuple[_Point, Floats]:
        """Return a point in equilibrium near forces, and the motion that nothing hinders, if any.

        ``level`` (N, 3): how much each of the ``force`` (N, 3) may change beside the others.
        """
        weight = np.einsum("ni,ij->nij", np.square(level), np.eye(3))
        left = self._load + self._balance.wrench(force)
        motion = self._balance.solver(weight)(left)
        force = force - np.square(level) * self._balance.parting(motion)
        left = self._load + self._balance.wrench(force)
        loose = motion if np.abs(left).max() > _DONE else 0 * motion
        slack = self._cones.most + self._cones.of(force)
        raised = _ROOM + 1.2 * float(max((_length(slack[:, 1:]) - slack[:, 0]).max(), 0.0))
        slack[:, 0] += raised
        press = slack * _FLIP / _product(slack, slack * _FLIP)[:, None]
        return _Point(force, raised, slack, 0 * motion, press / press[:, 0].sum()), loose

    @np.errstate(all="ignore")
    def better(self, point: _Point) -> _Point | None:
        """Return a better point; none if there is no way to one."""
        scale, inverse = _scaling(point.slack, point.press)
        go = self._directions(point, inverse)
        even = _apply(scale, point.press)
        first = go(-even)
        reach = min(1.0, _reach(point.slack, first.slack), _reach(point.press, first.press))
        center = (1 - reach) ** 3 * _product(point.slack, point.press).sum() / (2 * len(even))
        aim = -_circle(even, even)
        aim -= _circle(_apply(inverse, first.slack), _apply(scale, first.press))
        aim[:, 0] += center
        last = go(_divide(aim, even))
        ahead = min(1.0, _SHARE * _reach(point.slack, last.slack))
        turned = min(1.0, _SHARE * _reach(point.press, last.press))
        if not (max(ahead, turned) > _STUCK and np.isfinite(last.raised)):
            return None
        return _Point(
            force=point.force + ahead * last.force,
            raised=point.raised + ahead * last.raised,
            slack=point.slack + ahead * last.slack,
            motion=point.motion + turned * last.motion,
            press=point.press + turned * last.press,
        )

    def _directions(self, point: _Point, inverse: Floats) -> Callable[[Floats], _Point]:
        """Return the direction in which to go from a point, by the aim of the scaled cones.

        ``inverse`` (C, 4, 4): of the scaling.
        """
        balance, cones, square = self._balance, self._cones, inverse @ inverse
        weighed = square @ cones.map
        soft = _inverse(cones.owned(cones.map.transpose(0, 2, 1) @ weighed))
        solve = balance.solver(soft)
        lift, stiff = cones.owned(weighed[:, 0]), square[:, 0, 0].sum()
        left = balance.wrench(point.force) + self._load
        uneven = balance.parting(point.motion) - cones.pulled(point.press)
        too_much = point.press[:, 0].sum() - 1.0
        lifting = solve(balance.wrench(_apply(soft, lift)))
        lifted = _apply(soft, lift - balance.parting(lifting))

        def direction(aim: Floats) -> _Point:
            pushed = _apply(inverse, aim)
            given = cones.pulled(pushed) - uneven
            motion = solve(balance.wrench(_apply(soft, given)) + left)
            force = _apply(soft, given - balance.parting(motion))
            rest = pushed[:, 0].sum() + too_much - (lift * force).sum()
            raised = float(rest / (stiff - (lift * lifted).sum()))
            force, motion = force - raised * lifted, motion - raised * lifting
            slack = cones.of(force)
            slack[:, 0] += raised
            return _Point(force, raised, slack, motion, pushed - _apply(square, slack))

        return direction

    def claim(self, point: _Point) -> Answer:
        """Return a point as an answer, whose z is what all bear more than they can."""
        part, contact = self._part, self._part.kept.copy()
        grip, motion = np.zeros((len(part.grips), 3)), np.zeros((len(part.blocks), 6))
        contact[part.corners] = point.force[: self._corners]
        grip[part.grips] = point.force[self._corners :]
        motion[part.blocks] = point.motion.reshape(-1, 6)
        return Answer(Claim.SOLVED, max(point.raised, 0.0), contact, grip, motion)

    def promises(self, point: _Point) -> bool:
        """Return whether a point's forces or its motion may prove something."""
        rest = (self._cones.most * point.press).sum()
        return point.raised <= _DONE or bool(self._load @ point.motion > rest)


def approach(
    assembly: Assembly, case: Case, force: Floats, level: Floats, part: Part | None = None
) -> Iterator[Answer]:
    """Yield forces and motions, each nearer to a proof, until it is stuck or `ROUNDS` are over.

    Of the case, only what it bears at a z of zero counts. The first answer has the forces in
    equilibrium next to ``force`` (N, 3), of corners and then of grips, over the force scale;
    ``level`` (N, 3), positive: how much each may change for that beside the others; ``part``: what
    alone changes, by default all; forces and levels are then those of its corners and grips.
    """
    if not len(force):
        return
    search = _Search(assembly, case, _whole(assembly) if part is None else part)
    try:
        point: _Point | None
        point, motion = search.start(force, level)
        yield search.claim(replace(point, raised=0.0, motion=motion))
        for _ in range(ROUNDS):
            point = search.better(point)
            if point is None:
                return
            if search.promises(point):
                yield search.claim(point)
    except (RuntimeError, np.linalg.LinAlgError):  # a system that has no solution
        return


def _scaling(slack: Floats, press: Floats) -> tuple[Floats, Floats]:
    """Return the matrices (C, 4, 4) that scale multipliers as their inverse does slacks."""
    sizes = [np.sqrt(_product(part, part * _FLIP))[:, None] for part in (slack, press)]
    slack, press = slack / sizes[0], press / sizes[1]
    middle = slack + press * _FLIP
    middle /= np.sqrt(2 * (1 + _product(slack, press)))[:, None]
    middle[:, 0] += 1.0
    turn = middle[:, :, None] * middle[:, None] / middle[:, :1, None] - _MIRROR
    size = np.sqrt(sizes[0] / sizes[1])[:, None]
    return turn * size, turn * (_FLIP[:, None] * _FLIP) / size


def _inverse(matrices: Floats) -> Floats:
    """Return the inverses of positive definite matrices (N, 3, 3): a tenth of NumPy's time."""
    (a, b, c), (_, d, e), (_, _, f) = np.ascontiguousarray(matrices.transpose(1, 2, 0))
    first, second = b / a, c / a
    d = d - first * b
    third = (e - second * b) / d
    f = f - second * c - third * third * d
    far = first * third - second
    out = np.empty_like(matrices)
    out[:, 2, 2] = 1 / f
    out[:, 1, 2] = out[:, 2, 1] = -third / f
    out[:, 0, 2] = out[:, 2, 0] = far / f
    out[:, 1, 1] = 1 / d + third * third / f
    out[:, 0, 1] = out[:, 1, 0] = -first / d - far * third / f
    out[:, 0, 0] = 1 / a + first * first / d + far * far / f
    return out


def _reach(cones: Floats, step: Floats) -> float:
    """Return how many steps (C, 4) lead from within the cones to their edge."""
    second = _product(step, step * _FLIP)
    first, none = _product(cones, step * _FLIP), _product(cones, cones * _FLIP)
    under = first**2 - second * none
    fall = np.sqrt(np.maximum(under, 0.0)) - first
    ends = (under >= -_ROUNDED * first**2) & (fall > 0)  # zero where only the first number is any
    return float(np.min(none[ends] / fall[ends], initial=_FARTHEST))


def _circle(first: Floats, second: Floats) -> Floats:
    """Return the Jordan products of vectors (C, 4)."""
    out = first[:, :1] * second + second[:, :1] * first
    out[:, 0] = _product(first, second)
    return out


def _divide(product: Floats, factor: Floats) -> Floats:
    """Return the other factors of Jordan products (C, 4)."""
    first = _product(product, factor * _FLIP) / _product(factor, factor * _FLIP)
    out = (product - first[:, None] * factor) / factor[:, :1]
    out[:, 0] = first
    return out


def _product(first: Floats, second: Floats) -> Floats:
    return np.asarray(np.einsum("ci,ci->c", first, second))


def _apply(matrices: Floats, vectors: Floats) -> Floats:
    return np.asarray(np.einsum("cij,cj->ci", matrices, vectors))


def _length(vectors: Floats) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=1))
