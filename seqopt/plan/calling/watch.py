"""How a formulation is run, and a watch on it: its time limit, and what it has found so far."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
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


@dataclass(frozen=True)
class Finding:
    """What a formulation knew at a time.

    ``seconds``: since it began; ``objective``: of the best choice so far; infinite where there was
    none; ``bound``: the highest proven; minus infinity where there was none.
    """

    seconds: float
    objective: float
    bound: float

    @property
    def gap(self) -> float:
        """What the bound leaves open, over the size of the objective; infinite if either lacks."""
        left = self.objective - self.bound
        return left / max(abs(self.objective), abs(self.bound)) if left else 0.0

    def __str__(self) -> str:
        said = [f"{self.seconds:.2f} s"]
        said += [f"objective {self.objective:.6g}"] if math.isfinite(self.objective) else []
        said += [f"bound {self.bound:.6g}"] if math.isfinite(self.bound) else []
        if len(said) == 3:
            said.append(f"gap {100 * self.gap:.3g} %")
        return ", ".join(said)


class Watch:
    """A watch on one call of a formulation, which asks it for the time and tells it what it finds.

    ``time_limit``: after which the formulation is to stop, s; ``progress``: told every finding.

    Examples
    --------
    >>> watch = Watch(time_limit=60.0)
    >>> watch.tell(objective=12.0)
    >>> watch.tell(bound=9.0)
    >>> watch.over, [finding.objective for finding in watch.trace], watch.bound
    (False, [12.0, 12.0], 9.0)
    """

    def __init__(
        self, time_limit: float = math.inf, progress: Callable[[Finding], object] | None = None
    ) -> None:
        self._start = time.perf_counter()
        self._limit = time_limit
        self._progress = progress
        self._trace: list[Finding] = []
        self._interrupted = False

    @property
    def seconds(self) -> float:
        """Since the watch was started."""
        return time.perf_counter() - self._start

    @property
    def left(self) -> float:
        """How much time is left, s; zero where it is over."""
        return 0.0 if self._interrupted else max(0.0, self._limit - self.seconds)

    @property
    def over(self) -> bool:
        """Whether the time limit is reached, or somebody asked for an end."""
        return self._interrupted or self.seconds >= self._limit

    @property
    def interrupted(self) -> bool:
        """Whether somebody asked for an end."""
        return self._interrupted

    def interrupt(self) -> None:
        """Ask for an end: time is over from now on."""
        self._interrupted = True

    @property
    def trace(self) -> tuple[Finding, ...]:
        """What was found, in order."""
        return tuple(self._trace)

    @property
    def objective(self) -> float:
        """Of the best choice that was told."""
        return self._trace[-1].objective if self._trace else math.inf

    @property
    def bound(self) -> float:
        """The highest that was told."""
        return self._trace[-1].bound if self._trace else -math.inf

    def tell(self, objective: float = math.inf, bound: float = -math.inf) -> None:
        """Take note of a choice or a bound; what is no better than before is passed over.

        ``objective``, ``bound``: in the unit of the criterion.
        """
        if objective < self.objective or bound > self.bound or not self._trace:
            best = min(objective, self.objective)
            found = Finding(self.seconds, best, max(bound, self.bound))
            self._trace.append(found)
            if self._progress is not None:
                self._progress(found)


def trace_rows(trace: Sequence[Finding]) -> list[dict[str, float]]:
    """Return a trace as rows of a table.

    Result: columns ``seconds``, ``objective``, ``bound`` and ``gap``.
    """
    names = ("seconds", "objective", "bound", "gap")
    return [{name: getattr(found, name) for name in names} for found in trace]
