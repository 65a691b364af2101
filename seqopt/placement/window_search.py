"""The search of Bruun et al., move by move, solving only the models that it meets.

A formulation is given the costs of all choices, so that its answer can be certified. Where a model
is expensive these costs are the price of the proof. This search asks less: every move's candidates
in the steps where it alone is open, and in the step that it shares with the move before only those
that go with the choice made there (equation 1). It chooses as a formulation does that looks at one
window after the other, and knows nothing of what it misses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SolverError
from seqopt.placement.problem import Problem
from seqopt.responses.choices import Evaluation
from seqopt.sequence.schedule import OpenGrip, Schedule


@dataclass(frozen=True)
class WindowSearch:
    """What a search move by move looked at, and what it chose.

    Attributes
    ----------
    alone : Problem
        The steps in which one move is open.
    shared : tuple of Problem
        Of every move, the steps shared with the move before, whose choice is made; it may be empty.
    choice : tuple of int
        The chosen candidate of every move.
    """

    alone: Problem
    shared: tuple[Problem, ...]
    choice: tuple[int, ...]

    @property
    def explored(self) -> tuple[Problem, ...]:
        """The problems of which responses were computed."""
        return (self.alone, *(problem for problem in self.shared if problem.evaluation.steps))

    def costs(self, move: int) -> Floats:
        """Return what the candidates of a move cost after the choices before it.

        Parameters
        ----------
        move : int
            Index of a move that was chosen.

        Returns
        -------
        (C_k,) float
        """
        return np.asarray(self.alone.sums.single[move] + self.shared[move].sums.single[0])


def search_windows(problem: Problem) -> WindowSearch:
    """Choose every open grip of a build, one move after the other.

    Parameters
    ----------
    problem : Problem
        Its own responses are not computed.

    Returns
    -------
    WindowSearch
        With a choice for every move.

    Raises
    ------
    SolverError
        If a move has no candidate left after the choices before it. Others may have led on.
    """
    schedule = problem.schedule
    single = replace(schedule, steps=tuple(s for s in schedule.steps if len(s.moves) == 1))
    found = WindowSearch(_of(problem, single), (), ())
    nodes: list[int] = []
    for k, move in enumerate(schedule.moves):
        shared = _of(problem, window(schedule, k, nodes))
        found = replace(found, shared=(*found.shared, shared))
        costs = found.costs(k)
        if not np.isfinite(costs).any():
            raise SolverError(
                f"move {k + 1}, step {move.step}: {move.robot} has no allowed grip after the "
                "choices before it; relax a limit, or let a formulation look at all choices"
            )
        found = replace(found, choice=(*found.choice, int(np.argmin(costs))))
        nodes.append(move.candidates[found.choice[-1]])
    return found


def window(schedule: Schedule, move: int, nodes: Sequence[int]) -> Schedule:
    """Return the steps that a move shares with the one before, as a schedule of that move alone.

    Parameters
    ----------
    schedule : Schedule
        With all moves open.
    move : int
        Index of a move.
    nodes : sequence of int
        Chosen for the moves before.

    Returns
    -------
    Schedule
        Of one move; without steps if it shares none.
    """

    def grip(held: int | OpenGrip | None) -> int | OpenGrip | None:
        if not isinstance(held, OpenGrip):
            return held
        return OpenGrip(0) if held.move == move else nodes[held.move]

    steps = [
        replace(step, grips=tuple(grip(held) for held in step.grips))
        for step in schedule.steps
        if step.moves == (move - 1, move)
    ]
    return replace(schedule, steps=tuple(steps), moves=(schedule.moves[move],))


def _of(problem: Problem, schedule: Schedule) -> Problem:
    """Return the problem of another schedule, everything else being the same."""
    evaluation = Evaluation(problem.engine, schedule, problem.evaluation.wanted)
    return replace(problem, evaluation=evaluation)
