"""Goals of builds with resources, bounded one after the other on the judge's own graph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph.formulation import Solution
from seqopt.graph.graph import Graph, LabelProof
from seqopt.graph.paths import cut, potentials, tied
from seqopt.judge._label_proof import Book, Closed, SumBook, TwinBook, kept_below, limit_below
from seqopt.judge._states import StateEvaluator
from seqopt.problem.amounts import NONE
from seqopt.problem.resources import StepArrays


def label_bounds(
    evaluator: StateEvaluator, rebuilt: Any, values: Sequence[float], found: Solution
) -> Callable[[Graph], tuple[float, ...]]:
    """Return what bounds the goals after those about margins, by labels, on rebuilt subgraphs.

    ``rebuilt``: states, as of `seqopt.judge._proof.Rebuilt`; ``values``: of all goals; ``found``:
    what is claimed, with labels. The function raises `SolverError` if labels are given that do not
    prove what is claimed.
    """
    rows = _LabeledRows(evaluator, rebuilt, values, found)
    return lambda graph: _GoalProofs(rows, graph, values, found).bounds()


class _LabeledRows:
    """The states that a better build could pass, by number, in the columns of the judge.

    ``level`` (n,); ``rows`` (n, c); ``timed``: the same in time, if that counts.
    """

    def __init__(
        self, evaluator: StateEvaluator, rebuilt: Any, values: Sequence[float], found: Solution
    ) -> None:
        self.evaluator, self._rebuilt = evaluator, rebuilt
        self._margins = values[: evaluator.margins]
        tables, problem = evaluator.tables, evaluator.problem
        self.level = np.array(rebuilt.parts)[rebuilt.part_of()]
        self.rows = np.concatenate([own[:, : tables.robots] for own in rebuilt.states])
        columns = [r for kind in problem.space.kinds for r in kind.robots]
        self._columns = [columns.index(r) for r in tables.team]  # of the search
        clocks = (goal.twin.clocks for goal in problem.goals if goal.in_time)
        self.timed = next((make(evaluator, rebuilt, found.motions) for make in clocks), None)

    def clock(self, graph: Graph, proof: LabelProof, most: float, *, strict: bool) -> Any:
        """Return the book of time, and which moves its arcs are."""
        assert self.timed is not None
        wide = proof.prices.ndim == 2 and proof.prices.shape[1] == 1 + len(self._columns)
        if not wide:
            raise SolverError("there is no price for every robot")
        prices = proof.prices[:, [0, *(1 + c for c in self._columns)]]
        return self.timed.clock(graph, prices, most, strict=strict)

    def twins(self, graph: Graph, move: Ints) -> list[Book]:
        """Return the books of the problem's own resources on some moves of a graph."""
        problem, tables = self.evaluator.problem, self.evaluator.tables
        nodes = np.full((len(self.rows), len(problem.network.scene.robots)), NONE)
        nodes[:, list(tables.team)] = tables.nodes[self.rows.clip(min=0)]
        bricks = np.array([tables.bricks_at(k) if k else 0 for k in range(tables.last + 1)])
        source, target = graph.source[move], graph.target[move]
        steps = StepArrays(bricks[self.level[target]], nodes[source], nodes[target])
        return [TwinBook(each.twin, steps) for each in problem.paths if each.twin is not None]

    def labels(self, proof: LabelProof, width: int) -> tuple[Ints, Floats]:
        """Return labels (N, width) by the numbers of their states, as far as there are such.

        Entries of robots that could change places are sorted, and with them their readiness.
        """
        count, tables = len(self._columns), self.evaluator.tables
        states, values = proof.states, proof.labels
        if len(states) and (states.ndim != 2 or states.shape[1] < 1 + count):
            raise SolverError("labels are none of this build: they have other columns")
        if len(states) != len(values) or values.shape[1:] != (width,):
            return np.zeros(0, dtype=np.int64), np.zeros((0, width))
        order = [0, *(1 + c for c in self._columns)]
        states = states[:, [*order, *range(1 + count, states.shape[1])]]
        if self.timed is not None:
            values = values[:, [*order, *range(1 + count, width)]]
            values = self.timed.in_order(states[:, 1 : 1 + count], values)
        entries = tables.in_order(states[:, 1:].astype(tables.start().dtype))
        none = np.zeros(0, dtype=np.int64)
        numbers, labels = [none], [none]  # where builds begin a state may come twice
        firsts = np.cumsum([0, *map(len, self._rebuilt.states)])
        pairs = zip(self._rebuilt.parts, self._rebuilt.states, firsts[:-1], strict=True)
        for level, rows, first in pairs:
            own = np.flatnonzero(states[:, 0] == level)
            if len(own) and len(rows):
                codes, wanted = tables.codes(rows), tables.codes(entries[own])
                sort = np.argsort(codes)
                at = sort[np.searchsorted(codes, wanted, sorter=sort).clip(max=len(rows) - 1)]
                same = codes[at] == wanted
                numbers.append(first + at[same])
                labels.append(own[same])
        number, label = np.concatenate(numbers), np.concatenate(labels)
        known = np.isfinite(values[label]).all(axis=1)
        return number[known], values[label[known]]

    def fallen(self, states: Ints) -> Bools:
        """Return which states of some numbers are proven to fall; where it begins none is."""
        out = np.zeros(len(states), dtype=bool)
        if not self.evaluator.demands(self._margins):
            return out
        for level in np.unique(self.level[states]).tolist():
            own = np.flatnonzero((self.level[states] == level) & (states > 0))
            out[own] = ~self.evaluator.may_stand(level, self.rows[states[own]], self._margins)
        return out


