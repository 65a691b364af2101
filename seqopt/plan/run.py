"""How a formulation is to be run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Run:
    """How long a formulation may take, who is told what it finds, and which models it is given.

    ``time_limit``: s; ``proof``: whether the answer is proven; ``lazy``: whether only models that
    the proof needs are solved; ``options``: of the formulation.
    """

    time_limit: float = math.inf
    progress: Callable[[Any], object] | None = None
    proof: bool = True
    lazy: bool = False
    options: dict[str, Any] = field(default_factory=dict)


@contextmanager
def timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Note how long something takes under the name of a stage."""
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start
