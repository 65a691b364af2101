r"""What a unit wrench on any brick moves and stresses, grown brick by brick in one pair of arrays.

A new brick hangs on the tree by one spring: it moves as its parent does, and by what the spring
gives. That only borders the arrays. Every other spring that begins to act with it closes a loop;
all of them together change what stands by a correction of rank :math:`6m`,

.. math:: S = C + \Gamma B, \qquad X = -\Gamma S^{-1}, \qquad G \leftarrow G + X \Gamma^T

with the gaps :math:`\Gamma` at these springs under each load, their own compliances :math:`C` and
the loads :math:`B` that their wrenches :math:`X` are. A gap is summed along the shortest way
through springs that act already, from what each transmits: the small difference of two large
motions would lose digits.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import parent_process
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.network._mechanics import point_motion
from seqopt.network.network import GROUND, Network

TINY, ROUNDING = np.finfo(float).tiny, np.finfo(float).eps
_AT_ONCE = 2**17  # numbers changed at a time: they stay in the processor's cache
_LEAST = 4  # times as many, from which on one more thread pays
_SUMMED = 2**22  # the same, where much is done with each, brick after brick
_TAKEN = 1e3  # times less a brick moves in closed loops: rounding of what is gone would show
_WORSE = 10.0  # times the rounding that was left when they were summed anew
_SAMPLE = 600  # motions that are compared with each other, about
_MOST = 0.95  # share of all pairs of motions whose asymmetry counts as rounding


@dataclass(frozen=True, eq=False, repr=False)
class SpanningTree(FrozenValue):
    """A tree in which every brick hangs on one spring; arrays run over the first bricks placed."""

    spring: Ints  # (B,); the spring that each brick hangs on
    parent: Ints  # (B,); the brick at the spring's other end, or `GROUND`


def grow_tree(network: Network) -> SpanningTree:
    """Return the tree that hangs every brick, when placed, on the spring nearest to the ground.

    It ends before the brick with which a spring without stiffness in some direction begins to act,
    or that is placed without a spring to what stands: from there on a structure may have no
    compliance of its own.
    """
    springs = network.springs
    slack = springs.since[(springs.stiffness <= 0).any(axis=1)]
    hung = springs.bodies[springs.since == springs.bodies[:, 1] + 1, 1]
    bare = np.setdiff1d(np.arange(len(network.inner)), hung)
    count = int(min([len(network.inner), *bare, *(slack - 1)]))
    spring, parent = np.empty((2, count), dtype=np.int64)
    depth = np.zeros(count + 1, dtype=np.int64)  # the ground, index -1, comes last
    for b in range(count):
        mine = np.flatnonzero((springs.bodies[:, 1] == b) & (springs.since == b + 1))
        best = mine[np.argmin(depth[springs.bodies[mine, 0]])]
        spring[b], parent[b] = best, springs.bodies[best, 0]
        depth[b] = depth[parent[b]] + 1
    return SpanningTree(spring, parent)


class _Before(NamedTuple):
    """The last brick count but one: answers to its weight, lost digits, and later changes.

    ``closing`` (1 + kb, n), ``changes`` of n rows: what loops added to twists and wrenches.
    """

    weighed: list[Floats]
    loss: Floats
    closing: Floats
    changes: list[Floats]


class Growth:
    """The answers of a growing structure to its weight and to unit wrenches on its bricks.

    Row 0 is the weight of the bricks that stand with all else that loads and moves them, row
    ``1 + 6b + i`` a unit of component ``i`` on brick b at its centroid. The arrays have room for
    all bricks of the tree.

    ``tree``: on which the bricks hang. ``twist`` (1 + 6B, 6B): of the bricks, m and rad; ``wrench``
    (1 + 6B, 2, 3S): forces, N, then moments, N m, of every spring on its second body; ``loss``
    (B,): how much more than the last digit of a brick's motions is rounding, as what moved it
    further before is gone; ``remembers``: whether `answers` takes the last brick count but one from
    the last, which differs in rounding.
    """

    remembers = False

    def __init__(self, network: Network, tree: SpanningTree) -> None:
        self._network, self._tree = network, tree
        most = 6 * len(tree.spring)
        counts = np.arange(len(tree.spring) + 1)
        # how many springs act on as many bricks
        self._acting = np.searchsorted(network.springs.since, counts, side="right").tolist()
        springs, first = network.springs, self._acting[-1]
        self._compliance = np.zeros((first, 6, 6))  # of springs, m/N and rad/(N m)
        for own, given in (
            (slice(3), springs.translational_stiffness),
            (slice(3, 6), springs.rotational_stiffness),
        ):
            axes = springs.axes[:first]
            self._compliance[:, own, own] = axes.transpose(0, 2, 1) / given[:first, None] @ axes
        self._shift = network.springs.movement[: self._acting[-1]]
        center = network.centroid[: len(tree.spring)]
        self._own_arm = _carried(center - network.springs.position[tree.spring])
        self._along = _carried(center - center[tree.parent])
        self.loss = np.ones(len(tree.spring))
        self.twist = np.empty((1 + most, most))
        self.wrench = np.zeros((1 + most, 2, 3 * self._acting[-1]))
        self._before: _Before | None = None
        self._start()

    def reach(self, bricks: int) -> None:
        """Let a number of bricks stand, at most the tree's; fewer than before are begun anew."""
        if bricks < self.bricks:
            self.wrench[:] = 0.0  # springs not of the tree act on all rows
            self._start()
        while self.bricks < bricks:
            weighed = [each.copy() for each in self._answers(0)]
            loss = self.loss[: self.bricks].copy()
            self._add()
            closing, changes = np.empty((1 + self._moves, 0)), [np.empty((0, 1))] * 3
            mine = np.arange(*self._acting[self.bricks - 1 : self.bricks + 1])
            others = mine[mine != self._tree.spring[self.bricks - 1]]
            if others.size:
                closing, changes = self._close(others)
            self._before = _Before(weighed, loss, closing, changes)

    def reaches(self, bricks: int) -> bool:
        """Return whether a brick count is answered without beginning anew."""
        return bricks >= self.bricks - (self.remembers and self._before is not None)

    def answers(self, bricks: int, held: Ints) -> tuple[Floats, Floats, Floats]:
        """Return twists and wrenches (1 + kh, n) by the weight and unit wrenches, and loss (h,)."""
        if bricks > self.bricks or not self.reaches(bricks):
            self.reach(bricks)
        rows: slice | Ints = slice(1 + 6 * bricks)
        if len(held) < bricks:
            every = 1 + 6 * held[:, None] + np.arange(6)
            rows = np.concatenate([[0], every.ravel()])
        found, loss = [*self._answers(rows)], self.loss
        if bricks < self.bricks and self._before is not None:
            weighed, loss, closing, changes = self._before
            for i, (change, row) in enumerate(zip(changes, weighed, strict=True)):
                found[i] = (found[i] - closing[rows] @ change)[:, : len(row)]
                found[i][0] = row
        wrench = [part.reshape(len(part), -1, 1, 3) for part in found[1:]]
        return found[0], np.concatenate(wrench, axis=2).reshape(len(found[0]), -1), loss[held]

    @property
    def _moves(self) -> int:
        return 6 * self.bricks

    def _answers(self, rows: slice | Ints | int) -> tuple[Floats, Floats, Floats]:
        """Return twists of bricks that stand, and forces and moments of springs that act."""
        force, moment = self.wrench[:, :, : 3 * self._acting[self.bricks]].swapaxes(0, 1)
        return self.twist[:, : self._moves][rows], force[rows], moment[rows]

    def _start(self) -> None:
        self.bricks, self._left = 0, 1.0  # rounding when the twists were summed anew
        self._before = None
        self._tie(np.arange(0))
        self.twist[0] = 0.0

    def _add(self) -> None:
        """Hang the next brick on its spring."""
        tree, k, brick = self._tree, 6, self.bricks
        spring, parent = int(tree.spring[brick]), int(tree.parent[brick])
        old, after = slice(0, 1 + k * brick), 1 + k * brick
        mine, rows = slice(k * brick, k * brick + k), slice(after, after + k)
        self.bricks += 1
        self.wrench[0, :, 3 * self._acting[brick] : 3 * self._acting[self.bricks]] = 0.0
        acting = slice(3 * self._acting[self.bricks])  # of old rows as of new springs: zeros
        own, along = self._own_arm[brick], self._along[brick]
        flexibility = own @ self._compliance[spring] @ own.T
        if parent != GROUND:
            moved = slice(k * parent, k * parent + k)
            theirs = slice(1 + moved.start, 1 + moved.stop)
            self.twist[rows, : k * brick] = along @ self.twist[theirs, : k * brick]
            self.twist[old, mine] = self.twist[old, moved] @ along.T
            self.wrench[rows, :, acting] = np.tensordot(along, self.wrench[theirs, :, acting], 1)
            flexibility = flexibility + along @ self.twist[theirs, moved] @ along.T
            self.loss[brick] = self.loss[parent]
        else:
            self.twist[rows, : k * brick], self.twist[old, mine] = 0.0, 0.0
            self.wrench[rows, :, acting] = 0.0
            self.loss[brick] = 1.0
            if self._shift[spring].any():
                self.twist[0, mine] = own @ self._shift[spring]
        self.twist[rows, mine] = flexibility
        self.wrench[rows, :, self._of(spring)] = -own.reshape(k, 2, 3)
        pulls = [(brick, self._network.weight[brick])]  # and loads that begin with it
        begun = self._network.applied(brick + 1, before=brick)
        pulls += [(body, begun[body]) for body in np.flatnonzero(begun.any(axis=1)).tolist()]
        for body, pull in pulls:
            loaded = self._answers(slice(1 + k * body, 1 + k * body + len(pull)))
            for weighed, answer in zip(self._answers(0), loaded, strict=True):
                weighed[:] += pull @ answer
        self._tie(np.array([spring]), self._ties)

    def _of(self, spring: int) -> slice:
        """Return the columns of a spring's forces, and of its moments."""
        return slice(3 * spring, 3 * spring + 3)

    def _close(self, springs: Ints) -> tuple[Floats, list[Floats]]:
        """Let springs act that close loops; return the changes, as `_Before` has them."""
        k, rows = 6, slice(0, 1 + self._moves)
        gaps = np.concatenate([self._gap(s) for s in springs], axis=1)
        answers = self._answers(rows)
        pulled = [np.concatenate([self._pulled(e, s) for s in springs]) for e in answers[1:]]
        own = linalg.block_diag(*self._compliance[springs])
        system = own + np.concatenate([self._pulled(gaps, s) for s in springs])
        factors = linalg.lu_factor(0.5 * (system + system.T))
        closing = -linalg.lu_solve(factors, gaps.T).T
        closing -= linalg.lu_solve(factors, (gaps + closing @ system).T).T
        changes, before = [np.ascontiguousarray(gaps[1:].T), *pulled], self._own().copy()
        _add_products(answers, closing, changes)
        for i, spring in enumerate(springs.tolist()):
            mine = closing[:, k * i : k * i + k].reshape(-1, 2, 3)
            self.wrench[rows, :, self._of(spring)] = mine
        self._tie(springs, self._ties)
        lost = (before / np.maximum(self._own(), TINY)).reshape(self.bricks, k).max(axis=1)
        self.loss[: self.bricks] *= np.maximum(lost, 1.0)
        if self.loss[: self.bricks].max() > max(_TAKEN, _WORSE * self._left):
            self._sum_again()
        return closing, changes

    def _own(self) -> Floats:
        """Return how far unit wrenches move their own bricks, (kb,)."""
        return self.twist[1 : 1 + self._moves, : self._moves].diagonal()

    def _sum_again(self) -> None:
        """Sum all twists anew, by spring deformations on the shortest path from the ground."""
        k, springs, center = 6, self._network.springs, self._network.centroid
        ways, shift = [], np.zeros((self.bricks, k))  # the ground's, where bricks hang on it
        for parent, brick, spring, sign in self._ways(GROUND):
            at_spring = _carried(center[brick] - springs.position[spring])
            given = self._compliance[spring] @ at_spring.T
            arm = center[brick] - center[parent] if parent != GROUND else np.zeros(3)
            ways.append((brick, parent, spring, -sign * given, _carried(arm).T))
            shift[brick] = at_spring @ self._shift[spring]
        step = max(1, _SUMMED // self._moves)
        for start in range(0, 1 + self._moves, step):
            part = slice(start, min(start + step, 1 + self._moves))
            twist = self.twist[part].reshape(part.stop - start, -1, k)
            for brick, parent, spring, given, along in ways:
                twist[:, brick] = self.wrench[part, :, self._of(spring)].reshape(-1, k) @ given
                if parent != GROUND:
                    twist[:, brick] += twist[:, parent] @ along
                elif start == 0:
                    twist[0, brick] += shift[brick]
        # by how many last digits what should be symmetric is not: that is rounding
        some = np.linspace(0, self._moves - 1, min(self._moves, _SAMPLE)).astype(int)
        matrix, root = self.twist[np.ix_(1 + some, some)], np.sqrt(np.abs(self._own()[some]))
        apart = np.abs(matrix - matrix.T) / np.maximum(root * root[:, None], TINY)
        self._left = max(1.0, float(np.quantile(apart, _MOST)) / ROUNDING)
        self.loss[: self.bricks] = self._left

    def _gap(self, spring: int) -> Floats:
        """Return how far the bodies of a spring part at it under every load, (1 + kb, k)."""
        springs = self._network.springs
        at, out = springs.position[spring], np.zeros((1 + self._moves, 6))
        first, body = springs.bodies[spring].tolist()
        trail = {}
        for before, after, s, sign in self._ways(first):
            trail[after] = before, s, sign
            if after == body:
                break
        while body != first:
            body, s, sign = trail[body]
            carried = _carried(at - springs.position[s])
            turn = self._compliance[s] @ carried.T
            out -= self.wrench[: len(out), :, self._of(s)].reshape(-1, 6) @ (sign * turn)
            out[0] += sign * carried @ self._shift[s]
        out[0] -= self._shift[spring]
        return out

    def _tie(self, springs: Ints, ties: dict[int, dict[int, int]] | None = None) -> None:
        """Let ways lead through springs, beside those that do or alone."""
        self._ties: dict[int, dict[int, int]] = {GROUND: {}} if ties is None else ties
        bodies = self._network.springs.bodies[springs].tolist()
        for spring, (first, second) in zip(springs.tolist(), bodies, strict=True):
            self._ties.setdefault(first, {})[second] = spring
            self._ties.setdefault(second, {})[first] = spring

    def _ways(self, start: int) -> Iterator[tuple[int, int, int, float]]:
        """Yield the bodies before and after a spring on ways from one, it, and its sign.

        Nearest first; the sign is negative where its second body comes before.
        """
        seen, queue = {start}, deque([start])
        while queue:
            body = queue.popleft()
            for other, spring in self._ties[body].items():
                if other not in seen:
                    seen.add(other)
                    queue.append(other)
                    second = self._network.springs.bodies[spring, 1]
                    yield body, other, spring, 1.0 if second == other else -1.0

    def _pulled(self, answers: Floats, spring: int) -> Floats:
        """Return rows of the answers to a spring's unit wrenches on both its bodies."""
        k, springs = 6, self._network.springs
        out = np.zeros((k, answers.shape[1]))
        for body, sign in zip(springs.bodies[spring].tolist(), (-1.0, 1.0), strict=True):
            if body != GROUND:
                arm = springs.position[spring] - self._network.centroid[body]
                out += sign * _carried(arm) @ answers[1 + k * body : 1 + k * body + k]
        return out


def _carried(arm: Floats) -> Floats:
    """Return the twists (.., 6, 6) at the ends of arms (.., 3) for unit twists at its start."""
    turned = np.broadcast_to(np.eye(6)[3:], (*arm.shape[:-1], 3, 6))
    return np.concatenate([point_motion(arm), turned], axis=-2)


def _add_products(targets: Sequence[Floats], left: Floats, changes: Sequence[Floats]) -> None:
    """Add to matrices (n, m) products of one (n, p) with others (p, m), a few rows at a time."""
    step = max(1, _AT_ONCE // max(target.shape[1] for target in targets))
    starts = range(0, len(left), step)
    threads = min(_cores(), len(starts) // _LEAST)

    def add(first: int) -> None:
        rooms = np.empty(step * max(target.shape[1] for target in targets))
        for start in starts[first :: max(threads, 1)]:
            some = left[start : start + step]
            for target, change in zip(targets, changes, strict=True):
                part = target[start : start + step]
                part += np.matmul(some, change, out=rooms[: part.size].reshape(part.shape))

    _in_threads(add, range(max(threads, 1)))


@cache
def _cores() -> int:
    """Return on how many cores this process may work: one where it is one of several workers."""
    if parent_process() is not None:
        return 1
    known = getattr(os, "sched_getaffinity", None)  # not everywhere
    return len(known(0)) if known else os.cpu_count() or 1


def _in_threads(function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
    """Return what a function that leaves Python's lock alone makes of tasks, one a thread."""
    first, *others = tasks
    if not others:
        return [function(first)]
    with ThreadPoolExecutor(len(others)) as pool:
        found = pool.map(function, others)  # begun at once
        return [function(first), *found]
