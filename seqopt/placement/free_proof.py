"""The proof that no free schedule is better: a graph of its own, and what no path stays below.

The graph is built anew by a second version of the rules, with responses that the engine computes
again. Which states a search visited may be told, so that many are looked at together; states that
this leaves out are found all the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import InfeasibleError
from seqopt.graph.duality import lexicographic_bounds
from seqopt.graph.graph import Graph
from seqopt.graph.paths import lexicographic, reached, tied
from seqopt.placement.free_answers import ask
from seqopt.placement.free_goals import Measure
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.free_states import move_amounts
from seqopt.placement.free_tables import Follows, RuleTables
from seqopt.placement.requirements import LIMIT_TOLERANCE
from seqopt.placement.standing_proof import StandingProof
from seqopt.responses.known_rows import KnownRows
from seqopt.sequence.free_check import RuleBook
from seqopt.sequence.free_rules import Payload

BELOW = 1e-9  # by how much a plan must be better, over the size of the value
Hint = Mapping[int, Ints]  # states that a search visited, by brick count


class Proof:
    """What no free schedule stays below, by independent rules and new responses.

    Parameters
    ----------
    problem : FreeProblem
    hint : mapping of int to (n, c) int, optional
        States that are likely to be passed, by brick count, as of
        `seqopt.sequence.free_space.FreeSpace`; only time depends on them.

    Attributes
    ----------
    states : int
        How many states a better plan could pass.
    """

    def __init__(self, problem: FreeProblem, hint: Hint | None = None) -> None:
        self._problem, self._hint = problem, hint or {}
        book = RuleBook(problem.network, problem.rules)
        most = _loads(problem, book)
        self._parks = any(goal.measure is Measure.TRAVEL for goal in problem.goals)
        self._tables = RuleTables(book, _alike(book, most), parks=self._parks)
        self._payload = np.array([most[r] for r in book.team])
        columns = [r for kind in problem.space.kinds for r in kind.robots]
        self._columns = [columns.index(r) for r in book.team]
        self._stands = StandingProof(problem, most)
        self._known = KnownRows()
        self._fallen: dict[int, Ints] = {}
        self._leading = sum(goal.of_margins for goal in problem.goals)
        self.states = 0

    def bounds(self, values: Sequence[float]) -> tuple[float, ...]:
        """Return what no plan stays below in every goal, those before it being at their values.

        Parameters
        ----------
        values : sequence of float
            Of every goal; what is said of margins of stability means nothing.

        Returns
        -------
        tuple of float
            Infinite where there is no plan.
        """
        while True:
            levels = _Levels(self, values)
            self.states = sum(map(len, levels.states))
            out = lexicographic_bounds(levels.graph(), values)
            if not self._fall(levels, values, out):
                return out

    def is_impossible(self, margins: Sequence[float] = ()) -> bool:
        """Return whether no plan is allowed, or none in which all states have better margins.

        Parameters
        ----------
        margins : sequence of float, optional
            Of the first goals.

        Returns
        -------
        bool
        """
        levels = _Levels(self, (), margins)
        graph = levels.graph()
        self.states = max(self.states, graph.states)
        return not graph.ends[reached(graph)].any()

    def _fall(self, levels: _Levels, values: Sequence[float], bounds: Sequence[float]) -> bool:
        """Return whether a state on a path that would be better is proven to fall."""
        margins = values[: self._leading]
        pairs = zip(values[self._leading :], bounds[self._leading :], strict=True)
        if not self._stands.asked(margins) or all(v - BELOW * abs(v) <= b for v, b in pairs):
            return False
        try:
            path = np.array(lexicographic(levels.graph()).path)
        except InfeasibleError:
            return False
        first, found = 0, False
        for bricks, rows in enumerate(levels.states):
            own = rows[path[(path >= first) & (path < first + len(rows))] - first]
            fall = own[~self._may_stand(bricks, own, margins)] if bricks else own[:0]
            before = self._fallen.get(bricks, np.zeros(0, dtype=np.int64))
            self._fallen[bricks] = np.concatenate([before, self._tables.codes(fall)])
            first, found = first + len(rows), found or len(fall) > 0
        return found

    def told(self, bricks: int) -> Ints:
        """Return the states with some bricks of which it was told, as rows of the tables."""
        rows = self._hint.get(bricks)
        start = self._tables.start()
        if rows is None:
            return start[:0]
        robots = self._tables.robots
        columns = [*self._columns, *range(robots, rows.shape[1])]
        return self._tables.in_order(rows[:, columns].astype(start.dtype))

    def valued(
        self, bricks: int, states: Ints, asked: tuple[Sequence[float], Sequence[float]]
    ) -> tuple[Floats, Bools]:
        """Return what goals take of states, and which ones a better plan could pass.

        Parameters
        ----------
        bricks : int
        states : (n, c) int
        asked : tuple of (sequence of float, sequence of float)
            Values of goals, of which the first bounds states if it is about a worst step, and
            margins that states must have.

        Returns
        -------
        values : (n, g) float
        ok : (n,) bool
        """
        goals = self._problem.goals
        if not bricks:
            return np.zeros((len(states), len(goals))), np.ones(len(states), dtype=bool)
        held, payload = self._held(states)
        values, forces, ok = self._answers(bricks, held)
        ok &= (forces <= payload).all(axis=1)
        most, margins = asked
        k = self._leading
        if len(most) > k and goals[k].measure is Measure.PEAK:
            ok &= values[:, k] <= tied(most[k])
        if bricks in self._fallen:
            ok &= ~np.isin(self._tables.codes(states), self._fallen[bricks])
        if len(margins):
            ok[ok] = self._may_stand(bricks, states[ok], margins)
        return values, ok

    def _held(self, states: Ints) -> tuple[Ints, Floats]:
        """Return nodes held, ascending, and the payloads of those who hold them, (n, r)."""
        grips = states[:, : self._tables.robots].clip(min=0)
        order = np.argsort(grips, axis=1, kind="stable")
        return np.take_along_axis(grips, order, axis=1), self._payload[order]

    def _may_stand(self, bricks: int, states: Ints, margins: Sequence[float]) -> Bools:
        return self._stands.allows_rows(bricks, *self._held(states), margins)

    def _answers(self, bricks: int, held: Ints) -> tuple[Floats, Floats, Bools]:
        """Return values, forces of grips and what is within limits, of rows of nodes held."""
        goals, robots = len(self._problem.goals), held.shape[1]
        out = np.zeros((len(held), goals + robots + 1))
        count = np.count_nonzero(held, axis=1)
        for taken in np.unique(count).tolist():
            rows = np.flatnonzero(count == taken)
            nodes = held[rows, robots - taken :]
            codes = nodes @ len(self._tables.nodes) ** np.arange(taken)

            def compute(new: Ints, nodes: Ints = nodes) -> Floats:
                found = ask(self._problem, bricks, self._tables.nodes[nodes[new]])
                return np.column_stack([found.worth, found.forces, found.fit])

            found = self._known.of((bricks, taken), codes, compute)
            out[rows, :goals] = found[:, :goals]
            out[rows, goals + robots - taken :] = found[:, goals:]
        return out[:, :goals], out[:, goals:-1], out[:, -1] > 0

    def follow(self, bricks: int, states: Ints) -> Iterator[Follows]:
        """Yield what follows from states by the rules."""
        return self._tables.follow(bricks, states)

    def moved(self, values: Floats, found: Follows) -> Floats:
        """Return what goals take of moves to states with such values, (m, g)."""
        taken = np.column_stack([np.full(len(found.way), float(found.regrip)), found.way])
        return move_amounts(self._problem, values, taken)


class _Levels:
    """The states that a better plan could pass, level by level, and the moves between them."""

    def __init__(
        self, proof: Proof, values: Sequence[float], margins: Sequence[float] = ()
    ) -> None:
        self._proof, self._asked = proof, (values, margins)
        self._tables = tables = proof._tables
        self.states: list[Ints] = []
        self._arcs: list[tuple[Ints, Ints, Floats]] = []
        self._ends = np.zeros(0, dtype=bool)
        self._graph: Graph | None = None
        self._count = 0
        coming: list[tuple[Ints, Follows]] = []
        fresh = tables.start()
        for bricks in range(tables.last + 1):
            coming = self._close(bricks, [fresh, proof.told(bricks)], coming)
            fresh = np.concatenate([fresh[:0], *(found.states for _, found in coming)])

    def _close(
        self, bricks: int, entries: list[Ints], coming: list[tuple[Ints, Follows]]
    ) -> list[tuple[Ints, Follows]]:
        """Add the states of a brick count; return the moves that place the next one."""
        tables, first = self._tables, self._count
        fresh = np.concatenate(entries)
        seen = np.zeros(0, dtype=np.int64)
        codes, states, values = (
            [seen],
            [fresh[:0]],
            [np.zeros((0, len(self._proof._problem.goals)))],
        )
        onward: list[tuple[Ints, Follows]] = []
        while len(fresh):
            own, at = np.unique(tables.codes(fresh), return_index=True)
            new = ~np.isin(own, seen, assume_unique=True)
            seen = np.concatenate([seen, own[new]])
            rows = fresh[at[new]]
            worth, ok = self._proof.valued(bricks, rows, self._asked)
            states.append(rows[ok])
            codes.append(own[new][ok])
            values.append(worth[ok])
            found = [
                (found.source + self._count, found) for found in tables.follow(bricks, rows[ok])
            ]
            self._count += int(ok.sum())
            onward += [pair for pair in found if pair[1].bricks > bricks]
            inner = [pair for pair in found if pair[1].bricks == bricks]
            coming = coming + inner
            fresh = np.concatenate([fresh[:0], *(found.states for _, found in inner)])
        known, rows = np.concatenate(codes), np.concatenate(states)
        worth, order = np.concatenate(values), np.argsort(known, kind="stable")
        for source, move in coming:
            wanted = tables.codes(move.states)
            at = np.searchsorted(known, wanted, sorter=order).clip(max=max(0, len(known) - 1))
            kept = known[order[at]] == wanted if len(known) else np.zeros(len(wanted), dtype=bool)
            target = order[at[kept]] if len(known) else at[:0]
            amounts = self._proof.moved(worth[target], move._replace(way=move.way[kept]))
            self._arcs.append((source[kept], first + target, amounts))
        self.states.append(rows)
        self._ends = np.concatenate([self._ends, tables.ends(bricks, rows)])
        return onward

    def graph(self) -> Graph:
        """Return them as a graph."""
        if self._graph is None:
            source, target, amounts = map(np.concatenate, zip(*self._arcs, strict=True))
            peaks = tuple(g.measure is Measure.PEAK for g in self._proof._problem.goals)
            rows = source.astype(np.int32), target.astype(np.int32)
            self._graph = Graph(*rows, amounts, peaks, self._ends)
            self._arcs = []
        return self._graph


def _alike(book: RuleBook, most: Mapping[int, float]) -> list[tuple[int, ...]]:
    """Return the robots that could change places, group by group."""
    scene, last = book.network.scene, len(book.network.inner)
    groups: dict[object, list[int]] = {}
    for r in book.team:
        may = not book.rules.placers or scene.robots[r].name in book.rules.placers
        nodes = [book.newest_nodes[r, b] for b in range(1, last + 1)]
        key = (book.reached[r, last], tuple(nodes), may, most[r])
        groups.setdefault(key, []).append(r)
    return [tuple(group) for group in groups.values() if len(group) > 1]


def _loads(problem: FreeProblem, book: RuleBook) -> dict[int, float]:
    """Return the most that every robot of the scene may carry, N."""
    out = {}
    for r, robot in enumerate(problem.network.scene.robots):
        kept = book.rules.payload is Payload.KEPT
        cap = min(robot.payload if kept else np.inf, problem.caps.get(robot.name, np.inf))
        out[r] = cap * (1 + LIMIT_TOLERANCE)
    return out
