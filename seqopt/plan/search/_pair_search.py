"""The proof of an optimum from only those pairs that could lead to a better choice.

Where all pairs of candidates are too many to be looked at, most need not be. The search begins with
the choices that are made move by move, which tell what can be had. A pair that was not looked at
counts as if it cost next to nothing; while that makes a choice look better than the best one known,
the pairs that promise most are looked at, some of every move at once. When none is left, the best
choice known is proven; whoever ends the search before has a bound.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from seqopt._interrupts import answered
from seqopt.arrays import Floats, Ints
from seqopt.errors import InfeasibleError, ProblemError, SolverError, TimeUpError
from seqopt.graph.layers._partial_costs import PartialCosts, floor_of
from seqopt.graph.layers.costs import Joined
from seqopt.graph.layers.interface import CostProblem
from seqopt.graph.layers.layers import Layers, _pairs_as_moves, _possible_after
from seqopt.plan.calling._guard import select
from seqopt.plan.calling.formulation import End, Formulation, FormulationKind, Selection, Watch
from seqopt.plan.search._window_search import (
    WindowSearch,
    alone_steps,
    posed_anew,
    search_windows,
    shared_steps,
)
from seqopt.problem.criteria import WeightedSum, WorstRatio
from seqopt.problem.problem import Aim

FIRST = 2  # rows of every move that are asked for at first
MORE = 1.5  # by which that grows from one round to the next
BROAD = 1  # round after which a search for the least peak looks where its way ends alone
AT_END = 8  # rows there, for every one of a move
EQUAL = 1e-9  # of a value: two that differ by less are one, found in another order


@dataclass(frozen=True)
class PairSearch:
    """What a search among pairs found.

    ``costs``: all that it looked at; ``selection``: the best choice of which all pairs are known;
    its trace tells how choice and bound met; ``along``: the steps that the choice meets, move by
    move, to be solved anew; ``models``: how many models were solved.
    """

    costs: PartialCosts
    selection: Selection
    along: WindowSearch
    models: int

    @property
    def objective(self) -> float:
        """What the steps cost that the choice meets."""
        aim = self.costs.aim
        parts = [zip(aim.costs(part).single, some, strict=True) for part, some in self.along.met]
        met = [own[now] for part in parts for own, now in part]
        return float(sum(met) if aim is Aim.SUM else max(met))


def search_pairs(problem: Layers, formulation: Formulation, watch: Watch) -> PairSearch:
    """Solve a problem exactly, looking only at pairs that could be better than what is known.

    ``problem``: its own responses are not computed; ``formulation``: is given what is known. Raises
    `InfeasibleError` if no choice is allowed; `ProblemError` if the formulation is not exact, there
    are budgets, or costs have no floor; `TimeUpError` if it is stopped before a choice is known.
    """
    floor = _floor(problem, formulation)
    assert formulation.aim is not None  # it is of candidates
    walk = _Pairs(problem, formulation.aim, floor)
    with answered(watch.interrupt):
        walk.look_until_proven(watch)
    costs = walk.costs
    if math.isinf(costs.best):
        if watch.over:
            raise TimeUpError("no choice was found yet; give more")
        raise InfeasibleError("no choice is allowed; relax a limit or widen a reach")
    selection = _best_known(costs, formulation, watch)
    return PairSearch(costs, selection, walk.along(selection.choice), walk.models)


def _best_known(costs: PartialCosts, formulation: Formulation, watch: Watch) -> Selection:
    """Return what the formulation makes of the pairs that are known."""
    known, candidates = costs.known()
    found = select(formulation, CostProblem(known))
    choice = tuple(left[index] for left, index in zip(candidates, found.choice, strict=True))
    early = End.INTERRUPTED if watch.interrupted else End.STOPPED
    end = End.DONE if _proven(costs) else early
    watch.tell(found.objective, costs.bound)
    bound = min(found.objective, costs.bound)
    return replace(found, choice=choice, bound=bound, end=end, trace=watch.trace)


def _proven(costs: PartialCosts) -> bool:
    """Return whether no choice is below the best that is known; never where none is."""
    size = max(abs(costs.best), abs(costs.bound))
    return math.isfinite(costs.best) and costs.best - costs.bound <= EQUAL * size


def _floor(problem: Layers, formulation: Formulation) -> float:
    """Return what any pair costs at least; raise an error where that is not known."""
    if formulation.kind is not FormulationKind.EXACT:
        raise ProblemError(f"{formulation.name}: the lazy search proves; give an exact formulation")
    if problem.budgets:
        raise ProblemError("the lazy search takes no budgets; leave them out, or solve all pairs")
    floor = floor_of(problem.criterion)
    if floor is None:
        raise ProblemError(
            f"criterion {problem.criterion.name}: nothing is known of a pair before all are "
            "solved; rank given the choice before, take sums of responses, or state the least cost"
        )
    return floor


class _Pairs:
    """A search on its way: the costs that are known."""

    def __init__(self, problem: Layers, aim: Aim, floor: float) -> None:
        self._problem, self._schedule, self._aim = problem, problem.schedule, aim
        self._each = isinstance(problem.criterion, WeightedSum | WorstRatio)  # pair by pair
        sizes = [len(move.candidates) for move in self._schedule.moves]
        rows = [self._free(k, sizes) for k in range(len(sizes))]
        try:
            first = search_windows(problem)
        except SolverError:  # move by move it is a dead end; other choices may lead on
            first = WindowSearch(alone_steps(problem), (), ())
        self._alone = first.alone
        self.models = sum(part.evaluation.models for part in first.explored)
        for k, before in enumerate(first.choice[:-1], start=1):
            row = self._allowed(k, before, aim.costs(first.shared[k]).single[0])
            rows[k].setdefault(before, row)
        self.costs = PartialCosts(aim.costs(self._alone).single, tuple(rows), floor, aim)

    def _free(self, move: int, sizes: Sequence[int]) -> dict[int, Floats]:
        """Return the rows of a move that shares no step with the one before: nothing."""
        if not move or (move - 1, move) in self._schedule.steps_of:
            return {}
        return {before: np.zeros(sizes[move]) for before in range(sizes[move - 1])}

    def look_until_proven(self, watch: Watch) -> None:
        """Look at more and more pairs until none could be better, or time is over."""
        watch.tell(self.costs.best, self.costs.bound)
        for count in itertools.count():
            if _proven(self.costs) or watch.over:
                return
            most = math.ceil(FIRST * MORE**count)
            ends = self._aim is Aim.PEAK and count >= BROAD
            asked = self._where_it_ends(AT_END * most) if ends else self._everywhere(most)
            if not asked:
                return
            self._look(asked, watch)
            watch.tell(self.costs.best, self.costs.bound)

    def _everywhere(self, most: int) -> list[tuple[int, int]]:
        """Return the rows of every move that promise most."""
        out = []
        for k in range(1, len(self._schedule.moves)):
            promise = self.costs.promise(k)
            order = np.lexsort((self.costs.reached[k - 1], promise))[:most]
            out += [(k, int(i)) for i in order if promise[i] < self.costs.best]
        return out

    def _where_it_ends(self, most: int) -> list[tuple[int, int]]:
        """Return rows of the candidates that known pairs lead to below the best, the last first.

        If all such rows are known, no choice has a lower peak than the best.
        """
        out: list[tuple[int, int]] = []
        for k in range(len(self._schedule.moves) - 1, 0, -1):
            promise = self.costs.promise(k)
            below = (self.costs.arrived[k - 1] < self.costs.best) & (promise < self.costs.best)
            order = np.argsort(promise, kind="stable")
            out += [(k, int(i)) for i in order if below[i]][: most - len(out)]
        return out

    def _look(self, asked: Sequence[tuple[int, int]], watch: Watch) -> None:
        """Solve rows of pairs, and learn from those that were done before time was over."""
        wanted = [self._wanted(k, before) for k, before in asked]
        schedule = _pairs_as_moves(self._schedule, asked, wanted)
        problem = posed_anew(self._problem, schedule)
        joined = Joined([len(move.candidates) for move in schedule.moves], self.costs.join)
        left = Counter(step.moves[0] for step in schedule.steps)
        with closing(problem.evaluation.levels()) as levels:
            for steps in levels:
                for choices in steps:
                    joined.add(choices.moves, problem.step_costs(choices))
                    left[choices.moves[0]] -= 1
                    self.models += len(schedule.moves[choices.moves[0]].candidates)
                if watch.over:
                    break
        rows = [dict(row) for row in self.costs.rows]
        for n, ((k, before), some) in enumerate(zip(asked, wanted, strict=True)):
            if not left[n]:
                row = np.full(len(self._schedule.moves[k].candidates), np.nan)
                row[some] = joined.single(n)
                rows[k][before] = self._allowed(k, before, row)
        self.costs = replace(self.costs, rows=tuple(rows))

    def _allowed(self, move: int, before: int, row: Floats) -> Floats:
        """Return a row of pairs, infinite where both would be one node."""
        return np.where(_possible_after(self._schedule, move, before), row, np.inf)

    def _wanted(self, move: int, before: int) -> Ints:
        """Return the candidates of a move that are looked at after one of the move before."""
        if not self._each:  # what one costs depends on the others
            return np.arange(len(self._schedule.moves[move].candidates))
        possible = _possible_after(self._schedule, move, before)
        return np.flatnonzero(possible & self.costs.worth_a_look(move, before))

    def along(self, choice: tuple[int, ...]) -> WindowSearch:
        """Return the steps that a choice meets, as a search move by move would have."""
        nodes = self._problem.nodes(choice)
        met = tuple(shared_steps(self._problem, k, nodes) for k in range(len(choice)))
        return WindowSearch(self._alone, met, choice)
