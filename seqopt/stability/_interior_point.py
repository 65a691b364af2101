"""Forces that hold an assembly, or a motion in which it falls, sought by an interior-point method.

All that contacts and grips can bear is raised by the same force t, which is minimized::

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

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from seqopt.arrays import Bools, Floats
from seqopt.contact.assembly import Assembly
from seqopt.network.network import GROUND
from seqopt.stability.limit_analysis import Answer, Case, Claim, limits

_REGULAR = 1e-13  # of the largest entry, added to all on the diagonal: blocks may be loose

Solve = Callable[[Floats], Floats]
FLIP = np.array([[1.0], [-1.0], [-1.0], [-1.0]])
_MIRROR = np.diag(FLIP[:, 0])[:, :, None]
_ROUNDED = 1e-12  # share of a square by which a difference may be negative from rounding
_FARTHEST = 1e3  # share of a step that counts as no limit
ROUNDS = 25  # at most; most structures need two to eight
_SHARE = 0.95  # of the way to the edge of the cones that is gone in a round
_STUCK = 1e-3  # share of a step so small that further rounds lead nowhere
_DONE = 1e-8  # t that counts as none, over the force scale
_ROOM = 0.1  # by which t starts above what the first forces need, over the force scale


class Balance:
    """The map E from forces to wrenches, and systems E B E^T y = r for weights B (3, 3, N).

    Bodies that touch are numbered close together, so that such a system is a narrow band.
    """

    def __init__(self, wrenches: sparse.csr_array) -> None:
        self._map, self._transposed = wrenches, wrenches.T.tocsr()
        blocks = wrenches.tobsr((6, 3))
        bodies, self._force = blocks.shape[0] // 6, blocks.indices
        acts = np.ones(len(blocks.indices)), blocks.indices, blocks.indptr
        on = sparse.csr_array(acts, shape=(bodies, blocks.shape[1] // 3))
        order = reverse_cuthill_mckee((on @ on.T).tocsr(), symmetric_mode=True)
        self._order = (6 * order[:, None] + np.arange(6)).ravel()
        at = np.argsort(order)[np.repeat(np.arange(bodies), np.diff(blocks.indptr))]
        along = np.lexsort((at, self._force))  # a force acts on one body, or on two
        two = np.flatnonzero(np.diff(self._force[along]) == 0)
        self._first = np.concatenate([along, along[two + 1]])
        second = np.concatenate([along, along[two]])
        row, column = (6 * at[each][:, None] + np.arange(6) for each in (self._first, second))
        line = row[:, :, None] - column[:, None]
        self._lower = line >= 0  # of what is symmetric
        self._lines = 1 + int(line.max(initial=0))
        self._entry = (line + self._lines * column[:, None])[self._lower]
        self._blocks, self._turned = blocks.data, blocks.data[second].swapaxes(1, 2)

    def wrench(self, force: Floats) -> Floats:
        """Return the wrenches (6B,) of forces (3, N)."""
        return np.asarray(self._map @ force.T.ravel())

    def parting(self, motion: Floats) -> Floats:
        """Return what a motion (6B,) does where forces act, (3, N)."""
        return np.ascontiguousarray((self._transposed @ motion).reshape(-1, 3).T)

    def solver(self, weight: Floats) -> Solve:
        """Return the solution of systems with weights; raises an error if there is none.

        It is that of a system with a larger diagonal, corrected once.
        """
        lines, size = self._lines, len(self._order)
        weighed = self._blocks @ weight.transpose(2, 0, 1)[self._force]
        entries = (weighed[self._first] @ self._turned)[self._lower]
        band = np.bincount(self._entry, entries, lines * size).reshape((lines, size), order="F")
        regular = _REGULAR * np.abs(band).max(initial=0.0)
        band[0] += regular
        factor = linalg.cholesky_banded(band, lower=True, check_finite=False), True

        def solution(right: Floats) -> Floats:
            given, out = right[self._order], np.empty(size)
            found = linalg.cho_solve_banded(factor, given, check_finite=False)
            left = given - linalg.blas.dsbmv(lines - 1, 1.0, band, found, lower=1)
            found += linalg.cho_solve_banded(factor, left + regular * found, check_finite=False)
            out[self._order] = found
            return out

        return solution


class Cones:
    """What corners and grips bear: cones of friction and payload, then cut-offs of tension.

    ``most`` (C,): the first row of h, which has no other; ``map`` (4, 3, C): G, of the force of the
    corner or grip that owns the cone. The first cones are owned in order, those of corners first,
    and the cut-offs by corners whose cone of friction does not end before.
    """

    def __init__(self, friction: float, tension: Floats, cohesion: Floats, payload: Floats) -> None:
        corners, self.owners = len(tension), len(tension) + len(payload)
        self._cut = np.flatnonzero((friction * tension < cohesion) | (friction == 0))
        self.owner = np.concatenate([np.arange(self.owners), self._cut])
        self.most = np.concatenate([cohesion, payload, tension[self._cut]])
        self.map = np.zeros((4, 3, len(self.owner)))
        self.map[0, 0, :corners] = friction
        self.map[[1, 2], [1, 2], :corners] = 1.0
        self.map[[1, 2, 3], [0, 1, 2], corners : self.owners] = 1.0
        self.map[0, 0, self.owners :] = 1.0

    def of(self, force: Floats) -> Floats:
        """Return G f (4, C)."""
        return apply(self.map, force[:, self.owner])

    def owned(self, values: Floats) -> Floats:
        """Return the sums over the cones of every owner, (..., N)."""
        out = values[..., : self.owners].copy()
        out[..., self._cut] += values[..., self.owners :]
        return out

    def pulled(self, values: Floats) -> Floats:
        """Return the transpose of G times values (4, C), (3, N)."""
        return self.owned(apply(self.map.swapaxes(0, 1), values))


def reach(cones: Floats, step: Floats) -> float:
    """Return how many steps (4, C) lead from within the cones to their edge."""
    turned = step * FLIP
    second = product(step, turned)
    first, none = product(cones, turned), product(cones, cones * FLIP)
    under = first**2 - second * none
    fall = np.sqrt(np.maximum(under, 0.0)) - first
    ends = (under >= -_ROUNDED * first**2) & (fall > 0)  # zero where only the first is any
    return float((none / fall)[ends].min(initial=_FARTHEST))


def scaling(slack: Floats, press: Floats) -> tuple[Floats, Floats]:
    """Return the matrices (4, 4, C) that scale multipliers as their inverse does slacks."""
    sizes = [np.sqrt(product(part, part * FLIP)) for part in (slack, press)]
    slack, press = slack / sizes[0], press / sizes[1]
    middle = slack + press * FLIP
    middle /= np.sqrt(2 * (1 + product(slack, press)))
    middle[0] += 1.0
    turn = middle[:, None] * (middle / middle[0]) - _MIRROR
    size = np.sqrt(sizes[0] / sizes[1])
    return turn * size, turn * (FLIP[:, None] * FLIP) / size


def circle(first: Floats, second: Floats) -> Floats:
    """Return the Jordan products of vectors (4, C)."""
    out: Floats = first[0] * second + second[0] * first
    out[0] = product(first, second)
    return out


def product(first: Floats, second: Floats) -> Floats:
    """Return the inner products (C,) of vectors (n, C)."""
    return np.asarray(np.einsum("ic,ic->c", first, second))


def apply(matrices: Floats, vectors: Floats) -> Floats:
    """Return products (n, C) of matrices (n, m, C) with vectors (m, C)."""
    return np.asarray(np.einsum("ijc,jc->ic", matrices, vectors))


def times(first: Floats, second: Floats) -> Floats:
    """Return products (n, k, C) of matrices (n, m, C) and (m, k, C)."""
    return np.asarray(np.einsum("ijc,jkc->ikc", first, second))


@dataclass(frozen=True, eq=False)
class _Point:
    """Forces f (3, N), t, s (4, C), the motion (6B,) and the cones' multipliers (4, C)."""

    force: Floats
    raised: float
    slack: Floats
    motion: Floats
    press: Floats


