"""Responses of every open step of a schedule, over the choices that are open in it.

Beside the responses of `seqopt.responses.quantities` there are those that belong to robots: the
force of each (``F_`` and its name, as `robot_response` writes it), of the one that takes its grip
(``F_move``) and the largest (``F_largest``), sizes without sign.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
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

    @property
    def steps(self) -> tuple[StepChoices, ...]:
        """All open steps, those of one brick count after the other.

        Raises `MechanismError`, `SolverError`, `WorkerError` as the engine does, and the workers;
        `MemoryShortError` if memory does not suffice.
        """
        return self._found[0]

    @cached_property
    def _found(self) -> tuple[tuple[StepChoices, ...], int, float]:
        """All open steps with their responses, the models solved for them, and the run time, s."""
        _require_memory(self.schedule, self.wanted, self.resources.max_memory)
        steps, models, start = list[StepChoices](), 0, time.perf_counter()
        works = {bricks: _work(self.schedule, own) for bricks, own in self._by_bricks.items()}
        total, resources = sum(works.values()), self.resources
        progress = Progress("responses", total, resources.progress)
        with keep(resources.executor, resources.workers):
            for bricks, own in self._by_bricks.items():
                sets = self._sets(bricks, total)
                steps += [self._choices(sets, step, {}) for step in own]
                models += sets.solved
                progress.add(works[bricks])
        return tuple(steps), models, time.perf_counter() - start

    @cached_property
    def _by_bricks(self) -> dict[int, list[OpenStep]]:
        """The open steps by how many bricks stand, ascending."""
        some = sorted((s for s in self.schedule.steps if s.moves), key=lambda step: step.bricks)
        return {bricks: [*own] for bricks, own in groupby(some, key=lambda step: step.bricks)}

    @property
    def is_kept(self) -> bool:
        """Whether the responses of all choices are computed."""
        return "_found" in vars(self)

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
        found = []
        for step in sorted(own, key=lambda step: step.number):
            if step.bricks not in self._windows:
                every = self._by_bricks.values()
                work = sum(_work(self.schedule, same, last=True) for same in every)
                self._windows[step.bricks] = self._sets(step.bricks, work)
            found.append(self._choices(self._windows[step.bricks], step, of))
        return tuple(found)

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
    possible = np.asarray((np.diff(np.sort(rows, axis=1), axis=1) > 0).all(axis=1))  # a node each
    if scene.has_arms:
        nodes_in_order = scene.placed_nodes
        order = np.argsort(nodes_in_order)
        places = np.zeros((len(rows), len(scene.robots)), dtype=np.int64)
        places[:, [*held]] = 1 + order[np.searchsorted(nodes_in_order, rows, sorter=order)]
        possible &= go_together(scene, step.bricks, places)
    return _Sets(shape, [*held], possible, scene.grip_kinds.numbers(rows[possible], [*held]))


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


_BESIDE = 6  # numbers per choice beside its responses: nodes, order, costs
_SHARE = 0.8  # of the free memory that responses and costs may take


def _require_memory(schedule: Schedule, wanted: Wanted, most: float | None) -> None:
    """Raise a `MemoryShortError` if the responses and costs of all choices take too much memory.

    ``most``: bytes that may be used; by default `_SHARE` of the free memory.
    """
    most = _SHARE * free_memory() if most is None else most
    needed = 8 * sum(  # bytes
        (len(wanted(schedule.moves[step.moves[-1]].bricks)) + _BESIDE)
        * _count(schedule, step.moves)
        for step in schedule.steps
        if step.moves
    )
    if needed > most:
        largest = max(len(move.candidates) for move in schedule.moves)
        raise MemoryShortError(
            f"the responses of all choices take about {needed / 1e9:.3g} GB, and "
            f"{most / 1e9:.3g} GB may be used; let robots reach less (a move has up to {largest} "
            "candidates), block nodes, take near candidates only, or search without proof"
        )
