"""Responses of every open step of a schedule, over the choices that are open in it.

Beside the responses of `seqopt.responses.quantities` there are those that belong to robots: the
force of each (``F_`` and its name, as `robot_response` writes it), of the one that takes its grip
(``F_move``) and the largest (``F_largest``), sizes without sign.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import or_
from typing import Protocol

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.engines.interface import Engine, Want
from seqopt.responses.memory import require_memory
from seqopt.responses.quantities import CHOSEN_BY, lengths, require_finite, robot_response
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule

BLOCK = 2048  # grip sets whose fields are held at once: few enough to stay in the cache
CHOICE_RESPONSES = ("T_max", "M_sup", "D_max", "C_max", "F_move", "F_largest")  # and one per robot


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


@dataclass(frozen=True)
class Evaluation:
    """The responses of all choices of a schedule, computed when they are first asked for.

    Parameters
    ----------
    engine : Engine
        What computes them.
    schedule : Schedule
        Whose open steps are evaluated.
    wanted : Wanted
        Which responses every move needs; no others are computed.
    """

    engine: Engine
    schedule: Schedule
    wanted: Wanted

    @cached_property
    def _found(self) -> tuple[tuple[StepChoices, ...], int, float]:
        start = time.perf_counter()
        steps, models = evaluate_choices(self.engine, self.schedule, self.wanted)
        return steps, models, time.perf_counter() - start

    @property
    def steps(self) -> tuple[StepChoices, ...]:
        """All open steps, in order."""
        return self._found[0]

    @property
    def models(self) -> int:
        """How many different models were solved for them."""
        return self._found[1]

    @property
    def seconds(self) -> float:
        """How long that took, s."""
        return self._found[2]


def evaluate_choices(
    engine: Engine, schedule: Schedule, wanted: Wanted
) -> tuple[tuple[StepChoices, ...], int]:
    """Solve every distinct model that the open steps of a schedule contain, once.

    Parameters
    ----------
    engine : Engine
        What solves them.
    schedule : Schedule
        Whose open steps are evaluated.
    wanted : Wanted
        Which responses every move needs.

    Returns
    -------
    steps : tuple of StepChoices
        All open steps, in order.
    models : int
        How many different models there were: a model is a brick count and the nodes held.

    Raises
    ------
    MechanismError, SolverError
        As the engine does.
    MemoryShortError
        If there is not the memory for them.
    """
    require_memory(schedule, wanted)
    alike: dict[tuple[int, int], list[OpenStep]] = {}
    for step in schedule.steps:
        if step.moves:
            alike.setdefault((step.bricks, len(_robots_holding(step))), []).append(step)
    out: list[StepChoices] = []
    models = 0
    for _, steps in sorted(alike.items()):
        found, count = _evaluate_alike(engine, schedule, steps, wanted)
        out += found
        models += count
    return tuple(sorted(out, key=lambda choices: choices.step.number)), models


def _evaluate_alike(
    engine: Engine, schedule: Schedule, steps: Sequence[OpenStep], wanted: Wanted
) -> tuple[list[StepChoices], int]:
    """Evaluate open steps with as many bricks and as many grips; count their distinct models."""
    names = [wanted(schedule.moves[step.moves[-1]].bricks) for step in steps]
    combinations = [_combinations(schedule, step) for step in steps]
    possible = [_no_node_twice(rows) for rows in combinations]
    rows = np.concatenate([rows[ok] for rows, ok in zip(combinations, possible, strict=True)])
    distinct, back = _distinct(np.sort(rows, axis=1))
    answers, forces = _answers(engine, steps[0].bricks, distinct, set().union(*names))
    ends = np.cumsum([ok.sum() for ok in possible])
    out = []
    for step, mine, ok, end in zip(steps, names, possible, ends, strict=True):
        part = slice(end - ok.sum(), end)
        index = back[part]
        by_robot = np.argsort(np.argsort(rows[part], axis=1), axis=1)
        found = {name: values[index] for name, values in answers.items()}
        found |= _robot_forces(schedule, step, np.take_along_axis(forces[index], by_robot, axis=1))
        spread = {name: _spread(found.get(name), ok) for name in sorted(mine)}
        shape = tuple(len(schedule.moves[m].candidates) for m in step.moves)
        shaped = {name: values.reshape(shape) for name, values in spread.items()}
        out.append(StepChoices(step, step.moves, shaped))
    return out, len(distinct)


def _spread(values: Floats | None, possible: Bools) -> Floats:
    """Return values over all choices, NaN for impossible ones and for a robot that holds none."""
    out = np.full(possible.shape, np.nan)
    if values is not None:
        out[possible] = values
    return out


def _distinct(rows: Ints) -> tuple[Ints, Ints]:
    """Return the distinct rows, ascending, and which of them each row is.

    Four times as fast as ``numpy.unique``, which sorts rows as if they were text.
    """
    order = np.lexsort(rows.T[::-1])
    ranked = rows[order]
    first = np.ones(len(rows), dtype=bool)
    first[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    back = np.empty(len(rows), dtype=np.int64)
    back[order] = np.cumsum(first) - 1
    return ranked[first], back


def window_models(schedule: Schedule, choice: Sequence[int]) -> int:
    """Return how many distinct models a search of one move after the other looks at.

    A step that two moves share is then solved for the later one's candidates only, the earlier
    choice being made.

    Parameters
    ----------
    schedule : Schedule
    choice : sequence of int
        The chosen candidate of every move.

    Returns
    -------
    int
    """
    seen: set[tuple[int, ...]] = set()
    for step in schedule.steps:
        if not step.moves:
            continue
        rows = _combinations(schedule, step)
        if len(step.moves) == 2:
            first = step.moves[0]
            node = schedule.moves[first].candidates[choice[first]]
            at = _robots_holding(step).index(step.grips.index(OpenGrip(first)))
            rows = rows[rows[:, at] == node]
        rows = np.sort(rows[_no_node_twice(rows)], axis=1)
        seen |= {(step.bricks, *row) for row in rows.tolist()}
    return len(seen)


def _robots_holding(step: OpenStep) -> list[int]:
    """Return which of the scene's robots grip."""
    return [i for i, grip in enumerate(step.grips) if grip is not None]


