r"""Lower bounds of paths, by arithmetic on the arrays of a graph.

Bounds come goal after goal: a `Stage` has the arcs that are left once the goals before it are at
their values, and the sums that are capped then. Nothing is shared with the formulations that are
judged. What proves a bound may come from wherever it does; only inequalities count that are
checked here:

- *Potentials* bound a sum, a *cut* bounds a worst amount (`seqopt.graph.graph`).
- *Multipliers* :math:`\lambda \ge 0` of caps prove a Lagrangian bound: the least cost of any path
  with them, by potentials. The best ones come by cutting planes (`seqopt.graph._budgets`).
- *Labels* of partial paths close what multipliers leave open. They say of some states what paths to
  them have come to in all resources. No path is better if every successor of one of them is
  dominated by another one, or cannot end better: that is computed again, by the judge's own books
  of resources. A sweep (`seqopt.graph._budgets`) finds them, or a formulation; if there are too
  many, the least bound of those left out holds for all.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph._budgets import (
    CappedSums,
    Joint,
    Plane,
    Polyhedron,
    Sweep,
    Swept,
    _cheapest,
    highest_bound,
)
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import (
    PEAK,
    ROUNDING,
    SUM,
    TIED,
    TIME,
    Graph,
    _Target,
    _to_go,
    cut,
    least_sum,
    moves_out,
    strictly_below,
    tied,
)
from seqopt.judge.certificate import limit_below
from seqopt.problem.requirements import Resource, StepArrays

ABOVE = 1e-6  # over a value: how far a claim may be above what is proven
MIXTURES = 80  # multipliers that are tried
DEAREST = 1e7  # largest multiplier, over what a path costs per unit of a cap
MOST = 5_000  # partial paths that are kept at a level
SLACK = 1e-9  # of a cap or a cost: what sums are off by; caps have as much more
EPS = float(np.finfo(float).eps)
TINY = float(np.finfo(float).tiny)
CHUNK = 400_000  # successors of labels that are looked at together
Labelled = tuple[Ints, Floats]  # numbers of states (N,), and values (N, k)
Excused = Callable[[Ints], Bools]  # which states need not be looked at: they are proven to fall


class Stage(NamedTuple):
    """What is left of a graph between goals: arcs, caps on sums of columns, and one of the time.

    ``limited``: of every cap its name, its column and the most.
    """

    graph: Graph
    limited: tuple[tuple[str, int, float], ...] = ()
    time: float = np.inf

    def after(self, goal: _Target, value: float) -> Stage:
        """Return what is left once a goal is at its value."""
        if goal.kind == PEAK:
            kept = self.graph.amounts[:, goal.columns[0]] <= tied(value)
            return self._replace(graph=self.graph.only(kept))
        if goal.kind == SUM:
            more = (goal.name, goal.columns[0], tied(value))
            return self._replace(limited=(*self.limited, more))
        time = tied(value) if goal.kind == TIME else np.inf
        return self._replace(time=min(self.time, time))  # what is left out makes a bound no higher

    def below(self, goal: _Target, value: float) -> Stage:
        """Return the arcs of paths that are below a value of a worst amount, not by rounding."""
        if goal.kind != PEAK:
            return self
        amounts = self.graph.amounts[:, goal.columns[0]]
        return self._replace(graph=self.graph.only(amounts + TIED * np.abs(amounts) < value))

    def caps(self, *, loose: bool = False) -> list[tuple[int, float]]:
        """Return columns and what may be taken of them; ``loose``: or more by rounding."""
        return [(column, tied(most) if loose else most) for _, column, most in self.limited]

    def books(self, goal: _Target, value: float, move: Ints) -> list[Book]:
        """Return the book of capped sums; that of a goal stays below a value.

        ``move``: of arcs, as of `SumBook`.
        """
        limited = [(column, most, False) for column, most in self.caps()]
        if goal.kind == SUM:
            limited.append((goal.columns[0], limit_below(value), True))
        if not limited:
            return []
        columns, most, strict = (np.array(each) for each in zip(*limited, strict=True))
        return [SumBook(self.graph, move, self.graph.amounts[:, columns], (most, strict))]


def budget_bounds(
    graph: Graph,
    values: Sequence[float],
    claimed: Sequence[float],
    priced: tuple[Sequence[float], Sequence[Sequence[float]]],
) -> tuple[float, ...]:
    """Return Lagrangian lower bounds of paths under caps on the last columns, goal by goal.

    ``values``, ``claimed``: of a path, and the bounds that are claimed for worst amounts;
    ``priced``: the caps; by goal, multipliers of these and of the sums before it; of a goal without
    any the judge finds its own.
    """
    caps, multipliers = priced
    first, out = len(graph.peaks) - len(caps), list[float]()
    stage = Stage(graph, tuple(("", c, cap) for c, cap in enumerate(caps, start=first)))
    for k in range(first):
        goal, own = _Target("", PEAK if graph.peaks[k] else SUM, (k,)), [0.0] * len(stage.limited)
        if is_given := k < len(multipliers):
            own = [max(price, 0.0) for price in multipliers[k]]
        if len(own) != len(stage.limited) or not np.isfinite(own).all():
            counts = f"{len(own)} where {len(stage.limited)} numbers belong"
            raise SolverError(f"there is no multiplier for every budget and goal: {counts}")
        if graph.peaks[k]:
            out.append(_peak_bound(stage, goal, claimed[k], own if is_given else None))
            stage = stage.after(goal, values[k])
            continue
        costs, limited = stage.graph.amounts[:, k], stage.caps(loose=True)
        bound = _sum_bound(stage, costs, own)
        if claimed[k] > bound + ABOVE * abs(claimed[k]):  # labels may close what is left open
            own_bound = least_within(stage.graph, costs, limited, values[k], own, labels=True)
            bound = max(bound, own_bound)
        out.append(bound)  # what is tied with a value would loosen the bounds of later goals
        stage = stage._replace(limited=(*stage.limited, ("", k, values[k])))
    return tuple(out)


def _sum_bound(stage: Stage, costs: Floats, prices: Sequence[float]) -> float:
    """Return the Lagrangian bound of a sum of costs (m,), by multipliers of the caps (B,)."""
    graph, back = stage.graph, 0.0
    for price, (column, most) in zip(prices, stage.caps(), strict=True):
        if price:
            costs = costs + price * graph.amounts[:, column]
            back += price * most
    return least_sum(graph, costs) - back - ROUNDING * graph.states * abs(back)


def _peak_bound(
    stage: Stage, goal: _Target, claimed: float | None, prices: Sequence[float] | None
) -> float:
    """Return the lower bound of a worst amount: as claimed if no path is below it, or a cut.

    That there is none below it is proven by multipliers of the caps, if they are given, else by the
    judge's own and labels. Without a claim, where sums are capped, the judge finds the largest
    amount below which its multipliers leave no path.
    """
    graph, column = stage.graph, goal.columns[0]
    if claimed is not None and stage.limited:
        part = stage.below(goal, claimed)
        nothing = np.zeros(len(part.graph.source))
        if prices is not None:
            return claimed if _sum_bound(part, nothing, prices) > 0 else -np.inf
        if least_within(part.graph, nothing, part.caps(loose=True), 1.0, labels=True) >= 1.0:
            return claimed
    least = cut(graph, column, np.inf)[0]
    levels = np.unique(graph.amounts[:, column]) if stage.limited else np.zeros(0)

    def is_open(level: float) -> bool:
        part = graph.only(graph.amounts[:, column] <= level)
        return least_within(part, np.zeros(len(part.source)), stage.caps(), 1.0) < 1.0

    first = bisect_left(levels, x=True, key=is_open)
    return max(least, float(levels[min(first, len(levels) - 1)])) if len(levels) else least


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
    prices: Sequence[float] = (),
    *,
    labels: bool = False,
) -> float:
    """Return a lower bound of paths within caps, at most a value.

    ``limited``: columns and what may be taken of them; ``value``: of a path within the caps;
    ``prices``: multipliers that are tried first, by default none; ``labels``: whether what
    multipliers leave open is closed by partial paths; the graph has a level for every move.
    """
    case = _case(graph, costs, limited, value)
    begin = np.array(prices) if len(prices) else np.zeros(len(limited))
    best, bound, _ = _best_multipliers(case, begin * case.sizes)
    if labels and value - bound > case.slack:
        bound = max(bound, _by_labels(case, best))
    return value if value - bound <= case.slack else bound


def _is_kept(graph: Graph, limited: Sequence[tuple[int, float]], *, labels: bool) -> bool:
    """Return whether a path is found that keeps all caps; ``labels``: as of `least_within`."""
    case, none = _case(graph, np.zeros(len(graph.source)), limited, 1.0), np.zeros(len(limited))
    best = _best_multipliers(case, none)
    if best.met or not labels:
        return best.met
    arcs = _swept(case, best.multipliers).arcs
    return bool(len(arcs) and (case.takes[arcs].sum(axis=0) <= case.caps).all())


def is_beyond(graph: Graph, limited: Sequence[tuple[int, float]]) -> bool:
    """Return whether potentials or multipliers prove that no path keeps all caps."""
    if any(least_sum(graph, graph.amounts[:, column]) > tied(most) for column, most in limited):
        return True
    return least_within(graph, np.zeros(len(graph.source)), limited, 1.0) >= 1.0


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
    return bound if closed.is_proof(labels) else -np.inf


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
        """Add the amounts of arcs."""
        return np.asarray(values + self._amounts[arc])

    def beyond(self, state: Ints, values: Floats) -> Bools:
        """Compare the least sums of all paths with the limits."""
        return _is_beyond_limits(values + self._left[state], self._most, self._strict)


class TwinBook(Book):
    """A resource of a problem by its twin; ``steps`` (a,): what it sees of arcs."""

    def __init__(self, twin: Resource, steps: StepArrays) -> None:
        self._twin, self._steps, self.first = twin, steps, np.array(twin.start, dtype=float)

    def follow(self, arc: Ints, values: Floats) -> Floats:
        """Extend values as the twin does."""
        return self._twin.extended(self._steps.only(arc), values)

    def dominated(self, first: Floats, other: Floats) -> Bools:
        """Return where the twin says so."""
        return self._twin.dominated(first, other)

    def ends(self, values: Floats) -> Bools:
        """Return where the twin says so."""
        return self._twin.ends(values)


def _is_beyond_limits(bounds: Floats, most: Floats, strict: Bools) -> Bools:
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

    def is_proof(self, labels: Labelled, excused: Excused | None = None) -> bool:
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

    def _are_dead(self, states: Ints, excused: Excused | None) -> bool:
        """Return whether all paths from some states to an end pass one that is proven to fall."""
        graph, seen = self._graph, np.zeros(self._graph.states, dtype=bool)
        while len(states):
            seen[states] = True
            states = states if excused is None else states[~excused(states)]
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
