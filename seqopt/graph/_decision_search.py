r"""Searches that solve a decision at a time: move by move, and the proof from few pairs.

Move by move, what costs least after the choice before it is chosen (equation 1 of Bruun et al.).
An optimum is proven from those pairs of candidates alone that lie on a best path.

A pair that is not solved has a lower bound: zero for sizes, one for ranks. With the
bound in its place every choice looks as cheap as it is, or cheaper, so that the least of this
graph is a lower bound,

.. math::

   \min_o \; \sum_k c_k(o_k) + \underline{d}_k(o_{k-1}, o_k) \; \le \; z^* .

The pairs of the candidates on its best path are solved, those of every move at once, and it is
sought again, until all pairs on it are known: then its cost is the bound (Dellin and Srinivasa,
2016). Of largest costs it is the path on which the fewest pairs are not known. A search that ends
before has a bound, too, and the judge is given the graph of lower bounds.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from seqopt._interrupts import answered
from seqopt.arrays import Floats, Ints, Terse
from seqopt.engines.interface import Fields, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import (
    InfeasibleError,
    MemoryShortError,
    NothingFoundError,
    ProblemError,
    TimeUpError,
)
from seqopt.graph.decision_costs import Joined, on_paths
from seqopt.graph.decisions import Decisions, windows
from seqopt.graph.formulation import Formulation, FormulationKind, Watch
from seqopt.graph.graph import Graph
from seqopt.graph.instance import PEAK, SUM, Instance, _Target
from seqopt.problem.criteria import WeightedSum, WorstRatio
from seqopt.problem.problem import Aim
from seqopt.responses._choices import StepChoices
from seqopt.responses.table import step_fields
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import Step


@dataclass(frozen=True, repr=False)
class Windows(Terse):
    """The steps that every move decides, after the choice before it; solved when first asked for.

    ``choice``: the chosen candidate of every move so far; ``fields``: by number, of steps that an
    engine had at hand on the way; ``rows``: by move, the steps that are solved.
    """

    problem: Decisions
    choice: list[int] = field(default_factory=list)
    fields: dict[int, Fields] = field(default_factory=dict, compare=False)
    rows: dict[int, tuple[StepChoices, ...]] = field(default_factory=dict, compare=False)

    def row(self, move: int) -> tuple[StepChoices, ...]:
        """Return the steps that a move decides, with responses of its candidates, (C_k,)."""
        if move not in self.rows:
            before = self.choice[move - 1] if move else 0
            self.rows[move] = self.problem.window_choices(move, before)
        return self.rows[move]

    def costs(self, move: int, aim: Aim = Aim.SUM) -> Floats:
        """Return costs (C_k,) of the candidates of a move after the choices before it."""
        costs = self.problem.possible_after(move, self.choice[move - 1] if move else 0)
        for choices in self.row(move):
            costs = aim.join(costs, self.problem.step_costs(choices))
        return costs

    def so_far(self) -> str:
        """Return the kind of choice, in a few words."""
        if not self.choice:
            return "no move was chosen yet"
        moves = self.problem.schedule.moves
        nodes = (str(moves[k].candidates[i]) for k, i in enumerate(self.choice))
        return f"{len(self.choice)} of {len(moves)} moves were chosen, at nodes {' '.join(nodes)}"


def walk_windows(problem: Decisions, watch: Watch) -> Windows:
    """Choose the candidate of least cost, one move after the other (equation 1 of Bruun et al.).

    Raises `NothingFoundError` if a move has no candidate left after the choices before it, while
    others may have led on; `TimeUpError` if time is over before the last move is chosen;
    `MemoryShortError`, `WorkerError` as `Evaluation.levels`; `KeyboardInterrupt`, with the nodes
    that were chosen so far as its text.
    """
    alone = alone_steps(problem)
    few = replace(problem.evaluation, more_work=alone.evaluation.work)
    found, noted = Windows(replace(problem, evaluation=few)), 0
    try:
        with closing(_decided(found.problem, alone, found.choice)) as rows:
            for k, row in enumerate(rows):
                if watch.over:
                    raise TimeUpError(f"{watch.seconds:.3g} s: {found.so_far()}; give more")
                found.rows[k] = row
                move, costs = problem.schedule.moves[k], found.costs(k)
                if not np.isfinite(costs).any():
                    raise NothingFoundError(
                        f"move {k + 1}, step {move.step}: {move.robot} has no allowed grip after "
                        "the choices before it; relax a limit, or let a formulation look at all "
                        "choices"
                    )
                found.choice.append(int(np.argmin(costs)))
                noted = _note_fields(found, noted)
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(found.so_far()) from stop
    return found


def _decided(
    problem: Decisions, alone: Decisions, choice: Sequence[int]
) -> Generator[tuple[StepChoices, ...], None, None]:
    """Yield the steps that moves decide, one move after the other, by ascending brick counts.

    ``choice``: grows between two moves. Sets that several moves meet are solved once.
    """
    if alone.evaluation.streams:
        raise MemoryShortError(
            "the responses of steps with one open grip do not fit into the memory that may be "
            "used; take near candidates only, or raise max_memory"
        )
    steps_of, own = problem.schedule.steps_of, defaultdict[int, list[StepChoices]](list)
    known, last = 0, problem.schedule.steps[-1].bricks
    with closing(alone.evaluation.levels()) as levels:
        for k in range(len(problem.schedule.moves)):
            shared = tuple[StepChoices, ...]()
            for moves in ((k - 1, k), (k,)):
                most = max((step.bricks for step in steps_of.get(moves, ())), default=0)
                while known < most:
                    found = next(levels, ())
                    known = found[-1].step.bricks if found else last + 1
                    for each in found:
                        own[each.moves[0]].append(each)
                if moves[0] < k and k:
                    shared = problem.window_choices(k, choice[-1], alone=False)
            yield tuple(sorted((*shared, *own.pop(k, ())), key=lambda each: each.step.number))


def alone_steps(problem: Decisions) -> Decisions:
    """Return the problem of the steps in which one move is open."""
    steps = tuple(step for step in problem.schedule.steps if len(step.moves) == 1)
    return posed_anew(problem, replace(problem.schedule, steps=steps))


def posed_anew(problem: Decisions, schedule: Schedule) -> Decisions:
    """Return the problem of another schedule, everything else being the same."""
    return replace(problem, evaluation=replace(problem.evaluation, schedule=schedule))


def _note_fields(found: Windows, noted: int) -> int:
    """Keep all fields of steps that are chosen, where an engine has them at hand; count these."""
    problem, choice = found.problem, found.choice
    engine, moves = problem.engine, problem.schedule.moves
    for step in problem.schedule.steps[noted:]:
        if any(move >= len(choice) for move in step.moves):
            break
        noted += 1
        if isinstance(engine, ComplianceEngine) and engine._recalls(step.bricks):
            nodes = (
                moves[g.move].candidates[choice[g.move]] if isinstance(g, OpenGrip) else g
                for g in step.grips
            )
            known = Step(step.number, step.kind, step.bricks, tuple(nodes))
            found.fields[step.number] = step_fields(engine, known, Want.ALL)
    return noted


EQUAL = 1e-9  # of a value: two that differ by less are one, found in another order


@dataclass
class PairBounds:
    """Costs of candidates alone, and of pairs: exact where they were solved, else a lower bound.

    ``single`` (list of (C_k,) float): of candidates; infinite where infeasible; ``floor``: lower
    bound of what a pair costs at least; ``aim``: whether costs add up or the largest counts;
    ``rows``: by move and candidate of the move before, what pairs cost (C_k,); NaN where they were
    passed over.
    """

    single: list[Floats]
    floor: float
    aim: Aim
    rows: dict[tuple[int, int], Floats] = field(default_factory=dict)

    def pairs(self, move: int, unknown: float) -> tuple[Ints, Floats]:
        """Return the solved candidates of the move before, (R,), and costs of pairs, (R, C_k)."""
        before = sorted(i for k, i in self.rows if k == move)
        none = np.zeros((0, len(self.single[move])))
        rows = np.vstack([none, *(self.rows[move, i] for i in before)])
        return np.array(before, dtype=np.int64), np.where(np.isnan(rows), unknown, rows)

    def best(self, unknown: float) -> tuple[float, tuple[int, ...]]:
        """Return the least cost, and a choice; ``unknown``: cost of pairs that are not solved."""
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
        all candidates of which no pair was solved, at the lower bound.
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
    exact, there are budgets, or costs have no lower bound; `TimeUpError` if no choice is known in
    time.
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


def _lower_bound(problem: Decisions, formulation: Formulation) -> float:
    """Return a lower bound of any pair's cost; raise an error where none is known."""
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
        aim, floor = formulation.aim or Aim.SUM, _lower_bound(problem, formulation)
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
        """Solve the pairs of least cost, move after move; a dead end leaves the rest open."""
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
