"""Forces that hold an assembly, or a motion in which it falls, sought by an interior-point method.

All that contacts and grips can bear is raised by the same force t, which is made small::

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
from itertools import compress

import numpy as np
from scipy import sparse

from seqopt.arrays import Bools, Floats
from seqopt.contact.assembly import Assembly
from seqopt.stability._search.balance import Balance, apart
from seqopt.stability._search.cones import (
    FLIP,
    Changing,
    Cones,
    Sought,
    apply,
    circle,
    divide,
    inverse_of,
    numbered,
    product,
    scaling,
    times,
)
from seqopt.stability.limit_analysis import Answer, Claim

ROUNDS = 25  # at most; most structures need two to eight
_SHARE = 0.95  # of the way to the edge of the cones that is gone in a round
_STUCK = 1e-3  # share of a step so small that further rounds lead nowhere
_DONE = 1e-8  # t that counts as none, over the force scale
_FEW = 0.5  # share of assemblies that are left, from which on it pays to search for them alone
_ROOM = 0.1  # by which t starts above what the first forces need, over the force scale


@dataclass(frozen=True, eq=False)
class _Point:
    """Forces f (3, N), t (A,), s (4, C), the motion (6B,) and the cones' multipliers (4, C)."""

    force: Floats
    raised: Floats
    slack: Floats
    motion: Floats
    press: Floats


def _cut(assembly: Assembly, part: Changing) -> list[sparse.csr_array]:
    """Return the maps of contacts and grips, of a part alone."""
    maps = assembly.contact_map, assembly.grip_map
    if part.blocks.all() and part.corners.all():
        return [*maps]
    rows = np.flatnonzero(np.repeat(part.blocks, 6))
    pairs = zip(maps, (part.corners, part.grips), strict=True)
    return [sparse.csr_array(each)[rows][:, np.repeat(own, 3).nonzero()[0]] for each, own in pairs]


class _Search:
    def __init__(self, sought: Sequence[Sought]) -> None:
        self._sought, self._parts = sought, [each.changing() for each in sought]
        pairs = [*zip(sought, self._parts, strict=True)]
        self._load = np.concatenate([_load(each, part) for each, part in pairs])
        maps = zip(*(_cut(each.assembly, part) for each, part in pairs), strict=True)
        self._balance = Balance([apart(each) for each in maps])
        self._cones = Cones(sought, self._parts)
        self._bodies = numbered([6 * int(np.count_nonzero(part.blocks)) for part in self._parts])

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
        center = (1 - np.minimum(1.0, np.minimum(*reach))) ** 3 / (
            2 * cones.sums(np.ones(even.shape[1]))
        )
        center *= cones.sums(product(point.slack, point.press))
        aim = -circle(even, even)
        aim -= circle(apply(inverse, first.slack), apply(scale, first.press))
        aim[0] += center[cones.group]
        last = go(divide(aim, even))
        ahead = np.minimum(1.0, _SHARE * cones.reach(point.slack, last.slack))
        turned = np.minimum(1.0, _SHARE * cones.reach(point.press, last.press))
        goes = (np.maximum(ahead, turned) > _STUCK) & ~done
        if not (goes.any() and np.isfinite(last.raised).all()):
            return None
        ahead, turned = ahead * goes, turned * goes
        of_cone = ahead[cones.group]
        return _Point(
            force=point.force + of_cone[: cones.owners] * last.force,
            raised=point.raised + ahead * last.raised,
            slack=point.slack + of_cone * last.slack,
            motion=point.motion + turned[self._bodies] * last.motion,
            press=point.press + turned[cones.group] * last.press,
        )

    def _directions(self, point: _Point, inverse: Floats) -> Callable[[Floats], _Point]:
        """Return the direction in which to go from a point, by the aim of the scaled cones.

        ``inverse`` (4, 4, C): of the scaling.
        """
        balance, cones, square = self._balance, self._cones, times(inverse, inverse)
        weighed = times(square, cones.map)
        soft = inverse_of(cones.owned(times(cones.map.swapaxes(0, 1), weighed)))
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

    def narrowed(self, point: _Point, which: Bools) -> tuple[_Search, _Point]:
        """Return a search, and the point, of some assemblies (A,) alone."""
        cones, bodies = which[self._cones.group], which[self._bodies]
        owners = cones[: self._cones.owners]
        return _Search([*compress(self._sought, which)]), _Point(
            force=point.force[:, owners],
            raised=point.raised[which],
            slack=point.slack[:, cones],
            motion=point.motion[bodies],
            press=point.press[:, cones],
        )

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


def _load(sought: Sought, part: Changing) -> Floats:
    """Return the wrenches of loads, and of what does not change, on what does."""
    load = sought.case.loads(sought.assembly)[0]
    if part.kept.any():
        load = load + sought.assembly.contact_map @ part.kept.ravel()
    return load.reshape(-1, 6)[part.blocks].ravel()


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
            if left.mean() <= _FEW:
                search, point = search.narrowed(point, left)
                numbers, left = numbers[left], left[left]
            if (point := search.better(point, ~left)) is None:
                return
            claimed, which = point, left & search.promises(point)
    except (RuntimeError, np.linalg.LinAlgError):  # a system that has no solution
        return


def approach(sought: Sought) -> Iterator[Answer]:
    """Yield forces and motions of one assembly, as `approach_all`."""
    for answers in approach_all([sought], np.zeros(1, dtype=bool)):
        yield from (answer for _, answer in answers)
