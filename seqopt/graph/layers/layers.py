"""The problem of support placement over a whole build, as one frozen value."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine
from seqopt.errors import InfeasibleError, ProblemError, did_you_mean
from seqopt.graph.layers.costs import Budget, Joined, LayeredCosts
from seqopt.graph.layers.windows import (
    by_move,
    compared,
    possible_after,
    spread_over_pairs,
    window_anew,
    window_kept,
)
from seqopt.problem.aims import Aim
from seqopt.problem.requirements import (
    Criterion,
    Limit,
    ResponsesAsked,
    as_limits,
    excesses,
    robots_of,
)
from seqopt.problem.scales import SceneFacts
from seqopt.responses.choices import CHOICE_RESPONSES, Evaluation, StepChoices
from seqopt.responses.quantities import robot_response
from seqopt.responses.resources import HERE, Resources
from seqopt.responses.table import analyze
from seqopt.sequence.schedule import OpenStep, Schedule
from seqopt.sequence.steps import Step
from seqopt.showing import Shown


@dataclass(frozen=True, repr=False)
class Layers(Shown):
    """Support placement over a whole build.

    Nothing is computed before it is asked for: responses, sums and peaks each on first use.

    Attributes
    ----------
    criterion : Criterion
        What a step costs.
    limits : tuple of Limit
        Bounds that no step may exceed, whether or not a grip is open in it.
    evaluation : Evaluation
        Raw responses of every open step.
    budgets : tuple of Budget
        Caps on totals over the build.
    """

    criterion: Criterion
    limits: tuple[Limit, ...]
    evaluation: Evaluation
    budgets: tuple[Budget, ...] = ()

    def __repr__(self) -> str:
        schedule = self.schedule
        counts = f"{len(schedule.steps)} steps, {len(schedule.moves)} moves"
        extras = f"{len(self.limits)} limits, {len(self.budgets)} budgets"
        what = f"{schedule.scene.name!r}, {schedule.method!r}: {counts}"
        return f"Layers({what}, criterion {self.criterion.name!r}, {extras})"

    @property
    def engine(self) -> Engine:
        """What computes the responses."""
        return self.evaluation.engine

    @property
    def schedule(self) -> Schedule:
        """The steps and moves."""
        return self.evaluation.schedule

    @property
    def sums(self) -> LayeredCosts:
        """The costs whose sum over the build is minimized."""
        return self._sums[0]

    @property
    def peaks(self) -> LayeredCosts:
        """The costs whose largest over the build is minimized."""
        return self._peaks[0]

    @cached_property
    def singles(self) -> tuple[Floats, ...]:
        """The sums of costs in the steps in which one move alone is open, by move."""
        return self._joined(np.add)[0].singles()

    @cached_property
    def _sums(self) -> tuple[LayeredCosts, float]:
        joined, seconds = self._joined(np.add)
        return joined.layered(), seconds

    @cached_property
    def _peaks(self) -> tuple[LayeredCosts, float]:
        joined, seconds = self._joined(np.maximum)
        return joined.layered(), seconds

    def _joined(self, join: np.ufunc) -> tuple[Joined, float]:
        """Return the costs of all choices, steps of the same moves joined, and the seconds."""
        joined = Joined([len(move.candidates) for move in self.schedule.moves], join)
        seconds = 0.0
        for steps in self.evaluation.levels():
            start = time.perf_counter()
            for choices in steps:
                faced = compared(choices, self.schedule, self.criterion)
                joined.add(faced.moves, self.step_costs(faced))
            seconds += time.perf_counter() - start
        return joined, seconds

    def seconds(self, aim: Aim) -> Mapping[str, float]:
        """Return what computing the costs of an aim took.

        ``aim``: sums or peaks. Result: ``respond`` (responses) and ``rank`` (costs), s.
        """
        ranked = self._sums[1] if aim is Aim.SUM else self._peaks[1]
        return {"respond": self.evaluation.seconds, "rank": ranked}

    def conditional(self, move: int, before: int) -> Floats:
        """Return the cost of a move's candidates in the shared steps, given the move before.

        Ranks are those among the candidates of this move alone.

        ``move``, ``before``: a move, and the candidate chosen for the move before it. Result
        (C_k,).
        """
        out = np.zeros(len(self.schedule.moves[move].candidates))
        for choices in self.window_choices(move, before):
            faced = compared(choices, self.schedule, self.criterion, before)
            if len(faced.moves) == 2:
                out = out + self.step_costs(faced)
        return np.where(possible_after(self.schedule, move, before), out, np.inf)

    def window_choices(self, move: int, before: int) -> tuple[StepChoices, ...]:
        """Return the steps that a move decides, for its candidates alone.

        ``move``, ``before``: a move, and the candidate chosen for the move before it. Result: in
        order, with responses (C_k,); those of steps shared with the move before are of that choice.
        Computed again if the responses of all choices are not kept.
        """
        if self.evaluation.streams:
            return window_anew(self.evaluation, move, before)
        return window_kept(self._decided.get(move, ()), before)

    @cached_property
    def _decided(self) -> Mapping[int, Sequence[StepChoices]]:
        return by_move(self.evaluation.steps)

    @cached_property
    def others(self) -> dict[Criterion, Layers]:
        """The same problem under other criteria that need the same responses, as they are met."""
        return {}

    def step_costs(self, choices: StepChoices, rows: slice | int = slice(None)) -> Floats:
        """Return the costs of a step's choices, infinite where they are not allowed.

        ``rows``: fixes the earlier move of a shared step to one candidate: costs, ranks included,
        are then those among the candidates of the later move alone. Result ((C,) or (C, D) float).
        """
        responses = {name: values[rows] for name, values in choices.responses.items()}
        move = self.schedule.moves[choices.moves[-1]]
        criterion = spread_over_pairs(choices, self.criterion)
        costs = criterion.costs(responses, move.bricks, len(move.candidates))
        costs = np.where(np.isfinite(costs), costs, np.inf)
        for limit in self.limits:
            costs[limit.exceeded(responses[limit.response])] = np.inf
        return costs

    def require_possible(self) -> None:
        """Raise an error if a step without an open grip exceeds a limit: no choice can keep it.

        Raises `InfeasibleError`, naming the limit, the value and the steps.
        """
        fixed = [_closed(step) for step in self.schedule.steps if not step.moves]
        if not (self.limits and fixed):
            return
        table = analyze(self.engine, fixed)
        for excess in excesses(self.schedule.scene, table, self.limits):
            raise InfeasibleError(
                f"{excess}, where no grip is left to choose; relax the limit or change the schedule"
            )

    def table(self) -> pd.DataFrame:
        """Return what is to be chosen.

        Result: a row per open grip; as of `seqopt.sequence.schedule.Schedule.table`.
        """
        return self.schedule.table()

    def nodes(self, choice: Sequence[int]) -> tuple[int, ...]:
        """Return the nodes that a choice stands for.

        ``choice``: a candidate for every move.
        """
        return tuple(m.candidates[c] for m, c in zip(self.schedule.moves, choice, strict=True))

    def steps(self, choice: Sequence[int]) -> tuple[Step, ...]:
        """Return the checked steps of the schedule with a choice.

        ``choice``: a candidate for every move. Raises `StepError` if a step is impossible.
        """
        return self.schedule.fill(self.nodes(choice))


def _closed(step: OpenStep) -> Step:
    """Return an open step in which no grip is open."""
    grips = tuple(grip if isinstance(grip, int) else None for grip in step.grips)
    return Step(step.number, step.kind, step.bricks, grips)


def candidate_layers(
    engine: Engine,
    schedule: Schedule,
    criterion: Criterion,
    limits: Sequence[Limit] = (),
    also: Sequence[str] = (),
    resources: Resources = HERE,
) -> Layers:
    """Return the problem of choosing the open grips of a schedule.

    Parameters
    ----------
    engine : Engine
        The engine that computes responses.
    schedule : Schedule
        The schedule whose open grips are to be chosen.
    criterion : Criterion
        What a step costs.
    limits : sequence of Limit
        Bounds that no step may exceed, whether or not a grip is open in it.
    also : sequence of str
        Further responses to compute, besides those that criterion and limits use.
    resources : Resources, optional
        Processes, memory and a folder for results; by default only this process.

    Returns
    -------
    Layers
        The problem; nothing is computed yet.

    Raises
    ------
    ProblemError
        If there is no such response, or no grip is open.
    """
    known = {*CHOICE_RESPONSES, *map(robot_response, robots_of(engine, schedule, criterion))}
    asked = ResponsesAsked(criterion.for_scene(SceneFacts(engine)), as_limits(limits), tuple(also))
    if unknown := {name for move in schedule.moves for name in asked(move.bricks)} - known:
        why = f"does not exist{did_you_mean(min(unknown), known)}"
        raise ProblemError(f"response {min(unknown)} {why}; give {', '.join(sorted(known))}")
    schedule.require_pairs()
    return Layers(asked.criterion, asked.limits, Evaluation(engine, schedule, asked, resources))
