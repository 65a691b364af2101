"""Claims: every experiment at reduced size ends with its verdict."""

from __future__ import annotations

import pytest

from experiments.harness.claim import Times, claims
from tests.builders import ROOT
from tests.commands import run

ALWAYS = "frame_contrast"  # one that takes a second runs among the quick tests too


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n == ALWAYS else pytest.mark.slow) for n in claims()]
)
def test_a_quick_run_ends_with_a_verdict(name):
    before = sorted((ROOT / "experiments" / "results").glob("*"))
    times = [path.stat().st_mtime_ns for path in before]
    verdict = run(name, "--quick").splitlines()[-1]
    assert verdict.startswith("verdict: the claim")
    if claims()[name].times is not Times.JUDGED:  # else it depends on the machine
        assert "the claim holds" in verdict
    assert [path.stat().st_mtime_ns for path in before] == times  # a quick run writes nothing
