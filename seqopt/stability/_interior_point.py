"""Forces that hold an assembly, or a motion in which it falls, sought by an interior-point method.

All that contacts and grips can bear is raised by the same force t, which is minimized::

    minimize    t
    subject to  E f + w = 0                        every block in equilibrium
                s = h + G f + t (1, 0, 0, 0)       a cone for what every corner and grip bears

over second-order cones of four numbers, in which the first is no less than the others' length.
Forces f hold as soon as t is not positive, and the multipliers of the first line are a motion in
which it falls as soon as they prove a positive t, so few rounds are needed: an answer is offered
after each. It proves nothing by itself. Small assemblies are sought for beside each other, each
with its own t: their numbers together take hardly longer than those of one.

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

_REGULAR = 1e-13  # of the largest entry, added to all on the diagonal: blocks may be loose

Solve = Callable[[Floats], Floats]


def apart(maps: Sequence[sparse.csr_array]) -> sparse.csr_array:
    """Return maps that have neither rows nor columns in common."""
    rows, columns = zip(*(each.shape for each in maps), strict=True)
    before = np.cumsum([0, *columns])
    indices = [each.indices + first for each, first in zip(maps, before.tolist(), strict=False)]
    counts = np.concatenate([[0], *(np.diff(each.indptr) for each in maps)])
    entries = np.concatenate([each.data for each in maps]), np.concatenate(indices)
    shape = sum(rows), int(before[-1])
    return sparse.csr_array((*entries, np.cumsum(counts)), shape=shape)


class Balance:
    """The map E from forces to wrenches, and systems E B E^T y = r for weights B (3, 3, N).

    Bodies that touch are numbered close together, so that such a system is a narrow band.
    """

    def __init__(self, maps: Sequence[sparse.csr_array]) -> None:
        self._map = sparse.hstack(maps, format="csr")
        self._transposed, blocks = self._map.T.tocsr(), self._map.tobsr((6, 3))
        bodies, forces = blocks.shape[0] // 6, blocks.shape[1] // 3
        acts = np.ones(len(blocks.indices)), blocks.indices, blocks.indptr
        on = sparse.csr_array(acts, shape=(bodies, forces))
        order = reverse_cuthill_mckee((on @ on.T).tocsr(), symmetric_mode=True)
        self._order = (6 * order[:, None] + np.arange(6)).ravel()
        self._ordered = self._map[self._order]
        self._turned = self._ordered.T.tocsr()
        rows = np.repeat(np.arange(forces), 3)  # of weights, three of each force
        self._places = (3 * rows[:, None] + np.arange(3)).ravel(), np.arange(0, 9 * forces + 1, 3)

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
        weights = sparse.csr_array((weight.transpose(2, 0, 1).ravel(), *self._places))
        system = (self._ordered @ weights @ self._turned).tocoo()
        line, size = system.row - system.col, len(self._order)
        lower, lines = line >= 0, int(line.max(initial=0)) + 1  # of what is symmetric
        band = np.zeros((lines, size), order="F")
        band[line[lower], system.col[lower]] = system.data[lower]
        regular = _REGULAR * np.abs(system.data).max()
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


FLIP = np.array([[1.0], [-1.0], [-1.0], [-1.0]])
_MIRROR = np.diag(FLIP[:, 0])[:, :, None]
_ROUNDED = 1e-12  # share of a square by which a difference may be negative from rounding
_FARTHEST = 1e3  # share of a step that counts as no limit


class Changing(NamedTuple):
    """The part of an assembly that changes: other blocks rest, other corner forces stay.

    ``blocks`` (B,), ``corners`` (K,), ``grips`` (G,): which; ``kept`` (K, 3): what others bear,
    over the force scale.
    """

    blocks: Bools
    corners: Bools
    grips: Bools
    kept: Floats


class Sought(NamedTuple):
    """A search for forces or a motion: assembly, case, and what alone changes, by default all.

    Of the case, only what it bears at a z of zero counts.
    """

    assembly: Assembly
    case: Case
    part: Changing | None = None

    def changing(self) -> Changing:
        """Return what changes."""
        if self.part is not None:
            return self.part
        assembly = self.assembly
        counts = len(assembly.centroid), len(assembly.corner), len(assembly.payload)
        blocks, corners, grips = (np.ones(count, dtype=bool) for count in counts)
        return Changing(blocks, corners, grips, np.zeros((len(corners), 3)))


class Cones:
    """What corners and grips bear: cones of friction and payload, then cut-offs of tension.

    ``most`` (C,): the first row of h, which has no other; ``map`` (4, 3, C): G, of the force of the
    corner or grip that owns the cone; ``group`` (C,): number of the assembly. The first cones are
    owned in order, those of corners first, and the cut-offs by corners whose cone of friction does
    not end before.
    """

    def __init__(self, sought: Sequence[Sought], parts: Sequence[Changing]) -> None:
        borne = []
        for each, part in zip(sought, parts, strict=True):
            tension, cohesion, payload = limits(each.assembly, each.case, 0.0)
            own = tension[part.corners], cohesion[part.corners], payload[part.grips]
            borne.append((*own, np.full(len(own[0]), each.case.friction)))
        tension, cohesion, payload, friction = map(np.concatenate, zip(*borne, strict=True))
        corners, self.owners = len(tension), len(tension) + len(payload)
        self._cut = np.flatnonzero((friction == 0) | (friction * tension < cohesion))
        self.owner = np.concatenate([np.arange(self.owners), self._cut])
        counts = [[len(each[0]) for each in borne], [len(each[2]) for each in borne]]
        groups = [np.repeat(np.arange(len(parts)), count) for count in counts]
        self.group = np.concatenate(groups)[self.owner]
        self._groups = len(parts)
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

    def sums(self, values: Floats) -> Floats:
        """Return the sums over every assembly, (A,), of values of its cones or their owners."""
        return np.asarray(np.bincount(self.group[: len(values)], values, self._groups), float)

    def least(self, values: Floats, which: Bools | slice = slice(None)) -> Floats:
        """Return the least of some values (C,) of every assembly, (A,)."""
        out = np.full(self._groups, np.inf)
        np.minimum.at(out, self.group[which], values[which])
        return out

    def reach(self, cones: Floats, step: Floats) -> Floats:
        """Return how many steps (4, C) lead from within the cones to their edge, (A,)."""
        turned = step * FLIP
        second = product(step, turned)
        first, none = product(cones, turned), product(cones, cones * FLIP)
        under = first**2 - second * none
        fall = np.sqrt(np.maximum(under, 0.0)) - first
        ends = (under >= -_ROUNDED * first**2) & (fall > 0)  # zero where only the first is any
        return np.minimum(self.least(none / fall, ends), _FARTHEST)


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


ROUNDS = 25  # at most; most structures need two to eight
_SHARE = 0.95  # of the way to the edge of the cones that is gone in a round
_STUCK = 1e-3  # share of a step so small that further rounds lead nowhere
_DONE = 1e-8  # t that counts as none, over the force scale
_ROOM = 0.1  # by which t starts above what the first forces need, over the force scale


@dataclass(frozen=True, eq=False)
class _Point:
    """Forces f (3, N), t (A,), s (4, C), the motion (6B,) and the cones' multipliers (4, C)."""

    force: Floats
    raised: Floats
    slack: Floats
    motion: Floats
    press: Floats


