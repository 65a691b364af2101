"""Responses of every state of a schedule over the choices that are open in it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule

BLOCK = 2048  # grip sets whose fields are held at once: few enough to stay in the cache
SCALARS = ("T_max", "M_sup", "D_max", "F_move", "F_largest")  # beside the force of every robot
SOURCES = {"T_max": Want.EDGES, "M_sup": Want.SUPPORT, "D_max": Want.DISPLACEMENTS}


@dataclass(frozen=True)
class StepChoices:
    """One step of a schedule and what every choice in it leads to.

    Attributes
    ----------
    step : OpenStep
    moves : tuple of int
        The open moves: one, or two neighboring ones.
    responses : mapping of str to (C,) or (C, D) float
        Over the candidates of the moves; SI units, sizes without sign; NaN where two robots would
        hold one node, all NaN for a robot that does not grip.
    """

    step: OpenStep
    moves: tuple[int, ...]
    responses: Mapping[str, Floats]


@dataclass(frozen=True)
class Evaluation:
    """All open states of a schedule, and how many models were solved for them."""

    states: tuple[StepChoices, ...]
    models: int


def evaluate_choices(
    engine: Engine, schedule: Schedule, wanted: Callable[[int], Iterable[str]]
) -> Evaluation:
    """Solve every distinct model that the open states of a schedule contain, once.

    Parameters
    ----------
    engine : Engine
    schedule : Schedule
    wanted : callable
        The names of the responses that a move needs when it is made with so many bricks placed.
    """
    shapes: dict[tuple[int, int], list[OpenStep]] = {}
    for step in schedule.steps:
        if step.moves:
            shapes.setdefault((step.bricks, len(_held(step))), []).append(step)
    states: dict[int, StepChoices] = {}
    models = 0
    for (bricks, _), steps in sorted(shapes.items()):
        names = [set(wanted(schedule.moves[step.moves[-1]].bricks)) for step in steps]
        combos = [_combinations(schedule, step) for step in steps]
        valid = [_valid(rows) for rows in combos]
        rows = np.concatenate([rows[ok] for rows, ok in zip(combos, valid, strict=True)])
        distinct, back = _distinct(np.sort(rows, axis=1))
        models += len(distinct)
        union = set().union(*names)
        answers = _answers(engine, bricks, distinct, union)
        starts = np.cumsum([0, *(ok.sum() for ok in valid)])
        for i, step in enumerate(steps):
            part = slice(starts[i], starts[i + 1])
            order = np.argsort(np.argsort(rows[part], axis=1), axis=1)
            index = back[part]
            found = {name: values[index] for name, values in answers.items() if values.ndim == 1}
            forces = np.take_along_axis(answers["F"][index], order, axis=1)
            found |= _robot_forces(schedule, step, forces)
            states[step.number] = _step_choices(schedule, step, found, valid[i], names[i])
    return Evaluation(tuple(states[n] for n in sorted(states)), models)


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

    A state that two moves share is then solved for the later one's candidates only, the earlier
    choice being made.
    """
    seen: set[tuple[int, ...]] = set()
    for step in schedule.steps:
        if not step.moves:
            continue
        rows = _combinations(schedule, step)
        if len(step.moves) == 2:
            first = step.moves[0]
            node = schedule.moves[first].candidates[choice[first]]
            at = _held(step).index(step.grips.index(OpenGrip(first)))
            rows = rows[rows[:, at] == node]
        rows = np.sort(rows[_valid(rows)], axis=1)
        seen |= {(step.bricks, *row) for row in rows.tolist()}
    return len(seen)


def _held(step: OpenStep) -> list[int]:
    """Return the places of the robots that grip."""
    return [i for i, grip in enumerate(step.grips) if grip is not None]


def _combinations(schedule: Schedule, step: OpenStep) -> Ints:
    """Return the nodes held, (choices, grips), for all combinations of the open moves."""
    candidates = [np.array(schedule.moves[m].candidates, dtype=np.int64) for m in step.moves]
    grid = np.meshgrid(*candidates, indexing="ij")
    columns = []
    for robot in _held(step):
        grip = step.grips[robot]
        if isinstance(grip, OpenGrip):
            columns.append(grid[step.moves.index(grip.move)].ravel())
        else:
            columns.append(np.full(grid[0].size, grip))
    return np.stack(columns, axis=1).astype(np.int64)


def _valid(rows: Ints) -> np.ndarray:
    """Return which rows name no node twice."""
    return np.asarray((np.diff(np.sort(rows, axis=1), axis=1) > 0).all(axis=1))


def _want(names: set[str]) -> Want:
    want = Want(0)
    for name in names & SOURCES.keys():
        want |= SOURCES[name]
    return want


def _answers(engine: Engine, bricks: int, grips: Ints, names: set[str]) -> dict[str, Floats]:
    """Return the wanted responses of grip sets (S, r); see `_selected`."""
    starts = range(0, max(len(grips), 1), BLOCK)
    want = _want(names)
    parts = [_selected(engine.solve(bricks, grips[i : i + BLOCK], want), names) for i in starts]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _selected(fields: Fields, names: set[str]) -> dict[str, Floats]:
    """Return the wanted scalar responses and, as ``F``, the size of every grip force."""
    out = {"F": np.sqrt(_squared(fields.grip_force))}
    if "T_max" in names:
        out["T_max"] = fields.edge_force.max(axis=1)
    if "M_sup" in names:
        out["M_sup"] = np.sqrt(_squared(fields.support[:, 3:]))
    if "D_max" in names:
        out["D_max"] = np.sqrt(_squared(fields.displacement).max(axis=1))
    return out


def _squared(vectors: Floats) -> Floats:
    """Return the squared lengths of vectors (..., 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)  # adding whole arrays outruns sums of three
    return np.asarray(x * x + y * y + z * z)


def _robot_forces(schedule: Schedule, step: OpenStep, forces: Floats) -> dict[str, Floats]:
    """Return the forces by robot, of the robot whose move decides the state, and the largest."""
    robots = [schedule.scene.robots[i].name for i in _held(step)]
    out = {f"F_{name}": forces[:, i] for i, name in enumerate(robots)}
    out["F_move"] = out[f"F_{schedule.moves[step.moves[-1]].robot}"]
    out["F_largest"] = forces.max(axis=1)
    return out


def _step_choices(
    schedule: Schedule,
    step: OpenStep,
    found: Mapping[str, Floats],
    valid: np.ndarray,
    names: set[str],
) -> StepChoices:
    shape = tuple(len(schedule.moves[m].candidates) for m in step.moves)
    spread = {}
    for name in sorted(names):
        values = np.full(valid.shape, np.nan)
        if name in found:
            values[valid] = found[name]
        values.flags.writeable = False
        spread[name] = values.reshape(shape)
    return StepChoices(step, step.moves, spread)
