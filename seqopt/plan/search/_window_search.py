"""The search of Bruun et al., move by move, solving only the models that it needs.

A formulation is given the costs of all choices, so that its answer can be certified. Where a model
is expensive these costs are the price of the proof. This search asks less: every move's candidates
in the steps where it alone is open, and in the step that it shares with the move before only those
that go with the choice made there (equation 1). It chooses as a formulation does that looks at one
window after the other, and knows nothing of what it misses.

Its choices begin the proof of an optimum from only those pairs that could lead to a better one. A
pair that was not looked at counts as if it cost next to nothing; while that makes a choice look
better than the best one known, the pairs that promise most are looked at, some of every move at
once. When none is left, the best choice known is proven; whoever ends before has a bound.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from seqopt._interrupts import answered
from seqopt.arrays import Floats, Ints, Terse
from seqopt.errors import (
    InfeasibleError,
    MemoryShortError,
    NothingFoundError,
    ProblemError,
    TimeUpError,
)
from seqopt.graph.formulation import Formulation, FormulationKind, Run, Watch
from seqopt.graph.layers._partial_costs import PartialCosts, floor_of
from seqopt.graph.layers.compiled import compile_costs
from seqopt.graph.layers.costs import Joined
from seqopt.graph.layers.layers import Layers, _pairs_as_moves, _possible_after, window
from seqopt.graph.solution import StatePath
from seqopt.plan._paths import find_path
from seqopt.problem.criteria import WeightedSum, WorstRatio
from seqopt.problem.problem import Aim
from seqopt.sequence.schedule import Schedule


@dataclass(frozen=True, repr=False)
class WindowSearch(Terse):
    """What a search move by move looked at, and what it chose.

    ``alone``: the steps in which one move is open; ``shared``: of every move, the steps shared with
    the move before, whose choice is made; it may be empty; ``choice``: the chosen candidate of
    every move.
    """

    alone: Layers
    shared: tuple[Layers, ...]
    choice: tuple[int, ...]

    @property
    def explored(self) -> tuple[Layers, ...]:
        """The problems of which responses were computed."""
        return (self.alone, *(problem for problem in self.shared if problem.evaluation.steps))

    @property
    def met(self) -> list[tuple[Layers, tuple[int, ...]]]:
        """The problems with all steps of the build, and what is chosen in each."""
        each = zip(self.shared, self.choice, strict=True)
        return [(self.alone, self.choice), *((problem, (now,)) for problem, now in each)]

    def costs(self, move: int) -> Floats:
        """Return what the candidates of a move cost after the choices before it, (C_k,)."""
        return np.asarray(self.alone.sums.single[move] + self.shared[move].sums.single[0])


def search_windows(problem: Layers, watch: Watch | None = None) -> WindowSearch:
    """Choose every open grip of a build, one move after the other, by ascending brick counts.

    ``problem``: its own responses are not computed. Raises `NothingFoundError` if a move has no
    candidate left after the choices before it, while others may have led on; `TimeUpError` if time
    is over before the last move is chosen;
    `MemoryShortError` if there is not the memory for what it looks at; `KeyboardInterrupt`, with
    the nodes that were chosen so far as its text.
    """
    walk = _Walk(problem)
    try:
        with closing(walk.alone.evaluation.levels()) as levels:
            for steps in levels:
                if watch is not None and watch.over:
                    raise TimeUpError(f"{watch.seconds:.3g} s: {walk.so_far()}; give more")
                for choices in steps:  # with one open move
                    walk.own.add(choices.moves, walk.alone.step_costs(choices))
                walk.choose(known=steps[-1].step.bricks)
        walk.choose(known=math.inf)
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(walk.so_far()) from stop
    return WindowSearch(walk.alone, tuple(walk.shared), tuple(walk.choice))


class _Walk:
    """A search on its way: what was looked at, and what is chosen."""

    def __init__(self, problem: Layers) -> None:
        self.alone, self._schedule = alone_steps(problem), problem.schedule
        whole = replace(problem.evaluation, more_work=self.alone.evaluation.work)
        self._problem = replace(problem, evaluation=whole)  # of which little is asked at a time
        if self.alone.evaluation.streams:
            raise MemoryShortError(
                "the responses of steps with one open grip do not fit into the memory that may be "
                "used; take near candidates only, or raise max_memory"
            )
        self.own = Joined([len(move.candidates) for move in self._schedule.moves], np.add)
        self.shared: list[Layers] = []
        self.choice: list[int] = []

    def choose(self, known: float) -> None:
        """Choose the moves whose steps have at most so many bricks."""
        while len(self.choice) < len(self._schedule.moves):
            k = len(self.choice)
            if len(self.shared) == k and self._last((k - 1, k)) <= known:
                nodes = {k - 1: self._node(k - 1)} if k else {}
                self.shared.append(shared_steps(self._problem, k, nodes))
                _ = self.shared[-1].sums  # looked at now
            if len(self.shared) == k or self._last((k,)) > known:
                return
            self._choose(k)

    def _last(self, moves: tuple[int, ...]) -> int:
        """Return the largest brick count of steps in which given moves are open."""
        return max((step.bricks for step in self._schedule.steps_of.get(moves, ())), default=0)

    def _node(self, k: int) -> int:
        return self._schedule.moves[k].candidates[self.choice[k]]

    def _choose(self, k: int) -> None:
        move = self._schedule.moves[k]
        costs = self.own.single(k) + self.shared[k].sums.single[0]
        if k:
            costs = np.where(_possible_after(self._schedule, k, self.choice[-1]), costs, np.inf)
        if not np.isfinite(costs).any():
            raise NothingFoundError(
                f"move {k + 1}, step {move.step}: {move.robot} has no allowed grip after the "
                "choices before it; relax a limit, or let a formulation look at all choices"
            )
        self.choice.append(int(np.argmin(costs)))

    def so_far(self) -> str:
        """Return what is chosen, in a few words."""
        if not self.choice:
            return "no move was chosen yet"
        chosen = " ".join(str(self._node(k)) for k in range(len(self.choice)))
        moves = f"{len(self.choice)} of {len(self._schedule.moves)} moves"
        return f"{moves} were chosen, at nodes {chosen}"


def alone_steps(problem: Layers) -> Layers:
    """Return the problem of the steps in which one move is open."""
    steps = tuple(step for step in problem.schedule.steps if len(step.moves) == 1)
    return posed_anew(problem, replace(problem.schedule, steps=steps))


def shared_steps(problem: Layers, move: int, nodes: Sequence[int] | Mapping[int, int]) -> Layers:
    """Return the problem of the steps shared with the move before, after the ``nodes`` chosen."""
    few = replace(problem.evaluation, resources=problem.evaluation.resources.alone())
    return posed_anew(replace(problem, evaluation=few), window(problem.schedule, move, nodes))


def posed_anew(problem: Layers, schedule: Schedule) -> Layers:
    """Return the problem of another schedule, everything else being the same."""
    return replace(problem, evaluation=replace(problem.evaluation, schedule=schedule))


FIRST = 2  # rows of every move that are asked for at first
MORE = 1.5  # by which that grows from one round to the next
BROAD = 1  # round after which a search for the least peak looks where its way ends alone
AT_END = 8  # rows there, for every one of a move
EQUAL = 1e-9  # of a value: two that differ by less are one, found in another order


@dataclass(frozen=True)
class PairSearch:
    """What a search among pairs found.

    ``costs``: all that it looked at; ``choice``: the best one of which all pairs are known;
    ``selection``: what is claimed of it; its trace tells how choice and bound met; ``along``: the
    steps that the choice meets, move by move, to be solved anew; ``models``: how many models were
    solved; ``given`` (n,): what steps without an open grip cost.
    """

    costs: PartialCosts
    choice: tuple[int, ...]
    selection: StatePath
    along: WindowSearch
    models: int
    given: Floats

    @property
    def objective(self) -> float:
        """What all steps cost, those that the choice meets and those that are given."""
        aim = self.costs.aim
        parts = [zip(aim.costs(part).single, some, strict=True) for part, some in self.along.met]
        met = [*self.given, *(own[now] for part in parts for own, now in part)]
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
    choice, selection = _best_known(costs, formulation, watch)
    along = walk.along(choice)
    return PairSearch(costs, choice, selection, along, walk.models, problem.given_costs)


def _best_known(
    costs: PartialCosts, formulation: Formulation, watch: Watch
) -> tuple[tuple[int, ...], StatePath]:
    """Return the choice that the formulation makes of the pairs that are known."""
    known, candidates = costs.known()
    compiled = compile_costs("what is known", known, costs.aim)
    found = find_path(compiled.instance, formulation, Run(proof=False), compiled.offset).selection
    met = compiled.choice([node for (node,) in found.states])
    choice = tuple(left[index] for left, index in zip(candidates, met, strict=True))
    early = "" if _proven(costs) else "interrupt" if watch.interrupted else "time"
    (value,) = found.objective
    watch.tell(value, costs.bound)
    bound = (min(value, costs.bound),)
    return choice, replace(found, bound=bound, stopped=early, trace=watch.trace)


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
        rows = [dict[int, Floats]() for _ in sizes]
        for k in range(1, len(sizes)):
            if (k - 1, k) not in self._schedule.steps_of:  # no step is shared: nothing to pay
                rows[k] = {before: np.zeros(sizes[k]) for before in range(sizes[k - 1])}
        try:
            first = search_windows(problem)
        except NothingFoundError:  # move by move it is a dead end; other choices may lead on
            first = WindowSearch(alone_steps(problem), (), ())
        self._alone = first.alone
        self.models = sum(part.evaluation.models for part in first.explored)
        for k, before in enumerate(first.choice[:-1], start=1):
            row = self._allowed(k, before, aim.costs(first.shared[k]).single[0])
            rows[k].setdefault(before, row)
        single = [*aim.costs(self._alone).single]
        for cost in problem.given_costs.tolist():
            single[0] = (np.add if aim is Aim.SUM else np.maximum)(single[0], cost)
        self.costs = PartialCosts(tuple(single), tuple(rows), floor, aim)

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
        """Return the rows of every move with the lowest bounds."""
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