def _combinations(schedule: Schedule, step: OpenStep) -> Ints:
    """Return the nodes held, (choices, grips), for all combinations of the open moves."""
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


def _no_node_twice(rows: Ints) -> Bools:
    return np.asarray((np.diff(np.sort(rows, axis=1), axis=1) > 0).all(axis=1))


def _answers(
    engine: Engine, bricks: int, grips: Ints, names: Set[str]
) -> tuple[dict[str, Floats], Floats]:
    """Return the wanted responses of grip sets (S, r) and the sizes (S, r) of their forces."""
    asked = [CHOSEN_BY[name] for name in sorted(names & CHOSEN_BY.keys())]
    want = reduce(or_, (response.needs for response in asked), Want.SCREEN)
    found: dict[str, list[Floats]] = {response.name: [] for response in asked}
    forces = []
    for start in range(0, max(len(grips), 1), BLOCK):
        fields = engine.solve(bricks, grips[start : start + BLOCK], want)
        forces.append(require_finite("grip force", lengths(fields.grip_force), bricks))
        for response in asked:
            values = response.of(engine.network, fields)
            found[response.name].append(require_finite(response.name, values, bricks))
    return {name: np.concatenate(parts) for name, parts in found.items()}, np.concatenate(forces)


def _robot_forces(schedule: Schedule, step: OpenStep, forces: Floats) -> dict[str, Floats]:
    """Return the forces by robot, of the robot whose move decides the step, and the largest."""
    robots = [schedule.scene.robots[i].name for i in _robots_holding(step)]
    out = {robot_response(name): forces[:, i] for i, name in enumerate(robots)}
    out["F_move"] = out[robot_response(schedule.moves[step.moves[-1]].robot)]
    out["F_largest"] = forces.max(axis=1)
    return out