class _Search:
    def __init__(self, sought: Sequence[Sought]) -> None:
        self._parts = [each.changing() for each in sought]
        loads, contacts, grips = [], list[sparse.csr_array](), list[sparse.csr_array]()
        for (assembly, case, _), part in zip(sought, self._parts, strict=True):
            rows = np.flatnonzero(np.repeat(part.blocks, 6))
            stays = assembly.contact_map @ part.kept.ravel()  # what does not change bears
            loads.append((case.loads(assembly)[0] + stays)[rows])
            pairs = (assembly.contact_map, part.corners), (assembly.grip_map, part.grips)
            for out, (whole, own) in zip((contacts, grips), pairs, strict=True):
                all_change = part.blocks.all() and part.corners.all()
                columns = np.flatnonzero(np.repeat(own, 3))
                out.append(whole if all_change else sparse.csr_array(whole)[rows][:, columns])
        self._load = np.concatenate(loads)
        self._balance = Balance([apart(contacts), apart(grips)])
        self._cones = Cones(sought, self._parts)
        self._bodies = np.repeat(np.arange(len(loads)), [len(load) for load in loads])

    @np.errstate(all="ignore")
    def start(self) -> tuple[_Point, Floats]:
        """Return the point of least forces in equilibrium, and motions that nothing hinders."""
        balance, cones = self._balance, self._cones
        weight = np.repeat(np.eye(3)[:, :, None], cones.owners, axis=2)
        motion = balance.solver(weight)(self._load)
        force = -balance.parting(motion)
        worst = np.zeros(len(self._parts))
        np.maximum.at(worst, self._bodies, np.abs(self._load + balance.wrench(force)))
        loose = np.where((worst > _DONE)[self._bodies], motion, 0.0)
        slack = cones.of(force)
        slack[0] += cones.most
        needed = -cones.least(slack[0] - np.linalg.norm(slack[1:], axis=0))
        raised = _ROOM + 1.2 * np.maximum(needed, 0.0)
        slack[0] += raised[cones.group]
        press = slack * FLIP / product(slack, slack * FLIP)
        press /= cones.sums(press[0])[cones.group]
        return _Point(force, raised, slack, 0 * motion, press), loose

    @np.errstate(all="ignore")
    def better(self, point: _Point, done: Bools) -> _Point | None:
        """Return a point that is better for assemblies not done (A,); none if no way leads to one.

        Those that are done stay where they are.
        """
        cones = self._cones
        scale, inverse = scaling(point.slack, point.press)
        go = self._directions(point, inverse)
        even = apply(scale, point.press)
        first = go(-even)
        reach = cones.reach(point.slack, first.slack), cones.reach(point.press, first.press)
        center = (1 - np.minimum(1.0, np.minimum(*reach))) ** 3 / 2
        center *= cones.sums(product(point.slack, point.press)) / cones.sums(np.ones(len(even.T)))
        aim = -circle(even, even)
        aim -= circle(apply(inverse, first.slack), apply(scale, first.press))
        aim[0] += center[cones.group]
        turned = even * FLIP  # of the Jordan product that is aimed at, even is one factor
        other = product(aim, turned) / product(even, turned)
        step = (aim - other * even) / even[0]
        step[0] = other
        last = go(step)
        ahead = np.minimum(1.0, _SHARE * cones.reach(point.slack, last.slack))
        spun = np.minimum(1.0, _SHARE * cones.reach(point.press, last.press))
        goes = (np.maximum(ahead, spun) > _STUCK) & ~done
        if not (goes.any() and np.isfinite(last.raised).all()):
            return None
        ahead, spun = ahead * goes, spun * goes
        of_cone = ahead[cones.group]
        return _Point(
            force=point.force + of_cone[: cones.owners] * last.force,
            raised=point.raised + ahead * last.raised,
            slack=point.slack + of_cone * last.slack,
            motion=point.motion + spun[self._bodies] * last.motion,
            press=point.press + spun[cones.group] * last.press,
        )

    def _directions(self, point: _Point, inverse: Floats) -> Callable[[Floats], _Point]:
        """Return the direction in which to go from a point, by the aim of the scaled cones.

        ``inverse`` (4, 4, C): of the scaling.
        """
        balance, cones, square = self._balance, self._cones, times(inverse, inverse)
        weighed = times(square, cones.map)
        borne = cones.owned(times(cones.map.swapaxes(0, 1), weighed))
        soft = np.asarray(np.linalg.inv(borne.T).T, dtype=float)
        solve = balance.solver(soft)
        lift, stiff = cones.owned(weighed[0]), cones.sums(square[0, 0])
        left = balance.wrench(point.force) + self._load
        uneven = balance.parting(point.motion) - cones.pulled(point.press)
        too_much = cones.sums(point.press[0]) - 1.0
        lifting = solve(balance.wrench(apply(soft, lift)))
        lifted = apply(soft, lift - balance.parting(lifting))
        stiff -= cones.sums(product(lift, lifted))

        def direction(aim: Floats) -> _Point:
            pushed = apply(inverse, aim)
            given = cones.pulled(pushed) - uneven
            motion = solve(balance.wrench(apply(soft, given)) + left)
            force = apply(soft, given - balance.parting(motion))
            rest = cones.sums(pushed[0]) + too_much - cones.sums(product(lift, force))
            raised = rest / stiff
            of_cone = raised[cones.group]
            force = force - of_cone[: cones.owners] * lifted
            motion = motion - raised[self._bodies] * lifting
            slack = cones.of(force)
            slack[0] += of_cone
            return _Point(force, raised, slack, motion, pushed - apply(square, slack))

        return direction

    def claims(self, point: _Point, which: Bools) -> list[Answer]:
        """Return a point as answers for some assemblies (A,).

        Their z is what all bear more than they can.
        """
        owners = self._cones.group[: self._cones.owners]
        out = []
        for number in np.flatnonzero(which).tolist():
            part = self._parts[number]
            force = point.force[:, owners == number].T
            contact, grip = part.kept.copy(), np.zeros((len(part.grips), 3))
            motion = np.zeros((len(part.blocks), 6))
            corners = np.count_nonzero(part.corners)
            contact[part.corners], grip[part.grips] = force[:corners], force[corners:]
            motion[part.blocks] = point.motion[self._bodies == number].reshape(-1, 6)
            value = max(float(point.raised[number]), 0.0)
            out.append(Answer(Claim.SOLVED, value, contact, grip, motion))
        return out

    def promises(self, point: _Point) -> Bools:
        """Return for which assemblies a point's forces or its motion may prove something, (A,)."""
        rest = self._cones.sums(self._cones.most * point.press[0])
        work = np.bincount(self._bodies, self._load * point.motion, len(self._parts))
        return np.asarray((point.raised <= _DONE) | (work > rest))


