"""Responses of every open step of a schedule, over the choices that are open in it.

Beside the responses of `seqopt.responses.quantities` there are those that belong to robots: the
force of each (``F_`` and its name, as `robot_response` writes it), of the one that takes its grip
(``F_move``) and the largest (``F_largest``), sizes without sign.

Where the responses of all choices are more than the memory that may be used, they come one brick
count after the other, and whoever needs costs alone keeps these.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain, count, islice, zip_longest
from typing import TypeVar

import numpy as np

from seqopt.arrays import Terse
from seqopt.engines.interface import Engine
from seqopt.errors import MemoryShortError
from seqopt.responses._blocks import (
    COMPILED,
    Answers,
    Batch,
    Block,
    Blocks,
    StepChoices,
    Store,
    Wanted,
    _grip_rows,
    batch_of,
    choices_of,
    combinations,
    distinct,
    no_node_twice,
    open_store,
    require_memory,
    steps_of_batches,
    tally_of,
    work,
    worker_for,
)
from seqopt.responses._given_steps import GivenSteps
from seqopt.responses.resources import HERE, Resources
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.work._workers import Crew, Lanes, hire, map_ordered
from seqopt.work.progress import Progress

CHOICE_RESPONSES = ("T_max", "M_sup", "D_max", "C_max", "F_move", "F_largest")  # and one per robot

__all__ = ["CHOICE_RESPONSES", "Evaluation", "StepChoices", "Wanted", "evaluate_choices"]

_Each = TypeVar("_Each")
_SEVERAL = 4  # portions' work that states of one brick count may be before they are parted
_PREPARED = 0.15  # of all work, that every process does for itself on the vault of 338 bricks
_PORTIONS = 32  # tasks for every worker: one that is slow, or dies, leaves little to the others


@dataclass(frozen=True, eq=False, repr=False)
class _Portion:
    """Blocks that are answered together."""

    blocks: tuple[Block, ...]
    stored: list[Answers] | None = None  # their answers, if they are known
    lane: int = 0  # which of several processes is to answer them

    @property
    def work(self) -> float:
        """About how much work they are, stored or not."""
        return sum(block.work for block in self.blocks)


def _answer_blocks(
    engine: Engine, blocks: Iterable[Block], total: float, resources: Resources, *, apart: bool
) -> Generator[Answers, None, None]:
    """Return the answers to blocks of states, in their order.

    Each process of our own prepares every brick count up to the last that it is asked for. Apart,
    it gets neighboring ones only, and answers to later ones wait for those to earlier ones.

    ``blocks``: taken as they are needed; ``total``: about how much work they are; ``apart``:
    whether there is room for all answers, and no hurry for the next one.
    """
    store = open_store(resources.cache, engine)
    progress = Progress("responses", total, resources.progress)
    with hire(resources.executor, resources.workers, lanes=apart) as crew:
        elsewhere = crew is not None
        course = _Course(engine, store, progress, elsewhere)
        places: Iterable[int] = count()
        portions = _share_out(blocks, store, total, crew)
        if isinstance(crew, Lanes):
            places, portions = _take_turns([*portions], crew.workers)
        work = partial(_answer_portion, worker_for(engine, elsewhere=elsewhere))
        with closing(map_ordered(work, portions, crew, course.stored, course.done)) as results:
            for answers in _in_places(places, results):
                yield from answers


def _take_turns(
    portions: Sequence[_Portion], lanes: int
) -> tuple[Iterator[int], Iterator[_Portion]]:
    """Return portions with their lanes, which take turns, and the places where they stood.

    ``lanes``: each gets neighboring ones. Later lanes get fewer, since they prepare all that comes
    before them too: with a share f of the work they end together where lane i ends at the share (1
    - q^i) / (1 - q^n) with q = 1 / (1 + f).
    """
    before = 1 - (1 + _PREPARED) ** -np.arange(1.0, lanes + 1)
    work = np.array([portion.work for portion in portions])
    middle = (np.cumsum(work) - work / 2) / max(float(work.sum()), 1.0)
    lane_of = np.searchsorted(before[:-1] / before[-1], middle).tolist()
    mine: list[list[tuple[int, _Portion]]] = [[] for _ in range(lanes)]
    for place, (portion, lane) in enumerate(zip(portions, lane_of, strict=True)):
        mine[lane].append((place, replace(portion, lane=lane)))
    turns = [pair for turn in zip_longest(*mine) for pair in turn if pair is not None]
    return iter([place for place, _ in turns]), iter([portion for _, portion in turns])


def _in_places(places: Iterable[int], results: Iterable[_Each]) -> Iterator[_Each]:
    """Yield results in the order of their places, each as soon as those before it are there.

    ``places``: from 0, each once, in the order of the results.
    """
    waiting: dict[int, _Each] = {}
    following = 0
    for result, place in zip(results, places, strict=False):
        waiting[place] = result
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def _share_out(
    blocks: Iterable[Block], store: Store | None, total: float, crew: Crew | None
) -> Iterator[_Portion]:
    """Return portions of about equal work, each of neighboring blocks; stored ones apart.

    Engines that grow with the structure serve ascending brick counts best, and what all states of
    one share they prepare once: portions keep the order of the blocks, and end between brick counts
    unless one has several portions' work.

    ``total``: about how much work they are; ``crew``: without one each block is a portion.
    """
    enough = 0.0 if crew is None else total / (_PORTIONS * crew.workers)
    mine: list[Block] = []
    for block in blocks:
        found = None if store is None else store.find(block)
        if mine:
            several = 1 if block.bricks != mine[-1].bricks else _SEVERAL
            if found is not None or sum(each.work for each in mine) >= several * enough:
                yield _Portion(tuple(mine))
                mine = []
        if found is not None:
            yield _Portion((block,), [found])
        elif crew is None:
            yield _Portion((block,))
        else:
            mine.append(block)
    if mine:
        yield _Portion(tuple(mine))


@dataclass(frozen=True, eq=False, repr=False)
class _Course:
    """What happens to answers as soon as they are there: kept, counted, told of."""

    engine: Engine
    store: Store | None
    progress: Progress
    elsewhere: bool

    def stored(self, portion: _Portion) -> list[Answers] | None:
        if portion.stored is not None:
            self._count(portion.stored)
            self.progress.add(portion.work)
        return portion.stored

    def done(self, portion: _Portion, answers: list[Answers]) -> None:
        if self.store is not None:
            for block, found in zip(portion.blocks, answers, strict=True):
                self.store.keep(block, found)
        if self.elsewhere:  # here the engine itself has counted
            self._count(answers)
        self.progress.add(portion.work)

    def _count(self, answers: list[Answers]) -> None:
        tally = tally_of(self.engine)
        for what, sets in chain.from_iterable(found.tally for found in answers):
            tally[what] = tally.get(what, 0) + sets


def _answer_portion(answer: Callable[[Blocks], list[Answers]], portion: _Portion) -> list[Answers]:
    return answer(portion.blocks)


@dataclass(frozen=True, repr=False)
class Evaluation(Terse):
    """The responses of all choices of a schedule, computed when they are first asked for.

    Parameters
    ----------
    engine : Engine
        What computes them.
    schedule : Schedule
        Whose open steps are evaluated.
    wanted : Wanted
        Which responses every move needs; no others are computed.
    resources : Resources, optional
        Processes, memory and a folder for answers; by default this process alone.
    more_work : float, optional
        About how much more work is to come, as `seqopt.responses._blocks.work` has it.
    """

    engine: Engine
    schedule: Schedule
    wanted: Wanted
    resources: Resources = HERE
    more_work: float = 0.0

    @cached_property
    def given(self) -> GivenSteps:
        """The steps without an open grip."""
        return GivenSteps(self.engine, self.schedule)

    @property
    def work(self) -> float:
        """About how much work it is."""
        steps = (step for step in self.schedule.steps if step.moves)
        return sum(work(choices_of(self.schedule, step), step.bricks) for step in steps)

    @cached_property
    def streams(self) -> bool:
        """Whether there is memory for costs alone: responses then come, and go, step by step.

        Raises `MemoryShortError` if there is not even that.
        """
        return not require_memory(self.schedule, self.wanted, self.resources.max_memory)

    @property
    def steps(self) -> tuple[StepChoices, ...]:
        """All open steps, in order.

        Raises `MemoryShortError` if there is not the memory to keep them.
        """
        if self.streams:
            raise MemoryShortError(
                "the responses of all choices do not fit into the memory that may be used; take "
                "them from levels(), step by step, or raise max_memory"
            )
        return self._found.steps

    def levels(self, *, soon: bool = False) -> Generator[Sequence[StepChoices], None, None]:
        """Return all open steps, in order, those of one brick count after the other.

        They are computed as they are taken, and kept for the next time where there is memory.

        ``soon``: whether there is much to do with each: several processes then work on the next
        ones together. Else each works on a part of the build of its own, which takes less time.
        Raises `MechanismError`, `SolverError`, `WorkerError` as the engine does, and the workers;
        `MemoryShortError` if there is not the memory.
        """
        keep, known = not self.streams, vars(self).get("_found")
        if known is not None and keep:
            yield known.steps
            return
        steps: list[StepChoices] = []
        models, seconds, start = 0, 0.0, time.perf_counter()
        with closing(_by_level(self, apart=keep and not soon)) as levels:
            for found, count in levels:
                models += count
                seconds += time.perf_counter() - start
                steps += found if keep else ()
                yield found
                start = time.perf_counter()
        vars(self)["_found"] = _Found(tuple(steps), models, seconds + time.perf_counter() - start)

    @cached_property
    def _found(self) -> _Found:
        for _ in self.levels():
            pass
        found: _Found = vars(self)["_found"]
        return found

    @property
    def models(self) -> int:
        """How many different models there are: a model is a brick count and the nodes held."""
        return self._found.models

    @property
    def seconds(self) -> float:
        """How long solving them took, s."""
        return self._found.seconds


@dataclass(frozen=True, eq=False, repr=False)
class _Found(Terse):
    """What is kept of an evaluation; no steps where there is not the memory."""

    steps: tuple[StepChoices, ...]
    models: int
    seconds: float


def evaluate_choices(
    engine: Engine, schedule: Schedule, wanted: Wanted, resources: Resources = HERE
) -> tuple[tuple[StepChoices, ...], int]:
    """Return the steps and the number of models of an `Evaluation`."""
    evaluation = Evaluation(engine, schedule, wanted, resources)
    return evaluation.steps, evaluation.models


def _by_level(
    evaluation: Evaluation, *, apart: bool
) -> Generator[tuple[list[StepChoices], int], None, None]:
    """Yield the steps with one brick count after the other, and how many models they have."""
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
    with closing(_answer_blocks(engine, blocks(), total, resources, apart=apart)) as answers:
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
    """Return how many distinct models a search of one move after the other looks at.

    A step that two moves share is then solved for the later one's candidates only, the earlier
    choice being made.

    ``choice``: the chosen candidate of every move.
    """
    return sum(
        len(distinct(np.concatenate([_window_states(schedule, step, choice) for step in steps]))[0])
        for steps in chain(*steps_of_batches(schedule))
    )


def _window_states(schedule: Schedule, step: OpenStep, choice: Sequence[int]) -> np.ndarray:
    """Return the nodes held (S, r), ascending, for what is open once the earlier move is made."""
    if len(step.moves) == 2:
        first = step.moves[0]
        node = schedule.moves[first].candidates[choice[first]]
        step = replace(step, grips=tuple(node if g == OpenGrip(first) else g for g in step.grips))
    rows = combinations(schedule, step)
    return np.sort(_grip_rows(schedule, step, rows[no_node_twice(rows)]), axis=1)