class _Search:
    """A search among some ``blocks`` (B,) of an assembly: the others rest, as the ground does."""

    def __init__(self, assembly: Assembly, case: Case, blocks: Bools) -> None:
        bodies = assembly.bodies[assembly.contact]
        self._corners = ((bodies != GROUND) & blocks[bodies]).any(axis=1)
        self._blocks, self._grips = blocks, blocks[assembly.grip_block]
        maps = [assembly.contact_map, assembly.grip_map]
        if not blocks.all():
            rows, pairs = np.repeat(blocks, 6), zip(maps, (self._corners, self._grips), strict=True)
            maps = [sparse.csr_array(whole)[rows][:, np.repeat(own, 3)] for whole, own in pairs]
        tension, cohesion, payload = limits(assembly, case, 0.0)
        borne = tension[self._corners], cohesion[self._corners], payload[self._grips]
        self.cones = Cones(case.friction, *borne)
        self.load = case.loads(assembly)[0][np.repeat(blocks, 6)]
        self._balance = Balance(sparse.hstack(maps, format="csr"))

    @np.errstate(all="ignore")
    def start(self, near: Floats | float) -> tuple[_Point, Floats]:
        """Return the point of forces in equilibrium next to some, and a motion nothing hinders."""
        balance, cones = self._balance, self.cones
        weight = np.repeat(np.eye(3)[:, :, None], cones.owners, axis=2)
        force = np.zeros((3, cones.owners)) + near
        motion = balance.solver(weight)(self.load + balance.wrench(force))
        force -= balance.parting(motion)
        loose = np.abs(self.load + balance.wrench(force)).max() > _DONE
        slack = cones.of(force)
        slack[0] += cones.most
        needed = -(slack[0] - np.linalg.norm(slack[1:], axis=0)).min()
        raised = float(_ROOM + 1.2 * max(needed, 0.0))
        slack[0] += raised
        press = slack * FLIP / product(slack, slack * FLIP)
        press /= press[0].sum()
        return _Point(force, raised, slack, 0 * motion, press), loose * motion

    @np.errstate(all="ignore")
    def better(self, point: _Point) -> _Point | None:
        """Return a point that is better; none if no way leads to one."""
        scale, inverse = scaling(point.slack, point.press)
        go = self._directions(point, inverse)
        even = apply(scale, point.press)
        first = go(-even)
        most = min(reach(point.slack, first.slack), reach(point.press, first.press))
        center = (1 - min(1.0, most)) ** 3 / 2
        center *= product(point.slack, point.press).mean()
        aim = -circle(even, even)
        aim -= circle(apply(inverse, first.slack), apply(scale, first.press))
        aim[0] += center
        turned = even * FLIP  # of the Jordan product that is aimed at, even is one factor
        other = product(aim, turned) / product(even, turned)
        step = (aim - other * even) / even[0]
        step[0] = other
        last = go(step)
        ahead = min(1.0, _SHARE * reach(point.slack, last.slack))
        spun = min(1.0, _SHARE * reach(point.press, last.press))
        if max(ahead, spun) <= _STUCK or not np.isfinite(last.raised):
            return None
        return _Point(
            force=point.force + ahead * last.force,
            raised=point.raised + ahead * last.raised,
            slack=point.slack + ahead * last.slack,
            motion=point.motion + spun * last.motion,
            press=point.press + spun * last.press,
        )

    def _directions(self, point: _Point, inverse: Floats) -> Callable[[Floats], _Point]:
        """Return the direction in which to go from a point, by the aim of the scaled cones."""
        balance, cones, square = self._balance, self.cones, times(inverse, inverse)
        weighed = times(square, cones.map)
        borne = cones.owned(times(cones.map.swapaxes(0, 1), weighed))
        soft = np.asarray(np.linalg.inv(borne.T).T, dtype=float)
        solve = balance.solver(soft)
        lift = cones.owned(weighed[0])
        left = balance.wrench(point.force) + self.load
        uneven = balance.parting(point.motion) - cones.pulled(point.press)
        too_much = point.press[0].sum() - 1.0
        lifting = solve(balance.wrench(apply(soft, lift)))
        lifted = apply(soft, lift - balance.parting(lifting))
        stiff = square[0, 0].sum() - product(lift, lifted).sum()

        def direction(aim: Floats) -> _Point:
            pushed = apply(inverse, aim)
            given = cones.pulled(pushed) - uneven
            motion = solve(balance.wrench(apply(soft, given)) + left)
            force = apply(soft, given - balance.parting(motion))
            raised = float((pushed[0].sum() + too_much - product(lift, force).sum()) / stiff)
            force = force - raised * lifted
            motion = motion - raised * lifting
            slack = cones.of(force)
            slack[0] += raised
            return _Point(force, raised, slack, motion, pushed - apply(square, slack))

        return direction

    def claim(self, point: _Point) -> Answer:
        """Return a point as an answer; its z is what all bear more than they can."""
        contact, grip = np.zeros((len(self._corners), 3)), np.zeros((len(self._grips), 3))
        motion, corners = np.zeros((len(self._blocks), 6)), np.count_nonzero(self._corners)
        contact[self._corners], grip[self._grips] = point.force.T[:corners], point.force.T[corners:]
        motion[self._blocks] = point.motion.reshape(-1, 6)
        return Answer(Claim.SOLVED, max(point.raised, 0.0), contact, grip, motion)


def approach(
    assembly: Assembly, case: Case, blocks: Bools | None = None, near: Floats | float = 0.0
) -> Iterator[Answer]:
    """Yield forces and motions, each nearer to a proof that a case needs no z, or some.

    The first answer has the forces in equilibrium that differ least from ``near`` (K + G, 3), over
    the force scale, by default none, and claims no z. Ends when no better one is found, or after
    `ROUNDS`. ``blocks`` (B,): that move, by default all.
    """
    blocks = np.ones(len(assembly.centroid), dtype=bool) if blocks is None else blocks
    if not (blocks.any() and len(assembly.corner) + len(assembly.payload)):
        return
    try:
        search = _Search(assembly, case, blocks)
        point, motion = search.start(np.transpose(near))
        yield search.claim(replace(point, raised=0.0, motion=motion))
        for _ in range(ROUNDS - 1):
            better = search.better(point)
            if better is None:
                return
            point = better
            work = search.load @ point.motion - search.cones.most @ point.press[0]
            if point.raised <= _DONE or work > 0:  # its forces or its motion may prove something
                yield search.claim(point)
    except (RuntimeError, np.linalg.LinAlgError):  # a system that has no solution
        return
