"""Responses of every open step of a schedule, over the choices that are open in it.

Beside the responses of `seqopt.responses.quantities` there are those that belong to robots: the
force of each (``F_`` and its name, as `robot_response` writes it), of the one that takes its grip
(``F_move``) and the largest (``F_largest``), sizes without sign.

If the responses of all choices exceed the memory limit, they are computed by brick count, and only
costs are kept.
"""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import NamedTuple, TypeAlias, cast

import numpy as np
import pandas as pd

from seqopt.arrays import Bools, Floats, FrozenValue, Ints, Terse
from seqopt.engines.interface import Engine
from seqopt.errors import MemoryShortError
from seqopt.responses._blocks import work
from seqopt.responses._grip_sets import GripSets
from seqopt.responses._tolerance import COLUMN, is_tolerance, tolerances_along
from seqopt.responses.quantities import CHOSEN_BY, OFFERED, PROP_EXCESS, TOLERANCE, robot_response
from seqopt.responses.resources import HERE, Resources
from seqopt.responses.table import analyze
from seqopt.scene._armed import go_together
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.sequence.steps import Grips, Step
from seqopt.work._workers import free_memory, keep
from seqopt.work.progress import Progress

CHOICE_RESPONSES = (*OFFERED, "F_move", "F_largest")  # and one per robot

Wanted: TypeAlias = Callable[[int], Set[str]]
"""Returns the names of the responses that a move needs, given the bricks placed when it is made."""


@dataclass(frozen=True, eq=False, repr=False)
class StepChoices(FrozenValue):
    """One open step of a schedule, and the responses of every choice.

    Attributes
    ----------
    step : OpenStep
        Which step of the schedule it is.
    moves : tuple of int
        Index of every open move: one, or two neighboring ones.
    responses : mapping of str to (C,) or (C, D) float
        Over the candidates of the moves; SI units, sizes without sign; NaN where two robots would
        hold one node, all NaN for a robot that does not grip. Of a window, where the earlier move
        is chosen, over the candidates of the later one.
    """

    step: OpenStep
    moves: tuple[int, ...]
    responses: Mapping[str, Floats]


