"""Open steps with as many bricks and as many grips: their choices, and the states in them, once.

Different choices in different steps are often one state: a brick count and the nodes held.

Before computing, it is checked whether there is enough memory for the responses of all choices.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from enum import Enum
from itertools import groupby
from typing import Protocol

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import MemoryShortError
from seqopt.responses.blocks import Answers, Block
from seqopt.responses.quantities import CHOSEN_BY, robot_response
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.work.memory import free_memory

BLOCK = 2048  # grip sets whose fields are held at once: few enough to stay in the cache


@dataclass(frozen=True, eq=False, repr=False)
class StepChoices(FrozenValue):
    """One open step of a schedule and what every choice in it leads to.

    Attributes
    ----------
    step : OpenStep
        Which step of the schedule it is.
    moves : tuple of int
        Index of every open move: one, or two neighboring ones.
    responses : mapping of str to (C,) or (C, D) float
        Over the candidates of the moves; SI units, sizes without sign; NaN where two robots would
        hold one node, all NaN for a robot that does not grip.
    """

    step: OpenStep
    moves: tuple[int, ...]
    responses: Mapping[str, Floats]


class Wanted(Protocol):
    """Which responses a move needs."""

    def __call__(self, bricks: int) -> Set[str]:
        """Return the names of the responses that a move needs.

        Parameters
        ----------
        bricks : int
            Bricks placed when the move is made.

        Returns
        -------
        set of str
        """


@dataclass(frozen=True, eq=False, repr=False)
class Batch(FrozenValue):
    """Open steps with as many bricks and as many grips."""

    schedule: Schedule
    steps: tuple[OpenStep, ...]
    names: tuple[frozenset[str], ...]  # responses that each step needs
    rows: Ints  # (P, r); nodes held, for all possible choices of one step after the other
    possible: tuple[Bools, ...]  # (C,); which choices of each step leave no node held twice
    states: Ints  # (S, r); the different sets of nodes in them, ascending
    state: Ints  # (P,); which of these each choice leads to

    def blocks(self) -> Iterator[Block]:
        """Yield the states in blocks, one at least."""
        names = tuple(sorted(frozenset().union(*self.names) & CHOSEN_BY.keys()))
        for start in range(0, max(len(self.states), 1), BLOCK):
            yield Block(self.steps[0].bricks, self.states[start : start + BLOCK].copy(), names)

    @property
    def count(self) -> int:
        """How many blocks there are."""
        return max(-(-len(self.states) // BLOCK), 1)

    def choices(self, answers: Sequence[Answers]) -> list[StepChoices]:
        """Return the responses of every step's choices. ``answers``: to the blocks."""
        values = {k: np.concatenate([a.values[k] for a in answers]) for k in answers[0].values}
        forces = np.concatenate([a.forces for a in answers])
        ends = np.cumsum([ok.sum() for ok in self.possible])
        out = []
        for step, mine, ok, end in zip(self.steps, self.names, self.possible, ends, strict=True):
            part = slice(end - ok.sum(), end)
            index = self.state[part]
            by_robot = np.argsort(np.argsort(self.rows[part], axis=1), axis=1)
            found = {name: answer[index] for name, answer in values.items() if name in mine}
            held = np.take_along_axis(forces[index], by_robot, axis=1)
            found |= _robot_forces(self.schedule, step, held)
            spread = {name: _spread(found.get(name), ok) for name in sorted(mine)}
            shape = tuple(len(self.schedule.moves[m].candidates) for m in step.moves)
            shaped = {name: each.reshape(shape) for name, each in spread.items()}
            out.append(StepChoices(step, step.moves, shaped))
        return out


def steps_of_batches(schedule: Schedule) -> list[list[list[OpenStep]]]:
    """Return the open steps of a schedule by brick count and, within it, by how many grips.

    Result: ascending.
    """
    keyed = sorted(
        (
            (step.bricks, len(_robots_holding(step)), step.number, step)
            for step in schedule.steps
            if step.moves
        ),
        key=lambda item: item[:3],
    )
    return [
        [[item[3] for item in same] for _, same in groupby(level, key=lambda item: item[1])]
        for _, level in groupby(keyed, key=lambda item: item[0])
    ]


def choices_of(schedule: Schedule, step: OpenStep) -> int:
    """Return how many choices a step has, impossible ones among them."""
    return math.prod(len(schedule.moves[m].candidates) for m in step.moves)


def batch_of(schedule: Schedule, steps: Sequence[OpenStep], wanted: Wanted) -> Batch:
    """Return what open steps with as many bricks and as many grips have in common.

    ``wanted``: which responses every move needs.
    """
    names = tuple(frozenset(wanted(schedule.moves[step.moves[-1]].bricks)) for step in steps)
    choices = [combinations(schedule, step) for step in steps]
    possible = tuple(no_node_twice(rows) for rows in choices)
    rows = np.concatenate([rows[ok] for rows, ok in zip(choices, possible, strict=True)])
    states, state = distinct(np.sort(rows, axis=1))
    return Batch(schedule, tuple(steps), names, rows, possible, states, state)