def approach_all(sought: Sequence[Sought], done: Bools) -> Iterator[list[tuple[int, Answer]]]:
    """Yield forces and motions, each nearer to a proof, with the numbers of their assemblies.

    ``done`` (A,): of which nothing more is asked, as the caller says. The first answers have the
    least forces in equilibrium. Ends when all is done or stuck, or after `ROUNDS`.
    """
    parts = map(Sought.changing, sought)
    numbers = np.flatnonzero([part.corners.any() or part.grips.any() for part in parts])
    if not len(numbers):
        return
    search = _Search([sought[number] for number in numbers.tolist()])
    try:
        point: _Point | None
        point, motion = search.start()
        claimed, which = replace(point, raised=0 * point.raised, motion=motion), ~done[numbers]
        for _ in range(ROUNDS):
            yield [*zip(numbers[which].tolist(), search.claims(claimed, which), strict=True)]
            left = ~done[numbers]
            if not left.any():
                return
            if (point := search.better(point, ~left)) is None:
                return
            claimed, which = point, left & search.promises(point)
    except (RuntimeError, np.linalg.LinAlgError):  # a system that has no solution
        return


def approach(sought: Sought) -> Iterator[Answer]:
    """Yield forces and motions of one assembly, as `approach_all`."""
    for answers in approach_all([sought], np.zeros(1, dtype=bool)):
        yield from (answer for _, answer in answers)
