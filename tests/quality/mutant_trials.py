"""Tests against a mutant, in a process of their own that holds it in memory.

Nothing is written: Python gets the mutant's text where it asks for the module, no file is changed,
and nothing else sees it. Processes are forked from one that has imported the libraries, which takes
ten times as long as most tests; of seqopt it has imported nothing, so that all of it meets the
mutant. A process that uses too much time or memory is ended.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import resource
import signal
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import InspectLoader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.quality.mutants import ROOT, path_of

LIBRARIES = ("numpy", "scipy.sparse.linalg", "scipy.stats", "pandas", "networkx", "jsonschema")
SOLVERS = ("cvxpy", "clarabel", "highspy")
OURS = ("seqopt", "formulations", "tests")
SECONDS, FACTOR = 10, 10  # of processor time: at least, and over what the tests take by themselves
FIRST = 300  # the same where the tests have not been run before
BYTES = 4 * 2**30
PASSED, FAILED, UNSEEN = 0, 1, 77
EARLY = "ignore:Module already imported:pytest.PytestAssertRewriteWarning"


class Mutated(MetaPathFinder, InspectLoader):
    """Finds one module, with a text that is not that of its file."""

    def __init__(self, module: str, source: str) -> None:
        self.module, self.source, self.seen = module, source, False

    def find_spec(self, fullname: str, path: object, target: object = None) -> ModuleSpec | None:
        """Return where the module is found: here."""
        if fullname != self.module:
            return None
        return spec_from_file_location(fullname, path_of(fullname), loader=self)

    def get_source(self, fullname: str) -> str:
        """Return the text."""
        self.seen = True
        return self.source

    def is_package(self, fullname: str) -> bool:
        """Return that it is none."""
        return False


def preload() -> None:
    """Import the libraries, once for all trials, and nothing that may meet a mutant."""
    for name in (*LIBRARIES, *SOLVERS):
        importlib.import_module(name)
    known = ("tests", *(name for name in sys.modules if name.startswith("tests.quality")))
    early = [n for n in sys.modules if n.split(".")[0] in OURS and n not in known]
    assert not early, early


def limit(module: str, source: str, tests: Sequence[str]) -> int:
    """Return how much processor time a mutant's tests get, s: ten times what they take without."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    trial(module, source, tests, FIRST)
    taken = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    return max(SECONDS, round(FACTOR * taken))


def trial(module: str, source: str, tests: Sequence[str], seconds: int) -> str:
    """Return what becomes of a module with a text: it survives its tests, or how it does not.

    Parameters
    ----------
    module : str
        Dotted.
    source : str
        Its text.
    tests : sequence of str
        Files, from the root of the repository.
    seconds : int
        Of processor time, after which tests are ended.

    Returns
    -------
    str
        survived, killed, timed out, or ended (the process died).

    Raises
    ------
    RuntimeError
        If the tests never asked for the module.
    """
    process = multiprocessing.get_context("fork").Process(
        target=_run, args=(module, source, tests, seconds)
    )
    with warnings.catch_warnings():  # of threads that libraries have started: ours are done
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    process.join(20 * seconds)
    if process.is_alive():
        process.kill()
        process.join()
        return "timed out"
    if process.exitcode == UNSEEN:
        raise RuntimeError(f"no test imports {module}")
    if process.exitcode in (-signal.SIGXCPU, -signal.SIGKILL):
        return "timed out"
    return {PASSED: "survived", FAILED: "killed"}.get(process.exitcode or 0, "ended")


def _run(module: str, source: str, tests: Sequence[str], seconds: int) -> None:
    """Run tests and end this process with their status."""
    os.chdir(ROOT)
    with Path(os.devnull).open("w", encoding="utf-8") as nothing:
        for stream in (sys.stdout, sys.stderr):
            os.dup2(nothing.fileno(), stream.fileno())
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    sys.dont_write_bytecode = True
    finder = Mutated(module, source)
    sys.meta_path.insert(0, finder)
    settings.register_profile(  # as in tests/conftest.py; what fails need not be made small
        "mutants",
        derandomize=True,
        deadline=None,
        max_examples=40,
        suppress_health_check=[HealthCheck.too_slow],
        phases=[Phase.explicit, Phase.generate],
    )
    words = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:faulthandler", "-W", EARLY]
    words += ["-m", "not slow", "--hypothesis-profile", "mutants", *tests]
    status = pytest.main(words)
    if status == pytest.ExitCode.NO_TESTS_COLLECTED or (not finder.seen and not status):
        os._exit(UNSEEN)
    os._exit(PASSED if status == pytest.ExitCode.OK else FAILED)
