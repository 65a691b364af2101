"""Responses of every open step of a schedule, over the choices that are open in it.

Beside the responses of `seqopt.responses.quantities` there are those that belong to robots: the
force of each (``F_`` and its name, as `robot_response` writes it), of the one that takes its grip
(``F_move``) and the largest (``F_largest``), sizes without sign.

If the responses of all choices exceed the memory limit, they are computed by brick count, and only
costs are kept.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, islice
from typing import cast

import numpy as np
import pandas as pd

from seqopt.arrays import Terse
from seqopt.engines.interface import Engine
from seqopt.errors import MemoryShortError
from seqopt.responses._blocks import (
    COMPILED,
    Batch,
    Block,
    StepChoices,
    Wanted,
    _grip_rows,
    batch_of,
    choices_of,
    combinations,
    distinct,
    no_node_twice,
    require_memory,
    steps_of_batches,
    work,
)
from seqopt.responses._grip_sets import answer_blocks
from seqopt.responses._tolerance import is_tolerance, with_tolerances
from seqopt.responses.quantities import OFFERED
from seqopt.responses.resources import HERE, Resources
from seqopt.responses.table import analyze
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.sequence.steps import Grips, Step

CHOICE_RESPONSES = (*OFFERED, "F_move", "F_largest")  # and one per robot

__all__ = ["CHOICE_RESPONSES", "Evaluation", "StepChoices", "Wanted"]


@dataclass(frozen=True, repr=False)
class Evaluation(Terse):
    """The responses of all choices of a schedule, computed on first use.

    Parameters
    ----------
    engine : Engine
        What computes them.
    schedule : Schedule
        Whose open steps are evaluated.
    wanted : Wanted
        Which responses every move needs; no others are computed.
    resources : Resources, optional
        Processes and memory; by default this process alone.
    more_work : float, optional
        About how much more work is to come, as `seqopt.responses._blocks.work` has it.
    """

    engine: Engine
    schedule: Schedule
    wanted: Wanted
    resources: Resources = HERE
    more_work: float = 0.0

    @cached_property
    def given(self) -> tuple[Step, ...]:
        """The steps without an open grip in which bricks stand, in order."""
        some = (step for step in self.schedule.steps if not step.moves and step.bricks)
        return tuple(Step(s.number, s.kind, s.bricks, cast(Grips, s.grips)) for s in some)

    @cached_property
    def _given_table(self) -> pd.DataFrame:
        return analyze(self.engine, self.given)

    def table_of_given(self, names: Iterable[str]) -> pd.DataFrame:
        """Return the table of `seqopt.analyze` of given steps, with the tolerances in ``names``."""
        table = self._given_table
        for name in {*filter(is_tolerance, names)}:
            table = with_tolerances(self.engine, self.given, table, name)
        return table

    @property
    def work(self) -> float:
        """Estimated work, without unit."""
        steps = (step for step in self.schedule.steps if step.moves)
        return sum(work(choices_of(self.schedule, step), step.bricks) for step in steps)

    @cached_property
    def streams(self) -> bool:
        """Whether memory suffices for costs alone: responses are then computed step by step.

        Raises `MemoryShortError` if it does not suffice for costs either.
        """
        return not require_memory(self.schedule, self.wanted, self.resources.max_memory)

    @property
    def steps(self) -> tuple[StepChoices, ...]:
        """All open steps, in order.

        Raises `MemoryShortError` if memory does not suffice for them.
        """
        if self.streams:
            raise MemoryShortError(
                "the responses of all choices do not fit into the memory that may be used; take "
                "them from levels(), step by step, or raise max_memory"
            )
        return self._found.steps

    def levels(self) -> Generator[Sequence[StepChoices], None, None]:
        """Return all open steps, in order, those of one brick count after the other.

        They are computed lazily, and cached if memory suffices.

        Raises `MechanismError`, `SolverError`, `WorkerError` as the engine does, and the workers;
        `MemoryShortError` if memory does not suffice.
        """
        keep = not self.streams
        if self._kept and keep:
            yield self._kept[0].steps
            return
        steps: list[StepChoices] = []
        models, seconds, start = 0, 0.0, time.perf_counter()
        with closing(_by_level(self)) as levels:
            for found, count in levels:
                models += count
                seconds += time.perf_counter() - start
                steps += found if keep else ()
                yield found
                start = time.perf_counter()
        self._kept[:] = [_Found(tuple(steps), models, seconds + time.perf_counter() - start)]

    @property
    def is_kept(self) -> bool:
        """Whether the responses of all choices are computed, and cached."""
        return bool(self._kept) and not self.streams

    @cached_property
    def _kept(self) -> list[_Found]:
        """The evaluation, after computing all levels."""
        return []

    @property
    def _found(self) -> _Found:
        if not self._kept:
            deque(self.levels(), maxlen=0)
        return self._kept[0]

    @property
    def models(self) -> int:
        """Number of distinct models: a model is a brick count and the nodes held."""
        return self._found.models

    @property
    def seconds(self) -> float:
        """Run time of solving them, s."""
        return self._found.seconds


@dataclass(frozen=True, eq=False, repr=False)
class _Found(Terse):
    """Cached results of an evaluation; without steps if memory does not suffice."""

    steps: tuple[StepChoices, ...]
    models: int
    seconds: float


def _by_level(evaluation: Evaluation) -> Generator[tuple[list[StepChoices], int], None, None]:
    """Yield the steps by brick count, with their number of models."""
    schedule = evaluation.schedule
    levels = steps_of_batches(schedule)
    under_way: deque[list[Batch]] = deque()

    def blocks() -> Iterator[Block]:
        for level in levels:
            groups = [batch_of(schedule, steps, evaluation.wanted) for steps in level]
            under_way.append(groups)
            for group in groups:
                yield from group.blocks(compiled=total + evaluation.more_work >= COMPILED)

    total = evaluation.work
    engine, resources = evaluation.engine, evaluation.resources
    with closing(answer_blocks(engine, blocks(), total, resources)) as answers:
        for first in answers:  # blocks, and so `under_way`, are taken no earlier
            groups, here = under_way.popleft(), chain([first], answers)
            yield (  # in no variable: what is not kept is free while the next ones are computed
                sorted(
                    [each for g in groups for each in g.choices([*islice(here, g.count)])],
                    key=lambda choices: choices.step.number,
                ),
                sum(len(group.states) for group in groups),
            )


def window_models(schedule: Schedule, choice: Sequence[int]) -> int:
    """Return the number of distinct models of a search move by move.

    A step shared by two moves is then solved for candidates of the later one only, given the
    earlier choice.

    ``choice``: the chosen candidate of every move.
    """
    return sum(
        len(distinct(np.concatenate([_window_states(schedule, step, choice) for step in steps]))[0])
        for steps in chain(*steps_of_batches(schedule))
    )


def _window_states(schedule: Schedule, step: OpenStep, choice: Sequence[int]) -> np.ndarray:
    """Return the nodes held (S, r), ascending, of open choices given the earlier move."""
    if len(step.moves) == 2:
        first = step.moves[0]
        node = schedule.moves[first].candidates[choice[first]]
        step = replace(step, grips=tuple(node if g == OpenGrip(first) else g for g in step.grips))
    rows = combinations(schedule, step)
    return np.sort(_grip_rows(schedule, step, rows[no_node_twice(rows)]), axis=1)
