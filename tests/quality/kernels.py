"""Which kernels do linear algebra: OpenBLAS has one for every kind of processor.

They differ in the last digits. numpy and scipy bring an OpenBLAS each. On x86 another kernel can be
asked for by its name in the environment, in ``OPENBLAS_CORETYPE``: tests run under two of them show
what last digits decide.

Command: ``python -m tests.quality.kernels`` prints the name of a kernel that this processor can run
and does not by default; nothing where there is none. With ``running`` it prints those that run.
"""

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy.linalg
import scipy.linalg
from threadpoolctl import threadpool_info

OTHERS = ("Nehalem", "Haswell")  # of 2008, which every x86 can run, and of 2013, if that one runs
NAMES = ("Prescott", "Nehalem", "Sandybridge", "Haswell", "SkylakeX")  # oldest first
X86 = ("amd64", "x86_64")
VARIABLE = "OPENBLAS_CORETYPE"


def running() -> dict[str, str]:
    """Return the kernel of every OpenBLAS that is loaded, by the package that brings it."""
    found = {}
    for library in threadpool_info():
        if library["internal_api"] == "openblas":
            packages = [p.__name__ for p in (numpy, scipy) if p.__name__ in library["filepath"]]
            name = packages[0] if packages else Path(library["filepath"]).name
            found[name] = str(library["architecture"])
    return found


def other() -> str:
    """Return the name of a kernel that does not run, but can; empty where there is none."""
    known = set(running().values())
    if not known or platform.machine().lower() not in X86:
        return ""
    return next(name for name in OTHERS if name not in known)


def every() -> dict[str, str]:
    """Return the kernels that this machine can run, each with the name by which it is asked for.

    One that a processor lacks ends its process, or another one runs for it. Where no kernel can be
    asked for, the one that runs stands for all.
    """
    found: dict[str, str] = {}
    for name in NAMES if other() else ():
        asked = [sys.executable, "-m", "tests.quality.kernels", "running"]
        own = os.environ | {VARIABLE: name}
        done = subprocess.run(asked, env=own, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            found.setdefault(done.stdout.strip(), name)
    return found or {" ".join(sorted({*running().values()})): ""}


if __name__ == "__main__":
    print(" ".join(sorted({*running().values()})) if "running" in sys.argv else other())
