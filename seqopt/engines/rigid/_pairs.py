"""How grips stand in the equations of sets: in which rows, which share a brick, how hands give."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, frozen
from seqopt.engines._hands import Hands
from seqopt.engines.interface import _couples
from seqopt.engines.rigid._operator import ComplianceOperator


class Pairs(NamedTuple):
    """Two grips on one brick.

    ``sets``, ``first``, ``second``, ``brick`` (p,): the grip set, which two of its grips, and the
    brick; ``axis`` (p, d): unit vectors from the first grip to the second.
    """

    sets: Ints
    first: Ints
    second: Ints
    brick: Ints
    axis: Floats

    def within(self, start: int, end: int) -> Pairs:
        """Return those of some sets, counted from the first of these."""
        found = self.only((self.sets >= start) & (self.sets < end))
        return found._replace(sets=found.sets - start)

    def only(self, which: Bools) -> Pairs:
        """Return some of them."""
        sets, first, second, brick, axis = self
        return Pairs(sets[which], first[which], second[which], brick[which], axis[which])

    def rigid(self, hands: Hands | None, sets: int, grips: int) -> Bools:
        """Return which pairs (p,) have hands that are both rigid, in so many sets."""
        if hands is None or hands.give is None:
            return np.ones(len(self.sets), dtype=bool)
        soft = hands.soft(sets, grips)
        return np.asarray(~soft[self.sets, self.first] & ~soft[self.sets, self.second])


def pairs_of(operator: ComplianceOperator, columns: Ints) -> Pairs:
    """Return all pairs of grips of the sets that share a brick."""
    couples = _couples(columns.shape[1])
    one, other = columns.T.take(couples, axis=0)
    same = one ^ 1 == other  # the two nodes of a brick
    if not np.count_nonzero(same):
        return _none(operator.axis.shape[1])
    couple, sets = same.nonzero()
    node, (first, second) = one[same], couples.take(couple, axis=1)
    return Pairs(sets, first, second, node // 2, operator.across.take(node, axis=0))


@cache
def _none(directions: int) -> Pairs:
    none = frozen(np.empty(0, dtype=np.int64))
    return Pairs(none, none, none, none, frozen(np.empty((0, directions))))


def _count_grips(operator: ComplianceOperator, count: int) -> int:
    """Return how many grips sets of as many unknowns have."""
    return (count - operator.loose) // (operator.directions + operator.moments)


def _by_grip(operator: ComplianceOperator, force: Floats, grips: int) -> Floats:
    """Return what hands bear, (S, r, w), of unknowns (S, k)."""
    width = operator.directions
    first, last = grips * width, grips * (width + operator.moments)
    shift = force[:, :first].reshape(len(force), grips, width)
    if not operator.moments:
        return shift
    return np.dstack([shift, force[:, first:last].reshape(len(force), grips, operator.moments)])


def _as_rows(operator: ComplianceOperator, each: Floats) -> Floats:
    """Return numbers of grips (S, r, w) as rows (k, S) of unknowns, loose motions left out."""
    width, sets = operator.directions, len(each)
    first = each[:, :, :width].reshape(sets, each.shape[1] * width)
    if each.shape[2] == width:
        return np.ascontiguousarray(first.T)
    rest = each[:, :, width:].reshape(sets, each.shape[1] * (each.shape[2] - width))
    return np.ascontiguousarray(np.hstack([first, rest]).T)


def _brace(system: Floats, pairs: Pairs) -> None:
    """Give the force between two grips on one brick a flexibility, so that there is one answer."""
    count, sets = system.shape[1:]
    width = pairs.axis.shape[1]
    blocks = system.reshape(count // width, width, count // width, width, sets)
    every = np.arange(count)[:, None]
    scaled = system[every, every, pairs.sets].sum(axis=0)[:, None] * pairs.axis
    block = scaled[:, :, None] * pairs.axis[:, None]
    rows = np.array([pairs.first, pairs.second, pairs.second])
    columns = np.array([pairs.first, pairs.second, pairs.first])
    blocks[rows, :, columns, :, pairs.sets] += np.array([block, block, -block])


_Spread = Callable[[Floats, Floats], tuple[Floats, Floats]]


def _soften(
    system: Floats, operator: ComplianceOperator, pairs: Pairs, hands: Hands, off: Floats | None
) -> _Spread:
    """Let hands give way in equations (k + 1, k, S), as of `_solve_positive`, in place.

    Two hands on one brick, of which one gives way, share what acts along it as they give. Where
    they are nearly rigid that is told apart from what both bear, so that it stays accurate.

    ``off`` (n, S): by how much hands already let their nodes move. Result: the function that
    returns forces (k, S) and pivots (k, S) of the grips from those of the equations.
    """
    count, sets = system.shape[1:]
    grips = _count_grips(operator, count)
    rigid = pairs.rigid(hands, sets, grips)
    close = _nearly_rigid(system, operator, pairs, hands) & ~rigid
    apart = _told_apart(system, operator, pairs.only(close), hands, off) if close.any() else None
    _add_give(system, operator, hands)
    if off is not None:
        system[-1, : len(off)] -= off
    if apart is not None:
        system[:, :, apart.sets] = apart.system
    if rigid.any():
        nodes = grips * operator.directions
        _brace(system[:nodes, :nodes], pairs.only(rigid))
    _let_turn(system, operator, hands)
    return _as_they_are if apart is None else apart.joined


_CLOSE = 1e-4  # give of two hands on one brick, over its flexibility, below which digits are lost


def _as_they_are(force: Floats, pivot: Floats) -> tuple[Floats, Floats]:
    """Return forces and pivots of equations in which no pair is told apart."""
    return force, pivot


def _nearly_rigid(
    system: Floats, operator: ComplianceOperator, pairs: Pairs, hands: Hands
) -> Bools:
    """Return which pairs (p,) give so little along their bricks that digits would be lost."""
    if not len(pairs.sets):
        return np.zeros(0, dtype=bool)
    width = operator.directions
    give = hands.each_give(system.shape[2], _count_grips(operator, system.shape[1]))
    own = give[pairs.sets, pairs.first] + give[pairs.sets, pairs.second]
    along = np.einsum("pi,pij,pj->p", pairs.axis, own[:, :width, :width], pairs.axis)
    rows = width * pairs.second[:, None] + np.arange(width)
    stands = system[rows, rows, pairs.sets[:, None]].mean(axis=1)
    return np.asarray(along < _CLOSE * stands)


def _rows_of(operator: ComplianceOperator, grips: int, grip: int, ways: int) -> list[int]:
    """Return the rows of the unknowns of a grip, of which there are as many."""
    width = operator.directions
    force = [grip * width + way for way in range(width)]
    rest = ways - width
    return force + [grips * width + grip * rest + way for way in range(rest)]


def _add_give(system: Floats, operator: ComplianceOperator, hands: Hands) -> None:
    """Add to equations, in place, how every hand gives way."""
    grips = _count_grips(operator, system.shape[1])
    assert hands.give is not None
    ways, used = hands.give.shape[2], np.asarray(hands.give.any(axis=0))
    for grip in range(grips):
        rows = _rows_of(operator, grips, grip, ways)
        for a, b in _lower(ways):
            if used[a, b]:
                own = hands.kind[:, 0 if hands.alike else grip]
                system[rows[a], rows[b]] += hands.give[own, a, b]


def _lower(ways: int) -> list[tuple[int, int]]:
    """Return the places of a lower triangle."""
    return [(a, b) for a in range(ways) for b in range(a + 1)]


def _let_turn(system: Floats, operator: ComplianceOperator, hands: Hands) -> None:
    """Let hands that bear no moment bear none, where others of the scene do, in place."""
    count, sets = system.shape[1:]
    grips = _count_grips(operator, count)
    free = ~hands.each_turns(sets, grips)
    if not operator.moments or not free.any():
        return
    for grip in range(grips):
        mine = np.flatnonzero(free[:, grip])
        for row in _rows_of(operator, grips, grip, operator.directions + operator.moments)[
            operator.directions :
        ]:
            system[row][:, mine] = 0.0
            system[:, row, mine] = 0.0
            system[row, row, mine] = 1.0


class _Apart(NamedTuple):
    """Equations of sets in which two hands share a brick and one gives way.

    What both bear along the brick, and what one bears for the other, are told apart.
    """

    sets: Ints  # (n,)
    system: Floats  # (k + 1, k, n)
    forces: Floats  # (n, k, k); those of grips for unit unknowns
    factor: Floats  # (k, n); by how much less an unknown is determined than its pivot says

    def joined(self, force: Floats, pivot: Floats) -> tuple[Floats, Floats]:
        """Return the forces (k, S) of grips and their pivots (k, S) from those of unknowns."""
        force[:, self.sets] = np.einsum("nij,jn->in", self.forces, force[:, self.sets])
        pivot[:, self.sets] /= self.factor
        return force, pivot


def _told_apart(
    system: Floats, operator: ComplianceOperator, pairs: Pairs, hands: Hands, off: Floats | None
) -> _Apart:
    """Return the equations of the sets of pairs of which one hand gives way, changed."""
    count = system.shape[1]
    sets = np.unique(pairs.sets)
    part = system[:, :, sets].transpose(2, 0, 1)
    whole = np.tril(part[:, :count])
    whole += np.tril(whole, -1).transpose(0, 2, 1)
    give = _full_give(operator, hands.of(sets), len(sets), count)
    forces, kept = np.tile(np.eye(count), (2, len(sets), 1, 1))
    factor, width = np.ones((count, len(sets))), operator.directions
    for at, first, second, _, axis in zip(*pairs, strict=True):
        n = int(np.searchsorted(sets, at))
        one, other = (slice(width * g, width * g + width) for g in (first, second))
        own = give[n, one, one] + give[n, other, other]
        size = np.sqrt(np.trace(whole[n, other, other]) / width / (axis @ own @ axis))
        along = np.outer(axis, axis)
        kept[n, other, other] -= along
        forces[n, other, other] += (size - 1) * along
        forces[n, one, other] = -size * along
        factor[other, n] = max(1.0, size)
    load = np.einsum("nj,nji->ni", part[:, count], kept)
    if off is not None:
        own_off = np.pad(off[:, sets], ((0, count - len(off)), (0, 0)))
        load -= np.einsum("jn,nji->ni", own_off, forces)
    out = np.empty((len(sets), count + 1, count))
    out[:, :count] = kept.transpose(0, 2, 1) @ whole @ kept
    out[:, :count] += forces.transpose(0, 2, 1) @ give @ forces
    out[:, count] = load
    return _Apart(sets, out.transpose(1, 2, 0), forces, factor)


def _full_give(operator: ComplianceOperator, hands: Hands, sets: int, count: int) -> Floats:
    """Return how hands give way as matrices (n, k, k) of all unknowns."""
    grips = _count_grips(operator, count)
    each, out = hands.each_give(sets, grips), np.zeros((sets, count, count))
    for grip in range(grips):
        rows = _rows_of(operator, grips, grip, each.shape[2])
        out[:, np.array(rows)[:, None], rows] = each[:, grip]
    return out
