"""Experiments run as a user runs them, warnings being errors."""

from __future__ import annotations

import subprocess
import sys

from tests.builders import ROOT


def run(name, *arguments):
    """Return what an experiment prints."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", f"experiments.{name}", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