class _Sets(NamedTuple):
    """The grip sets of a step's choices, (p, r) of those that are possible, (P,)."""

    shape: tuple[int, ...]  # candidates of the moves that are not chosen yet
    robots: Sequence[int]  # that hold, by column
    possible: Bools
    grips: Ints


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
    """

    engine: Engine
    schedule: Schedule
    wanted: Wanted
    resources: Resources = HERE

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
        if not any(map(is_tolerance, names)):
            return self._given_table
        return self._given_table.assign(**{COLUMN: tolerances_along(self.engine, self.given)})

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
        kept = not self.streams
        if self._kept and kept:
            yield self._kept[0][0]
            return
        steps, models, seconds = list[StepChoices](), 0, 0.0
        works = {bricks: _work(self.schedule, own) for bricks, own in self._by_bricks.items()}
        total, resources = sum(works.values()), self.resources
        progress = Progress("responses", total, resources.progress)
        with keep(resources.executor, resources.workers):
            for bricks, own in self._by_bricks.items():
                start = time.perf_counter()
                sets = self._sets(bricks, total)
                found = [self._choices(sets, step, {}) for step in own]
                models, seconds = models + sets.solved, seconds + time.perf_counter() - start
                progress.add(works[bricks])
                steps += found if kept else ()
                yield found
        self._kept[:] = [(tuple(steps), models, seconds)]

    @cached_property
    def _by_bricks(self) -> dict[int, list[OpenStep]]:
        """The open steps by how many bricks stand, ascending."""
        some = sorted((s for s in self.schedule.steps if s.moves), key=lambda step: step.bricks)
        return {bricks: [*own] for bricks, own in groupby(some, key=lambda step: step.bricks)}

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

    def window(self, move: int, before: int) -> tuple[StepChoices, ...]:
        """Return the steps that a move decides, with responses of its candidates, (C_k,).

        ``before``: the candidate that is chosen for the move before it. What windows of the same
        brick counts have in common is solved once.
        """
        steps, of = self.schedule.steps_of, {move - 1: before}
        own = [*steps.get((move - 1, move), ()), *steps.get((move,), ())]
        return tuple(
            self._choices(self._window_sets(step.bricks), step, of)
            for step in sorted(own, key=lambda step: step.number)
        )

    def _window_sets(self, bricks: int) -> GripSets:
        if bricks not in self._windows:
            work = sum(_work(self.schedule, own, last=True) for own in self._by_bricks.values())
            self._windows[bricks] = self._sets(bricks, work)
        return self._windows[bricks]

    @cached_property
    def _windows(self) -> dict[int, GripSets]:
        """The grip sets of windows that were looked at, by brick count."""
        return {}

    def _sets(self, bricks: int, work: float) -> GripSets:
        """Return grip sets with the responses that steps with so many bricks ask for."""
        moves = self.schedule.moves
        asked = {n for s in self._by_bricks[bricks] for n in self.wanted(moves[s.moves[-1]].bricks)}
        names = sorted(asked & {*CHOSEN_BY, PROP_EXCESS, TOLERANCE})
        quiet = replace(self.resources, progress=None)  # each call would begin anew
        return GripSets(self.engine, names, quiet, screen=True, loose=False, work=work)

    def _choices(self, sets: GripSets, step: OpenStep, chosen: Mapping[int, int]) -> StepChoices:
        """Return the responses of a step; ``chosen``: candidates of moves that are made."""
        shape, robots, possible, grips = _sets_of(self.schedule, step, chosen)
        values, forces = sets.of_grips(step.bricks, grips)
        scene, move = self.schedule.scene, self.schedule.moves[step.moves[-1]]
        found = dict(zip(sets.names, values.T, strict=True))
        found |= {
            robot_response(scene.robots[i].name): f for i, f in zip(robots, forces.T, strict=True)
        }
        found["F_move"] = found[robot_response(move.robot)]
        found["F_largest"] = forces.max(axis=1)
        shaped = {}
        for name in sorted(self.wanted(move.bricks)):  # NaN: impossible, or a robot holds none
            spread = np.full(len(possible), np.nan)
            if name in found:
                spread[possible] = found[name]
            shaped[name] = spread.reshape(shape)
        return StepChoices(step, step.moves, shaped)


def _sets_of(schedule: Schedule, step: OpenStep, chosen: Mapping[int, int]) -> _Sets:
    """Return the grip sets of a step's choices; ``chosen``: candidates of moves that are made."""
    moves, scene = schedule.moves, schedule.scene
    nodes = {m: np.array(moves[m].candidates, dtype=np.int64) for m in step.moves}
    open_ = [m for m in step.moves if m not in chosen]
    shape = tuple(len(nodes[m]) for m in open_)
    grid = dict(zip(open_, np.meshgrid(*(nodes[m] for m in open_), indexing="ij"), strict=True))
    held = {i: grip for i, grip in enumerate(step.grips) if grip is not None}
    columns = []
    for grip in held.values():
        if isinstance(grip, OpenGrip):
            own = grid.get(grip.move)
            columns.append(nodes[grip.move][chosen[grip.move]] if own is None else own)
        else:
            columns.append(np.int64(grip))
    rows = np.stack([np.broadcast_to(column, shape).ravel() for column in columns], axis=1)
    possible = (np.diff(np.sort(rows, axis=1), axis=1) > 0).all(axis=1)  # a node each
    possible &= _for_arms(scene, step, rows)
    return _Sets(shape, [*held], possible, scene.grip_kinds.numbers(rows[possible], [*held]))


