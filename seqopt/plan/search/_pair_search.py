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
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from seqopt._interrupts import answered
from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, TimeUpError
from seqopt.graph.formulation import Formulation, FormulationKind, Run, Solution, Watch
from seqopt.graph.graph import Graph
from seqopt.graph.instance import PEAK, SUM, Instance, _Target
from seqopt.graph.layers.compiled import on_paths
from seqopt.graph.layers.costs import Joined
from seqopt.graph.layers.layers import Layers, possible_after, windows
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
    """Costs of single choices, and of those pairs that were looked at.

    ``single`` (tuple of (C_k,) float): of candidates alone; infinite where not allowed; ``before``
    (tuple of (R_k,) int): the candidates of the move before whose pairs were looked at, ``rows``
    (tuple of (R_k, C_k) float): what these cost; infinite where not allowed, NaN where they were
    passed over; ``floor``: what any other pair costs at least; ``aim``: whether costs add up or the
    largest counts.
    """

    single: tuple[Floats, ...]
    before: tuple[Ints, ...]
    rows: tuple[Floats, ...]
    floor: float
    aim: Aim

    @cached_property
    def reached(self) -> tuple[Floats, ...]:
        """Lower bounds of the build up to every candidate, (C_k,) each."""
        return self._forward(self.floor)

    @cached_property
    def arrived(self) -> tuple[Floats, ...]:
        """The least cost up to every candidate by pairs that are known, (C_k,) each."""
        return self._forward(np.inf)

    def _forward(self, unknown: float) -> tuple[Floats, ...]:
        out, join = [self.single[0]], self.aim.join
        for own, before, rows in zip(self.single[1:], self.before, self.rows, strict=True):
            known = join(out[-1][before, None], np.where(np.isnan(rows), unknown, rows))
            other = join(np.delete(out[-1], before).min(initial=np.inf), unknown)
            out.append(join(own, np.minimum(known.min(axis=0, initial=np.inf), other)))
        return tuple(out)

    @cached_property
    def to_go(self) -> tuple[Floats, ...]:
        """Lower bounds from every candidate to the end, its own cost included, (C_k,) each."""
        out, join = [self.single[-1]], self.aim.join
        for own, before, rows in zip(
            self.single[-2::-1], self.before[::-1], self.rows[::-1], strict=True
        ):
            ahead = np.full(len(own), join(self.floor, out[0].min()))
            ahead[before] = join(np.where(np.isnan(rows), self.floor, rows), out[0]).min(axis=1)
            out.insert(0, join(own, ahead))
        return tuple(out)

    @property
    def bound(self) -> float:
        """Lower bound of any choice."""
        return float(self.to_go[0].min())

    @property
    def best(self) -> float:
        """The least that a choice costs of which all pairs are known; infinite if there is none."""
        return float(self.arrived[-1].min())

    @property
    def proven(self) -> bool:
        """Whether no choice is below the best that is known; never where none is."""
        size = max(abs(self.best), abs(self.bound))
        return math.isfinite(self.best) and self.best - self.bound <= EQUAL * size

    def promise(self, move: int) -> Floats:
        """Return lower bounds of choices by candidates of the move before, (C_{k-1},).

        Infinite where their pairs were looked at.
        """
        after = self.aim.join(self.floor, self.to_go[move].min())
        out = np.asarray(self.aim.join(self.reached[move - 1], after))
        out[self.before[move - 1]] = np.inf
        return out

    def worth_a_look(self, move: int, before: int) -> Bools:
        """Return which candidates (C_k,), after one of the move before, could still be better."""
        least = self.aim.join(self.floor, self.to_go[move])
        return np.asarray(self.aim.join(self.reached[move - 1][before], least) < self.best)

    def learned(self, found: Sequence[tuple[int, int, Floats]]) -> KnownCosts:
        """Return what is known with rows (C_k,) of a move and a candidate of the one before."""
        before, rows = [*self.before], [*self.rows]
        for move in {move for move, *_ in found}:
            own = [(at, row) for k, at, row in found if k == move]
            before[move - 1] = np.append(before[move - 1], [at for at, _ in own])
            rows[move - 1] = np.vstack([rows[move - 1], *(row for _, row in own)])
        return replace(self, before=tuple(before), rows=tuple(rows))

    def compiled(self, *, unknown: bool) -> tuple[Instance, Ints]:
        """Return the graph of pairs that are known, or of all, and which nodes it has of all.

        Nodes are the start, the candidates of every move, and by move the one that leads on from
        all candidates of which no pair was looked at, at the floor.
        """
        sizes = [len(own) for own in self.single]
        levels = np.repeat(np.arange(len(sizes) + 1), [1, *sizes])
        ends = np.append(levels == len(sizes), np.zeros(len(sizes) - 1, dtype=bool))
        levels = np.append(levels, np.arange(2, len(sizes) + 1))
        source, target, costs = self._arcs(unknown=unknown)
        able, peak = np.isfinite(costs), self.aim is Aim.PEAK
        ends_of = source[able].astype(np.int32), target[able].astype(np.int32)
        graph, kept = on_paths(Graph(*ends_of, costs[able, None], (peak,), ends))
        arrays = graph.source, graph.target, graph.ends, ("cost",), graph.amounts
        goal = _Target("cost", PEAK if peak else SUM, (0,))
        return Instance("pairs", *arrays, (goal,), states=levels[kept, None]), kept

    def _arcs(self, *, unknown: bool) -> tuple[Ints, Ints, Floats]:
        sizes = [len(own) for own in self.single]
        firsts = np.cumsum([1, *sizes])
        every = [first + np.arange(size) for first, size in zip(firsts, sizes, strict=False)]
        arcs = [(np.zeros(sizes[0], dtype=np.int64), every[0], self.single[0])]
        for k, (before, rows) in enumerate(zip(self.before, self.rows, strict=True), start=1):
            found = np.where(np.isnan(rows), self.floor if unknown else np.inf, rows)
            arcs.append(
                (
                    np.repeat(every[k - 1][before], sizes[k]),
                    np.tile(every[k], len(before)),
                    self.aim.join(found, self.single[k]).ravel(),
                )
            )
            others, through = np.delete(every[k - 1], before), firsts[-1] + k - 1
            if unknown and len(others):
                arcs.append(
                    (others, np.full(len(others), through), np.full(len(others), self.floor))
                )
                arcs.append((np.full(sizes[k], through), every[k], self.single[k]))
        source, target, costs = (np.concatenate(each) for each in zip(*arcs, strict=True))
        return source, target, costs


