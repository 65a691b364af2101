"""How long a call takes."""

import time
from collections.abc import Callable


def best(call: Callable[[], object], rounds: int) -> float:
    """Return the shortest of several runs, s."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)
