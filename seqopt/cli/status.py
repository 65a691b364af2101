"""Exit statuses: what the end of a command says to the program that called it."""

from __future__ import annotations

from enum import IntEnum

from seqopt.cli.saying.terminal import complain
from seqopt.errors import (
    InfeasibleError,
    MechanismError,
    SeqoptError,
    SolverError,
    TimeUpError,
    WorkerError,
)


class Status(IntEnum):
    """How a command ended."""

    DONE = 0
    DOES_NOT_HOLD = 1  # done, and something asked for does not hold
    BAD_INPUT = 2
    NO_ANSWER = 3  # infeasible, or a mechanism
    FAILED = 4  # a solver, workers, or memory; says nothing about the structure
    INTERRUPTED = 130


def status_of(error: BaseException) -> Status:
    """Say in a line on standard error what went wrong, and return the exit status.

    ``error``: an error of seqopt, of the system, of memory, or an interrupt.
    """
    if isinstance(error, KeyboardInterrupt):
        complain(f"seqopt: interrupted{f'; {error}' if str(error) else ''}")
        return Status.INTERRUPTED
    if isinstance(error, MemoryError):
        advice = "" if isinstance(error, SeqoptError) else f"; {LESS}"
        complain(f"seqopt: out of memory: {str(error) or 'no more is to be had'}{advice}")
        return Status.FAILED
    if isinstance(error, SolverError):
        what = "time is over" if isinstance(error, TimeUpError) else "solver failed"
        complain(f"seqopt: {what}: {error}")
        return Status.FAILED
    if isinstance(error, OSError) and not isinstance(error, SeqoptError):
        complain(f"seqopt: error: cannot write standard output: {error.strerror or error}")
        return Status.BAD_INPUT
    complain(f"seqopt: error: {error}")
    if isinstance(error, WorkerError):
        return Status.FAILED
    none = isinstance(error, MechanismError | InfeasibleError)
    return Status.NO_ANSWER if none else Status.BAD_INPUT


LESS = "take fewer bricks, robots that reach less, or a computer with more memory"
