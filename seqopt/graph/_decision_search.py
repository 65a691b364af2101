"""The search of a decision at a time: move by move, from only the models that it looks at.

Move by move, what costs least after the choice before it is chosen (equation 1 of Bruun et al.).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from seqopt.arrays import Floats, Terse
from seqopt.errors import NothingFoundError, TimeUpError
from seqopt.graph.decisions import Decisions
from seqopt.graph.formulation import Watch
from seqopt.problem.problem import Aim
from seqopt.responses._choices import StepChoices
from seqopt.work._workers import keep


@dataclass(frozen=True, repr=False)
class Windows(Terse):
    """The steps that every move decides, after the choice before it; solved when first asked for.

    ``choice``: the chosen candidate of every move so far; ``rows``: by move, the steps that are
    solved.
    """

    problem: Decisions
    choice: list[int] = field(default_factory=list)
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
    `WorkerError`; `KeyboardInterrupt`, with the nodes that were chosen so far as its text.
    """
    found, resources = Windows(problem), problem.evaluation.resources
    try:
        with keep(resources.executor, resources.workers):
            for k, move in enumerate(problem.schedule.moves):
                if watch.over:
                    raise TimeUpError(f"{watch.seconds:.3g} s: {found.so_far()}; give more")
                costs = found.costs(k)
                if not np.isfinite(costs).any():
                    raise NothingFoundError(
                        f"move {k + 1}, step {move.step}: {move.robot} has no allowed grip after "
                        "the choices before it; relax a limit, or let a formulation look at all "
                        "choices"
                    )
                found.choice.append(int(np.argmin(costs)))
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(found.so_far()) from stop
    return found
