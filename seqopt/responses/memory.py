"""Whether there is the memory for the responses of all choices, before they are computed."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Set
from enum import Enum
from pathlib import Path

from seqopt.errors import MemoryShortError
from seqopt.responses.alike import choices_of
from seqopt.sequence.schedule import Schedule

NUMBER = 8  # bytes
BESIDE = 6  # numbers per choice beside its responses: nodes, order, costs
COSTS = 4  # numbers per choice where costs alone are kept: as found, posed, handed over, solved
AT_ONCE = 24  # numbers per choice of the brick count that is being evaluated
SHARE = 0.8  # of the free memory that responses and costs may take
MEMORY = Path("/proc/meminfo")
OWN = Path("/proc/self/statm")
GROUPS = (
    (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current")),
    (
        Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
        Path("/sys/fs/cgroup/memory/memory.usage_in_bytes"),
    ),
)  # what a container may have, and has


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

    Parameters
    ----------
    schedule : Schedule

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


def free_memory() -> float:
    """Return how much memory can still be had.

    Returns
    -------
    float
        Bytes; infinite where the system does not say.
    """
    return max(min(_free_at_all(), _free_in_group(), _free_within_limit()), 0.0)


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

    Returns
    -------
    Keeping

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


def _free_at_all() -> float:
    if not MEMORY.exists():
        return math.inf
    rows = (line.split() for line in MEMORY.read_text(encoding="ascii").splitlines())
    return next((1024.0 * int(row[1]) for row in rows if row[0] == "MemAvailable:"), math.inf)


def _free_in_group() -> float:
    """Return what is left of the memory that a container may have."""
    for limit, used in GROUPS:
        try:
            return float(limit.read_text("ascii")) - float(used.read_text("ascii"))
        except (OSError, ValueError):  # not there, or "max"
            continue
    return math.inf


def _free_within_limit() -> float:
    """Return what is left of the addresses that this process may have."""
    if os.name != "posix":
        return math.inf
    import resource  # noqa: PLC0415  # POSIX has it alone

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return math.inf
    own = int(OWN.read_text("ascii").split()[0]) * resource.getpagesize() if OWN.exists() else 0
    return float(limit - own)
