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
from seqopt.errors import ProblemError
from seqopt.network.network import Network
from seqopt.placement.costs import Budget, LayeredCosts
from seqopt.placement.interface import Aim
from seqopt.placement.possible import compared, spread_over_pairs
from seqopt.placement.requirements import Criterion, Limit, ResponsesAsked
from seqopt.placement.scales import SceneFacts
from seqopt.responses.choices import CHOICE_RESPONSES, Evaluation, StepChoices
from seqopt.responses.quantities import robot_response
from seqopt.scene.checks import short
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step


@dataclass(frozen=True, repr=False)
class Problem:
    """Support placement over a whole build.

    Nothing is computed before it is asked for: responses, sums and peaks each on first use.

    Attributes
    ----------
    criterion : Criterion
        What a step costs.
    limits : tuple of Limit
        What no open step may exceed.
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
        return f"Problem({what}, criterion {self.criterion.name!r}, {extras})"

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
        """The costs whose sum over the build is to be least."""
        return self._sums[0]

    @property
    def peaks(self) -> LayeredCosts:
        """The costs whose largest over the build is to be least."""
        return self._peaks[0]

    @cached_property
    def _sums(self) -> tuple[LayeredCosts, float]:
        return self._layered(np.add)

    @cached_property
    def _peaks(self) -> tuple[LayeredCosts, float]:
        return self._layered(np.maximum)

    def _layered(self, join: np.ufunc) -> tuple[LayeredCosts, float]:
        """Return the costs of all choices, steps of the same moves joined, and the seconds."""
        steps = self.evaluation.steps
        start = time.perf_counter()
        faced = [compared(choices, self.schedule, self.criterion) for choices in steps]
        costs = [(choices.moves, self.step_costs(choices)) for choices in faced]
        known = [c[np.isfinite(c)].min() for _, c in costs if np.isfinite(c).any()]
        least = 0.0 if join is np.add else min(known, default=0.0)  # where no step is open
        sizes = [len(move.candidates) for move in self.schedule.moves]
        single = [np.full(size, least) for size in sizes]
        shared = [np.full(pair, least) for pair in zip([1, *sizes[:-1]], sizes, strict=True)]
        for moves, cost in costs:
            target = single if len(moves) == 1 else shared
            target[moves[-1]] = join(target[moves[-1]], cost)
        layered = LayeredCosts(tuple(single), tuple(shared))
        return layered, time.perf_counter() - start

    def seconds(self, aim: Aim) -> Mapping[str, float]:
        """Return what computing the costs of an aim took.

        Parameters
        ----------
        aim : Aim
            Sums or peaks.

        Returns
        -------
        mapping of str to float
            ``respond`` (responses) and ``rank`` (costs), s.
        """
        ranked = self._sums[1] if aim is Aim.SUM else self._peaks[1]
        return {"respond": self.evaluation.seconds, "rank": ranked}

    def conditional(self, move: int, before: int) -> Floats:
        """Return the cost of a move's candidates in the shared steps, given the move before.

        Ranks are those among the candidates of this move alone.

        Parameters
        ----------
        move, before : int
            A move, and the candidate chosen for the move before it.

        Returns
        -------
        (C_k,) float
        """
        out = np.zeros(len(self.schedule.moves[move].candidates))
        for choices in self.evaluation.steps:
            choices = compared(choices, self.schedule, self.criterion)  # noqa: PLW2901
            if len(choices.moves) == 2 and choices.moves[1] == move:
                out = out + self.step_costs(choices, before)
        return out

    @cached_property
    def others(self) -> dict[Criterion, Problem]:
        """The same problem under other criteria that need the same responses, as they are met."""
        return {}

    def step_costs(self, choices: StepChoices, rows: slice | int = slice(None)) -> Floats:
        """Return the costs of a step's choices, infinite where they are not allowed.

        Parameters
        ----------
        choices : StepChoices
        rows : int, optional
            Fixes the earlier move of a shared step to one candidate: costs, ranks included, are
            then those among the candidates of the later move alone.

        Returns
        -------
        (C,) or (C, D) float
        """
        responses = {name: values[rows] for name, values in choices.responses.items()}
        move = self.schedule.moves[choices.moves[-1]]
        criterion = spread_over_pairs(choices, self.criterion)
        costs = criterion.costs(responses, move.bricks, len(move.candidates))
        costs = np.where(np.isfinite(costs), costs, np.inf)
        for limit in self.limits:
            costs[limit.exceeded(responses[limit.response])] = np.inf
        return costs

    def table(self, choices: StepChoices) -> pd.DataFrame:
        """Return raw responses and cost of every choice in a step.

        Parameters
        ----------
        choices : StepChoices
            One of ``evaluation.steps``.

        Returns
        -------
        pandas.DataFrame
            A row per choice, labeled by its nodes; SI units.
        """
        moves = [self.schedule.moves[m] for m in choices.moves]
        names = [f"{move.robot}_node" for move in moves]
        index = pd.MultiIndex.from_product([move.candidates for move in moves], names=names)
        columns: Mapping[str, Floats] = {**choices.responses, "cost": self.step_costs(choices)}
        return pd.DataFrame({name: values.ravel() for name, values in columns.items()}, index=index)

    def nodes(self, choice: Sequence[int]) -> tuple[int, ...]:
        """Return the nodes that a choice stands for.

        Parameters
        ----------
        choice : sequence of int
            A candidate for every move.

        Returns
        -------
        tuple of int
        """
        return tuple(m.candidates[c] for m, c in zip(self.schedule.moves, choice, strict=True))

    def steps(self, choice: Sequence[int]) -> tuple[Step, ...]:
        """Return the checked steps of the schedule with a choice.

        Parameters
        ----------
        choice : sequence of int
            A candidate for every move.

        Returns
        -------
        tuple of Step

        Raises
        ------
        StepError
            If a step is impossible.
        """
        return self.schedule.fill(self.nodes(choice))


def pose(
    engine: Engine,
    schedule: Schedule,
    criterion: Criterion,
    limits: Sequence[Limit] = (),
    also: Sequence[str] = (),
) -> Problem:
    """Return the problem of filling a schedule's open grips.

    Parameters
    ----------
    engine : Engine
        What computes responses.
    schedule : Schedule
        Whose open grips are to be chosen.
    criterion : Criterion
        What a step costs.
    limits : sequence of Limit
        What no open step may exceed.
    also : sequence of str
        Responses to evaluate beside those that criterion and limits name; no others are.

    Returns
    -------
    Problem
        Nothing is computed yet.

    Raises
    ------
    ProblemError
        If there is no such response, or no grip is open.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> engine, schedule = seqopt.make_engine("auto", network), seqopt.three_robot_loop(network)
    >>> problem = seqopt.pose(engine, schedule, seqopt.CRITERIA["worst-ratio"])
    >>> len(problem.schedule.moves), problem.criterion.name, problem.limits
    (22, 'worst-ratio', ())
    """
    robots = _robots(engine, schedule, criterion)
    limits = (limits,) if isinstance(limits, Limit) else limits
    asked = ResponsesAsked(criterion.for_scene(SceneFacts(engine)), tuple(limits), tuple(also))
    known = {*CHOICE_RESPONSES, *map(robot_response, robots)}
    for move in schedule.moves:
        if unknown := asked(move.bricks) - known:
            listed = ", ".join(sorted(known))
            raise ProblemError(f"response {min(unknown)}: there is no such; give {listed}")
    return Problem(asked.criterion, asked.limits, Evaluation(engine, schedule, asked))


def _robots(engine: Engine, schedule: Schedule, criterion: Criterion) -> list[str]:
    """Return the names of a schedule's robots if all is what it should be, and grips are open."""
    _require_kinds(engine, schedule, criterion)
    if not schedule.moves:
        raise ProblemError(
            f"schedule {schedule.method}: with {len(schedule.scene.bricks)} bricks it leaves no "
            "grip open; there is nothing to choose, analyze its steps"
        )
    return [robot.name for robot in schedule.scene.robots]


def _require_kinds(engine: Engine, schedule: Schedule, criterion: Criterion) -> None:
    """Say what is wanted where something else is given."""
    wanted = (
        (engine, isinstance(getattr(engine, "network", None), Network), "engine", "make_engine"),
        (schedule, isinstance(schedule, Schedule), "schedule", "three_robot_loop"),
        (criterion, hasattr(criterion, "for_scene"), "criterion", "CRITERIA"),
    )
    for given, right, what, source in wanted:
        if not right:
            raise ProblemError(f"{short(given)} is no {what}; take one of seqopt.{source}")
