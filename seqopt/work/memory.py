"""How much memory there is."""

from __future__ import annotations

import math
import os
from pathlib import Path

_MEMORY = Path("/proc/meminfo")
_OWN = Path("/proc/self/statm")
_GROUPS = (
    (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current")),
    (
        Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
        Path("/sys/fs/cgroup/memory/memory.usage_in_bytes"),
    ),
)  # what a container may have, and has


def free_memory() -> float:
    """Return how much memory can still be had.

    Result: bytes; infinite where the system does not say.
    """
    return max(min(_free_at_all(), _free_in_group(), _free_within_limit()), 0.0)


def _free_at_all() -> float:
    if not _MEMORY.exists():
        return math.inf
    rows = (line.split() for line in _MEMORY.read_text(encoding="ascii").splitlines())
    return next((1024.0 * int(row[1]) for row in rows if row[0] == "MemAvailable:"), math.inf)


def _free_in_group() -> float:
    """Return what is left of the memory that a container may have."""
    for limit, used in _GROUPS:
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
    own = int(_OWN.read_text("ascii").split()[0]) * resource.getpagesize() if _OWN.exists() else 0
    return float(limit - own)
