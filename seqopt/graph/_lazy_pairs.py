r"""The proof of an optimum from those pairs of candidates alone that lie on a best path.

A pair costs no less than some floor until it is solved: zero for sizes, one for ranks. With the
floor in its place every choice looks as cheap as it is, or cheaper, so that the least of this
graph is a lower bound,

.. math::

   \min_o \; \sum_k c_k(o_k) + \underline{d}_k(o_{k-1}, o_k) \; \le \; z^* .

The pairs of the candidates on its best path are solved, those of every move at once, and it is
sought again, until all pairs on it are known: then its cost is the bound (Dellin and Srinivasa,
2016). Of largest costs it is the path on which the fewest pairs are not known. Whoever ends before
has a bound, too, and the judge is given the graph of floors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from seqopt._interrupts import answered
from seqopt.arrays import Floats, Ints
from seqopt.errors import InfeasibleError, ProblemError, TimeUpError
from seqopt.graph._windows import alone_steps, posed_anew
from seqopt.graph.compiled import on_paths
from seqopt.graph.decision_costs import Joined
from seqopt.graph.decisions import Decisions, windows
from seqopt.graph.formulation import Formulation, FormulationKind, Watch
from seqopt.graph.graph import Graph
from seqopt.graph.instance import PEAK, SUM, Instance, _Target
from seqopt.problem.criteria import WeightedSum, WorstRatio
from seqopt.problem.problem import Aim

EQUAL = 1e-9  # of a value: two that differ by less are one, found in another order


@dataclass
class PairBounds:
    """Costs of candidates alone, and of pairs: exact where they were solved, else a lower bound.

    ``single`` (list of (C_k,) float): of candidates; infinite where not allowed; ``floor``: what a
    pair costs at least; ``aim``: whether costs add up or the largest counts; ``rows``: by move and
    candidate of the move before, what pairs cost (C_k,); NaN where they were passed over.
    """

    single: list[Floats]
    floor: float
    aim: Aim
    rows: dict[tuple[int, int], Floats] = field(default_factory=dict)

    def pairs(self, move: int, unknown: float) -> tuple[Ints, Floats]:
        """Return the solved candidates of the move before, (R,), and what pairs cost, (R, C_k)."""
        before = sorted(i for k, i in self.rows if k == move)
        none = np.zeros((0, len(self.single[move])))
        rows = np.vstack([none, *(self.rows[move, i] for i in before)])
        return np.array(before, dtype=np.int64), np.where(np.isnan(rows), unknown, rows)

    def best(self, unknown: float) -> tuple[float, tuple[int, ...]]:
        """Return the least cost, and a choice; ``unknown``: what pairs cost that are not solved."""
        return self._path(self.aim.join, self.single, [self._level(k, unknown) for k in self._ks])

    def fewest_open(self, most: float) -> tuple[int, ...]:
        """Return the choice of which no cost is above a value, and the fewest pairs are open."""
        single = [np.where(own <= most, 0.0, np.inf) for own in self.single]
        levels = []
        for before, rows, _ in (self._level(k, np.nan) for k in self._ks):
            open_ = np.where(np.isnan(rows), 1.0, np.where(rows <= most, 0.0, np.inf))
            levels.append((before, open_, 1.0 if self.floor <= most else np.inf))
        return self._path(np.add, single, levels)[1]

    @property
    def _ks(self) -> range:
        return range(1, len(self.single))

    def _level(self, move: int, unknown: float) -> tuple[Ints, Floats, float]:
        return *self.pairs(move, unknown), unknown

    def _path(
        self, join: np.ufunc, single: Sequence[Floats], levels: Sequence[tuple[Ints, Floats, float]]
    ) -> tuple[float, tuple[int, ...]]:
        """Return the least value and a choice that has it, by dynamic programming."""
        least, came = single[0], list[Ints]()
        for own, (before, rows, unknown) in zip(single[1:], levels, strict=True):
            others = least.copy()
            others[before] = np.inf
            through = join(others.min(), np.full((1, len(own)), unknown))
            every = np.vstack([join(least[before, None], rows), through])
            pick = every.argmin(axis=0)
            came.append(np.append(before, others.argmin())[pick])
            least = join(every[pick, np.arange(len(own))], own)
        choice = [int(least.argmin())]
        for back in reversed(came):
            choice.insert(0, int(back[choice[0]]))
        return float(least.min()), tuple(choice)

    def compiled(self, *, unknown: bool) -> tuple[Instance, Ints]:
        """Return the graph of solved pairs, or of all, and which nodes it has of all.

        Nodes are the start, the candidates of every move, and by move the one that leads on from
        all candidates of which no pair was solved, at the floor.
        """
        sizes = [len(own) for own in self.single]
        count, firsts = len(sizes), np.cumsum([1, *sizes])
        nodes = [first + np.arange(size) for first, size in zip(firsts, sizes, strict=False)]
        levels = np.repeat(np.arange(count + 1), [1, *sizes])
        levels = np.append(levels, np.arange(2, count + 1))
        ends = (levels == count) & (np.arange(len(levels)) < firsts[-1])
        arcs = [(np.zeros(sizes[0], dtype=np.int64), nodes[0], self.single[0])]
        for k in self._ks:
            before, rows = self.pairs(k, self.floor if unknown else np.inf)
            source, target = np.repeat(nodes[k - 1][before], sizes[k]), np.tile(nodes[k], len(rows))
            arcs.append((source, target, self.aim.join(rows, self.single[k]).ravel()))
            others, hub = np.delete(nodes[k - 1], before), firsts[-1] + k - 1
            if unknown and len(others):
                into = np.full(len(others), hub), np.full(len(others), self.floor)
                arcs += [(others, *into), (np.full(sizes[k], hub), nodes[k], self.single[k])]
        source, target, costs = (np.concatenate(each) for each in zip(*arcs, strict=True))
        able, peak = np.isfinite(costs), self.aim is Aim.PEAK
        pair = source[able].astype(np.int32), target[able].astype(np.int32)
        graph, kept = on_paths(Graph(*pair, costs[able, None], (peak,), ends))
        goal = _Target("cost", PEAK if peak else SUM, (0,))
        arrays = graph.source, graph.target, graph.ends, ("cost",), graph.amounts
        return Instance("pairs", *arrays, (goal,), states=levels[kept, None]), kept


class LazyProof(NamedTuple):
    """What pairs are known to cost, why the search ended early, and how many models were solved."""

    bounds: PairBounds
    stopped: str
    models: int


def prove_lazily(problem: Decisions, formulation: Formulation, watch: Watch) -> LazyProof:
    """Solve pairs of candidates until a best path of their lower bounds has no unsolved one.

    Raises `InfeasibleError` if no choice is allowed; `ProblemError` if the formulation is not
    exact, there are budgets, or costs have no floor; `TimeUpError` if no choice is known in time.
    """
    search = _Search(problem, formulation)
    with answered(watch.interrupt):
        search.dive(watch)
        while search.open and not watch.over:
            search.solve(search.open)
            search.settle(watch)
    if math.isinf(search.bounds.best(np.inf)[0]):
        if search.open:
            raise TimeUpError("no choice was found yet; give more")
        raise InfeasibleError("no choice is allowed; relax a limit or widen a reach")
    stopped = ("interrupt" if watch.interrupted else "time") if search.open else ""
    return LazyProof(search.bounds, stopped, search.models)


def _floor(problem: Decisions, formulation: Formulation) -> float:
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
    """A search on its way: the bounds, and pairs on their best path that are not solved."""

    def __init__(self, problem: Decisions, formulation: Formulation) -> None:
        aim, floor = formulation.aim or Aim.SUM, _floor(problem, formulation)
        self._problem, self._aim, schedule = problem, aim, problem.schedule
        self._each = isinstance(problem.criterion, WeightedSum | WorstRatio)  # pair by pair
        first = alone_steps(problem)
        work = replace(problem.evaluation, more_work=first.evaluation.work)
        self._few = replace(problem, evaluation=work)  # of which little is asked at a time
        single = list(aim.costs(first).single)
        self.models = first.evaluation.models
        for cost in problem.given_costs.tolist():
            single[0] = aim.join(single[0], cost)
        self.bounds = PairBounds(single, floor, aim)
        for k in range(1, len(single)):
            if (k - 1, k) not in schedule.steps_of:  # no step is shared: nothing to pay
                free = np.broadcast_to(0.0, len(single[k]))
                self.bounds.rows |= {(k, i): free for i in range(len(single[k - 1]))}
        self.open: list[tuple[int, int]] = []

    def dive(self, watch: Watch) -> None:
        """Solve the pairs of what costs least, move after move; a dead end leaves the rest open."""
        at = int(self.bounds.single[0].argmin())
        for k in range(1, len(self.bounds.single)):
            if (k, at) not in self.bounds.rows:
                self.solve([(k, at)])
            costs = self._aim.join(self.bounds.rows[k, at], self.bounds.single[k])
            at = int(costs.argmin())
            if np.isinf(costs[at]):
                break
        self.settle(watch)

    def settle(self, watch: Watch) -> None:
        """Find the best path of the bounds anew, and which pairs on it are not solved."""
        bounds = self.bounds
        (least, choice), met = bounds.best(bounds.floor), bounds.best(np.inf)[0]
        if self._aim is Aim.PEAK and np.isfinite(least):
            choice = bounds.fewest_open(least + EQUAL * abs(least))
        self.open = []
        proven = met - least <= EQUAL * max(abs(met), abs(least)) if np.isfinite(met) else False
        if np.isfinite(least) and not proven:
            steps = enumerate(choice[:-1], start=1)
            self.open = [(k, i) for k, i in steps if (k, i) not in bounds.rows]
        watch.tell(met, least)

    def solve(self, asked: Sequence[tuple[int, int]]) -> None:
        """Solve the pairs of some candidates, given with the move that follows on each."""
        best, problem = self.bounds.best(np.inf)[0], self._problem
        wanted = []
        for k, before in asked:
            able = np.isfinite(problem.possible_after(k, before))
            if self._each:  # what one costs does not depend on the others
                able &= self.bounds.single[k] < best
            wanted.append(np.flatnonzero(able) if self._each else np.arange(len(able)))
        posed = posed_anew(self._few, windows(problem.schedule, asked, wanted))
        joined = Joined([*map(len, wanted)], self._aim.join)
        for choices in chain.from_iterable(posed.evaluation.levels()):
            joined.add(choices.moves, posed.step_costs(choices))
            self.models += len(wanted[choices.moves[0]])
        for n, ((k, before), some) in enumerate(zip(asked, wanted, strict=True)):
            row = np.full(len(self.bounds.single[k]), np.nan)
            row[some] = joined.single(n)
            never = np.isinf(problem.possible_after(k, before))
            self.bounds.rows[k, before] = np.where(never, np.inf, row)
