"""Goals of builds in time, bounded one after the other on the judge's own graph."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph.formulation import Solution
from seqopt.graph.graph import Graph, LabelProof
from seqopt.graph.paths import cut, potentials, tied
from seqopt.judge._proof import Rebuilt
from seqopt.judge._states import StateEvaluator
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import StepKind
from seqopt.times._acts import Acts, Team, acts_of_rows
from seqopt.times._durations import require_durations
from seqopt.times._label_proof import Closed, Limits, kept_below, limit_below
from seqopt.times._mortar_floors import cured_rows


def label_bounds(
    evaluator: StateEvaluator, rebuilt: Rebuilt, values: Sequence[float], found: Solution
) -> Callable[[Graph], tuple[float, ...]]:
    """Return what bounds the goals after those about margins, by labels, on rebuilt subgraphs.

    ``values``: of all goals; ``found``: what is claimed, with labels. The function raises
    `SolverError` if labels are given that do not prove what is claimed.
    """
    rows = _TimedRows(evaluator, rebuilt, values, found)
    return lambda graph: _GoalProofs(rows, graph, values, found).bounds()


class _TimedRows:
    """The states that a better build could pass, by number, in the columns of the judge.

    ``level`` (n,); ``rows`` (n, c).
    """

    def __init__(
        self, evaluator: StateEvaluator, rebuilt: Rebuilt, values: Sequence[float], found: Solution
    ) -> None:
        self.evaluator, self._rebuilt = evaluator, rebuilt
        self._margins = values[: evaluator.margins]
        tables, problem = evaluator.tables, evaluator.problem
        self.level = np.array(rebuilt.parts)[rebuilt.part_of()]
        self.rows = np.concatenate([own[:, : tables.robots] for own in rebuilt.states])
        columns = [r for kind in problem.space.kinds for r in kind.robots]
        self._columns = [columns.index(r) for r in tables.team]  # of the search
        self.cured = cured_rows(evaluator, rebuilt, found.motions)
        scene, own = problem.network.scene, require_durations(problem.network.scene, tables.team)
        times = np.array([[d.fetch, d.place, d.approach, d.grip, d.release] for d in own])
        slow = np.array([0.0 if d.speed is None else 1 / d.speed for d in own])
        at = [scene.node_position(node) for node in tables.nodes[1:].tolist()]
        self._team = Team(times, slow, tables.groups, np.array([(0.0,) * 3, *at]), problem.parks)

    def acts(self, graph: Graph) -> Acts:
        """Return who may act in the moves of a graph of these states, and for how long."""
        places = self.level[graph.target] > self.level[graph.source]
        rules = self.evaluator.problem.rules
        if isinstance(rules, Schedule):
            kinds = [False, *(step.kind is StepKind.PLACE for step in rules.steps)]
            places = np.array(kinds)[self.level[graph.target]]
        return acts_of_rows(graph, self.rows.astype(np.int64), places, self._team, self.cured)

    def multipliers(self, proof: LabelProof) -> Floats:
        """Return multipliers (L, 1 + c) of the time of all and of robots, by columns."""
        count = len(self._columns)
        if proof.prices.ndim != 2 or proof.prices.shape[1] != 1 + count:
            raise SolverError("there is no price for every robot")
        return np.asarray(proof.prices[:, [0, *(1 + c for c in self._columns)]])

    def labels(self, proof: LabelProof) -> tuple[Ints, Floats]:
        """Return labels by the numbers of their states, as far as there are such states.

        Entries of robots that could change places are sorted, and with them their readiness.
        """
        count, tables = len(self._columns), self.evaluator.tables
        given = proof.states, proof.labels
        wide = all(each.ndim == 2 and each.shape[1] >= 1 + count for each in given)
        if not wide or len(proof.states) != len(proof.labels):
            raise SolverError("labels are none of this build: they have other columns")
        order = [0, *(1 + c for c in self._columns)]
        states = proof.states[:, [*order, *range(1 + count, proof.states.shape[1])]]
        values = proof.labels[:, [*order, *range(1 + count, proof.labels.shape[1])]]
        for group in self._team.groups:
            columns = [1 + c for c in group]
            sort = np.lexsort((values[:, columns], -states[:, columns]), axis=1)
            values[:, columns] = np.take_along_axis(values[:, columns], sort, axis=1)
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
        self, rows: _TimedRows, graph: Graph, values: Sequence[float], found: Solution
    ) -> None:
        self._rows, self._graph, self._values, self._found = rows, graph, values, found
        problem = rows.evaluator.problem
        self._aims = len(problem.aims)
        self._is_time = [goal.in_time for goal in problem.goals]
        self._time, self._sums = np.inf, list[tuple[int, float]]()
        for k, cap in zip(range(self._aims, len(values)), problem.budgets, strict=True):
            self._cap(k, tied(cap))
        self._filtered = not problem.budgets and rows.cured is None

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
        limits = Limits(caps[0], np.array(caps[1:]), np.array(strict))
        acts, multipliers = self._rows.acts(graph), self._rows.multipliers(proof)
        closed = Closed(acts, graph.amounts[:, columns], multipliers, limits)
        labels, cured = self._rows.labels(proof), self._rows.cured
        bricks = 0 if cured is None else len(cured.full)
        width = 1 + acts.entries.shape[1] + len(columns) + bricks
        if labels[1].shape[1] != width:
            labels = labels[0][:0], np.zeros((0, width))
        if closed.is_proof(labels, self._rows.fallen):
            return claimed
        if len(proof.labels):
            goal = self._rows.evaluator.problem.names[k]
            raise SolverError(f"{goal}: labels do not prove that no build is below {claimed:.9g}")
        return min(closed.bound, claimed) if self._is_time[k] else -np.inf
