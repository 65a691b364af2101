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
from itertools import count, zip_longest
from typing import TypeVar

import numpy as np

from seqopt.arrays import Terse
from seqopt.engines.interface import Engine
from seqopt.errors import MemoryShortError
from seqopt.responses._blocks import (
    Answers,
    Batch,
    Block,
    Blocks,
    Keeping,
    StepChoices,
    Store,
    Wanted,
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
from seqopt.responses.resources import HERE, Resources
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.work._workers import Crew, Lanes, hire, map_ordered
from seqopt.work.progress import Progress

_Each = TypeVar("_Each")
_SEVERAL = 4  # portions' work that states of one brick count may be before they are parted
_PREPARED = 0.15  # of all work, that every process does for itself on the vault of 338 bricks
_PORTIONS = 32  # tasks for every worker: one that is slow, or dies, leaves little to the others


@dataclass(frozen=True)
class Portion:
    """Blocks that are answered together."""

    blocks: tuple[Block, ...]
    stored: list[Answers] | None = None  # their answers, if they are known
    lane: int = 0  # which of several processes is to answer them

    @property
    def work(self) -> float:
        """About how much work they are, stored or not."""
        return sum(block.work for block in self.blocks)


def answer_blocks(
    engine: Engine,
    blocks: Iterable[Block],
    total: float,
    resources: Resources,
    *,
    apart: bool = False,
) -> Generator[Answers, None, None]:
    """Return the answers to blocks of states, in their order.

    Each process of our own prepares every brick count up to the last that it is asked for. Apart,
    it gets neighboring ones only, and answers to later ones wait for those to earlier ones.

    ``blocks``: taken as they are needed; ``total``: about how much work they are; ``apart``:
    whether there is room for all answers, and no hurry for the next one. Raises `MechanismError`,
    `SolverError`, `WorkerError` as the engine does, and the workers.
    """
    store = open_store(resources.cache, engine)
    progress = Progress("responses", total, resources.progress)
    with hire(resources.executor, resources.workers, lanes=apart) as crew:
        course = _Course(engine, store, progress, elsewhere=crew is not None)
        portions = share_out(blocks, store, total, crew)
        lanes = crew.workers if isinstance(crew, Lanes) else 0
        places, portions = take_turns([*portions], lanes) if lanes else (count(), portions)
        results = map_ordered(
            partial(_answer_portion, worker_for(engine, elsewhere=crew is not None)),
            portions,
            crew,
            course.stored,
            course.done,
        )
        with closing(results):
            for answers in in_places(places, results):
                yield from answers


def take_turns(portions: Sequence[Portion], lanes: int) -> tuple[Iterator[int], Iterator[Portion]]:
    """Return portions with their lanes, which take turns, and the places where they stood.

    ``lanes``: each gets neighboring ones. Later lanes get fewer, since they prepare all that comes
    before them too: with a share f of the work they end together where lane i ends at the share (1
    - q^i) / (1 - q^n) with q = 1 / (1 + f).
    """
    before = 1 - (1 + _PREPARED) ** -np.arange(1.0, lanes + 1)
    work = np.array([portion.work for portion in portions])
    middle = (np.cumsum(work) - work / 2) / max(float(work.sum()), 1.0)
    lane_of = np.searchsorted(before[:-1] / before[-1], middle).tolist()
    mine: list[list[tuple[int, Portion]]] = [[] for _ in range(lanes)]
    for place, (portion, lane) in enumerate(zip(portions, lane_of, strict=True)):
        mine[lane].append((place, replace(portion, lane=lane)))
    turns = [pair for turn in zip_longest(*mine) for pair in turn if pair is not None]
    return iter([place for place, _ in turns]), iter([portion for _, portion in turns])


def in_places(places: Iterable[int], results: Iterable[_Each]) -> Iterator[_Each]:
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


def share_out(
    blocks: Iterable[Block], store: Store | None, total: float, crew: Crew | None
) -> Iterator[Portion]:
    """Return portions of about equal work, each of neighboring blocks; stored ones apart.

    Engines that grow with the structure serve ascending brick counts best, and what all states of
    one share they prepare once: portions keep the order of the blocks, and end between brick counts
    unless one has several portions' work.

    ``total``: about how much work they are; ``crew``: without one each block is a portion.
    """
    enough = 0.0 if crew is None else total / (_PORTIONS * crew.workers)
    mine: list[Block] = []
    for block in blocks:
        if _complete(mine, block, enough):
            yield Portion(tuple(mine))
            mine = []
        found = None if store is None else store.find(block)
        if found is None:
            mine.append(block)
        if mine and (found is not None or crew is None):
            yield Portion(tuple(mine))
            mine = []
        if found is not None:
            yield Portion((block,), [found])
    if mine:
        yield Portion(tuple(mine))


def _complete(mine: Sequence[Block], coming: Block, enough: float) -> bool:
    """Return whether blocks are a portion before another one comes."""
    work = sum(block.work for block in mine)
    between = bool(mine) and coming.bricks != mine[-1].bricks
    return work >= (enough if between else _SEVERAL * enough) and bool(mine)


@dataclass(frozen=True)
class _Course:
    """What happens to answers as soon as they are there: kept, counted, told of."""

    engine: Engine
    store: Store | None
    progress: Progress
    elsewhere: bool

    def stored(self, portion: Portion) -> list[Answers] | None:
        if portion.stored is not None:
            self._count(portion.stored)
            self.progress.add(portion.work)
        return portion.stored

    def done(self, portion: Portion, answers: list[Answers]) -> None:
        if self.store is not None:
            for block, found in zip(portion.blocks, answers, strict=True):
                self.store.keep(block, found)
        if self.elsewhere:  # here the engine itself has counted
            self._count(answers)
        self.progress.add(portion.work)

    def _count(self, answers: list[Answers]) -> None:
        tally = tally_of(self.engine)
        for found in answers:
            for what, sets in found.tally:
                tally[what] = tally.get(what, 0) + sets


def _answer_portion(answer: Callable[[Blocks], list[Answers]], portion: Portion) -> list[Answers]:
    return answer(portion.blocks)


CHOICE_RESPONSES = ("T_max", "M_sup", "D_max", "C_max", "F_move", "F_largest")  # and one per robot

__all__ = ["CHOICE_RESPONSES", "Evaluation", "StepChoices", "Wanted", "evaluate_choices"]


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
    """

    engine: Engine
    schedule: Schedule
    wanted: Wanted
    resources: Resources = HERE

    @cached_property
    def streams(self) -> bool:
        """Whether there is memory for costs alone: responses then come, and go, step by step.

        Raises `MemoryShortError` if there is not even that.
        """
        most = self.resources.max_memory
        return require_memory(self.schedule, self.wanted, most) is Keeping.COSTS

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


@dataclass(frozen=True, repr=False)
class _Found(Terse):
    """What is kept of an evaluation; no steps where there is not the memory."""

    steps: tuple[StepChoices, ...]
    models: int
    seconds: float


def evaluate_choices(
    engine: Engine, schedule: Schedule, wanted: Wanted, resources: Resources = HERE
) -> tuple[tuple[StepChoices, ...], int]:
    """Solve every distinct model that the open steps of a schedule contain, once.

    ``engine``: what solves them; ``schedule``: whose open steps are evaluated; ``wanted``: which
    responses every move needs. Results: ``steps``: all open steps, in order; ``models``: how many
    different models there were: a model is a brick count and the nodes held. Raises
    `MechanismError`, `SolverError`, `WorkerError` as the engine does, and the workers;
    `MemoryShortError` if there is not the memory for them.
    """
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
                yield from group.blocks()

    total = sum(
        work(choices_of(schedule, step), step.bricks)
        for level in levels
        for steps in level
        for step in steps
    )
    found: list[Answers] = []
    resources = evaluation.resources
    with closing(
        answer_blocks(evaluation.engine, blocks(), total, resources, apart=apart)
    ) as answers:
        for each in answers:
            found.append(each)
            if len(found) == sum(group.count for group in under_way[0]):
                groups = under_way.popleft()
                yield _joined(groups, found), sum(len(group.states) for group in groups)
                found = []


def _joined(groups: Sequence[Batch], answers: Sequence[Answers]) -> list[StepChoices]:
    """Return the choices of all steps with as many bricks, in order."""
    out: list[StepChoices] = []
    start = 0
    for group in groups:
        out += group.choices(answers[start : start + group.count])
        start += group.count
    return sorted(out, key=lambda choices: choices.step.number)


def window_models(schedule: Schedule, choice: Sequence[int]) -> int:
    """Return how many distinct models a search of one move after the other looks at.

    A step that two moves share is then solved for the later one's candidates only, the earlier
    choice being made.

    ``choice``: the chosen candidate of every move.
    """
    models = 0
    for level in steps_of_batches(schedule):
        for steps in level:
            rows = np.concatenate([_window_states(schedule, step, choice) for step in steps])
            models += len(distinct(rows)[0])
    return models


def _window_states(schedule: Schedule, step: OpenStep, choice: Sequence[int]) -> np.ndarray:
    """Return the nodes held (S, r), ascending, for what is open once the earlier move is made."""
    if len(step.moves) == 2:
        first = step.moves[0]
        node = schedule.moves[first].candidates[choice[first]]
        grips = tuple(node if grip == OpenGrip(first) else grip for grip in step.grips)
        step = replace(step, grips=grips)
    rows = combinations(schedule, step)
    return np.sort(rows[no_node_twice(rows)], axis=1)