class PairSearch(NamedTuple):
    """What a search among pairs found.

    ``selection``: what is claimed of the best choice of which all pairs are known, a path through
    the ``instance`` with floors; ``along``: the steps that it meets, to be solved anew; ``models``:
    how many models were solved.
    """

    instance: Instance
    selection: Solution
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
    met, nodes = costs.compiled(unknown=False)
    found = find_path(met, formulation, Run(proof=False)).selection
    passed = nodes[[node for (node,) in found.states]]
    firsts = np.cumsum([1, *map(len, costs.single[:-1])])
    choice = tuple((passed - firsts).tolist())
    floors, nodes = costs.compiled(unknown=True)
    along = search.along(choice)
    value = _value(along, costs.aim, problem.given_costs)
    watch.tell(value, costs.bound)
    claimed = replace(
        found,
        states=tuple((node,) for node in np.searchsorted(nodes, passed).tolist()),
        objective=(value,),
        bound=(min(value, costs.bound),),
        stopped="" if costs.proven else "interrupt" if watch.interrupted else "time",
        trace=watch.trace,
    )
    return PairSearch(floors, claimed, along, search.models)


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
        before, rows = list[Ints](), list[Floats]()
        for k, (last, own) in enumerate(pairwise(single), start=1):
            free = (k - 1, k) not in self._schedule.steps_of  # no step is shared: nothing to pay
            before.append(np.arange(len(last) * free))
            rows.append(np.broadcast_to(0.0, (len(last) * free, len(own))))
        costs = KnownCosts(tuple(single), tuple(before), tuple(rows), floor, aim)
        pairs = enumerate(zip(first.choice, first.shared[1:], strict=False), start=1)
        met = [(k, at, aim.costs(part).single[0]) for k, (at, part) in pairs]
        shared = [row for row in met if (row[0] - 1, row[0]) in self._schedule.steps_of]
        self.costs = costs.learned([self._allowed(*row) for row in shared])

    def look_until_proven(self, watch: Watch) -> None:
        """Look at more and more pairs until none could be better, or time is over."""
        watch.tell(self.costs.best, self.costs.bound)
        for count in itertools.count():
            if self.costs.proven or watch.over:
                return
            asked = self._promising(count)
            if not asked:
                return
            self._look(asked, watch)
            watch.tell(self.costs.best, self.costs.bound)

    def _promising(self, count: int) -> list[tuple[int, int]]:
        """Return the rows of every move with the lowest bounds, more in every round.

        Of the least peak later only those that known pairs lead to below the best, the last first:
        if all such rows are known, no choice has a lower peak.
        """
        costs, most = self.costs, math.ceil(FIRST * MORE**count)
        ends, out = self._aim is Aim.PEAK and count >= BROAD, list[tuple[int, int]]()
        for k in range(len(self._schedule.moves) - 1, 0, -1):
            promise = costs.promise(k)
            able = promise < costs.best
            if ends:
                able &= costs.arrived[k - 1] < costs.best
            order = np.lexsort((costs.reached[k - 1] * (not ends), promise))
            rows = [(k, int(i)) for i in order if able[i]]
            out += rows[: AT_END * most - len(out) if ends else most]
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
        done = []
        for n, ((k, before), some) in enumerate(zip(asked, wanted, strict=True)):
            row = np.full(len(self._schedule.moves[k].candidates), np.nan)
            row[some] = joined.single(n)
            done += [self._allowed(k, before, row)] if not left[n] else []
        self.costs = self.costs.learned(done)

    def _allowed(self, move: int, before: int, row: Floats) -> tuple[int, int, Floats]:
        """Return a row of pairs, infinite where both would be one node, and where it belongs."""
        possible = possible_after(self._schedule, move, before)
        return move, before, np.where(possible, row, np.inf)

    def _wanted(self, move: int, before: int) -> Ints:
        """Return the candidates of a move that are looked at after one of the move before."""
        if not self._each:  # what one costs depends on the others
            return np.arange(len(self._schedule.moves[move].candidates))
        possible = possible_after(self._schedule, move, before)
        return np.flatnonzero(possible & self.costs.worth_a_look(move, before))

    def along(self, choice: tuple[int, ...]) -> WindowSearch:
        """Return the steps that a choice meets, as a search move by move would have."""
        rows = enumerate(zip((0, *choice), choice, strict=False))
        met = tuple(row_of(self._problem, k, before) for k, (before, _) in rows)
        return WindowSearch(self._alone, met, choice)
