"""Goals of builds in time, proven one after the other on the judge's own graph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph.duality import cut, potentials
from seqopt.graph.graph import Graph, LabelProof
from seqopt.graph.paths import tied
from seqopt.graph.solution import StatePath
from seqopt.graph.states.states import States
from seqopt.judge._proof import Rebuilt
from seqopt.judge._states import StateEvaluator, Tables
from seqopt.problem.problem import Measure
from seqopt.sequence._durations import require_durations
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import StepKind
from seqopt.times._label_proof import Closed, Limits, Team, TimedMoves, kept_below, limit_below
from seqopt.times._mortar_floors import CuredRows, cured_rows

Fallen = Callable[[int, Ints], Bools]


@dataclass(frozen=True, eq=False)
class TimedStates:
    """The states that a better build could pass, by level, and the moves between them.

    ``levels``: of rows (n, c), numbered one level after the other; ``which``: their levels, of
    which the first may come twice, as where the build begins; ``fallen``: which rows (k,) of a
    level are proven to fall; ``cured``: what all of them ask of mortar, where it cures.
    """

    problem: States
    tables: Tables
    levels: Sequence[Ints]
    which: Sequence[int]
    graph: Graph
    fallen: Fallen
    cured: CuredRows | None = None

    @property
    def starts(self) -> Ints:
        """The number of the first state of every level."""
        return np.cumsum([0, *map(len, self.levels)])[:-1]

    def moves(self, graph: Graph) -> TimedMoves:
        """Return what moves of a graph of these states take of the time of robots."""
        rows = np.concatenate([each[:, : self.tables.robots] for each in self.levels])
        level = np.repeat(self.which, [*map(len, self.levels)])
        places = level[graph.target] > level[graph.source]
        rules = self.problem.rules
        if isinstance(rules, Schedule):
            kinds = [False, *(step.kind is StepKind.PLACE for step in rules.steps)]
            places = np.array(kinds)[level[graph.target]]
        return TimedMoves(graph, rows.astype(np.int64), places, self._team(), self.cured)

    def _team(self) -> Team:
        scene, tables = self.problem.network.scene, self.tables
        own = require_durations(scene, tables.team)
        times = np.array([[d.fetch, d.place, d.approach, d.grip, d.release] for d in own])
        slow = np.array([0.0 if d.speed is None else 1 / d.speed for d in own])
        at = [scene.node_position(node) for node in tables.nodes[1:].tolist()]
        places = np.array([(0.0, 0.0, 0.0), *at])
        return Team(times, slow, tables.groups, places, self.problem.parks)

    def numbers(self, proof: LabelProof) -> tuple[Ints, Floats]:
        """Return labels by the numbers of their states, as far as there are such states.

        Entries of robots that could change places are sorted, and with them their readiness.
        """
        columns = [r for kind in self.problem.space.kinds for r in kind.robots]
        order = [columns.index(r) for r in self.tables.team]
        count = len(order)
        if (
            proof.states.ndim != 2
            or proof.labels.ndim != 2
            or (
                len(proof.states) != len(proof.labels)
                or proof.states.shape[1] < 1 + count
                or proof.labels.shape[1] < 1 + count
            )
        ):
            raise SolverError("labels are none of this build: they have other columns")
        entries = proof.states[
            :, [*(1 + np.array(order)), *range(1 + count, proof.states.shape[1])]
        ]
        values = proof.labels[
            :, [0, *(1 + np.array(order)), *range(1 + count, proof.labels.shape[1])]
        ]
        team = self._team()
        for group in team.groups:
            own, times = entries[:, group], values[:, [1 + c for c in group]]
            sort = np.lexsort((times, -own), axis=1)
            values[:, [1 + c for c in group]] = np.take_along_axis(times, sort, axis=1)
        entries = self.tables.in_order(entries.astype(self.tables.start().dtype))
        numbers, labels = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        for level, rows, first in zip(self.which, self.levels, self.starts, strict=True):
            own = np.flatnonzero(proof.states[:, 0] == level)
            if len(own) and len(rows):
                codes = self.tables.codes(rows)
                sort = np.argsort(codes)
                wanted = self.tables.codes(entries[own])
                at = np.searchsorted(codes, wanted, sorter=sort).clip(max=len(rows) - 1)
                found = codes[sort[at]] == wanted
                numbers.append(first + sort[at[found]])
                labels.append(own[found])
        number, label = np.concatenate(numbers), np.concatenate(labels)
        known = np.isfinite(values[label]).all(axis=1)
        return number[known], values[label[known]]

    def all_fallen(self, states: Ints) -> Bools:
        """Return which states of some numbers are proven to fall."""
        out = np.zeros(len(states), dtype=bool)
        every = zip(self.which, self.levels, self.starts, strict=True)
        for level, rows, first in [*every][1:]:  # in the first one it begins, whatever it takes
            own = np.flatnonzero((states >= first) & (states < first + len(rows)))
            if len(own):
                out[own] = self.fallen(level, rows[states[own] - first])
        return out


class Claim(NamedTuple):
    """What is claimed of a build in time.

    ``values``: of all goals; ``bounds``: what no build stays below; ``proofs``: of the latter;
    ``motions``: in which states fall while mortar cures.
    """

    values: Sequence[float]
    bounds: Sequence[float]
    proofs: Sequence[LabelProof]
    motions: Sequence[Floats] = ()


class GoalProofs:
    """Bounds on the goals of a build in time, each where those before it are at their values."""

    def __init__(self, states: TimedStates, claim: Claim) -> None:
        self._states, self._claim, values = states, claim, claim.values
        problem = states.problem
        self._aims = len(problem.aims)
        self._is_time = [goal.measure is Measure.MAKESPAN for goal in problem.goals]
        self._graph = states.graph
        caps = zip(range(self._aims, len(values)), problem.budgets, strict=True)
        self._time, self._sums = np.inf, list[tuple[int, float]]()
        for k, cap in caps:
            self._cap(k, tied(cap))
        self._filtered = not problem.budgets and states.cured is None
        self.states = 0

    def _cap(self, k: int, most: float) -> None:
        """Let builds take no more of a goal from now on."""
        if self._is_time[k]:
            self._time = min(self._time, most)
        elif self._graph.peaks[k]:
            self._graph = self._graph.only(self._graph.amounts[:, k] <= most)
        else:
            self._sums.append((k, most))

    def bounds(self, first: int) -> tuple[float, ...]:
        """Return what no build stays below in every aim from the first one that is not known."""
        proofs, out = iter(self._claim.proofs), list[float]()
        for k in range(first, self._aims):
            value = self._claim.values[k]
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
        """Return the bound of a goal that labels prove, or prices alone."""
        claimed, graph = min(self._claim.bounds[k], self._claim.values[k]), self._graph
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
        moves = self._states.moves(graph)
        limits = Limits(caps[0], np.array(caps[1:]), np.array(strict))
        prices = self._in_order(proof.prices)
        closed = Closed(moves, graph.amounts[:, columns], prices, limits)
        labels = self._states.numbers(proof)
        cured = self._states.cured
        bricks = 0 if cured is None else len(cured.floors.full)
        width = 1 + self._states.tables.robots + len(columns) + bricks
        if labels[1].shape[1] != width:
            labels = labels[0][:0], np.zeros((0, width))
        is_proof, count = closed.is_proof(labels, self._states.all_fallen)
        self.states += count
        if is_proof:
            return claimed
        if len(proof.labels):
            goal = self._states.problem.names[k]
            raise SolverError(f"{goal}: labels do not prove that no build is below {claimed:.9g}")
        return min(closed.bound, claimed) if self._is_time[k] else -np.inf

    def _in_order(self, prices: Floats) -> Floats:
        """Return prices (L, 1 + c) by the columns of the judge."""
        columns = [r for kind in self._states.problem.space.kinds for r in kind.robots]
        order = [1 + columns.index(r) for r in self._states.tables.team]
        if prices.ndim != 2 or prices.shape[1] != 1 + len(order):
            raise SolverError("there is no price for every robot")
        return np.asarray(prices[:, [0, *order]])


def label_bounds(
    evaluator: StateEvaluator, rebuilt: Rebuilt, values: Sequence[float], found: StatePath
) -> Callable[[Graph], tuple[float, ...]]:
    """Return what bounds the goals after those about margins, by labels, on rebuilt subgraphs.

    ``values``: of all goals; ``found``: what is claimed, with labels. The function raises
    `SolverError` if labels are given that do not prove what is claimed.
    """
    first, tables = evaluator.margins, evaluator.tables
    margins, claim = values[:first], Claim(values, found.bound, found.proofs, found.motions)

    def fallen(level: int, rows: Ints) -> Bools:
        if not evaluator.demands(margins):
            return np.zeros(len(rows), dtype=bool)
        return ~evaluator.may_stand(level, rows, margins)

    bricks = [tables.bricks_at(level) if level else 0 for level in rebuilt.parts]
    grips = [evaluator.held_to_stand(rows) for rows in rebuilt.states]
    cured = cured_rows(evaluator.problem, bricks, grips, claim.motions)

    def bounds(graph: Graph) -> tuple[float, ...]:
        own = tables, rebuilt.states, rebuilt.parts, graph, fallen, cured
        return GoalProofs(TimedStates(evaluator.problem, *own), claim).bounds(first)

    return bounds
