"""Blocks of states shared out: to this process or others, with what is stored left out."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from itertools import count, zip_longest
from typing import TypeVar

import numpy as np

from seqopt.engines.interface import Engine
from seqopt.responses.blocks import Answers, Block, Blocks, Store, open_store, tally_of, worker_for
from seqopt.responses.resources import Resources
from seqopt.work.progress import Progress
from seqopt.work.workers import Crew, Lanes, hire, map_ordered

_Found = TypeVar("_Found")
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


def in_places(places: Iterable[int], results: Iterable[_Found]) -> Iterator[_Found]:
    """Yield results in the order of their places, each as soon as those before it are there.

    ``places``: from 0, each once, in the order of the results.
    """
    waiting: dict[int, _Found] = {}
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
