"""What a command answers, and the three forms in which it is printed: text, quiet text, JSON."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from importlib.metadata import version
from pathlib import Path

from seqopt.cli.saying.terminal import complain, note, show, show_text
from seqopt.cli.status import Status


@dataclass(frozen=True)
class Answer:
    """What a command answers.

    ``facts``: what there is to know, for scripts: values, mappings, sequences and tables; ``text``:
    the same for people: lines on standard output; ``headings``: lines of the text that are
    headings; ``data``: a table as CSV that goes to standard output, where no file is written for
    it; ``written``: files and folders that were written; ``notes``: what else is worth knowing:
    lines on standard error; ``failures``: what went wrong although there is an answer: lines on
    standard error; ``status``: how the command ended.
    """

    facts: Mapping[str, object]
    text: str = ""
    headings: tuple[str, ...] = ()
    data: str = ""
    written: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    status: Status = Status.DONE

    def document(self, command: str) -> dict[str, object]:
        """Return what scripts are told.

        ``command``: its name. Result: ready for JSON: the facts between ``command``, ``seqopt``
        (the version) and ``written``, ``notes``, ``failures``, ``exit_status``.
        """
        return {
            "command": command,
            "seqopt": version("seqopt"),
            **{name: plain(value) for name, value in self.facts.items()},
            "written": [str(path) for path in self.written],
            "notes": list(self.notes),
            "failures": list(self.failures),
            "exit_status": int(self.status),
        }


def print_answer(answer: Answer, options: argparse.Namespace) -> Status:
    """Print an answer in the form that is asked for.

    ``options``: with ``command``, ``json`` and ``quiet``. Result: of the answer.
    """
    if options.json:
        show(json.dumps(answer.document(options.command), indent=2, allow_nan=False) + "\n")
    elif options.quiet:
        paths = "".join(f"{path}\n" for path in answer.written)
        show(answer.data or paths or f"{answer.text}\n")
    else:
        _print_text(answer)
    if not options.quiet:
        for text in answer.notes:
            note(text)
    for text in answer.failures:
        complain(text)
    return answer.status


def _print_text(answer: Answer) -> None:
    """Print an answer for people; where its files are written, nothing is lost if nobody hears."""
    if answer.data:
        show(answer.data)
    if answer.text and not (answer.written and sys.stdout is None):
        show_text(answer.text, answer.headings)


def plain(value: object) -> object:
    """Return a value as JSON can hold it, numbers with all of their digits.

    ``value``: also numpy's values and arrays, tables, paths and members of enumerations. Result:
    what is not known (NaN) as null, what is infinite as the text ``inf`` or ``-inf``; a table as a
    list of rows.

    Examples
    --------
    >>> plain({"gap": float("nan"), "bond": float("inf"), "nodes": (1, 20)})
    {'gap': None, 'bond': 'inf', 'nodes': [1, 20]}
    """
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, str | int | None):
        return value
    if isinstance(value, Mapping):
        return {str(name): plain(part) for name, part in value.items()}
    if isinstance(value, Sequence | set | frozenset):
        return [plain(part) for part in value]
    return _unpacked(value)


def _unpacked(value: object) -> object:
    """Return what a table, an array, a member of an enumeration or anything else holds."""
    import pandas as pd  # noqa: PLC0415  # help needs none of it

    if isinstance(value, pd.DataFrame):
        return plain(value.to_dict(orient="records"))
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    return plain(value.value) if isinstance(value, Enum) else str(value)


def _number(value: float) -> float | str | None:
    if math.isnan(value):
        return None
    return value if math.isfinite(value) else str(value)
