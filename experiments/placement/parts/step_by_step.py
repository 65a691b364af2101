"""Grips of a schedule chosen move by move, each the best for the steps until the next move."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np

from seqopt.engines.interface import Engine, Fields
from seqopt.engines.rigid.ungripped import Ungripped, ungripped_system
from seqopt.network.network import Network
from seqopt.responses.quantities import CHOSEN_BY, lengths
from seqopt.responses.staged import Placing, StagedState, next_state, state_fields
from seqopt.responses.table import step_fields
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.sequence.steps import Step

History = TypeVar("History")
Advance = Callable[[History, Step], tuple[History, Fields]]
"""Takes what came before and a step; returns what has come then, and the step's fields."""


def worst_ratio(network: Network, fields: Fields, limits: tuple[tuple[str, float], ...]) -> float:
    """Return the largest ratio of a response of one grip set to its limit."""
    found = {"F_largest": lengths(fields.grip_force).max(axis=1, initial=0.0)}
    names = [name for name, _ in limits if name not in found]
    found |= {name: CHOSEN_BY[name].of(network, fields) for name in names}
    return max(float(found[name][0]) / limit for name, limit in limits)


def from_scratch(engine: Engine) -> Advance[None]:
    """Return how an engine goes on: it knows nothing of the steps before."""
    return lambda _, step: (None, step_fields(engine, step))


def staged(network: Network, placing: Placing) -> Advance[StagedState]:
    """Return how a staged analysis goes on."""
    parts: dict[int, Ungripped] = {}

    def advance(before: StagedState, step: Step) -> tuple[StagedState, Fields]:
        if step.bricks not in parts:
            parts[step.bricks] = ungripped_system(network, step.bricks)
        after = next_state(parts[step.bricks], before, step, placing)
        return after, state_fields(parts[step.bricks], after)

    return advance


def nothing_yet(network: Network) -> StagedState:
    """Return the state before the first brick."""
    return StagedState(0, np.zeros(0), np.zeros((len(network.springs.since), 6)), np.zeros(0))


def choose(
    schedule: Schedule,
    advance: Advance[History],
    start: History,
    cost: Callable[[Fields], float],
) -> tuple[int, ...]:
    """Return a node for every move; of two as good the first.

    A move is judged by the worst step from the one in which it takes its grip to the one before
    the next move takes its own.
    """
    history, nodes = start, []
    for step in schedule.steps[: schedule.moves[0].step - 1 if schedule.moves else None]:
        history, _ = advance(history, _closed(step, []))
    for number in range(len(schedule.moves)):
        ways = [
            (*_until_next(schedule, [*nodes, node], advance, history, cost), node)
            for node in _free(schedule, number, nodes)
        ]
        _, history, node = min(ways, key=lambda way: way[0])
        nodes.append(node)
    return tuple(nodes)


def _until_next(
    schedule: Schedule,
    nodes: list[int],
    advance: Advance[History],
    history: History,
    cost: Callable[[Fields], float],
) -> tuple[float, History]:
    """Return the worst cost of the steps that the last of the nodes decides, and what then is."""
    worst = 0.0
    for step in _decided(schedule, len(nodes) - 1):
        history, fields = advance(history, _closed(step, nodes))
        worst = max(worst, cost(fields))
    return worst, history


def _decided(schedule: Schedule, number: int) -> Iterator[OpenStep]:
    """Yield the steps from a move to the next one."""
    ends = [move.step for move in schedule.moves[1:]] + [len(schedule.steps) + 1]
    yield from schedule.steps[schedule.moves[number].step - 1 : ends[number] - 1]


def _free(schedule: Schedule, number: int, nodes: list[int]) -> list[int]:
    """Return the candidates of a move that the move before does not hold at the same time."""
    step = schedule.steps[schedule.moves[number].step - 1]
    taken = {nodes[move] for move in step.moves if move < number}
    return [node for node in schedule.moves[number].candidates if node not in taken]


def _closed(step: OpenStep, nodes: list[int]) -> Step:
    grips = tuple(nodes[g.move] if isinstance(g, OpenGrip) else g for g in step.grips)
    return Step(step.number, step.kind, step.bricks, grips)
