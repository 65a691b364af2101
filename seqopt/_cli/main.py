"""The command line: ``seqopt compare | optimize | pareto | analyze | assess | report | …``."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module

from seqopt._cli.answer import Status, print_answer, status_of
from seqopt._cli.arguments import EXAMPLES, Request, named_command, parser, request
from seqopt._cli.registry import COMMANDS
from seqopt._cli.terminal import flush, quiet_numbers, show, silence
from seqopt._registry import Later
from seqopt.errors import SeqoptError

WATCHER = Later("seqopt._cli.watcher")  # 60 ms: it needs NumPy


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command, by its words or those of the shell, and return its `Status`."""
    words = sys.argv[1:] if arguments is None else arguments
    asked: Request | None = None  # whose words an error is about
    status: int = Status.DONE
    try:
        if "_ARGCOMPLETE" in os.environ:  # the shell asks what may follow
            import_module("argcomplete").autocomplete(parser())
        try:
            asked = request(words) if words else None
        except SystemExit as stop:  # the parser has said why, or printed its help
            status = int(stop.code or 0)
        else:
            if asked is None:
                show(EXAMPLES)
            else:
                shows = not asked.quiet
                with quiet_numbers(quiet=asked.quiet), WATCHER.Watcher(shows=shows) as tell:
                    answer = asked.answer(tell)
                status = print_answer(answer, asked.name, quiet=asked.quiet, as_json=asked.json)
        flush()
    except BrokenPipeError:  # the reader of our output has gone: not an error of ours
        silence(sys.stdout)
        return Status.DONE
    except (SeqoptError, KeyboardInterrupt, MemoryError, OSError) as error:
        status = status_of(error, str if asked is None else asked.spoken)
        with suppress(OSError):
            flush()
    return status


def load(words: Sequence[str]) -> None:
    """Load the libraries of the command among the words, if there is one.

    Later imports would be subject to interrupts. Garbage collection is off meanwhile, and freezes
    all loaded objects.
    """
    gc.disable()
    asked = named_command(words)
    if asked in COMMANDS:
        np = import_module("numpy")
        # few commands need pandas, only the start of SciPy looks at these parts
        sys.modules.setdefault("pandas", Later("pandas"))
        for part in ("ctypeslib", "f2py", "fft", "ma", "polynomial", "random", "testing"):
            if part not in vars(np):
                vars(np)[part] = sys.modules.setdefault(f"numpy.{part}", Later(f"numpy.{part}"))
        for name in ("seqopt._cli.signatures", "seqopt._cli.watcher"):
            import_module(name)
        COMMANDS[asked].load()
    gc.freeze()
    gc.enable()
