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

from seqopt.arrays import Ints, Terse
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
from seqopt.responses._tolerance import COLUMN, is_tolerance, tolerances_along
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
            distances = tolerances_along(self.engine, self.given, name)
            table = table.assign(**{COLUMN: distances})
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
        return self._found[0]

    def levels(self) -> Generator[Sequence[StepChoices], None, None]:
        """Return all open steps, in order, those of one brick count after the other.

        They are computed lazily, and cached if memory suffices.

        Raises `MechanismError`, `SolverError`, `WorkerError` as the engine does, and the workers;
        `MemoryShortError` if memory does not suffice.
        """
        keep = not self.streams
        if self._kept and keep:
            yield self._kept[0][0]
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
        self._kept[:] = [(tuple(steps), models, seconds + time.perf_counter() - start)]

    @property
    def is_kept(self) -> bool:
        """Whether the responses of all choices are computed, and cached."""
        return bool(self._kept) and not self.streams

    @cached_property
    def _kept(self) -> list[tuple[tuple[StepChoices, ...], int, float]]:
        """After computing all levels: steps, if memory suffices for them, models and seconds."""
        return []

    @property
    def _found(self) -> tuple[tuple[StepChoices, ...], int, float]:
        if not self._kept:
            deque(self.levels(), maxlen=0)
        return self._kept[0]

    @property
    def models(self) -> int:
        """Number of distinct models: a model is a brick count and the nodes held."""
        return self._found[1]

    @property
    def seconds(self) -> float:
        """Run time of solving them, s."""
        return self._found[2]


def _by_level(evaluation: Evaluation) -> Generator[tuple[list[StepChoices], int], None, None]:
    """Yield the steps by brick count, with their number of models."""
    schedule, total = evaluation.schedule, evaluation.work
    compiled = total + evaluation.more_work >= COMPILED
    under_way: deque[list[tuple[Batch, int]]] = deque()  # and numbers of blocks

    def blocks() -> Iterator[Block]:
        for level in steps_of_batches(schedule):
            groups = [batch_of(schedule, steps, evaluation.wanted) for steps in level]
            each = [group.blocks(compiled=compiled) for group in groups]
            under_way.append([*zip(groups, map(len, each), strict=True)])
            yield from chain.from_iterable(each)

    engine, resources = evaluation.engine, evaluation.resources
    with closing(answer_blocks(engine, blocks(), total, resources)) as answers:
        for first in answers:  # blocks, and so `under_way`, are taken no earlier
            groups, here = under_way.popleft(), chain([first], answers)
            yield (  # in no variable: what is not kept is free while the next ones are computed
                sorted(
                    [each for g, count in groups for each in g.choices([*islice(here, count)])],
                    key=lambda choices: choices.step.number,
                ),
                sum(len(group.states) for group, _ in groups),
            )


def window_models(schedule: Schedule, choice: Sequence[int]) -> int:
    """Return the number of distinct models of a search move by move.

    A step shared by two moves is then solved for candidates of the later one only, given the
    earlier choice.

    ``choice``: the chosen candidate of every move.
    """

    def states(step: OpenStep) -> Ints:
        if len(step.moves) == 2:
            first = step.moves[0]
            node = schedule.moves[first].candidates[choice[first]]
            given = tuple(node if grip == OpenGrip(first) else grip for grip in step.grips)
            step = replace(step, grips=given)
        rows = combinations(schedule, step)
        return np.sort(_grip_rows(schedule, step, rows[no_node_twice(rows)]), axis=1)

    return sum(
        len(distinct(np.concatenate([*map(states, steps)]))[0])
        for steps in chain(*steps_of_batches(schedule))
    )
