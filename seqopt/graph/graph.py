"""A build as a graph of states and moves, as arrays; best paths through it, and their lower bounds.

Best paths are found goal after goal by scipy.sparse.csgraph. Bounds of all paths come by weak
duality, checked with arithmetic alone. A sum is bounded by potentials: no move leads to a state by
less than the difference of both states' potentials, so that no path takes less than the end's. A
worst amount is bounded by a cut: every move that leaves a set of states, with the start among them
and no end, takes at least as much. Potentials and sets come from wherever they may; only the
inequalities count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, dijkstra

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import InfeasibleError, ProblemError

Rows = NDArray[np.int32]
SUM, PEAK, TAIL, TIME = "sum", "peak", "tail", "time"
TIED = 1e-9  # of the least: by how much a path may exceed it and still be one of the best
OPEN = 2.0  # moves that a path may be longer for a state less to be asked
MOST = 64  # states of a part that are asked at once
ROUNDING = 1e-12  # by how much sums may be off, over the largest potential


@dataclass(frozen=True, eq=False, repr=False)
class Graph(FrozenValue):
    """States of a build and the moves between them; the first state is where the build starts.

    Parameters
    ----------
    source, target : (m,) int
        The states that every move leads from and to; moves are sorted by these.
    amounts : (m, g) float
        What every goal takes of every move; from 0 where amounts are added up.
    peaks : tuple of bool
        By goal: whether the largest amount on a path counts, or their sum.
    ends : (n,) bool
        The states in which a build may end.
    caps : tuple of float, optional
        What the sums of as many last columns may be at most.
    alone : (m, 2) float, optional
        What a search is charged that looks at the moves from one state alone, in two parts: what
        depends on the next state only, and what is shared with the move before (ranks are those
        among the moves from this state). By default the first amount.

    Raises
    ------
    ProblemError
        If an amount is no number, or negative where amounts are added up.
    """

    source: Rows
    target: Rows
    amounts: Floats
    peaks: tuple[bool, ...]
    ends: Bools
    caps: tuple[float, ...] = ()
    alone: Floats | None = None

    def __post_init__(self) -> None:
        sums = self.amounts[:, [not peak for peak in self.peaks]]
        if np.isnan(self.amounts).any():
            raise ProblemError("an amount is no number; give one for every move")
        if (sums < 0).any():
            raise ProblemError(
                f"a step adds {sums.min():.4g} to a sum: to repeat it would pay without end; ask "
                "for the worst value, or for a quantity that is never negative"
            )
        codes = self.source.astype(np.int64) * self.states + self.target
        if (np.diff(codes) < 0).any():
            order = np.argsort(codes, kind="stable")
            for name in ("source", "target", "amounts", "alone"):
                if getattr(self, name) is not None:
                    object.__setattr__(self, name, getattr(self, name)[order])
        for name in ("source", "target"):  # as csgraph wants them
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name)))
        super().__post_init__()

    @property
    def states(self) -> int:
        """How many states there are."""
        return len(self.ends)

    @property
    def goals(self) -> int:
        """Number of columns that are minimized, those with caps left out."""
        return len(self.peaks) - len(self.caps)

    def __repr__(self) -> str:
        return f"<Graph: {self.states} states, {len(self.source)} moves, {len(self.peaks)} goals>"

    def only(self, kept: Bools) -> Graph:
        """Return the graph with some of its moves, (m,) bool; all its states stay."""
        if kept.all():
            return self
        names = ("source", "target", "amounts") + ("alone",) * (self.alone is not None)
        return self._with(**{name: getattr(self, name)[kept] for name in names})

    def bare(self, goal: int, states: Bools) -> Graph:
        """Return the subgraph of states (n,), the start among them, with the amounts of one goal.

        States are numbered anew, in order; no move leads to others.
        """
        number, kept = np.cumsum(states, dtype=np.int32) - 1, states[self.source]
        return self._with(
            source=number[self.source[kept]],
            target=number[self.target[kept]],
            amounts=self.amounts[kept, goal : goal + 1],
            peaks=(self.peaks[goal],),
            ends=self.ends[states],
            caps=(),
            alone=None,
        )

    def moves_from(self, state: int) -> slice:
        """Return which moves lead from a state."""
        first, last = np.searchsorted(self.source, np.array([state, state + 1], self.source.dtype))
        return slice(int(first), int(last))

    def _with(self, **changed: object) -> Graph:
        """Return a subgraph of checked arrays: it is not checked again."""
        part = object.__new__(Graph)
        own = {field.name: getattr(self, field.name) for field in fields(Graph)}
        part.__setstate__(own | changed)
        return part

    def matrix(self, costs: Floats, kept: Bools | None = None) -> sparse.csr_array:
        """Return costs (m,) of some of the moves, (m,) bool, from states to states, (n, n).

        Costs of zero are entries too, and so are all costs of moves side by side.
        """
        source, target = self.source, self.target
        if kept is not None:
            source, target, costs = source[kept], target[kept], costs[kept]
        starts = np.zeros(self.states + 1, dtype=np.int32)
        np.cumsum(np.bincount(source, minlength=self.states), out=starts[1:])
        shape = (self.states, self.states)
        return sparse.csr_array((costs, target, starts), shape=shape)


class _Target(NamedTuple):
    """What is minimized along a path.

    ``kind``: ``sum`` or ``peak`` of one column, ``tail``: the mean of the largest sums of several
    columns, no one of which weighs more than ``most``, or ``time``: when the last act ends.
    """

    name: str
    kind: str
    columns: tuple[int, ...] = ()
    most: float = 1.0


def _target_sums(goal: _Target, totals: Floats) -> float:
    """Return the tail mean of totals (S,): the mean of the largest, by their weights."""
    weights = np.clip(1.0 - goal.most * np.arange(len(totals)), 0.0, goal.most)
    return float(np.sort(totals)[::-1] @ weights / weights.sum())


class Best(NamedTuple):
    """A best path.

    Attributes
    ----------
    path : tuple of int
        Its states, the start left out.
    values : tuple of float
        What every goal takes of it.
    """

    path: tuple[int, ...]
    values: tuple[float, ...]


def lexicographic(graph: Graph) -> Best:
    """Return the path that is best in the first goal, among these in the second, and so on.

    Of equal ones it is the shortest, and of these the one whose states come first.

    Parameters
    ----------
    graph : Graph

    Returns
    -------
    Best

    Raises
    ------
    InfeasibleError
        If no path leads to an end.
    """
    values = []
    for goal in range(len(graph.peaks)):
        graph, least = keep_best(graph, goal)
        values.append(least)
    return Best(fewest_moves(graph), tuple(values))


def keep_best(graph: Graph, goal: int) -> tuple[Graph, float]:
    """Return the subgraph of the paths that are best in a goal, and its least value."""
    kept, least = _best_moves(graph, goal)
    return graph.only(kept), least


def _best_moves(graph: Graph, goal: int) -> tuple[Bools, float]:
    """Return which moves (m,) are on paths that are best in a goal, and its least value."""
    amounts = graph.amounts[:, goal]
    if graph.peaks[goal]:
        least = least_peak(graph, goal)
        return amounts <= tied(least), least
    before, after = distances(graph, amounts), distances(graph, amounts, back=True)
    least = float(after[0])
    if not np.isfinite(least):
        raise InfeasibleError("no path leads to an end")
    return before[graph.source] + amounts + after[graph.target] <= tied(least), least


def tied(value: float) -> float:
    """Return the largest value that equals this one up to rounding; an infinite one is itself."""
    return value + TIED * abs(value) if isfinite(value) else value


def strictly_below(value: float) -> float:
    """Return the threshold below which a value is better by more than an error of rounding."""
    return value - TIED * abs(value)


def least_peak(graph: Graph, goal: int) -> float:
    """Return the least worst amount of any path; an `InfeasibleError` says that there is none."""
    least = _least_or_none(graph, goal)
    if least is None:
        raise InfeasibleError("no path leads to an end")
    return least


def _least_or_none(graph: Graph, goal: int) -> float | None:
    """Return the least worst amount of any path, by bisection over all amounts that occur.

    A path that is found leaves no larger amount open. If there is none, every path leaves the
    states that are reached: no amount is open that is less than the least of the moves out.
    """
    if graph.ends[0]:
        return 0.0
    least, graph = None, graph.bare(goal, reached(graph))
    open_ = graph.amounts[:, 0] if graph.ends.any() else np.zeros(0)
    while len(open_):
        level = np.partition(open_, len(open_) // 2)[len(open_) // 2]
        kept = graph.amounts[:, 0] <= level
        inside = reached(graph, kept)
        if graph.ends[inside].any():
            least, open_ = float(level), open_[open_ < level]
            graph = graph.only(kept).bare(0, inside)
        else:
            out = inside[graph.source] & ~inside[graph.target]
            open_ = open_[open_ >= graph.amounts[out, 0].min()]
    return least


def reached(graph: Graph, kept: Bools | None = None) -> Bools:
    """Return which states the start reaches by some of the moves, (n,) bool."""
    out = np.zeros(graph.states, dtype=bool)
    matrix = graph.matrix(np.ones(len(graph.source)), kept)
    out[breadth_first_order(matrix, 0, return_predecessors=False)] = True
    return out


def distances(graph: Graph, costs: Floats, *, back: bool = False) -> Floats:
    """Return the least sum of costs (m,) from the start to every state, or from it to an end.

    Infinite where no path leads, (n,).
    """
    matrix: Any = graph.matrix(costs)
    if not back:
        return np.asarray(dijkstra(matrix, indices=[0])[0])
    ends = np.flatnonzero(graph.ends)
    if not len(ends):
        return np.full(graph.states, np.inf)
    return np.asarray(dijkstra(matrix.T.tocsr(), indices=ends, min_only=True))


def _on_paths(graph: Graph) -> Bools:
    """Return which moves are on paths from the start to an end, (m,)."""
    to_end = np.isfinite(distances(graph, np.ones(len(graph.source)), back=True))
    return np.asarray(reached(graph)[graph.source] & to_end[graph.target])


class Contracted(NamedTuple):
    """A graph whose moves are decisions, each with the forced moves behind it.

    ``kept`` (n,): which states of the whole graph its states are: the start, and the next ones with
    several successors; where decisions of one state lead to the same one, those that they enter
    first. ``enters`` (m,): the state of the whole graph that each move enters first; ``after``
    (N,): of every state of the whole graph the successor, where that is forced; else itself.
    """

    graph: Graph
    kept: Ints
    enters: Ints
    after: Ints

    def expanded(self, path: Sequence[int]) -> tuple[int, ...]:
        """Return a path of decisions with all states that it passes in the whole graph."""
        out = list[int]()
        entered = self.enters[moves_along(self.graph, path)].tolist()
        for state in (0, *entered) if path else ():
            out.append(state)
            while (following := int(self.after[out[-1]])) != out[-1]:
                out.append(following)
        return tuple(out[1:])


def contracted(graph: Graph) -> Contracted:
    """Return the graph of decisions: a state with one successor is passed by the move into it.

    ``graph``: all of its moves are on paths from the start to an end, so that no cycle is forced.
    """
    columns, joins = graph.amounts, np.array([*graph.peaks, graph.peaks[0], graph.peaks[0]])
    if graph.alone is not None:
        columns = np.column_stack([columns, graph.alone])
    joins, count = joins[: columns.shape[1]], len(graph.peaks)
    nothing, states = np.where(joins, -np.inf, 0.0), np.arange(graph.states)
    forced = (np.bincount(graph.source, minlength=graph.states) == 1) & ~graph.ends
    only, after, total = forced[graph.source], states.copy(), np.tile(nothing, (graph.states, 1))
    after[graph.source[only]], total[graph.source[only]] = graph.target[only], columns[only]
    end = after.copy()
    while (end != end[end]).any():
        total = np.where(joins, np.maximum(total, total[end]), total + total[end])
        end = end[end]
    if graph.ends[end[0]]:  # nothing is left to decide: one move leads there
        forced[0], after[0], end[0], total[0] = False, 0, 0, nothing
    free = ~forced[graph.source]
    leads = end[graph.target]
    pairs = graph.source[free].astype(np.int64) * graph.states + leads[free]
    distinct, times = np.unique(pairs, return_counts=True)
    apart = np.isin(states, distinct[times > 1] % graph.states)
    stands_for = np.where(apart[leads], graph.target, leads)
    kept = np.unique([0, *stands_for[free].tolist()])
    row, move = moves_out(graph, end[kept])
    taken = [columns[move], total[graph.target[move]], np.where(row[:, None], nothing, total[0])]
    joined = np.where(joins, np.max(taken, axis=0), np.sum(taken, axis=0))
    target = np.searchsorted(kept, stands_for[move])
    order = np.lexsort((target, row))
    joined, arcs = joined[order], (row[order].astype(np.int32), target[order].astype(np.int32))
    alone = None if graph.alone is None else joined[:, count:]
    ends = graph.ends[end[kept]]
    small = Graph(*arcs, joined[:, :count], graph.peaks, ends, graph.caps, alone)
    return Contracted(small, kept, graph.target[move][order].astype(np.int64), after)


def moves_out(graph: Graph, states: Ints) -> tuple[Ints, Ints]:
    """Return the moves that lead from states (n,): from which row each does, and its number."""
    numbers = np.arange(graph.states + 1).astype(graph.source.dtype)
    starts = np.searchsorted(graph.source, numbers)
    first, count = starts[states], starts[states + 1] - starts[states]
    row = np.repeat(np.arange(len(states)), count)
    return row, np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + first[row]


def moves_along(graph: Graph, path: Sequence[int]) -> Ints:
    """Return the moves of a path, its start left out, the first ones of those side by side."""
    codes = graph.source.astype(np.int64) * graph.states + graph.target
    states = np.array((0, *path), dtype=np.int64)
    return np.asarray(np.searchsorted(codes, states[:-1] * graph.states + states[1:]))


def is_path(graph: Graph, path: Sequence[int]) -> bool:
    """Return whether moves lead along states, the start left out, to an end."""
    states = np.asarray(path)
    if states.dtype.kind not in "iu" or states.ndim != 1:
        return False
    inside = ((states >= 0) & (states < graph.states)).all()
    codes = graph.source.astype(np.int64) * graph.states + graph.target
    taken = np.concatenate([[0], states[:-1]]) * graph.states + states
    return bool(inside and np.isin(taken, codes).all() and graph.ends[states[-1]])


def path_values(graph: Graph, path: Sequence[int]) -> tuple[float, ...]:
    """Return the value of every column of a path: its sum, or its largest amount.

    Of moves side by side those count that are best together.
    """
    moves = moves_along(graph, path)
    codes = graph.source.astype(np.int64) * graph.states + graph.target
    if (codes[moves] == codes[np.minimum(moves + 1, len(codes) - 1)])[moves + 1 < len(codes)].any():
        return lexicographic(graph.only(np.isin(codes, codes[moves]))).values
    taken = graph.amounts[moves]
    return tuple(np.where(graph.peaks, taken.max(axis=0, initial=0.0), taken.sum(axis=0)).tolist())


def fewest_moves(graph: Graph) -> tuple[int, ...]:
    """Return the states on a path of fewest moves, the first of them in the order of states."""
    costs = np.ones(len(graph.source))
    return _first_path(graph, costs, distances(graph, costs, back=True))


def _first_path(graph: Graph, costs: Floats, after: Floats) -> tuple[int, ...]:
    """Return the states on a shortest path by whole costs (m,), the first one of equal ones.

    ``after`` (n,): the least that is left from every state to an end.
    """
    tight = graph.only(after[graph.target] + costs == after[graph.source])
    state, path = 0, list[int]()
    while after[state] > 0:
        state = int(tight.target[np.searchsorted(tight.source, state)])
        path.append(state)
    return tuple(path)


PASSES, FAILS = 1, -1
Ask = Callable[[int, Ints], Ints]  # of a part by number, states (n,): which pass, 0: not known


def _lazy_path(
    graph: Graph,
    parts: Ints,
    known: Ints,
    ask: Ask,
    recall: Ask,
    tell: Callable[[], object] = lambda: None,
) -> tuple[int, ...] | None:
    """Return a path of states that pass, the start left out; None if there is none.

    Tests are expensive: only states on a path are asked, that on which the fewest are not known
    (Dellin and Srinivasa, A unifying formalism for shortest path problems with expensive edge
    evaluations, 2016). A part that turned paths down before is asked first, and more of it each
    time. ``parts`` (n,): of every state, from 0; ``known`` (n,): 1 where a state passes, -1 where
    it does not, else 0; updated in place; ``ask``: tests states of a part; what stays open counts
    as failed; ``recall``: cached verdicts; ``tell``: called before every path.
    """
    failed = Counter[int]()
    while True:
        tell()
        left = graph.only((known[graph.target] != FAILS) & (known[graph.source] != FAILS))
        costs = np.where(known[left.target] == PASSES, 1.0, 1.0 + OPEN)  # few open states first
        after = distances(left, costs, back=True)
        first = _first_path(left, costs, after) if np.isfinite(after[0]) else ()
        path = np.array(first, dtype=np.int64)
        open_ = path[known[path] == 0]
        if not len(path):
            return None
        if not len(open_):
            return tuple(path.tolist())
        for part in sorted(set(parts[open_].tolist()), key=lambda p: (-failed[p], p)):
            if not _all_pass(part, open_[parts[open_] == part], known, ask):
                failed[part] += 1
                others = np.flatnonzero((parts == part) & (known == 0))
                known[others] = recall(part, others)
                others = others[(known[others] == 0) & np.isfinite(after[others])]
                others = others[np.argsort(after[others], kind="stable")]
                _all_pass(part, others[: min(2 ** failed[part], MOST) // 2], known, ask)
                break


def _all_pass(part: int, rows: Ints, known: Ints, ask: Ask) -> bool:
    """Test states of a part; return whether all pass."""
    if len(rows):
        known[rows] = np.where(ask(part, rows) == PASSES, PASSES, FAILS)
    return bool((known[rows] == PASSES).all())


def lexicographic_bounds(graph: Graph, values: Sequence[float]) -> tuple[float, ...]:
    """Return lexicographic lower bounds of all paths, goals before each being at their values.

    Infinite where no path leads to an end, minus infinity where an inequality does not hold.
    """
    out = []
    for goal, value in enumerate(values):
        bound, kept = (cut if graph.peaks[goal] else potentials)(graph, goal, value)
        out.append(bound)
        graph = graph.only(kept)
    return tuple(out)


def cut(graph: Graph, goal: int, value: float) -> tuple[float, Bools]:
    """Return the bound of a worst amount, and the moves that take no more than a value."""
    amounts = graph.amounts[:, goal]
    least = _least_or_none(graph, goal)
    inside = reached(graph, amounts < (np.inf if least is None else least))
    leaving = inside[graph.source] & ~inside[graph.target]
    bound = float(amounts[leaving].min(initial=np.inf))
    if not inside[0] or graph.ends[inside].any():
        bound = 0.0 if least == 0.0 else -np.inf
    return bound, amounts <= tied(value)


def potentials(graph: Graph, goal: int, value: float) -> tuple[float, Bools]:
    """Return the bound of a sum, and the moves that can be on a path of no more than a value."""
    costs = graph.amounts[:, goal]
    before, after = distances(graph, costs), distances(graph, costs, back=True)
    bound, every = _sum_bound(graph, costs, before), np.ones(len(costs), dtype=bool)
    if bound == -np.inf or after[graph.ends].any() or not _hold(after, costs, graph, back=True):
        return bound, every
    return bound, before[graph.source] + costs + after[graph.target] <= tied(value)


def _sum_bound(graph: Graph, costs: Floats, before: Floats) -> float:
    """Return a lower bound of a sum of costs (m,) on all paths, by potentials of states (n,).

    Minus infinity where a move takes less than the difference of its states' potentials.
    """
    if before[0] > 0 or not _hold(before, costs, graph):
        return -np.inf
    return float(before[graph.ends].min(initial=np.inf))


def least_sum(graph: Graph, costs: Floats) -> float:
    """Return a lower bound of a sum of costs (m,), from 0, on all paths, by potentials.

    Infinite where no path leads to an end, minus infinity where an inequality does not hold.
    """
    return _sum_bound(graph, costs, distances(graph, costs))


def _to_go(graph: Graph, costs: Floats) -> Floats:
    """Return lower bounds (n,) of a sum of costs (m,), from 0, from states to ends.

    Infinite where no path leads to an end; zero where an inequality does not hold.
    """
    left = distances(graph, costs, back=True)
    if left[graph.ends].any() or not _hold(left, costs, graph, back=True):
        return np.zeros(graph.states)
    return left


def _hold(least: Floats, costs: Floats, graph: Graph, *, back: bool = False) -> bool:
    """Return whether potentials (n,) are dual feasible: no move costs less than their rise."""
    ends = (graph.target, graph.source) if back else (graph.source, graph.target)
    first, second = least[ends[0]], least[ends[1]]
    ways = np.isfinite(first)
    slack = ROUNDING * np.max(np.abs(least[np.isfinite(least)]), initial=0.0)
    return bool((second[ways] <= first[ways] + costs[ways] + slack).all())
