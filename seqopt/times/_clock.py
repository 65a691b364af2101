"""The time of builds as their judge follows it: readiness, ages of mortar, and bounds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph.graph import Graph
from seqopt.graph.paths import _to_go
from seqopt.judge._bounds import Book, is_beyond_limits
from seqopt.judge._proof import Rebuilt
from seqopt.judge._states import StateEvaluator
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import StepKind
from seqopt.times._acts import Acts, Team, acts_of_rows
from seqopt.times._durations import require_durations
from seqopt.times._mortar_floors import cured_rows


class Clock(Book):
    """When steps end, since when robots are free, and how old mortar is where it cures.

    ``acts``: all that may be taken; ``multipliers`` (L, 1 + c): of the time of all and of robots,
    made valid; ``most``: s; ``strict``: whether what ends then is no better either.
    """

    def __init__(self, acts: Acts, multipliers: Floats, most: float, *, strict: bool) -> None:
        self._acts, self._limit, columns = acts, (np.array([most]), np.array([strict])), acts.count
        self._multipliers = np.array([_valid(each, acts) for each in multipliers])
        self._multipliers = self._multipliers.reshape(-1, 1 + columns)
        self._left = [_to_go(acts.graph, acts.work @ each) for each in self._multipliers]
        placed = np.zeros(0) if acts.cured is None else acts.cured.placed
        self.first = np.concatenate([np.zeros(1 + columns), placed])

    @property
    def bound(self) -> float:
        """Lower bound of all builds by multipliers alone, s."""
        return max((float(left[0]) for left in self._left), default=0.0)

    def follow(self, arc: Ints, values: Floats) -> Floats:
        last = 1 + self._acts.count
        before = values[:, 0], values[:, 1:last], values[:, last:]
        return np.column_stack(self._acts.follow(arc, *before))

    def beyond(self, state: Ints, values: Floats) -> Bools:
        end, since = values[:, 0], values[:, 1 : 1 + self._acts.count]
        busy = np.where(self._acts.entries[state] <= 0, since, end[:, None])
        ends, over = end.copy(), self._acts.graph.ends[state]
        for multipliers, left in zip(self._multipliers, self._left, strict=True):
            bound = multipliers[0] * end + busy @ multipliers[1:] + left[state]
            ends = np.where(over, ends, np.maximum(ends, bound))
        return is_beyond_limits(ends[:, None], *self._limit)

    def counted(self, state: Ints, values: Floats) -> Floats:
        """Return labels with the readiness and ages that count.

        Who is free for longer than any preparation takes could as well be so for as long: who acts
        again acts no sooner, and who does not is done.
        """
        return self._acts.counted(state, values)


def _valid(multipliers: Floats, acts: Acts) -> Floats:
    """Return multipliers that prove a bound, near some: from 0, at most one together.

    Robots that are alike have the same.
    """
    out = np.where(np.isfinite(multipliers), multipliers, 0.0).clip(min=0.0)
    for group in acts.groups:
        columns = [1 + column for column in group]
        out[columns] = out[columns].mean()
    return np.asarray(out / max(1.0, float(out.sum())))


class TimedRows:
    """The states that a better build could pass, rebuilt, in time."""

    def __init__(
        self, evaluator: StateEvaluator, rebuilt: Rebuilt, motions: Sequence[Floats]
    ) -> None:
        tables, problem = evaluator.tables, evaluator.problem
        self._rules, self._team_columns = problem.rules, len(tables.team)
        self._level = np.array(rebuilt.parts)[rebuilt.part_of()]
        rows = np.concatenate([own[:, : tables.robots] for own in rebuilt.states])
        self._rows = rows.astype(np.int64)
        self._cured = cured_rows(evaluator, rebuilt, motions)
        scene, own = problem.network.scene, require_durations(problem.network.scene, tables.team)
        times = np.array([[d.fetch, d.place, d.approach, d.grip, d.release] for d in own])
        slow = np.array([0.0 if d.speed is None else 1 / d.speed for d in own])
        at = [scene.node_position(node) for node in tables.nodes[1:].tolist()]
        self._team = Team(times, slow, tables.groups, np.array([(0.0,) * 3, *at]), problem.parks)

    @property
    def cures(self) -> bool:
        """Whether mortar cures."""
        return self._cured is not None

    def acts(self, graph: Graph) -> Acts:
        """Return who may act in the moves of a graph of these states, and for how long."""
        places = self._level[graph.target] > self._level[graph.source]
        if isinstance(self._rules, Schedule):
            kinds = [False, *(step.kind is StepKind.PLACE for step in self._rules.steps)]
            places = np.array(kinds)[self._level[graph.target]]
        return acts_of_rows(graph, self._rows, places, self._team, self._cured)

    def clock(
        self, graph: Graph, multipliers: Floats, most: float, *, strict: bool
    ) -> tuple[Clock, Ints]:
        """Return the book of a graph of these states, and which moves its arcs are."""
        if multipliers.ndim != 2 or multipliers.shape[1] != 1 + self._team_columns:
            raise SolverError("there is no multiplier for every robot")
        acts = self.acts(graph)
        return Clock(acts, multipliers, most, strict=strict), acts.move

    def in_order(self, entries: Ints, values: Floats) -> Floats:
        """Return labels with readiness in the order of entries (N, c), as robots are alike."""
        out = values.copy()
        out[:, 1 : 1 + self._team_columns] *= entries <= 0
        for group in self._team.groups:
            columns = [1 + c for c in group]
            order = np.lexsort((out[:, columns], -entries[:, group]), axis=1)
            out[:, columns] = np.take_along_axis(out[:, columns], order, axis=1)
        return out
