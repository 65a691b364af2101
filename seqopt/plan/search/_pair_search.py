r"""The proof of an optimum from only those pairs that could lead to a better one.

A pair that was not looked at costs no less than some floor: zero for sizes, one for ranks. With the
floor in its place every choice looks as cheap as it is, or cheaper: the least of this graph is a
lower bound, and what known pairs alone lead to is an upper one,

.. math::

   \min_o \; \sum_k c_k(o_k) + \underline{d}_k(o_{k-1}, o_k) \; \le \; z^* \; \le \;
   \min_{o \, \text{known}} \; \sum_k c_k(o_k) + d_k(o_{k-1}, o_k).

While they differ, the pairs that promise most are looked at, some of every move at once (Dellin and
Srinivasa, 2016). A formulation then chooses among known pairs, and the judge is given the graph of
floors: its bound is one. Whoever ends before has a bound, too.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from seqopt._interrupts import answered
from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, TimeUpError
from seqopt.graph.formulation import Formulation, FormulationKind, Run, Watch
from seqopt.graph.instance import Instance
from seqopt.graph.layers.compiled import compile_costs
from seqopt.graph.layers.costs import Joined, LayeredCosts
from seqopt.graph.layers.layers import Layers, possible_after, windows
from seqopt.graph.solution import StatePath
from seqopt.plan._paths import find_path
from seqopt.plan.search._window_search import (
    WindowSearch,
    alone_steps,
    posed_anew,
    row_of,
    search_windows,
)
from seqopt.problem.criteria import WeightedSum, WorstRatio
from seqopt.problem.problem import Aim

FIRST = 2  # rows of every move that are asked for at first
MORE = 1.5  # by which that grows from one round to the next
BROAD = 1  # round after which a search for the least peak looks where its way ends alone
AT_END = 8  # rows there, for every one of a move
EQUAL = 1e-9  # of a value: two that differ by less are one, found in another order


@dataclass(frozen=True, eq=False, repr=False)
class KnownCosts(FrozenValue):
    """Costs of pairs of which some are known.

    ``floors``: those of all pairs, at their floor where they are not known; ``known`` (tuple of
    (C_{k-1}, C_k) bool): which pairs are; ``aim``: whether costs add up or the largest counts.
    """

    floors: LayeredCosts
    known: tuple[Bools, ...]
    aim: Aim

    @cached_property
    def met(self) -> LayeredCosts:
        """The same with no choices but those of which all pairs are known."""
        pairs = zip(self.known, self.floors.shared, strict=True)
        return replace(self.floors, shared=tuple(np.where(at, own, np.inf) for at, own in pairs))

    @cached_property
    def bound(self) -> float:
        """Lower bound of any choice."""
        return self.floors.least(self.aim)

    @cached_property
    def best(self) -> float:
        """The least that a choice costs of which all pairs are known; infinite if there is none."""
        return self.met.least(self.aim)

    @property
    def proven(self) -> bool:
        """Whether no choice is below the best that is known; never where none is."""
        size = max(abs(self.best), abs(self.bound))
        return math.isfinite(self.best) and self.best - self.bound <= EQUAL * size

    @cached_property
    def through(self) -> tuple[Floats, ...]:
        """Lower bounds of choices by every pair (C_{k-1}, C_k); infinite where it is known."""
        join, after = self.aim.join, self.floors.to_go(self.aim)
        before = (np.zeros(1), *self.floors.reached(self.aim))
        parts = zip(before[:-1], self.floors.shared, after, self.known, strict=True)
        return tuple(
            np.where(at, np.inf, join(join(a[:, None], own), b)) for a, own, b, at in parts
        )

    def learned(self, rows: Sequence[tuple[int, int, Ints, Floats]]) -> KnownCosts:
        """Return what is known with rows: a move, a candidate before, candidates, their costs."""
        shared = [own.copy() for own in self.floors.shared]
        known = [own.copy() for own in self.known]
        for move, before, some, costs in rows:
            possible = ~known[move][before, some]  # others are known to be no pairs
            shared[move][before, some[possible]] = costs[possible]
            known[move][before, some] = True
        return replace(self, floors=replace(self.floors, shared=tuple(shared)), known=tuple(known))


class PairSearch(NamedTuple):
    """What a search among pairs found.

    ``selection``: what is claimed of the best choice of which all pairs are known, a path through
    the ``instance`` with floors; ``along``: the steps that it meets, to be solved anew; ``models``:
    how many models were solved.
    """

    instance: Instance
    selection: StatePath
    along: WindowSearch
    models: int


def search_pairs(problem: Layers, formulation: Formulation, watch: Watch) -> PairSearch:
    """Solve a problem exactly, looking only at pairs that could be better than what is known.

    ``problem``: its own responses are not computed; ``formulation``: is given what is known. Raises
    `InfeasibleError` if no choice is allowed; `ProblemError` if the formulation is not exact, there
    are budgets, or costs have no floor; `TimeUpError` if it is stopped before a choice is known.
    """
    search = _Search(problem, formulation.aim or Aim.SUM, _floor(problem, formulation))
    with answered(watch.interrupt):
        search.look_until_proven(watch)
    costs = search.costs
    if math.isinf(costs.best):
        if watch.over:
            raise TimeUpError("no choice was found yet; give more")
        raise InfeasibleError("no choice is allowed; relax a limit or widen a reach")
    met, floors = (compile_costs("pairs", own, costs.aim) for own in (costs.met, costs.floors))
    found = find_path(met.instance, formulation, Run(proof=False)).selection
    choice = met.choice([node for (node,) in found.states])
    along = search.along(choice)
    value = _value(along, costs.aim, problem.given_costs)
    watch.tell(value, costs.bound)
    claimed = replace(
        found,
        states=tuple((node,) for node in floors.nodes(choice)),
        objective=(value,),
        bound=(min(value, costs.bound),),
        stopped="" if costs.proven else "interrupt" if watch.interrupted else "time",
        trace=watch.trace,
    )
    return PairSearch(floors.instance, claimed, along, search.models)


def _value(along: WindowSearch, aim: Aim, given: Floats) -> float:
    """Return what all steps cost, those that a choice meets and those that are given."""
    met = [along.costs(k, aim)[now] for k, now in enumerate(along.choice)]
    return float(aim.join.reduce([*given, *met]))


def _floor(problem: Layers, formulation: Formulation) -> float:
    """Return what any pair costs at least; raise an error where that is not known."""
    if formulation.kind is not FormulationKind.EXACT:
        raise ProblemError(f"{formulation.name}: the lazy search proves; give an exact formulation")
    if problem.budgets:
        raise ProblemError("the lazy search takes no budgets; leave them out, or solve all pairs")
    floor: float | None = getattr(problem.criterion, "least", None)
    if floor is None:
        raise ProblemError(
            f"criterion {problem.criterion.name}: nothing is known of a pair before all are "
            "solved; rank given the choice before, take sums of responses, or state the least cost"
        )
    return floor


class _Search:
    """A search on its way: the costs that are known."""

    def __init__(self, problem: Layers, aim: Aim, floor: float) -> None:
        self._problem, self._schedule, self._aim = problem, problem.schedule, aim
        self._each = isinstance(problem.criterion, WeightedSum | WorstRatio)  # pair by pair
        try:
            first = search_windows(problem)
        except NothingFoundError:  # move by move it is a dead end; other choices may lead on
            first = WindowSearch(alone_steps(problem), (), ())
        self._alone = first.alone
        self.models = sum(part.evaluation.models for part in first.explored)
        single = [*aim.costs(self._alone).single]
        for cost in problem.given_costs.tolist():
            single[0] = aim.join(single[0], cost)
        shared, known = [np.zeros((1, len(single[0])))], [np.ones((1, len(single[0])), dtype=bool)]
        for k in range(1, len(single)):
            possible, meets = (
                possible_after(self._schedule, k),
                (k - 1, k) in self._schedule.steps_of,
            )
            shared.append(np.where(possible, floor if meets else 0.0, np.inf))
            known.append(~possible if meets else np.ones(possible.shape, dtype=bool))
        costs = KnownCosts(LayeredCosts(tuple(single), tuple(shared)), tuple(known), aim)
        pairs = zip(first.choice, first.shared[1:], strict=False)
        rows = [(k, i, aim.costs(part).single[0]) for k, (i, part) in enumerate(pairs, start=1)]
        self.costs = costs.learned([(k, i, np.arange(len(own)), own) for k, i, own in rows])

    def look_until_proven(self, watch: Watch) -> None:
        """Look at more and more pairs until none could be better, or time is over."""
        watch.tell(self.costs.best, self.costs.bound)
        for count in itertools.count():
            if self.costs.proven or watch.over:
                return
            most = math.ceil(FIRST * MORE**count)
            ends = self._aim is Aim.PEAK and count >= BROAD
            asked = self._where_it_ends(AT_END * most) if ends else self._everywhere(most)
            if not asked:
                return
            self._look(asked, watch)
            watch.tell(self.costs.best, self.costs.bound)

    def _everywhere(self, most: int) -> list[tuple[int, int]]:
        """Return the rows of every move with the lowest bounds."""
        out, reached = [], self.costs.floors.reached(self._aim)
        for k in range(1, len(self._schedule.moves)):
            promise = self.costs.through[k].min(axis=1)
            order = np.lexsort((reached[k - 1], promise))[:most]
            out += [(k, int(i)) for i in order if promise[i] < self.costs.best]
        return out

    def _where_it_ends(self, most: int) -> list[tuple[int, int]]:
        """Return rows of the candidates that known pairs lead to below the best, the last first.

        If all such rows are known, no choice has a lower peak than the best.
        """
        out: list[tuple[int, int]] = []
        arrived = self.costs.met.reached(self._aim)
        for k in range(len(self._schedule.moves) - 1, 0, -1):
            promise = self.costs.through[k].min(axis=1)
            below = (arrived[k - 1] < self.costs.best) & (promise < self.costs.best)
            order = np.argsort(promise, kind="stable")
            out += [(k, int(i)) for i in order if below[i]][: most - len(out)]
        return out

    def _look(self, asked: Sequence[tuple[int, int]], watch: Watch) -> None:
        """Solve rows of pairs, and learn from those that were done before time was over."""
        wanted = [self._wanted(k, before) for k, before in asked]
        schedule = windows(self._schedule, asked, wanted)
        problem = posed_anew(self._problem, schedule)
        joined = Joined([len(move.candidates) for move in schedule.moves], self._aim.join)
        left = Counter(step.moves[0] for step in schedule.steps)
        with closing(problem.evaluation.levels()) as levels:
            for steps in levels:
                for choices in steps:
                    joined.add(choices.moves, problem.step_costs(choices))
                    left[choices.moves[0]] -= 1
                    self.models += len(schedule.moves[choices.moves[0]].candidates)
                if watch.over:
                    break
        rows = enumerate(zip(asked, wanted, strict=True))
        done = [(*row, some, joined.single(n)) for n, (row, some) in rows if not left[n]]
        self.costs = self.costs.learned(done)

    def _wanted(self, move: int, before: int) -> Ints:
        """Return the candidates of a move that are looked at after one of the move before."""
        if not self._each:  # what one costs depends on the others
            return np.arange(len(self._schedule.moves[move].candidates))
        return np.flatnonzero(self.costs.through[move][before] < self.costs.best)

    def along(self, choice: tuple[int, ...]) -> WindowSearch:
        """Return the steps that a choice meets, as a search move by move would have."""
        rows = enumerate(zip((0, *choice), choice, strict=False))
        met = tuple(row_of(self._problem, k, before) for k, (before, _) in rows)
        return WindowSearch(self._alone, met, choice)
