"""The proof that no free schedule is better: a graph of its own, and what no path stays below.

The graph is built anew by a second version of the rules, with responses that the engine computes
again. Which states a search visited may be told, so that many are looked at together; states that
this leaves out are found all the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import InfeasibleError
from seqopt.graph.budgets import budget_bounds, is_beyond
from seqopt.graph.duality import lexicographic_bounds
from seqopt.graph.graph import Graph
from seqopt.graph.paths import lexicographic, reached
from seqopt.graph.states.states import States
from seqopt.plan.judge.passable import Asked, Passable
from seqopt.plan.judge.rule_moves import Follows
from seqopt.problem.goals import Measure

BELOW = 1e-9  # by how much a plan must be better, over the size of the value
Hint = Mapping[int, Ints]  # states that a search visited, by brick count


class Proof:
    """What no free schedule stays below, by independent rules and new responses.

    ``hint`` (mapping of int to (n, c) int): states that are likely to be passed, by brick count, as
    of `seqopt.sequence.free_space.FreeSpace`; only time depends on them; ``states``: how many
    states a better plan could pass.
    """

    def __init__(self, problem: States, hint: Hint | None = None) -> None:
        self._passable = Passable(problem)
        self._told = {} if hint is None else _rows(problem, self._passable, hint)
        self.states = 0

    def bounds(self, values: Sequence[float]) -> tuple[float, ...]:
        """Return what no plan stays below in every goal, those before it being at their values.

        ``values``: of every goal; what is said of margins of stability means nothing. Result:
        infinite where there is no plan.
        """
        least = self._passable.least()
        if self._is_better(values, least) is None:
            self.states = 1  # a cut before the end alone
            return least
        while True:
            levels = _Levels(self._passable, self._told, Asked(values))
            self.states = sum(map(len, levels.states))
            graph = levels.graph()
            out = lexicographic_bounds(graph, values)
            if self._is_better(values, out) is None or not self._fall(levels, graph, values):
                return out

    def budget_bounds(
        self, values: Sequence[float], claimed: Sequence[float], prices: Sequence[Sequence[float]]
    ) -> tuple[float, ...]:
        """Return the same for plans within budgets, by prices that a formulation gives."""
        caps = self._passable.problem.budgets
        levels = _Levels(self._passable, self._told, Asked(values))
        self.states = sum(map(len, levels.states))
        return budget_bounds(levels.graph(), values, claimed, (caps, prices))

    def is_impossible(self, margins: Sequence[float] = ()) -> bool:
        """Return whether no plan is allowed, or none in which all states have such margins.

        States must stand if that is demanded.

        ``margins``: of the first goals.
        """
        graph = _Levels(self._passable, self._told, Asked((), margins)).graph()
        self.states = max(self.states, graph.states)
        caps = self._passable.problem.budgets
        return is_beyond(graph, caps) if caps else not graph.ends[reached(graph)].any()

    def _is_better(self, values: Sequence[float], bounds: Sequence[float]) -> int | None:
        """Return the first goal whose bound leaves room for a better plan; None if none does."""
        for k in range(self._passable.margins, len(values)):
            if not bounds[k] >= values[k] - BELOW * abs(values[k]):
                return k
        return None

    def _fall(self, levels: _Levels, graph: Graph, values: Sequence[float]) -> bool:
        """Return whether a state on a path that would be better is proven to fall."""
        passable = self._passable
        margins = values[: passable.margins]
        if not passable.stands.asked(margins):
            return False
        try:
            path = np.array(lexicographic(graph).path)
        except InfeasibleError:
            return False
        first, found = 0, False
        for level, rows in enumerate(levels.states):
            own = rows[path[(path >= first) & (path < first + len(rows))] - first]
            fall = own[~passable.may_stand(level, own, margins)] if level else own[:0]
            before = passable.fallen.get(level, np.zeros(0, dtype=np.int64))
            passable.fallen[level] = np.concatenate([before, passable.tables.codes(fall)])
            first, found = first + len(rows), found or len(fall) > 0
        return found


class _Levels:
    """The states that a better plan could pass, level by level, and the moves between them."""

    def __init__(self, passable: Passable, told: Mapping[int, Ints], asked: Asked) -> None:
        self._passable, self._asked = passable, asked
        self.states: list[Ints] = []
        self._moves: list[tuple[Ints, Ints, Floats]] = []
        self._ends: list[Bools] = []
        self._count = 0
        coming: list[tuple[Ints, Follows]] = []
        fresh = start = passable.tables.start()
        for level in range(passable.tables.last + 1):
            entries = np.concatenate([fresh, told.get(level, start[:0])])
            coming = self._close(level, entries, coming)
            fresh = np.concatenate([start[:0], *(move.states for _, move in coming)])

    def _close(
        self, level: int, entries: Ints, coming: list[tuple[Ints, Follows]]
    ) -> list[tuple[Ints, Follows]]:
        """Add the states of a level; return the moves that place the next one."""
        part, tables = self._passable.closed(level, entries, self._asked), self._passable.tables
        moves = [(follows.source + self._count, follows) for follows in part.follows]
        order = np.argsort(part.codes, kind="stable")
        for source, move in [*coming, *(pair for pair in moves if pair[1].level == level)]:
            wanted = tables.codes(move.states)
            at = np.searchsorted(part.codes, wanted, sorter=order)
            kept = at < len(part.codes)
            kept[kept] = part.codes[order[at[kept]]] == wanted[kept]
            target = order[at[kept]]
            taken = move._replace(way=move.way[kept])
            amounts = self._passable.moved(part.values[target], taken)
            self._moves.append((source[kept], self._count + target, amounts))
        self._count += len(part.states)
        self.states.append(part.states)
        self._ends.append(tables.ends(level, part.states))
        return [pair for pair in moves if pair[1].level > level]

    def graph(self) -> Graph:
        """Return them as a graph; the moves are then used up."""
        source, target, amounts = map(np.concatenate, zip(*self._moves, strict=True))
        self._moves.clear()
        peaks = tuple(goal.measure is Measure.PEAK for goal in self._passable.problem.goals)
        rows = source.astype(np.int32), target.astype(np.int32)
        return Graph(*rows, amounts, peaks, np.concatenate(self._ends))


def _rows(problem: States, passable: Passable, hint: Hint) -> dict[int, Ints]:
    """Return states of a search as rows of the tables, by brick count."""
    tables, columns = passable.tables, [r for kind in problem.space.kinds for r in kind.robots]
    order = [columns.index(r) for r in tables.team]
    return {
        bricks: tables.in_order(
            rows[:, [*order, *range(len(order), rows.shape[1])]].astype(tables.start().dtype)
        )
        for bricks, rows in hint.items()
    }
