"""The answer of a command, the three forms in which it is printed, and the exit status."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from importlib.metadata import version
from pathlib import Path
from typing import Any

from seqopt._cli.terminal import complain, show, show_text
from seqopt._registry import Later
from seqopt.errors import (
    InfeasibleError,
    MechanismError,
    NothingFoundError,
    ProblemError,
    SeqoptError,
    SolverError,
    TimeUpError,
    WorkerError,
)

FILES = Later("seqopt.exchange._files")  # of ``--json`` alone
LESS = "take fewer bricks, robots that reach less, or a computer with more memory"


class Status(IntEnum):
    """Exit status of a command."""

    DONE = 0
    DOES_NOT_HOLD = 1  # done, and something asked for does not hold
    BAD_INPUT = 2
    NO_ANSWER = 3  # infeasible, or a mechanism
    FAILED = 4  # a solver, a search, workers, or memory; says nothing about the structure
    CRASHED = 70  # an error of seqopt itself; no answer has this status
    INTERRUPTED = 130


def status_of(error: BaseException, said: Callable[[str], str] = str) -> Status:
    """Print an error as one line on standard error, and return the exit status.

    ``said``: returns a message in words of the command line.
    """
    if isinstance(error, KeyboardInterrupt):
        complain(f"seqopt: interrupted{f'; {error}' if str(error) else ''}")
        return Status.INTERRUPTED
    if isinstance(error, MemoryError):
        advice = "" if isinstance(error, SeqoptError) else f"; {LESS}"
        complain(f"seqopt: out of memory: {str(error) or 'no more is to be had'}{advice}")
        return Status.FAILED
    if isinstance(error, SolverError):
        ends = {TimeUpError: "time is over", NothingFoundError: "nothing found"}
        complain(f"seqopt: {ends.get(type(error), 'solver failed')}: {said(str(error))}")
        return Status.FAILED
    if isinstance(error, OSError) and not isinstance(error, SeqoptError):
        complain(f"seqopt: error: cannot write standard output: {error.strerror or error}")
        return Status.BAD_INPUT
    complain(f"seqopt: error: {said(str(error))}")
    if isinstance(error, WorkerError):
        return Status.FAILED
    none = isinstance(error, MechanismError | InfeasibleError)
    return Status.NO_ANSWER if none else Status.BAD_INPUT


@dataclass(frozen=True, eq=False, repr=False)
class Answer:
    """The answer of a command: facts for scripts and text for people."""

    facts: Mapping[str, object]  # values, mappings, sequences, tables, and what makes them if asked
    text: str = ""  # lines on standard output
    data: str = ""  # a table as CSV for standard output, if no file or text is; else if it is quiet
    written: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()  # further remarks: lines on standard error
    failures: tuple[str, ...] = ()  # what went wrong although there is an answer: as notes
    status: Status = Status.DONE
    scene: Any = None  # of which it is


def answer_of(result: Any) -> Answer:
    """Return the answer of what a command returns: an answer, a table or a text."""
    if hasattr(result, "to_csv"):
        return Answer({"rows": result}, data=result.to_csv(index=False))
    if isinstance(result, str | None):
        return Answer({"text": result or ""}, text=result or "")
    if not isinstance(result, Answer):
        text = f"it returns {type(result).__name__}; return a text or a table"
        raise ProblemError(f"the command cannot be answered: {text}")
    return result


def scene_facts(scene: Any) -> dict[str, object]:
    """Return name and size of a scene."""
    return {
        "name": scene.name,
        "bricks": len(scene.bricks),
        "joints": len(scene.joints),
        "ground_ends": len(scene.grounds),
        "robots": [robot.name for robot in scene.robots],
    }


def print_answer(answer: Answer, command: str, *, quiet: bool, as_json: bool) -> Status:
    """Print an answer as text, paths or JSON; a closed output is no error if files are written."""
    if as_json:
        document = {
            "command": command,
            "seqopt": version("seqopt"),
            **({} if answer.scene is None else {"scene": scene_facts(answer.scene)}),
            **answer.facts,
            "written": answer.written,
            "notes": answer.notes,
            "failures": answer.failures,
            "exit_status": answer.status,
        }
        show(json.dumps(FILES.json_value(document), indent=2, allow_nan=False) + "\n")
    elif quiet:
        paths = "".join(f"{path}\n" for path in answer.written)
        show(answer.data or paths or f"{answer.text}\n")
    else:
        if answer.data and not answer.text:
            show(answer.data)
        if answer.text and not (answer.written and sys.stdout is None):
            show_text(answer.text)
    for text in (*(() if quiet else answer.notes), *answer.failures):
        complain(text)
    return answer.status
