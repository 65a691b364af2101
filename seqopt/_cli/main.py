"""The command line: ``seqopt compare | optimize | pareto | analyze | assess | report | …``."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from types import ModuleType

from seqopt._cli.answer import Answer, Status, print_answer, status_of
from seqopt._cli.arguments import COMMANDS, EXAMPLES, asked_command, parser
from seqopt._cli.terminal import flush, quiet_numbers, show, silence
from seqopt.errors import SeqoptError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command, by its words or those of the shell, and return its `Status`.

    An error is one line on standard error.
    """
    try:
        status = _run(sys.argv[1:] if arguments is None else arguments)
        flush()
    except BrokenPipeError:  # the reader of our output has gone: not an error of ours
        silence(sys.stdout)
        return Status.DONE
    except (SeqoptError, KeyboardInterrupt, MemoryError, OSError) as error:
        status = status_of(error)
        with suppress(OSError):
            flush()
    return status


class _LaterPandas(ModuleType):
    """Stands for pandas until something of it is asked for."""

    def __getattr__(self, name: str) -> object:
        if sys.modules.get("pandas") is self:
            del sys.modules["pandas"]
        import pandas as pd  # noqa: PLC0415  # that is what it is for

        return getattr(pd, name)


def load(words: Sequence[str]) -> None:
    """Load the libraries of the command that words ask for, if they ask for one.

    They would meet its interrupts if they came later. Only pandas waits: what prints no table needs
    none, and it takes a quarter of the time.
    """
    asked = asked_command(words)
    if asked in COMMANDS:
        sys.modules.setdefault("pandas", _LaterPandas("pandas"))
        if any(map(os.path.exists, words)):
            import jsonschema  # noqa: F401, PLC0415  # scene files need it

        import seqopt._cli.watcher  # noqa: F401, PLC0415  # of which help needs nothing

        COMMANDS[asked].load()


def _run(words: Sequence[str]) -> int:
    if not words:
        show(EXAMPLES)
        return Status.DONE
    try:
        options = parser(asked_command(words)).parse_args(words)
    except SystemExit as stop:  # the parser has said why, or printed its help
        return int(stop.code or 0)
    from seqopt._cli.watcher import Watcher  # noqa: PLC0415  # of which help needs nothing

    options.words = (*words,)  # an instance says which ones made it
    with quiet_numbers(quiet=options.quiet), Watcher(shows=not options.quiet) as options.tell:
        answer: Answer = COMMANDS[options.command].load().run(options)
    answer = replace(answer, notes=(*getattr(options, "taken", ()), *answer.notes))
    return print_answer(answer, options)