class _GoalProofs:
    """Bounds on the goals of a build in time, each where those before it are at their values."""

    def __init__(
        self, rows: _LabeledRows, graph: Graph, values: Sequence[float], found: Solution
    ) -> None:
        self._rows, self._graph, self._values, self._found = rows, graph, values, found
        problem = rows.evaluator.problem
        self._aims = len(problem.aims)
        self._is_time = [goal.in_time for goal in problem.goals]
        self._time, self._sums = np.inf, list[tuple[int, float]]()
        for k, cap in zip(range(self._aims, len(values)), problem.budgets, strict=True):
            self._cap(k, tied(cap))
        cures = rows.timed is not None and rows.timed.cures
        self._filtered = not (problem.budgets or cures or problem.paths)

    def _cap(self, k: int, most: float) -> None:
        """Let builds take no more of a goal from now on."""
        if self._is_time[k]:
            self._time = min(self._time, most)
        elif self._graph.peaks[k]:
            self._graph = self._graph.only(self._graph.amounts[:, k] <= most)
        else:
            self._sums.append((k, most))

    def bounds(self) -> tuple[float, ...]:
        """Return lower bounds of the aims after those about margins."""
        proofs, out = iter(self._found.proofs), list[float]()
        for k in range(self._rows.evaluator.margins, self._aims):
            value = self._values[k]
            if self._filtered and not self._is_time[k]:
                proven = cut if self._graph.peaks[k] else potentials
                bound, kept = proven(self._graph, k, value)
                self._graph = self._graph.only(kept)
                out.append(bound)
                continue
            self._filtered = False
            proof = next(proofs, None)
            out.append(-np.inf if proof is None else self._by_labels(k, proof))
            self._cap(k, tied(value))
        return tuple(out)

    def _by_labels(self, k: int, proof: LabelProof) -> float:
        """Return the bound of a goal that labels prove, or multipliers alone."""
        claimed, graph = min(self._found.bound[k], self._values[k]), self._graph
        if not np.isfinite(claimed):
            return -np.inf
        columns = [column for column, _ in self._sums]
        caps = [self._time, *(most for _, most in self._sums)]
        strict = [False] * len(caps)
        if self._is_time[k]:
            caps[0], strict[0] = limit_below(claimed), True
        elif graph.peaks[k]:
            graph = graph.only(kept_below(graph.amounts[:, k], claimed))
        else:
            columns, strict = [*columns, k], [*strict, True]
            caps.append(limit_below(claimed))
        books, move = list[Book](), np.arange(len(graph.source))
        if self._rows.timed is not None:
            clock, move = self._rows.clock(graph, proof, caps[0], strict=strict[0])
            books.append(clock)
        if columns:
            limits = np.array(caps[1:]), np.array(strict[1:])
            books.append(SumBook(graph, move, graph.amounts[:, columns], limits))
        closed = Closed(graph, move, [*books, *self._rows.twins(graph, move)])
        if closed.is_proof(self._rows.labels(proof, closed.width), self._rows.fallen):
            return claimed
        if len(proof.labels):
            goal = self._rows.evaluator.problem.names[k]
            raise SolverError(f"{goal}: labels do not prove that no build is below {claimed:.9g}")
        return min(clock.bound, claimed) if self._is_time[k] else -np.inf
