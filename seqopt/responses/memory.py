"""Whether there is the memory for the responses of all choices, before they are computed."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Set
from pathlib import Path

from seqopt.errors import MemoryShortError
from seqopt.sequence.schedule import Schedule

NUMBER = 8  # bytes
BESIDE = 6  # numbers per choice beside its responses: nodes, order, costs
MEMORY = Path("/proc/meminfo")


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


def free_memory() -> float:
    """Return how much memory can still be had.

    Returns
    -------
    float
        Bytes; infinite where the system does not say.
    """
    free = math.inf
    if MEMORY.exists():
        rows = (line.split() for line in MEMORY.read_text(encoding="ascii").splitlines())
        free = next((1024.0 * int(row[1]) for row in rows if row[0] == "MemAvailable:"), free)
    if os.name == "posix":
        import resource  # noqa: PLC0415  # POSIX has it alone

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            free = min(free, float(limit))
    return free


def require_memory(schedule: Schedule, wanted: Callable[[int], Set[str]]) -> None:
    """Raise an error if the responses of all choices do not fit into memory.

    Parameters
    ----------
    schedule : Schedule
    wanted : callable
        Which responses every move needs.

    Raises
    ------
    MemoryShortError
        Saying what would be needed.
    """
    needed, free = bytes_of_choices(schedule, wanted), free_memory()
    if needed > free:
        most = max(len(move.candidates) for move in schedule.moves)
        raise MemoryShortError(
            f"the responses of all choices take about {needed / 1e9:.3g} GB, and {free / 1e9:.3g} "
            f"GB are free; let robots reach less (a move has up to {most} candidates), block "
            "nodes, or search without proof"
        )
