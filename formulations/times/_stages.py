"""Goals one after the other, on a graph in time: paths, with lower bounds that labels prove.

Goals before the makespan leave moves out, as without time; where there are budgets, and after the
makespan, they are sought by labels that keep all caps at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from formulations._search import StopError
from formulations.times._labels import Caps, Carrying, Prices
from seqopt.arrays import Bools
from seqopt.errors import InfeasibleError, NothingFoundError
from seqopt.graph._budgets import Labels, LateError, Swept
from seqopt.graph.formulation import LabelProof, Watch
from seqopt.graph.graph import _best_moves, _on_paths, moves_along, tied
from seqopt.graph.space import Visited
from seqopt.problem.amounts import Amount

SHARES = (0.25, 0.5, 0.75, 1.0)  # of the gap that is left, up to which labels are set
MOST = 40_000_000  # labels that are kept at once
BEAMS = (100, 1000, 5000)  # widths of the searches for a first path
ALMOST = 1e-9  # over a value: a path must be better by more than this to be better


class Chosen(NamedTuple):
    """A path through states, its start left out, with its makespan and lower bound, s.

    ``value``, ``bound``: s; ``labels``: that prove the bound, if there are any; ``late``: whether
    time was over.
    """

    path: tuple[int, ...]
    value: float
    bound: float
    labels: tuple[Labels, ...] = ()
    late: bool = False


@dataclass
class StageFound:
    """Moves and caps that are left after some goals, with the results of these."""

    kept: Bools
    caps: Caps
    filtered: bool  # whether moves alone say what is allowed
    path: tuple[int, ...] = ()
    bounds: list[float] = field(default_factory=list)
    proofs: list[LabelProof] = field(default_factory=list)
    late: bool = False

    def require_path(self) -> None:
        """Raise an error if no path was found, in time or at all."""
        if not self.path and self.late:
            raise StopError("time")
        if not self.path:
            raise InfeasibleError("no plan is within all budgets")


Least = Callable[[Carrying, StageFound, Chosen, Prices, Watch], Chosen]
"""Returns the path of least makespan by the moves and caps that are left, from a first one."""


def by_labels(
    carrying: Carrying, stage: StageFound, best: Chosen, prices: Prices, watch: Watch
) -> Chosen:
    """Return the path of least makespan, with the labels that prove it."""
    bound, labels = best.bound, tuple[Labels, ...]()
    start, shares = bound, SHARES if best.path else ()
    for share in shares or (np.inf,):  # narrow searches find nothing where budgets leave little
        limit = start + (best.value - start) * share if share < 1 else best.value * (1 - ALMOST)
        caps = replace(stage.caps, time=min(limit, stage.caps.time))
        try:
            swept = carrying.sweep(stage.kept, caps, prices, watch, most=MOST)
        except LateError:
            return Chosen(best.path, best.value, bound, labels, late=True)
        watch.tell(bound=bound)
        labels = tuple(swept.kept)
        if swept.path or not best.path:
            return Chosen(swept.path, swept.best, swept.best, labels)
        bound = max(bound, min(swept.left_out, best.value))
        if bound >= best.value * (1 - ALMOST):
            break
    return Chosen(best.path, best.value, best.value, labels)


class Goals(NamedTuple):
    """Goals, of which the last ones are capped by ``budgets``; the first are the ``aims``."""

    goals: tuple[Amount, ...]
    aims: tuple[Amount, ...]
    budgets: tuple[float, ...]


class Stages:
    """Goals of a problem one after the other, on a graph in time."""

    def __init__(
        self, problem: Goals, visited: Visited, least: Least, watch: Watch, carrying: Carrying
    ) -> None:
        self._problem, self._least, self._watch = problem, least, watch
        self._visited, self._carrying, self._graph = visited, carrying, carrying.graph
        budgets = dict(enumerate(problem.budgets, start=len(problem.aims)))
        is_time = {k: problem.goals[k].in_time for k in budgets}
        time = min((tied(cap) for k, cap in budgets.items() if is_time[k]), default=np.inf)
        sums = tuple((k, tied(cap)) for k, cap in budgets.items() if not is_time[k])
        timed = carrying.timed
        cures = timed is not None and timed.curing is not None
        filtered = not (budgets or cures or carrying.asked)
        self._stage = StageFound(_on_paths(self._graph), Caps(time, sums), filtered)

    def run(self) -> StageFound:
        """Return path and bounds; raise an `InfeasibleError` if no path is within all caps."""
        if not self._stage.kept.any():
            raise InfeasibleError("no plan is allowed")
        for k, goal in enumerate(self._problem.aims):
            if self._stage.late:
                self._stage.bounds.append(-np.inf)
            elif goal.in_time:
                self._makespan()
            elif self._stage.filtered:
                kept = self._stage.kept.copy()
                kept[kept], least = _best_moves(self._graph.only(kept), k)
                self._stage.kept = self._on_paths(kept)
                self._stage.bounds.append(least)
            elif goal.is_peak:
                self._peak(k)
            else:
                self._sum(k)
        if not self._stage.path:
            self._makespan()
        return self._stage

    def _on_paths(self, kept: Bools) -> Bools:
        """Return which of some moves (m,) are on paths from the start to an end."""
        out = kept.copy()
        out[out] = _on_paths(self._graph.only(kept))
        return out

    def _beams(self, kept: Bools, caps: Caps, prices: Prices, goal: int | None = None) -> Swept:
        """Return a good path within caps, by ever wider searches; an empty one if none is found."""
        best = Swept()
        for width in BEAMS:
            try:
                found = self._carrying.sweep(
                    kept, caps, prices, self._watch, width=width, goal=goal
                )
            except LateError:
                break
            if found.best < best.best:
                best = found
                if goal is None:
                    caps = replace(caps, time=found.best * (1 - ALMOST))
            if best.path and (not found.narrow or best.best <= prices.bound * (1 + ALMOST)):
                break
        return best

    def _makespan(self) -> None:
        """Find the least makespan; from then on it is a cap."""
        stage, carrying = self._stage, self._carrying
        prices = carrying.prices(stage.kept, self._watch)
        swept = self._beams(stage.kept, stage.caps, prices)
        found = Chosen(swept.path, swept.best, prices.bound)
        if found.value > prices.bound * (1 + ALMOST):
            found = self._least(carrying, stage, found, prices, self._watch)
        if not (found.path or found.late) and found.bound < np.inf:
            raise NothingFoundError("no plan within all budgets was found; take makespan_labels")
        stage.path, stage.late = found.path, found.late
        stage.require_path()
        stage.bounds.append(min(found.bound, found.value))
        stage.proofs.append(self._proof(found.labels, prices))
        stage.caps = replace(stage.caps, time=tied(found.value))
        stage.filtered = False

    def _peak(self, k: int) -> None:
        """Find the least worst amount of paths within caps, by bisection."""
        stage, amounts = self._stage, self._graph.amounts[:, k]
        levels = np.unique(amounts[stage.kept])
        low, high, labels = 0, len(levels), tuple[Labels, ...]()
        prices = self._carrying.prices(stage.kept, self._watch)
        if stage.path:
            high = int(np.searchsorted(levels, self._taken(stage.path, k)))
        try:
            while low < high:
                middle = (low + high) // 2
                kept = self._on_paths(stage.kept & (amounts <= levels[middle]))
                swept = Swept()
                if kept.any():
                    swept = self._beams(kept, stage.caps, prices)
                if kept.any() and not swept.path:  # the labels that show that there is none
                    swept = self._carrying.sweep(kept, stage.caps, prices, self._watch)
                if swept.path:
                    stage.path = swept.path
                    high = int(np.searchsorted(levels, self._taken(swept.path, k)))
                else:
                    low, labels = middle + 1, tuple(swept.kept)
        except LateError:
            stage.late = True
        stage.require_path()
        stage.bounds.append(float(levels[min(low, high)]))
        stage.proofs.append(self._proof(labels, prices))
        stage.kept = stage.kept & (amounts <= tied(float(levels[high])))

    def _sum(self, k: int) -> None:
        """Find the least sum of paths within caps; from then on it is a cap."""
        stage = self._stage
        goal = len(stage.caps.sums)
        value = self._taken(stage.path, k) if stage.path else np.inf
        caps = replace(stage.caps, sums=(*stage.caps.sums, (k, value * (1 - ALMOST))))
        prices = self._carrying.prices(stage.kept, self._watch)
        labels: tuple[Labels, ...] = ()
        bound = -np.inf
        try:
            swept = self._beams(stage.kept, caps, prices, goal)
            if swept.path:
                stage.path, value = swept.path, swept.best
                caps = replace(caps, sums=(*stage.caps.sums, (k, value * (1 - ALMOST))))
            swept = self._carrying.sweep(stage.kept, caps, prices, self._watch, goal=goal)
            if swept.path:
                stage.path, value = swept.path, swept.best
            bound, labels = value, tuple(swept.kept)
        except LateError:
            stage.late = True
        stage.require_path()
        stage.bounds.append(bound)
        stage.proofs.append(self._proof(labels, prices))
        stage.caps = replace(stage.caps, sums=(*stage.caps.sums, (k, tied(value))))

    def _taken(self, path: Sequence[int], k: int) -> float:
        """Return the value of a goal, no makespan, of a path."""
        graph = self._graph
        amounts = graph.amounts[moves_along(graph, path), k]
        return float(amounts.max(initial=0.0) if graph.peaks[k] else amounts.sum())

    def least(self, path: Sequence[int]) -> float:
        """Return the makespan of a path, s, with the waits for mortar that are known."""
        graph = self._graph
        codes = graph.source.astype(np.int64) * graph.states + graph.target
        kept = np.isin(codes, codes[moves_along(graph, path)])
        prices = self._carrying.prices(kept, Watch(0.0))
        return self._carrying.sweep(kept, Caps(), prices, Watch()).best

    def values(self, path: Sequence[int], makespan: float) -> tuple[float, ...]:
        """Return the values of goals of a path that takes so long, s."""
        goals = enumerate(self._problem.goals)
        return tuple(makespan if goal.in_time else self._taken(path, k) for k, goal in goals)

    def _proof(self, labels: Sequence[Labels], prices: Prices) -> LabelProof:
        each, kinds = prices.each, prices.kinds
        each = np.column_stack([each[:, :1], each[:, 1:][:, kinds]])
        rows = np.concatenate([part for *_, part in self._visited.states]).astype(np.int64)
        if not labels:
            none = np.zeros((0, each.shape[1]))
            return LabelProof(np.zeros((0, 1 + rows.shape[1]), dtype=np.int64), none, each)
        state = np.concatenate([own.state for own in labels])
        states = np.column_stack([self._carrying.levels[state], rows[state]])
        taken = np.concatenate([own.taken for own in labels])
        first = int(self._carrying.timed is None)  # moves are counted for the search alone
        return LabelProof(states, taken[:, first:], each)
