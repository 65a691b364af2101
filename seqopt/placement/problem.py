"""The problem of support placement over a whole build, as one frozen value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError
from seqopt.placement.costs import Budget, LayeredCosts
from seqopt.placement.criteria import Criterion
from seqopt.responses.choices import SCALARS, Evaluation, StepChoices, evaluate_choices
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Schedule


@dataclass(frozen=True)
class Limit:
    """No state with an open grip may exceed a value: response and bound, SI units.

    Responses are named as in `seqopt.placement.criteria`.
    """

    response: str
    bound: float


def payload_limits(scene: Scene) -> tuple[Limit, ...]:
    """Return limits that keep every robot within its payload."""
    return tuple(Limit(f"F_{robot.name}", robot.payload) for robot in scene.robots)


@dataclass(frozen=True)
class Problem:
    """Support placement over a whole build.

    Attributes
    ----------
    schedule : Schedule
        The steps and moves.
    criterion : Criterion
        What a state costs.
    limits : tuple of Limit
        What no state may exceed.
    evaluation : Evaluation
        Raw responses of every open state.
    budgets : tuple of Budget
        Caps on totals over the build.
    """

    schedule: Schedule
    criterion: Criterion
    limits: tuple[Limit, ...]
    evaluation: Evaluation = field(repr=False)
    budgets: tuple[Budget, ...] = ()

    @cached_property
    def sums(self) -> LayeredCosts:
        """The costs whose sum over the build is to be least."""
        return self._placement(np.add)

    @cached_property
    def peaks(self) -> LayeredCosts:
        """The costs whose largest over the build is to be least."""
        return self._placement(np.maximum)

    def _placement(self, join: np.ufunc) -> LayeredCosts:
        costs = [(state.moves, self.state_costs(state)) for state in self.evaluation.states]
        known = [c[np.isfinite(c)].min() for _, c in costs if np.isfinite(c).any()]
        least = 0.0 if join is np.add else min(known, default=0.0)  # where no state is open
        sizes = [len(move.candidates) for move in self.schedule.moves]
        single = [np.full(size, least) for size in sizes]
        shared = [np.full(pair, least) for pair in zip([1, *sizes[:-1]], sizes, strict=True)]
        for moves, cost in costs:
            target = single if len(moves) == 1 else shared
            target[moves[-1]] = join(target[moves[-1]], cost)
        return LayeredCosts(tuple(single), tuple(shared))

    def row(self, move: int, before: int) -> Floats:
        """Return the cost of a move's candidates in the shared states, given the move before.

        Ranks are those among the candidates of this move alone.
        """
        out = np.zeros(len(self.schedule.moves[move].candidates))
        for state in self.evaluation.states:
            if len(state.moves) == 2 and state.moves[1] == move:
                out = out + self.state_costs(state, before)
        return out

    def state_costs(self, state: StepChoices, rows: slice | int = slice(None)) -> Floats:
        """Return the costs of a state's choices, infinite where they are not allowed.

        ``rows`` fixes the earlier move of a shared state to one candidate: costs, ranks included,
        are then those among the candidates of the later move alone.
        """
        responses = {name: values[rows] for name, values in state.responses.items()}
        move = self.schedule.moves[state.moves[-1]]
        costs = self.criterion.costs(responses, move.bricks, len(move.candidates))
        costs = np.where(np.isfinite(costs), costs, np.inf)
        for limit in self.limits:
            over = responses[limit.response] > limit.bound
            costs[over] = np.inf
        return costs

    def table(self, state: StepChoices) -> pd.DataFrame:
        """Return raw responses and cost of a state, a row per choice, labeled by nodes."""
        moves = [self.schedule.moves[m] for m in state.moves]
        names = [f"{move.robot}_node" for move in moves]
        index = pd.MultiIndex.from_product([move.candidates for move in moves], names=names)
        columns: Mapping[str, Floats] = {**state.responses, "cost": self.state_costs(state)}
        return pd.DataFrame({name: values.ravel() for name, values in columns.items()}, index=index)

    def nodes(self, choice: Sequence[int]) -> tuple[int, ...]:
        """Return the nodes that candidates stand for."""
        return tuple(m.candidates[c] for m, c in zip(self.schedule.moves, choice, strict=True))

    @property
    def paper_models(self) -> tuple[int, int]:
        """How many models the study counts: cascading, and with the shared step over all pairs.

        It counts 2n candidates for every brick count n from 3 to the last, four states each, and
        2n times 2(n-1) pairs for the shared one.
        """
        counts = range(3, len(self.schedule.scene.bricks) + 1)
        cascading = sum(4 * 2 * n for n in counts)
        return cascading, sum(3 * 2 * n + 2 * n * 2 * (n - 1) for n in counts)


def pose(
    engine: Engine,
    schedule: Schedule,
    criterion: Criterion,
    limits: Sequence[Limit] = (),
    also: Sequence[str] = (),
) -> Problem:
    """Return the problem; only responses that criterion, limits and ``also`` name are evaluated."""
    robots = [robot.name for robot in schedule.scene.robots]
    named = criterion.for_robots(robots)
    known = {*SCALARS, *(f"F_{name}" for name in robots)}

    def wanted(bricks: int) -> set[str]:
        names = {*named.wanted(bricks), *(limit.response for limit in limits), *also}
        if names - known:
            raise ProblemError(
                f"response {min(names - known)}: there is no such; give {', '.join(sorted(known))}"
            )
        return names

    return Problem(schedule, named, tuple(limits), evaluate_choices(engine, schedule, wanted))