def _spread(values: Floats | None, possible: Bools) -> Floats:
    """Return values over all choices, NaN for impossible ones and for a robot that holds none."""
    out = np.full(possible.shape, np.nan)
    if values is not None:
        out[possible] = values
    return out


def distinct(rows: Ints) -> tuple[Ints, Ints]:
    """Return the distinct rows, ascending, and which of them each row is.

    Four times as fast as ``numpy.unique``, which sorts rows as if they were text.

    ``rows`` (P, r). Results: ``rows`` (S, r); ``which`` (P,).
    """
    order = np.lexsort(rows.T[::-1])
    ranked = rows[order]
    first = np.ones(len(rows), dtype=bool)
    first[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    back = np.empty(len(rows), dtype=np.int64)
    back[order] = np.cumsum(first) - 1
    return ranked[first], back


def _robots_holding(step: OpenStep) -> list[int]:
    """Return which of the scene's robots grip."""
    return [i for i, grip in enumerate(step.grips) if grip is not None]


def combinations(schedule: Schedule, step: OpenStep) -> Ints:
    """Return the nodes held for all combinations of the open moves of a step.

    Result (choices, grips).
    """
    candidates = [np.array(schedule.moves[m].candidates, dtype=np.int64) for m in step.moves]
    grid = np.meshgrid(*candidates, indexing="ij")
    columns = []
    for robot in _robots_holding(step):
        grip = step.grips[robot]
        if isinstance(grip, OpenGrip):
            columns.append(grid[step.moves.index(grip.move)].ravel())
        else:
            columns.append(np.full(grid[0].size, grip))
    return np.stack(columns, axis=1).astype(np.int64)


def no_node_twice(rows: Ints) -> Bools:
    """Return which rows name no node twice. ``rows`` (P, r). Result (P,)."""
    return np.asarray((np.diff(np.sort(rows, axis=1), axis=1) > 0).all(axis=1))


def _robot_forces(schedule: Schedule, step: OpenStep, forces: Floats) -> dict[str, Floats]:
    """Return the forces by robot, of the robot whose move decides the step, and the largest."""
    robots = [schedule.scene.robots[i].name for i in _robots_holding(step)]
    out = {robot_response(name): forces[:, i] for i, name in enumerate(robots)}
    out["F_move"] = out[robot_response(schedule.moves[step.moves[-1]].robot)]
    out["F_largest"] = forces.max(axis=1)
    return out


_NUMBER = 8  # bytes
_BESIDE = 6  # numbers per choice beside its responses: nodes, order, costs
_COSTS = 4  # numbers per choice where costs alone are kept: as found, posed, handed over, solved
_AT_ONCE = 24  # numbers per choice of the brick count that is being evaluated
_SHARE = 0.8  # of the free memory that responses and costs may take


class Keeping(Enum):
    """What is kept of the choices of a schedule."""

    RESPONSES = "responses"
    COSTS = "costs"  # responses come step by step, and go


def bytes_of_choices(schedule: Schedule, wanted: Callable[[int], Set[str]]) -> int:
    """Return what the responses of all choices of a schedule take, about.

    ``wanted``: which responses every move needs. Result: bytes.
    """
    total = 0
    for step in schedule.steps:
        moves = [schedule.moves[m] for m in step.moves]
        if moves:
            kept = len(wanted(moves[-1].bricks)) + _BESIDE
            total += _NUMBER * kept * math.prod(len(move.candidates) for move in moves)
    return total


def bytes_of_costs(schedule: Schedule) -> int:
    """Return what the costs of all choices take, about, while responses come step by step.

    Result: bytes.
    """
    of_moves: dict[tuple[int, ...], int] = {}
    of_bricks: dict[int, int] = {}
    for step in schedule.steps:
        if step.moves:
            choices = choices_of(schedule, step)
            of_moves[step.moves] = choices
            of_bricks[step.bricks] = of_bricks.get(step.bricks, 0) + choices
    return _NUMBER * (
        _COSTS * sum(of_moves.values()) + _AT_ONCE * max(of_bricks.values(), default=0)
    )


def require_memory(
    schedule: Schedule, wanted: Callable[[int], Set[str]], most: float | None = None
) -> Keeping:
    """Return what can be kept of all choices; raise an error if not even their costs can be.

    ``wanted``: which responses every move needs. ``most``: bytes that may be used; by default
    `_SHARE` of what is free.
    """
    most = _SHARE * free_memory() if most is None else most
    if bytes_of_choices(schedule, wanted) <= most:
        return Keeping.RESPONSES
    needed = bytes_of_costs(schedule)
    if needed <= most:
        return Keeping.COSTS
    largest = max(len(move.candidates) for move in schedule.moves)
    raise MemoryShortError(
        f"the costs of all choices take about {needed / 1e9:.3g} GB, and {most / 1e9:.3g} GB may "
        f"be used; let robots reach less (a move has up to {largest} candidates), block nodes, "
        "take near candidates only, or search without proof"
    )
