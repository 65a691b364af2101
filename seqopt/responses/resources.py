"""What a computation may use: processes or other machines."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace

from seqopt.errors import ProblemError
from seqopt.work.progress import Tell


@dataclass(frozen=True)
class Resources:
    """What a computation may use; no result depends on it.

    Parameters
    ----------
    workers : int, optional
        Processes to share the work among; with an executor, how many tasks it works on at once.
    executor : concurrent.futures.Executor, optional
        Any executor, instead of processes of our own. The caller ends it.
    progress : callable, optional
        Called with the progress, in a few words, of computations longer than a second.

    Raises
    ------
    ProblemError
        If a number is none that can be meant.

    Examples
    --------
    >>> Resources(workers=2).workers
    2
    """

    workers: int = 1
    executor: Executor | None = None
    progress: Tell | None = None

    def __post_init__(self) -> None:
        if isinstance(self.workers, bool) or not isinstance(self.workers, int) or self.workers < 1:
            raise ProblemError(f"workers is {self.workers!r}; give a whole number from 1")
        if not (self.executor is None or hasattr(self.executor, "submit")):
            raise ProblemError(
                f"executor: a {type(self.executor).__name__} is not an executor; "
                "give one of concurrent.futures, or workers"
            )

    def alone(self) -> Resources:
        """Return resources for little work: one process, without progress."""
        return replace(self, workers=1, executor=None, progress=None)


HERE = Resources()
"""This process alone."""
