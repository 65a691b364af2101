"""Run the command line as ``python -m seqopt``, or as the program ``seqopt``."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys

INTERRUPTED = 130  # as seqopt.cli.status has it, which may not be there yet


def run() -> int:
    """Run the command of the shell; an interrupt while it starts is one too.

    Returns
    -------
    int
        The exit status.
    """
    try:
        _take_signals()
        _open_streams()
        from seqopt.cli.main import main  # noqa: PLC0415  # what an interrupt may meet

        status = main()
    except KeyboardInterrupt:
        with contextlib.suppress(OSError, AttributeError):
            sys.stderr.write("seqopt: interrupted\n")
        status = INTERRUPTED
    if status == INTERRUPTED:  # else Python may end by the signal, where it met an exec of text
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, AttributeError):
                stream.flush()
        os._exit(INTERRUPTED)
    return status


def _take_signals() -> None:
    """Let all signals that ask for an end ask as ctrl-C does, so that files are cleaned up."""
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) is signal.SIG_DFL:
            signal.signal(getattr(signal, name), signal.default_int_handler)


def _open_streams() -> None:
    """Keep files of ours from taking the places of closed streams; print any name anywhere."""
    for place in range(3):
        try:
            os.fstat(place)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


if __name__ == "__main__":
    sys.exit(run())
