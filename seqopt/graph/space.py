"""What a graph is explored from: states in parts, parts on levels, and the moves between them.

A build is a path through states. Those of one *part* are rows of integers of equal width; a part
lies on a *level*, and every move stays within its part or leads to one of the next level. So an
`Explorer` visits a space level by level, whole batches of states at a time, below a threshold that
rises only as far as a proof needs it. `seqopt.graph._spaces` has those of problems: the open grips
of a schedule, free rules, and all orders of the bricks, where a part is a set of bricks. Anything
with the members of `Space` is explored, solved and judged in the same way: a puzzle without bricks
is, in `tests/formulations/test_free_formulations.py`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from itertools import accumulate
from operator import itemgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import InfeasibleError, NothingFoundError
from seqopt.graph.graph import Graph, Rows, strictly_below

Key: TypeAlias = Any
"""Key of a part, of any kind that the space uses: hashable, and different in every level."""

Found: TypeAlias = Sequence[tuple[int, Key, Ints]]
"""Level, part and state (c,) of all states of a path, the start left out."""


class Moves(NamedTuple):
    """Moves from states of one part to states (m, c) of one part.

    ``source`` (m,): row of the state that each leads from, among those that were asked for;
    ``taken`` (m, k): what they take of amounts that are about moves, as `Space.amounts` reads it.
    """

    source: Ints
    states: Ints
    taken: Floats


class Space(ABC):
    """States and moves that an explorer visits.

    Methods take the key of a part and states (n, c) of it, and return a row for each. What a class
    needs is abstract; the rest says what is so unless a class says otherwise: all moves are there,
    all values exact, and every state passes.
    """

    @property
    @abstractmethod
    def first(self) -> int:
        """The level on which builds begin, from 0."""

    @property
    @abstractmethod
    def levels(self) -> int:
        """The last level, on which builds may end."""

    @property
    @abstractmethod
    def peaks(self) -> tuple[bool, ...]:
        """By goal, whether the largest amount on a path counts, not the sum."""

    @abstractmethod
    def start(self) -> tuple[Key, Ints]:
        """Return the first part and its only state (1, c)."""

    @abstractmethod
    def codes(self, part: Key, states: Ints) -> Ints:
        """Return a number (n,) for every state that no other one of its part has."""

    @abstractmethod
    def within(self, part: Key, states: Ints) -> Moves:
        """Return the moves from states that stay within their part."""

    @abstractmethod
    def onward(self, part: Key, states: Ints) -> Iterator[tuple[Key, Moves]]:
        """Yield the moves from states that lead to the next level, by the part they lead to."""

    @abstractmethod
    def values(self, part: Key, states: Ints, *, rough: bool, most: float) -> tuple[Floats, Bools]:
        """Return the values of goals in states (n, g), SI units, and which are feasible (n,).

        ``rough``: whether single precision is enough; ``most``: where `floors` is true, values of a
        state in which the first goal is larger may be lower bounds above this.
        """

    @abstractmethod
    def ended(self, part: Key, states: Ints) -> Bools:
        """Return in which states of the last level a build may end, (n,)."""

    def amounts(self, values: Floats, taken: Floats) -> Floats:
        """Return goals of moves (m, g) by ``values`` of the states they lead to, and `Moves`."""
        return values

    def to_go(self, part: Key, states: Ints) -> Floats | None:
        """Return lower bounds (n,) of the second goal from states to an end; None if no count.

        It is a count if every move takes one of it; no move may lower the bound by more.
        """
        return None

    @property
    def complete(self) -> bool:
        """Whether these are all feasible moves."""
        return True

    @property
    def floors(self) -> bool:
        """Whether values above the limit may be lower bounds, not exact."""
        return False

    def stand(self, part: Key, states: Ints) -> Bools:
        """Return which states (n,) pass the tests that are too expensive for all states."""
        return np.ones(len(states), dtype=bool)

    def known(self, part: Key, states: Ints) -> Ints:
        """Return the cached verdicts of `stand`, (n,): 1 passes, -1 does not, 0 is open."""
        return np.zeros(len(states), dtype=np.int64)

    @property
    def effort(self) -> tuple[int, int]:
        """In a search of orders, numbers of sets of bricks visited and of grip sets solved."""
        return 0, 0

    def path(self, found: Found) -> tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]:
        """Return the order of bricks on a path, empty where it is given, and its states.

        Each is its level, then its numbers.
        """
        return (), tuple((level, *state.tolist()) for level, _, state in found)


NEW, PENDING, OPEN, CLOSED = range(4)  # of a state: above the threshold, visited, not allowed
ARRAYS = ("values", "mark", "exact", "floor", "spent", "to_go")  # of a part, a row for every state
FEW = 8  # states that a dive visits at once at first
STUCK = 1.0  # turns of a dive without a higher level, over the levels; successes need up to 0.6
BAND = 1e-5  # share of a value within which six digits do not decide
Valued = Callable[[Ints], tuple[Floats, Bools, float]]
"""Returns values, feasibility, and from which value of the first goal on they are lower bounds."""


class Part:
    """Discovered states of one part, in the order of their discovery."""

    def __init__(self, width: int, kind: np.dtype[Any], goals: int) -> None:
        self.states = np.zeros((0, width), dtype=kind)
        self.values = np.zeros((0, goals))
        self.mark = np.zeros(0, dtype=np.int8)
        self.exact = np.zeros(0, dtype=bool)
        self.floor = np.zeros(0, dtype=bool)  # of values: whether they may be too small
        self.spent, self.to_go = np.zeros(0), np.zeros(0)  # of steps, on the way here and at least
        self._codes = np.zeros(0, dtype=np.int64)
        self._rows = np.zeros(0, dtype=np.int32)

    def add(self, codes: Ints, states: Ints) -> Rows:
        """Return the rows of states; new ones are added, not yet valued."""
        distinct, first, back = np.unique(codes, return_index=True, return_inverse=True)
        at = np.searchsorted(self._codes, distinct)
        new = np.ones(len(distinct), dtype=bool)
        inside = at < len(self._codes)
        new[inside] = self._codes[at[inside]] != distinct[inside]
        rows, more = np.empty(len(distinct), dtype=np.int32), int(new.sum())
        rows[~new] = self._rows[at[~new]]
        rows[new] = np.arange(len(self.states), len(self.states) + more)
        if more:
            self.states = np.concatenate([self.states, states[first[new]]])
            for name in ARRAYS:
                own = getattr(self, name)
                grown = np.concatenate([own, np.zeros((more, *own.shape[1:]), own.dtype)])
                setattr(self, name, grown)
            self.spent[-more:] = np.inf
            self._codes = np.insert(self._codes, at[new], distinct[new])
            self._rows = np.insert(self._rows, at[new], rows[new])
        return rows[back]

    def copy(self) -> Part:
        """Return a part that grows by itself."""
        out = copy(self)
        for name in ARRAYS:
            setattr(out, name, getattr(self, name).copy())
        return out

    def value(self, rows: Ints, valued: Valued) -> bool:
        """Evaluate states that are new or known by lower bounds; return if there are any."""
        if len(rows):
            self.values[rows], allowed, most = valued(self.states[rows])
            self.floor[rows] = self.values[rows, 0] > most
            self.mark[rows] = np.where(allowed, PENDING, CLOSED)
        return len(rows) > 0

    @property
    def order(self) -> Ints:
        """The rows of visited states, sorted by code."""
        return np.asarray(self._rows[self.mark[self._rows] == OPEN])


class Visited(NamedTuple):
    """A graph, and which states its numbers stand for.

    Attributes
    ----------
    graph : Graph
    states : tuple of (int, Key, (n, c) int)
        Level, part and states, in the order of numbers.
    """

    graph: Graph
    states: tuple[tuple[int, Key, Ints], ...]

    def of(self, path: Sequence[int]) -> list[tuple[int, Key, Ints]]:
        """Return level, part and state (c,) of numbers that rise with levels."""
        firsts = [0, *accumulate(len(rows) for _, _, rows in self.states)]
        found = np.searchsorted(firsts, path, side="right") - 1
        return [
            (*self.states[i][:2], self.states[i][2][n - firsts[i]])
            for i, n in zip(found.tolist(), path, strict=True)
        ]


class Explorer:
    """The states of a space that are reached through states below a threshold, which may rise.

    Parameters
    ----------
    space : Space
    width : int, optional
        From how many new states of a level, those of least value, the search goes on, within parts
        only by moves that take nothing; from all by default.
    tell : callable, optional
        Called after every part of which states were visited; may raise to end the search.
    enough : float, optional
        With a width, states of no larger value are ties, of which a random sample is kept.

    Attributes
    ----------
    space : Space
        What is explored.
    threshold : float
        Upper limit of the first goal in visited states, if it is a peak.
    reached : int
        The last level on which a state is visited.
    level : int
        The level that was visited last.
    counts : bool
        Whether the space counts steps, as the second goal.
    passes : int
        How often the threshold rose.
    nbytes : int
        How much memory states and moves take.
    exact : bool
        Whether states are valued exactly at once, for searches that need that of nearly all.
    """

    exact = False

    def __init__(
        self,
        space: Space,
        width: int | None = None,
        tell: Callable[[Explorer], object] = lambda _: None,
        enough: float = -np.inf,
    ) -> None:
        self.space, self._width, self.tell, self._enough = space, width, tell, enough
        self._draws = np.random.default_rng(0)
        key, states = space.start()
        self._parts: list[dict[Key, Part]] = [{} for _ in range(space.levels + 1)]
        self._moves: dict[tuple[int, Key, Key], list[tuple[Rows, Rows, Floats]]] = defaultdict(list)
        self._shape = (states.shape[1], states.dtype, len(space.peaks))
        self._each = states[0].nbytes + 8 * len(space.peaks) + 14  # bytes of a state
        self._start = space.first, key
        part = self._parts[space.first][key] = Part(*self._shape)
        part.add(space.codes(key, states), states)
        part.mark[0] = PENDING
        to_go = space.to_go(key, states)
        self.counts = to_go is not None
        part.spent[0], part.to_go[0] = 0.0, 0.0 if to_go is None else to_go[0]
        self.threshold, self.below, self.most = -np.inf, np.inf, np.inf
        self.reached = self.level = space.first
        self.passes = self.nbytes = 0

    def rise(self, threshold: float = np.inf, below: float = np.inf, most: float = np.inf) -> bool:
        """Visit the states up to a threshold; return whether a build may end in one of them.

        ``below``: only states of which the first goal takes less than this, to 1e-9 of it, are
        visited: the cut that proves that nothing is better; ``most``: only states on paths of at
        least no more steps than this, where the space counts them. It rises from pass to pass by
        `fewest_left`: then the steps to a state that is visited are the fewest.
        """
        self._begin_pass(threshold, below, most)
        for level, parts in enumerate(self._parts):
            self.level = level
            for key, part in list(parts.items()):
                fresh = self._visit(level, key, part)
                self._go_on(level, key, part, fresh)
                if len(fresh):
                    self.tell(self)
        return self.whole

    def dive(self, threshold: float = np.inf, below: float = np.inf, most: float = np.inf) -> bool:
        """Visit states up to a threshold, the highest level first, until one may end a build.

        Few are visited at a time while that leads on, more and more where it does not; after some
        turns without a higher level it gives up, since whole levels are visited in larger batches.
        """
        self._begin_pass(threshold, below, most)
        level, highest, few, stuck = self.space.levels, -1, FEW, 0
        while not self.whole and stuck < STUCK * self.space.levels:
            parts = self._parts[level].items()
            eligible = ((key, part, self._eligible(key, part)) for key, part in parts)
            found = next((each for each in eligible if len(each[2])), None)
            if found is None:
                level -= 1
                if level < self.space.first:
                    return False
                continue
            key, part, fresh = found
            fresh = fresh[np.argsort(part.values[fresh, 0], kind="stable")[:few]]
            self.level = level
            self._open(level, key, part, fresh)
            self._go_on(level, key, part, fresh)
            self.tell(self)
            few, stuck = (FEW, 0) if level > highest else (4 * few, stuck + 1)
            highest = max(highest, level)
            level = min(level + 1, self.space.levels)
        return self.whole

    def _begin_pass(self, threshold: float, below: float, most: float) -> None:
        self.threshold, self.below, self.most = max(self.threshold, threshold), below, most
        self.passes += 1

    def copy(self) -> Explorer:
        """Return an independent explorer that starts from the visited states."""
        out = copy(self)
        out._parts = [{key: part.copy() for key, part in level.items()} for level in self._parts]
        out._moves = defaultdict(list, {key: [*moves] for key, moves in self._moves.items()})
        return out

    def visited(self) -> tuple[Ints, ...]:
        """Return the visited states, (n, c) each, level by level from the first."""
        parts = (tuple(level.values()) for level in self._parts[self.space.first :])
        none = np.zeros((0, self._shape[0]), dtype=self._shape[1])
        return tuple(
            np.concatenate([none, *(part.states[part.mark == OPEN] for part in level)])
            for level in parts
        )

    @property
    def whole(self) -> bool:
        """Whether a build may end in a visited state."""
        parts = self._parts[-1].items()
        return any(self.space.ended(k, p.states[p.mark == OPEN]).any() for k, p in parts)

    @property
    def excluded(self) -> float:
        """Least value of the first goal in states above the threshold; infinite without any."""
        every = (part for parts in self._parts for part in parts.values())
        least = (p.values[p.mark == PENDING, 0].min(initial=np.inf) for p in every)
        return float(min(least, default=np.inf))

    @property
    def fewest_left(self) -> float:
        """Fewest steps of paths through a state that was left out for its steps; or infinite."""
        least = np.inf
        for part in (part for parts in self._parts for part in parts.values()):
            open_ = (part.mark == PENDING) & (part.values[:, 0] <= self._most)
            open_ |= part.mark == NEW
            least = min(least, (part.spent + part.to_go)[open_].min(initial=np.inf))
        return float(least)

    @property
    def complete(self) -> bool:
        """Whether no feasible state that can be reached was left out."""
        return self._width is None and self.space.complete and self.excluded == np.inf

    def without_plan(self, why: str) -> InfeasibleError | NothingFoundError:
        """Return the error of visited states without a plan: infeasible only if they are complete.

        ``why``: the message.
        """
        if self.complete:
            return InfeasibleError(why)
        return NothingFoundError(f"{why} among the states that were looked at; look at all")

    def _visit(self, level: int, key: Key, part: Part) -> Ints:
        """Visit states below the threshold and their successors in a part; return their rows."""
        visited = [np.zeros(0, dtype=np.int64)]
        while True:
            fresh = self._eligible(key, part)
            if self._width is not None:  # least first; those that are small enough in any order
                values, places = part.values[fresh, 0], np.arange(len(fresh))
                enough = values <= self._enough
                drawn = np.where(enough, self._draws.random(len(values)), places)
                order = np.lexsort((drawn, np.where(enough, -np.inf, values)))
                fresh = fresh[order[: self._width]]
                part.mark[part.mark == PENDING] = CLOSED
            if not len(fresh):
                return np.concatenate(visited)
            self._open(level, key, part, fresh)
            visited.append(fresh)

    def _open(self, level: int, key: Key, part: Part, fresh: Ints) -> None:
        """Visit states, and add their successors within their part."""
        part.mark[fresh] = OPEN
        self.reached = max(self.reached, level)
        if level:
            moves = self.space.within(key, part.states[fresh])
            self._keep((level, key, key), (part, fresh), moves, part)

    def _eligible(self, key: Key, part: Part) -> Ints:
        """Return the states that are to be visited, all new ones being valued."""

        def valued(states: Ints) -> tuple[Floats, Bools, float]:
            most, rough = self._most, not self.exact
            return *self.space.values(key, states, rough=rough, most=most), most

        while True:
            few = part.spent + part.to_go <= self.most if self.counts else True
            part.value(np.flatnonzero((part.mark == NEW) & few), valued)
            first, below = part.values[:, 0], self.below
            inside = (part.mark == PENDING) & (first <= self._most) & few
            if np.isfinite(below):
                inside &= first < strictly_below(below)
            fresh = np.flatnonzero(inside)
            if self.space.floors and part.value(fresh[part.floor[fresh]], valued):
                continue
            close = fresh[:0]
            if np.isfinite(below):  # six digits do not say whether these lie below the cut
                near = np.abs(first[fresh] - below) <= BAND * abs(below)
                close = fresh[near & ~part.exact[fresh]]
            if not len(close):
                return fresh
            part.values[close], part.exact[close] = self._exact(key, part.states[close]), True

    def refine(
        self,
        values: Sequence[float] | None = None,
        among: Mapping[Key, Sequence[int]] | None = None,
    ) -> bool:
        """Value states exactly that are close to the worst values of a path; return if any were.

        All of them where no values are given; ``among``: as of `graph`.
        """
        found = False
        for parts in self._parts[1:]:
            for key, part in parts.items():
                close = ~part.exact & (part.mark == OPEN)
                if among is not None:
                    close &= np.isin(np.arange(len(close)), among.get(key, ()))
                near = np.full(len(close), values is None)
                for column, peak in enumerate(self.space.peaks):
                    if peak and values is not None:
                        gap = np.abs(part.values[:, column] - values[column])
                        near |= gap <= BAND * abs(values[column])
                rows = np.flatnonzero(close & near)
                if len(rows):
                    part.values[rows] = self._exact(key, part.states[rows])
                    part.exact[rows] = found = True
        return found

    def _exact(self, key: Key, states: Ints) -> Floats:
        return self.space.values(key, states, rough=False, most=np.inf)[0]

    def close(self, part: tuple[int, Key], states: Ints) -> None:
        """Exclude visited states of a part, given by its level and key."""
        found = self._parts[part[0]][part[1]]
        found.mark[found.add(self.space.codes(part[1], states), states)] = CLOSED

    @property
    def _most(self) -> float:
        """Upper limit of the first goal in visited states, with the error of single precision."""
        if not self.space.peaks[0]:
            return np.inf
        most = min(self.threshold, self.below)
        return most + (BAND * abs(most) if np.isfinite(most) else 0.0)

    def _go_on(self, level: int, key: Key, part: Part, fresh: Ints) -> None:
        """Add the successors of visited states on the next level."""
        if level == self.space.levels or not len(fresh):
            return
        for following, moves in self.space.onward(key, part.states[fresh]):
            after = self._parts[level + 1].setdefault(following, Part(*self._shape))
            self._keep((level, key, following), (part, fresh), moves, after)

    def _keep(
        self, which: tuple[int, Key, Key], begin: tuple[Part, Ints], moves: Moves, to: Part
    ) -> None:
        """Keep the moves from some states of a part to another one."""
        (part, fresh), before = begin, len(to.states)
        rows = to.add(self.space.codes(which[2], moves.states), moves.states)
        if self.counts:
            new = slice(before, None)
            to.to_go[new] = self.space.to_go(which[2], to.states[new])
            np.minimum.at(to.spent, rows, part.spent[fresh[moves.source]] + 1.0)
        self._moves[which].append((fresh[moves.source].astype(np.int32), rows, moves.taken))
        self.nbytes += 2 * rows.nbytes + moves.taken.nbytes
        self.nbytes += (len(to.states) - before) * self._each

    def way(self) -> Mapping[Key, Sequence[int]] | None:
        """Return a path to an end, as rows by part: back from each state to the least before it.

        Parts grow as states are discovered, so that a way back within one ends. None where what led
        to a state was excluded since.
        """
        into = defaultdict[Key, list[tuple[int, Key, Any]]](list)
        for (level, key, to), moves in self._moves.items():
            into[to].append((level, key, moves))
        found, rows = list[tuple[float, int, Key, int]](), dict[Key, list[int]]()
        for key, part in self._parts[-1].items():
            open_ = np.flatnonzero(part.mark == OPEN)
            ended = open_[self.space.ended(key, part.states[open_])]
            found += [(part.values[row, 0], self.space.levels, key, row) for row in ended.tolist()]
        while found:
            _, level, key, row = min(found, key=itemgetter(0))
            rows.setdefault(key, []).append(row)
            if (level, key, row) == (*self._start, 0):
                return rows
            found = []
            for level, before, moves in into[key]:
                part = self._parts[level][before]
                ways = np.concatenate([source[target == row] for source, target, _ in moves])
                ways = ways[(part.mark[ways] == OPEN) & ((before != key) | (ways < row))]
                best = ways[np.argsort(part.values[ways, 0])[:1]].tolist()
                found += [(part.values[own, 0], level, before, own) for own in best]
        return None

    def graph(self, among: Mapping[Key, Sequence[int]] | None = None) -> Visited:
        """Return the visited states and the moves among them, states in the order of codes.

        ``among``: rows of those that are meant, by part; by default all.
        """
        keys = [(level, key) for level, parts in enumerate(self._parts) for key in parts]
        orders = [self._parts[level][key].order for level, key in keys]
        if among is not None:
            pairs = zip(keys, orders, strict=True)
            orders = [own[np.isin(own, among.get(key, ()))] for (_, key), own in pairs]
        at = keys.index(self._start)  # the state in which builds begin is the first of its part
        orders[at] = np.concatenate([orders[at][:0], [0], orders[at][orders[at] != 0]])
        firsts = dict(zip(keys, accumulate(map(len, orders), initial=0), strict=False))
        number = {}
        for (level, key), order in zip(keys, orders, strict=True):
            number[level, key] = np.full(len(self._parts[level][key].mark), -1, dtype=np.int32)
            number[level, key][order] = firsts[level, key] + np.arange(len(order))
        moves = []
        for (level, key, to), parts in self._moves.items():
            source, target, taken = map(np.concatenate, zip(*parts, strict=True))
            further = level + (to != key)
            source, found = number[level, key][source], number[further, to][target]
            kept = (source >= 0) & (found >= 0)
            values = self._parts[further][to].values[target[kept]]
            moves.append((source[kept], found[kept], self.space.amounts(values, taken[kept])))
        ordered = [(*key, order) for key, order in zip(keys, orders, strict=True)]
        states = tuple((level, key, self._parts[level][key].states[o]) for level, key, o in ordered)
        ends, last = np.zeros(sum(map(len, orders)), dtype=bool), self.space.levels
        for level, key, rows in states:
            if level == last:
                first = firsts[level, key]
                ends[first : first + len(rows)] = self.space.ended(key, rows)
        source, target, taken = map(np.concatenate, zip(*moves, strict=True))
        return Visited(Graph(source, target, taken, self.space.peaks, ends), states)
