r"""Lower bounds of paths by what proves them: multipliers of caps, and labels.

It shares nothing with the formulations that it judges. Every multiplier :math:`\lambda \ge 0` of
the caps proves a Lagrangian bound: the least cost of any path with them, by potentials that are
checked. The best ones come by cutting planes (`seqopt.graph._budgets`); wherever they come from,
only the bound that they prove counts.

Then labels of partial paths close what multipliers leave open. They too may come from wherever they
do (`seqopt.graph._labels`): those that are no worse than the answer, within the caps and dominated
by no other one; if there are too many, the least bound of those left out holds for all.

Labels, of a sweep or of a formulation, say of some states what paths to them have come to in all
resources. They prove that no path is better if every successor of one of them is dominated by
another one, or cannot end better: that is computed again, by the judge's own books of resources.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph._budgets import Plane, Polyhedron, _cheapest, highest_bound
from seqopt.graph._labels import CappedSums, Joint, Sweep, Swept
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph, _to_go, least_sum, moves_out, strictly_below, tied
from seqopt.problem.requirements import Resource, StepArrays

MIXTURES = 80  # multipliers that are tried
DEAREST = 1e7  # largest multiplier, over what a path costs per unit of a cap
MOST = 5_000  # partial paths that are kept at a level
SLACK = 1e-9  # of a cap or a cost: what sums are off by; caps have as much more
EPS = float(np.finfo(float).eps)
TINY = float(np.finfo(float).tiny)
BETTER = 1e-9  # over a value: a path must be better by more than this
CHUNK = 400_000  # successors of labels that are looked at together
Labelled = tuple[Ints, Floats]  # numbers of states (N,), and values (N, k)
Excused = Callable[[Ints], Bools]  # which states need not be looked at: they are proven to fall


@dataclass(frozen=True, eq=False)
class _Case:
    """A scaled problem: costs (m,) and uses (m, B) of caps by moves, over their ``sizes``.

    ``value``: of a path within the caps; no higher bound is looked for.
    """

    graph: Graph
    costs: Floats
    takes: Floats
    caps: Floats
    sizes: Floats
    value: float

    @property
    def slack(self) -> float:
        """Rounding error of costs."""
        return SLACK * max(abs(self.value), TINY)


def _case(graph: Graph, costs: Floats, limited: Sequence[tuple[int, float]], value: float) -> _Case:
    taken = graph.amounts[:, [column for column, _ in limited]]
    most = np.array([cap for _, cap in limited])
    sizes = np.maximum(np.maximum(np.abs(most), np.abs(taken).max(axis=0, initial=0.0)), TINY)
    return _Case(graph, costs, taken / sizes, most / sizes + SLACK, sizes, value)


def least_within(
    graph: Graph,
    costs: Floats,
    limited: Sequence[tuple[int, float]],
    value: float,
    *,
    prices: Sequence[float] = (),
    laid_down: bool = False,
) -> tuple[float, Floats]:
    """Return a lower bound of paths within caps, at most a value, and its multipliers (B,).

    ``limited``: columns and what may be taken of them; ``value``: of a path within the caps;
    ``prices``: multipliers that are tried first, by default none; ``laid_down``: whether what
    multipliers leave open is closed by partial paths; the graph has a level for every move.
    """
    case = _case(graph, costs, limited, value)
    begin = np.array(prices) if len(prices) else np.zeros(len(limited))
    best, bound, _ = _best_multipliers(case, begin * case.sizes)
    if laid_down and value - bound > case.slack:
        bound = max(bound, _by_labels(case, best))
    return (value if value - bound <= case.slack else bound), best / case.sizes


def is_kept(graph: Graph, limited: Sequence[tuple[int, float]], *, laid_down: bool) -> bool:
    """Return whether a path is found that keeps all caps; ``laid_down``: as of `least_within`."""
    case, none = _case(graph, np.zeros(len(graph.source)), limited, 1.0), np.zeros(len(limited))
    best = _best_multipliers(case, none)
    if best.met or not laid_down:
        return best.met
    arcs = _swept(case, best.multipliers).arcs
    return bool(len(arcs) and (case.takes[arcs].sum(axis=0) <= case.caps).all())


def is_beyond(graph: Graph, limited: Sequence[tuple[int, float]]) -> bool:
    """Return whether potentials or multipliers prove that no path keeps all caps."""
    if any(least_sum(graph, graph.amounts[:, column]) > tied(most) for column, most in limited):
        return True
    return least_within(graph, np.zeros(len(graph.source)), limited, 1.0)[0] >= 1.0


class _Ascent(NamedTuple):
    """The best multipliers, the bound that they prove, and whether a path met keeps all caps."""

    multipliers: Floats
    bound: float
    met: bool


def _best_multipliers(case: _Case, start: Floats) -> _Ascent:
    """Return the best multipliers found from some on; each bound is checked here."""
    best, graph = _Ascent(start, -np.inf, met=False), case.graph

    def asked(prices: Floats) -> Plane | None:
        nonlocal best
        costs = case.costs + case.takes @ prices
        moves = _cheapest(graph, costs)
        if moves is None:
            best = best._replace(bound=np.inf)
            return None
        rounding = EPS * (graph.states + 1) * float(prices @ (1 + np.abs(case.caps)))
        bound = least_sum(graph, costs) - float(prices @ case.caps) - rounding
        over = case.takes[moves].sum(axis=0) - case.caps
        best = best._replace(met=best.met or bool((over <= 0).all()))
        if bound > best.bound:
            best = best._replace(multipliers=prices, bound=bound)
        return Plane(float(case.costs[moves].sum()), over, bound)

    def ended(bound: float) -> bool:
        return case.value - bound <= case.slack

    region = Polyhedron(DEAREST, units=np.ones(len(start)))
    highest_bound(asked, start, region, ended, rounds=MIXTURES, closed=SLACK)
    return best._replace(bound=best.bound - SLACK**0.5 * case.slack)


def _swept(case: _Case, multipliers: Floats) -> Swept:
    """Return labels of partial paths below the value and within the caps, and the best path."""
    sums = CappedSums(case.graph, case.costs, case.takes, case.caps, multipliers)
    limits = np.array([strictly_below(case.value), *case.caps])
    return Sweep(Joint(case.graph, [sums]), limits, width=MOST).run(Watch())


def _by_labels(case: _Case, multipliers: Floats) -> float:
    """Return the bound that labels of a sweep prove, wherever they come from; they are checked.

    A path below it and within the caps has a Lagrangian cost below it, too: what is pruned by that.
    """
    found, graph, move = _swept(case, multipliers), case.graph, np.arange(len(case.graph.source))
    bound = min(case.value, found.best, found.left_out)
    paid, below = float(multipliers @ case.caps), limit_below(bound)
    most, strict = np.array([below, *case.caps, below + paid]), np.ones(2 + len(case.caps), bool)
    strict[1:-1] = False
    amounts = np.column_stack([case.costs, case.takes, case.costs + case.takes @ multipliers])
    closed = Closed(graph, move, [SumBook(graph, move, amounts, (most, strict))])
    state, taken = (np.concatenate([own[k] for own in found.kept]) for k in (0, 1))
    labels = state, np.column_stack([taken, taken[:, 0] + taken[:, 1:] @ multipliers])
    return bound if closed.is_proof(labels, lambda some: np.zeros(len(some), bool)) else -np.inf


class Book:
    """One resource as the judge follows it, on arcs (a,) that are sorted by their sources.

    ``first`` (k,): values at the start.
    """

    first: Floats

    def follow(self, arc: Ints, values: Floats) -> Floats:
        """Return values (N, k) after arcs (N,); infinite where they may not be taken."""
        raise NotImplementedError

    def beyond(self, state: Ints, values: Floats) -> Bools:
        """Return which labels lead to nothing that is within the limits, (N,)."""
        return np.zeros(len(state), dtype=bool)

    def counted(self, state: Ints, values: Floats) -> Floats:
        """Return values (N, k) as they are compared for dominance."""
        return values

    def dominated(self, first: Floats, other: Floats) -> Bools:
        """Return where the first values (N, k) dominate the others."""
        return np.asarray((first <= other + np.abs(other) * 1e-12).all(axis=1))

    def ends(self, values: Floats) -> Bools:
        """Return with which values a path may end, (N,)."""
        return np.ones(len(values), dtype=bool)


class SumBook(Book):
    """Sums of amounts of arcs (a, q) within limits (q,); ``strict`` (q,): below these.

    ``graph``: without variants of arcs, ``move`` (a,): which of its moves arcs are.
    """

    def __init__(
        self, graph: Graph, move: Ints, amounts: Floats, limits: tuple[Floats, Bools]
    ) -> None:
        (self._most, self._strict), self._amounts = limits, amounts[move]
        self._left = np.column_stack([_to_go(graph, own) for own in amounts.T])
        self.first = np.zeros(amounts.shape[1])

    def follow(self, arc: Ints, values: Floats) -> Floats:
        return np.asarray(values + self._amounts[arc])

    def beyond(self, state: Ints, values: Floats) -> Bools:
        return is_beyond_limits(values + self._left[state], self._most, self._strict)


class TwinBook(Book):
    """A resource of a problem by its twin; ``steps`` (a,): what it sees of arcs."""

    def __init__(self, twin: Resource, steps: StepArrays) -> None:
        self._twin, self._steps, self.first = twin, steps, np.array(twin.start, dtype=float)

    def follow(self, arc: Ints, values: Floats) -> Floats:
        return self._twin.extended(self._steps.only(arc), values)

    def dominated(self, first: Floats, other: Floats) -> Bools:
        return self._twin.dominated(first, other)

    def ends(self, values: Floats) -> Bools:
        return self._twin.ends(values)


def is_beyond_limits(bounds: Floats, most: Floats, strict: Bools) -> Bools:
    """Return which rows of bounds (N, b) exceed a limit (b,), or attain it where it is strict."""
    slack = np.where(np.isfinite(most), 1e-12 * np.abs(most), 0.0)
    return np.asarray(np.where(strict, bounds >= most - slack, bounds > most).any(axis=1))


class Closed:
    """Labels to be checked as a proof: all successors are dominated, or pruned by bounds.

    ``graph``: states and moves; ``move`` (a,): of arcs, ascending; ``books``: of all resources.
    """

    def __init__(self, graph: Graph, move: Ints, books: Sequence[Book]) -> None:
        rows = graph.source[move], graph.target[move]
        self._graph, self._arcs = graph, Graph(*rows, np.zeros((len(move), 0)), (), graph.ends)
        cuts = np.cumsum([0, *(len(book.first) for book in books)]).tolist()
        self._books = [(b, slice(*cut)) for b, cut in zip(books, pairwise(cuts), strict=True)]
        self.width = cuts[-1]

    def is_proof(self, labels: Labelled, excused: Excused) -> bool:
        """Return whether labels prove that nothing is within the limits."""
        state, values = labels
        over = self._graph.ends[state] & self._joined("ends", values).all(axis=0)
        useful = self._open(state, values) & ~over
        order = np.lexsort((values[useful, 0], state[useful]))
        known = state[useful][order], values[useful][order]
        first = np.concatenate([book.first for book, _ in self._books])[None]
        start = np.zeros(1, dtype=np.int64)
        missing = [start[self._lacks(known, start, first)]]
        counts = np.bincount(self._arcs.source, minlength=self._graph.states)[known[0]]
        cuts = np.searchsorted(np.cumsum(counts), np.arange(CHUNK, counts.sum() + CHUNK, CHUNK))
        for rows in np.split(np.arange(len(counts)), np.unique(cuts)):
            row, arc = moves_out(self._arcs, known[0][rows])
            before = known[1][rows[row]]
            after = np.hstack([book.follow(arc, before[:, own]) for book, own in self._books])
            to, ever = self._arcs.target[arc].astype(np.int64), np.isfinite(after).all(axis=1)
            missing.append(to[ever][self._lacks(known, to[ever], after[ever])])
        return self._are_dead(np.unique(np.concatenate(missing)), excused)

    def _joined(self, name: str, values: Floats) -> Bools:
        return np.array([getattr(book, name)(values[:, own]) for book, own in self._books])

    def _are_dead(self, states: Ints, excused: Excused) -> bool:
        """Return whether all paths from some states to an end pass one that is proven to fall."""
        graph, seen = self._graph, np.zeros(self._graph.states, dtype=bool)
        while len(states):
            seen[states] = True
            states = states[~excused(states)]
            if graph.ends[states].any():
                return False
            after = np.unique(graph.target[np.isin(graph.source, states)]).astype(np.int64)
            states = after[~seen[after]]
        return True

    def _open(self, state: Ints, values: Floats) -> Bools:
        """Return which labels may still reach an end within the limits."""
        out = np.ones(len(state), dtype=bool)
        for book, own in self._books:
            out &= ~book.beyond(state, values[:, own])
        return out

    def _lacks(self, known: Labelled, state: Ints, values: Floats) -> Bools:
        """Return which labels may be better and are not dominated by a known one."""
        counted = np.hstack([book.counted(state, values[:, own]) for book, own in self._books])
        out = self._open(state, counted)
        over = self._graph.ends[state] & self._joined("ends", values).all(axis=0)
        rows = np.flatnonzero(out & ~over)
        place, end = (np.searchsorted(known[0], state[rows], side=s) for s in ("left", "right"))
        while len(rows):
            some = place < end
            rows, place, end = rows[some], place[some], end[some]
            below = np.ones(len(rows), dtype=bool)
            for book, own in self._books:
                below &= book.dominated(known[1][place, own], counted[rows, own])
            out[rows[below]] = False
            rows, place, end = rows[~below], place[~below] + 1, end[~below]
        return out


def limit_below(value: float) -> float:
    """Return the least that is no better than a value."""
    return value - BETTER * abs(value)
