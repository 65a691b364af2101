"""The search of Bruun et al., move by move, solving only the models that it needs.

A formulation is given the costs of all choices, so that its answer can be certified. Where a model
is expensive these costs are the price of the proof. This search asks less: every move's candidates
in the steps where it alone is open, and in the step that it shares with the move before only those
that go with the choice made there (equation 1). It chooses as a formulation does that looks at one
window after the other, and knows nothing of what it misses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from seqopt.arrays import Floats, Terse
from seqopt.errors import MemoryShortError, SolverError, TimeUpError
from seqopt.graph.layers.costs import Joined
from seqopt.graph.layers.layers import Layers, _possible_after, window
from seqopt.plan.calling.formulation import Watch
from seqopt.responses._choices import StepChoices
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

    ``problem``: its own responses are not computed. Raises `SolverError` if a move has no candidate
    left after the choices before it, while others may have led on, or if time is over before the
    last move is chosen; `MemoryShortError` if there is not the memory for what it looks at;
    `KeyboardInterrupt`, with the nodes that were chosen so far as its text.
    """
    walk = _Walk(problem)
    try:
        with closing(walk.alone.evaluation.levels(soon=True)) as levels:
            for steps in levels:
                if watch is not None and watch.over:
                    raise TimeUpError(f"{watch.seconds:.3g} s: {walk.so_far()}; give more")
                walk.look(steps)
                walk.choose(known=steps[-1].step.bricks)
        walk.choose(known=math.inf)
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(walk.so_far()) from stop
    return WindowSearch(walk.alone, tuple(walk.shared), tuple(walk.choice))


class _Walk:
    """A search on its way: what was looked at, and what is chosen."""

    def __init__(self, problem: Layers) -> None:
        self.alone, self._schedule = alone_steps(problem), problem.schedule
        whole = replace(problem.evaluation, beside=self.alone.evaluation.work)
        self._problem = replace(problem, evaluation=whole)  # of which little is asked at a time
        if self.alone.evaluation.streams:
            raise MemoryShortError(
                "the responses of steps with one open grip do not fit into the memory that may be "
                "used; take near candidates only, or raise max_memory"
            )
        self._own = Joined([len(move.candidates) for move in self._schedule.moves], np.add)
        self.shared: list[Layers] = []
        self.choice: list[int] = []

    def look(self, steps: Sequence[StepChoices]) -> None:
        """Take what steps with one open move cost."""
        for choices in steps:
            self._own.add(choices.moves, self.alone.step_costs(choices))

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
        costs = self._own.single(k) + self.shared[k].sums.single[0]
        if k:
            costs = np.where(_possible_after(self._schedule, k, self.choice[-1]), costs, np.inf)
        if not np.isfinite(costs).any():
            raise SolverError(
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
    """Return the problem of the steps that a move shares with the one before, whose node is chosen.

    ``nodes``: chosen for the moves before.
    """
    few = replace(problem.evaluation, resources=problem.evaluation.resources.alone())
    return posed_anew(replace(problem, evaluation=few), window(problem.schedule, move, nodes))


def posed_anew(problem: Layers, schedule: Schedule) -> Layers:
    """Return the problem of another schedule, everything else being the same."""
    return replace(problem, evaluation=replace(problem.evaluation, schedule=schedule))
