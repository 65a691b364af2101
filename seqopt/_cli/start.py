"""The start of the program, before libraries are loaded, and its end whatever happens."""

from __future__ import annotations

import contextlib
import gc
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

INTERRUPTED, FAILED, CRASHED = 130, 4, 70  # as `Status`, which may not be there yet
LEAST = 400e6  # bytes of addresses with which a program starts
AGAIN = 0.05  # s after which an interrupt that was lost is raised again


def run() -> int:
    """Run the shell's command and return its exit status, also if interrupted while loading."""
    try:
        _prepare()
        _answer_signals(_leave)  # libraries that are being loaded may lose what is raised in them
        from seqopt._cli.main import load, main  # noqa: PLC0415  # what an interrupt may meet

        load(sys.argv[1:])

        def raise_again(lost: sys.UnraisableHookArgs) -> None:
            """Repeat an interrupt that was raised where exceptions are ignored."""
            if issubclass(lost.exc_type, KeyboardInterrupt):
                from seqopt.work import _interrupt_main  # noqa: PLC0415  # 200 ms: it needs SciPy

                threading.Timer(AGAIN, _interrupt_main).start()  # at once it would meet this hook
            else:
                sys.__unraisablehook__(lost)

        sys.unraisablehook = raise_again
        _answer_signals(signal.default_int_handler)
        status = main()
    except KeyboardInterrupt:
        _leave()
    except (ImportError, MemoryError) as error:  # as where a limit of memory lets nothing be loaded
        said = " ".join(f"{type(error).__name__} {error}".split())
        _tell(f"seqopt: cannot start: {said}; give it more memory, or reinstall it\n")
        return FAILED
    except Exception as error:  # Python itself would end with the status of what does not hold
        said = " ".join(f"{type(error).__name__}: {error}".split())[:500]
        lines = "".join(traceback.format_exception(error))
        lines += f"seqopt: internal error: {said}; this is a fault of seqopt: report it\n"
        shown = (c if c == "\n" or c.isprintable() else repr(c)[1:-1] for c in lines)
        _tell("".join(shown))  # names of files may steer a terminal
        return CRASHED
    if status == INTERRUPTED:  # else Python may end by the signal, where it met an exec of text
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, AttributeError):
                stream.flush()
        os._exit(INTERRUPTED)
    gc.freeze()  # else Python would look through all once more before it ends
    return status


def _tell(text: str) -> None:
    with contextlib.suppress(OSError, AttributeError, ValueError):
        sys.stderr.write(text)


def _answer_signals(answer: Callable[[int, FrameType | None], object]) -> None:
    """Handle all termination signals like ctrl-C, so that temporary files are deleted."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) not in (signal.SIG_IGN, None):
            signal.signal(number, answer)


def _leave(*_: object) -> NoReturn:
    """Exit at once: before the start there are no files to clean up."""
    with contextlib.suppress(OSError):
        os.write(2, b"seqopt: interrupted\n")
    os._exit(INTERRUPTED)


def _prepare() -> None:
    """Occupy the descriptors of closed streams; escape characters that a stream cannot encode.

    Raises a `MemoryError` for a memory limit under which libraries hang.
    """
    for place in range(3):
        try:
            os.fstat(place)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if os.name == "posix":
        import resource  # noqa: PLC0415  # POSIX has it alone

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY and limit < LEAST:
            raise MemoryError(f"{limit / 1e6:.0f} MB may be used, and it takes {LEAST / 1e6:.0f}")
