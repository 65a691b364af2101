"""Checks, before computing, whether there is enough memory for the responses of all choices."""

from __future__ import annotations

import math
from collections.abc import Callable, Set
from enum import Enum

from seqopt.errors import MemoryShortError
from seqopt.responses.alike import choices_of
from seqopt.sequence.schedule import Schedule
from seqopt.work.memory import free_memory

NUMBER = 8  # bytes
BESIDE = 6  # numbers per choice beside its responses: nodes, order, costs
COSTS = 4  # numbers per choice where costs alone are kept: as found, posed, handed over, solved
AT_ONCE = 24  # numbers per choice of the brick count that is being evaluated
SHARE = 0.8  # of the free memory that responses and costs may take


class Keeping(Enum):
    """What is kept of the choices of a schedule."""

    RESPONSES = "responses"
    COSTS = "costs"  # responses come step by step, and go


def bytes_of_choices(schedule: Schedule, wanted: Callable[[int], Set[str]]) -> int:
    """Return what the responses of all choices of a schedule take, about.

    Parameters
    ----------
    schedule : Schedule
    wanted : callable
        Which responses every move needs.

    Returns
    -------
    int
        Bytes.
    """
    total = 0
    for step in schedule.steps:
        moves = [schedule.moves[m] for m in step.moves]
        if moves:
            kept = len(wanted(moves[-1].bricks)) + BESIDE
            total += NUMBER * kept * math.prod(len(move.candidates) for move in moves)
    return total


def bytes_of_costs(schedule: Schedule) -> int:
    """Return what the costs of all choices take, about, while responses come step by step.

    Returns
    -------
    int
        Bytes.
    """
    of_moves: dict[tuple[int, ...], int] = {}
    of_bricks: dict[int, int] = {}
    for step in schedule.steps:
        if step.moves:
            choices = choices_of(schedule, step)
            of_moves[step.moves] = choices
            of_bricks[step.bricks] = of_bricks.get(step.bricks, 0) + choices
    return NUMBER * (COSTS * sum(of_moves.values()) + AT_ONCE * max(of_bricks.values(), default=0))


def require_memory(
    schedule: Schedule, wanted: Callable[[int], Set[str]], most: float | None = None
) -> Keeping:
    """Return what can be kept of all choices; raise an error if not even their costs can be.

    Parameters
    ----------
    schedule : Schedule
    wanted : callable
        Which responses every move needs.
    most : float, optional
        Bytes that may be used; by default `SHARE` of what is free.

    Raises
    ------
    MemoryShortError
        Saying what would be needed.
    """
    most = SHARE * free_memory() if most is None else most
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