def _for_arms(scene: Scene, step: OpenStep, rows: Ints) -> Bools:
    """Return which choices (P,) of a step are feasible for arms.

    ``rows`` (P, r): nodes held, by the robots that hold any, in their order.
    """
    if not scene.has_arms:
        return np.ones(len(rows), dtype=bool)
    nodes = scene.placed_nodes
    order = np.argsort(nodes)
    held = np.zeros((len(rows), len(scene.robots)), dtype=np.int64)
    robots = [robot for robot, grip in enumerate(step.grips) if grip is not None]
    held[:, robots] = 1 + order[np.searchsorted(nodes, rows, sorter=order)]
    return go_together(scene, step.bricks, held)


def _work(schedule: Schedule, steps: Iterable[OpenStep], *, last: bool = False) -> float:
    """Return the estimated work of steps, without unit; ``last``: of their last moves alone."""
    return sum(work(_count(schedule, s.moves[-1:] if last else s.moves), s.bricks) for s in steps)


def _count(schedule: Schedule, moves: Iterable[int]) -> int:
    """Return the number of choices of moves, including infeasible ones."""
    return math.prod(len(schedule.moves[m].candidates) for m in moves)


def window_models(schedule: Schedule, choice: Sequence[int]) -> int:
    """Return the number of distinct models of a search move by move.

    A step shared by two moves is then solved for candidates of the later one only, given the
    earlier choice.

    ``choice``: the chosen candidate of every move.
    """
    met: dict[int, set[bytes]] = {}
    for step in (step for step in schedule.steps if step.moves):
        first = {m: choice[m] for m in step.moves[:-1]}
        rows = np.sort(_sets_of(schedule, step, first).grips, axis=1)
        met.setdefault(step.bricks, set()).update(row.tobytes() for row in rows)
    return sum(map(len, met.values()))


_NUMBER = 8  # bytes
_BESIDE = 6  # numbers per choice beside its responses: nodes, order, costs
_COSTS = 4  # numbers per choice where costs alone are kept: as found, posed, handed over, solved
_AT_ONCE = 24  # numbers per choice of the brick count that is being evaluated
_SHARE = 0.8  # of the free memory that responses and costs may take


def _bytes_of_choices(schedule: Schedule, wanted: Wanted) -> int:
    """Estimate the memory of the responses of all choices of a schedule, bytes."""
    return sum(
        _NUMBER
        * (len(wanted(schedule.moves[step.moves[-1]].bricks)) + _BESIDE)
        * _count(schedule, step.moves)
        for step in schedule.steps
        if step.moves
    )


def _bytes_of_costs(schedule: Schedule) -> int:
    """Estimate the memory of all costs if responses are computed step by step, bytes."""
    of_moves: dict[tuple[int, ...], int] = {}
    of_bricks = Counter[int]()
    for step in (step for step in schedule.steps if step.moves):
        of_moves[step.moves] = _count(schedule, step.moves)
        of_bricks[step.bricks] += of_moves[step.moves]
    at_once = _AT_ONCE * max(of_bricks.values(), default=0)
    return _NUMBER * (_COSTS * sum(of_moves.values()) + at_once)


def require_memory(schedule: Schedule, wanted: Wanted, most: float | None = None) -> bool:
    """Return whether memory suffices for the responses of all choices, not only for costs.

    ``most``: bytes that may be used; by default `_SHARE` of the free memory. Raises
    `MemoryShortError` if it does not suffice for the costs.
    """
    most = _SHARE * free_memory() if most is None else most
    if _bytes_of_choices(schedule, wanted) <= most:
        return True
    needed = _bytes_of_costs(schedule)
    if needed <= most:
        return False
    largest = max(len(move.candidates) for move in schedule.moves)
    raise MemoryShortError(
        f"the costs of all choices take about {needed / 1e9:.3g} GB, and {most / 1e9:.3g} GB may "
        f"be used; let robots reach less (a move has up to {largest} candidates), block nodes, "
        "take near candidates only, or search without proof"
    )
