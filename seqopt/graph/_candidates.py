"""Costs of states among the candidates of the grips that are open in their step.

Ranks of responses are those among all candidates, whether or not a build reaches them: what is
undefined, as of one node for two robots, drops out before; limits and filters are asked later.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import NothingFoundError, TimeUpError
from seqopt.graph.formulation import Solution, Watch
from seqopt.problem.criteria import Criterion, Ranked, RankSum, state_costs
from seqopt.work import _keep

if TYPE_CHECKING:
    from seqopt.sequence._space import Candidates


class CandidateCosts:
    """Costs of the candidates of every level, computed when first needed.

    ``problem``: `States` in one scene, whose criterion has costs only where a grip is open, or in
    all steps.
    """

    def __init__(self, problem: Any) -> None:
        self._problem = problem
        self._candidates: dict[int, Candidates] = {}
        self._costs: dict[tuple[int, bool], Floats] = {}

    def among(self, level: int, states: Ints, *, alone: bool = False) -> Floats:
        """Return costs of states (n,) among all candidates of their level; zero if none is open.

        ``alone``: of a step that two moves share, among the candidates of the later one.
        """
        problem = self._problem
        if not problem.space.open_columns(level):
            return np.zeros(len(states))
        candidates, criterion = self._of(level), problem.criterion
        if (level, alone) not in self._costs:
            if alone and isinstance(criterion, RankSum):
                criterion = replace(criterion, ranked=Ranked.CONDITIONAL)
            found = problem.seen(level, candidates.states, rough=True).responses
            shaped = {name: candidates.spread(values) for name, values in found.items()}
            self._costs[level, alone] = self._relative(level, criterion, shaped)
        return np.asarray(self._costs[level, alone][candidates.rows(states)])

    def _of(self, level: int) -> Candidates:
        if level not in self._candidates:
            self._candidates[level] = self._problem.space.candidates(level)
        return self._candidates[level]

    def _relative(self, level: int, criterion: Criterion, found: Mapping[str, Floats]) -> Floats:
        """Return costs of choices by their responses; infinite where one is impossible."""
        move = self._problem.space.decided_by(level)
        known = {name: np.where(np.isfinite(v), v, np.nan) for name, v in found.items()}
        costs = criterion.costs(known, move.bricks, len(move.candidates))
        return np.where(np.isfinite(costs), costs, np.inf)

    def of_branches(self, level: int, states: Ints) -> Floats:
        """Return costs of states (n,) that follow from one by the candidates of its next move.

        Ranks are those among all candidates of the move, also those that steps before turn down;
        infinite is what is not within limits.
        """
        problem = self._problem
        if not (len(states) and problem.space.open_columns(level)):
            return np.zeros(len(states))
        seen, fits = problem.responses(level, states, rough=problem.is_relative)
        if not problem.is_relative:
            costs = state_costs(problem.criterion, seen.responses, seen.bricks, seen.possible)
        else:
            *chosen, last = self._of(level).columns
            every = self._of(level).states
            every = every[(every[:, chosen] == states[0, chosen]).all(axis=1)]
            every = every[np.argsort(every[:, last])]
            found = problem.seen(level, every, rough=True).responses
            costs = self._relative(level, problem.criterion, found)
            costs = costs[np.searchsorted(every[:, last], states[:, last])]
        return np.where(fits, costs, np.inf)

    def charges(self, level: int, states: Ints) -> Floats:
        """Return what a search of one move alone is charged of states, (n, 2).

        First in steps in which one move is open, then in those that it shares with the one before.
        """
        problem = self._problem
        if problem.each:
            every = [one.candidates.charges(level, states) for one in problem.each]
            return np.asarray(np.max(every, axis=0))
        out, columns = np.zeros((len(states), 2)), problem.space.open_columns(level)
        if columns and problem.is_relative:
            out[:, int(len(columns) > 1)] = self.among(level, states, alone=True)
        elif columns:
            out[:, int(len(columns) > 1)] = problem.costs(level, problem.seen(level, states))
        return out


def walk(problem: Any, watch: Watch) -> Solution:
    """Return the plan of a search of one decision after the other; its value is not claimed.

    Raises `NothingFoundError` if no candidate is left after the choices before it, while others may
    have led on; `TimeUpError` if time is over; `KeyboardInterrupt`, with the number of steps that
    are decided as its text.
    """
    space, resources = problem.space, problem.resources
    path, state = list[tuple[int, ...]](), space.start()
    try:
        with _keep(resources.executor, resources.workers):
            while len(path) < space.levels:
                if watch.over:
                    raise TimeUpError(f"{watch.seconds:.3g} s: {_so_far(problem, path)}; give more")
                costs, trail = _branches(problem, len(path), state)
                if not np.isfinite(costs).any():
                    raise NothingFoundError(
                        f"step {len(path) + 1}: no grip is allowed after the choices before it; "
                        "relax a limit, or let a formulation look at all choices"
                    )
                best = int(np.argmin(costs))
                path += [(len(path) + k, *rows[best].tolist()) for k, rows in enumerate(trail, 1)]
                state = trail[-1][best : best + 1]
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(_so_far(problem, path)) from stop
    return Solution(tuple(path), (np.nan,) * len(problem.goals), (-np.inf,) * len(problem.goals))


def _branches(problem: Any, level: int, state: Ints) -> tuple[Floats, list[Ints]]:
    """Return the costs (k,) of a state's successors up to the next decision, and all their states.

    ``state`` (1, c); of every level passed the states (k, c).
    """
    costs, trail = np.zeros(1), list[Ints]()
    while level < problem.space.levels and len(costs):
        ((moves, _),) = problem.space.onward(level, trail[-1] if trail else state)
        if trail and (np.bincount(moves.source) > 1).any():
            break
        level += 1
        trail = [*(rows[moves.source] for rows in trail), moves.states]
        own = problem.candidates.of_branches(level, moves.states)
        costs = costs[moves.source] + own
    return costs, trail


def _so_far(problem: Any, path: list[tuple[int, ...]]) -> str:
    """Return how far a build is decided, in words."""
    if not path:
        return "no grip was chosen yet"
    return f"the grips of {len(path)} of {problem.space.levels} steps were chosen"
