"""Blocks of states shared out: to this process or others, with what is stored left out."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial

from seqopt.engines.interface import Engine
from seqopt.responses.resources import Resources
from seqopt.responses.shipping import Blocks, worker_for
from seqopt.responses.states import Answers, Block, tally_of
from seqopt.responses.store import Store, open_store
from seqopt.work.crew import Crew, hire
from seqopt.work.ordered import map_ordered
from seqopt.work.progress import Progress

SEVERAL = 4  # portions' work that states of one brick count may be before they are parted
PORTIONS = 32  # tasks for every worker: one that is slow, or dies, leaves little to the others


@dataclass(frozen=True)
class Portion:
    """Blocks that are answered together.

    Attributes
    ----------
    blocks : tuple of Block
    stored : list of Answers or None
        Their answers, if they are known.
    """

    blocks: tuple[Block, ...]
    stored: list[Answers] | None = None

    @property
    def work(self) -> float:
        """About how much work they are, stored or not."""
        return sum(block.work for block in self.blocks)


def answer_blocks(
    engine: Engine, blocks: Iterable[Block], total: float, resources: Resources
) -> Generator[Answers, None, None]:
    """Return the answers to blocks of states, in their order.

    Parameters
    ----------
    engine : Engine
    blocks : iterable of Block
        Taken as they are needed.
    total : float
        About how much work they are.
    resources : Resources

    Yields
    ------
    Answers

    Raises
    ------
    MechanismError, SolverError, WorkerError
        As the engine does, and the workers.
    """
    store = open_store(resources.cache, engine)
    progress = Progress("responses", total, resources.progress)
    with hire(resources.executor, resources.workers) as crew:
        course = _Course(engine, store, progress, elsewhere=crew is not None)
        results = map_ordered(
            partial(_answer_portion, worker_for(engine, elsewhere=crew is not None)),
            share_out(blocks, store, total, crew),
            crew,
            course.stored,
            course.done,
        )
        with closing(results):
            for answers in results:
                yield from answers


def share_out(
    blocks: Iterable[Block], store: Store | None, total: float, crew: Crew | None
) -> Iterator[Portion]:
    """Return portions of about equal work, each of neighboring blocks; stored ones apart.

    Engines that grow with the structure serve ascending brick counts best, and what all states of
    one share they prepare once: portions keep the order of the blocks, and end between brick counts
    unless one has several portions' work.

    Parameters
    ----------
    blocks : iterable of Block
    store : Store or None
    total : float
        About how much work they are.
    crew : Crew or None
        Without one each block is a portion.

    Yields
    ------
    Portion
    """
    enough = 0.0 if crew is None else total / (PORTIONS * crew.workers)
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
    return work >= (enough if between else SEVERAL * enough) and bool(mine)


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
            for what, count in found.tally:
                tally[what] = tally.get(what, 0) + count


def _answer_portion(answer: Callable[[Blocks], list[Answers]], portion: Portion) -> list[Answers]:
    return answer(portion.blocks)
