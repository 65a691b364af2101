"""Claims: every experiment at reduced size ends with its verdict, and its parts can fail."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


QUICK = [
    "engine_speed",
    "frame_contrast",
    "identify_arch25",
    "criteria_variants",
    "formulation_cost",
]


def run(name, *arguments):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", f"experiments.{name}", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("name", QUICK)
def test_a_quick_run_ends_with_a_verdict(name):
    before = sorted((ROOT / "experiments" / "results").glob("*"))
    times = [path.stat().st_mtime_ns for path in before]
    assert "verdict: the claim" in run(name, "--quick").splitlines()[-1]
    assert [path.stat().st_mtime_ns for path in before] == times  # a quick run writes nothing
