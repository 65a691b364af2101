"""List the experiments with claim and last verdict, or run them.

Command: ``python -m experiments`` lists; ``python -m experiments NAME`` runs one, whose ``--help``
says what else it takes; ``python -m experiments all`` runs each in a process of its own. With
``--quick`` they run at reduced size. Files change with ``--store`` alone. The exit status is 1 if a
claim does not hold, or if none is found. An experiment that an extra is missing for is left out.
"""

import os
import subprocess
import sys
import time
from collections.abc import Sequence

from experiments.harness.claim import (
    FAILS,
    HOLDS,
    MISSING,
    PREFIX,
    ClaimError,
    find_claim,
    modules,
    verdicts,
)
from experiments.harness.results import HOME, ONE_CORE


def run(name: str, *arguments: str) -> str:
    """Return how an experiment ended in a process of its own."""
    command = [sys.executable, "-m", "experiments", name, *arguments]
    more = {"capture_output": True, "text": True, "cwd": HOME.parent, "env": os.environ | ONE_CORE}
    done = subprocess.run(command, check=False, **more)
    last = (done.stdout.splitlines() or [""])[-1]
    if done.returncode in (HOLDS, FAILS) and last.startswith(PREFIX):
        return last.removeprefix(PREFIX)
    why = (done.stderr.splitlines() or [last])[-1]
    return ("left out: " if done.returncode == MISSING else "failed: ") + why


def run_all(*arguments: str) -> int:
    """Run all experiments, one after the other; return the exit status."""
    status = HOLDS
    for name in modules():
        start = time.perf_counter()
        verdict = run(name, *arguments)
        print(f"{name:22}{time.perf_counter() - start:7.1f} s  {verdict}", flush=True)
        if not verdict.startswith(("holds", "left out")):
            status = FAILS
    return status


def main(arguments: Sequence[str]) -> int:
    """List experiments, or run one or all; return the exit status."""
    try:
        if arguments[:1] == ["all"]:
            return run_all(*arguments[1:])
        if arguments[:1] in (["-h"], ["--help"]):
            print(__doc__)
        elif arguments and arguments != ["list"]:
            return find_claim(arguments[0]).main(arguments[1:])
        else:
            last = verdicts()["verdict"]
            for name, (_, text) in modules().items():
                print(f"{name:22}{last.get(name, 'not run'):22}{text}")
    except ClaimError as error:
        print(error, file=sys.stderr)
        return FAILS
    return HOLDS


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
