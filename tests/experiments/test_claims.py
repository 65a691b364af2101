"""Claims: every experiment at reduced size ends with its verdict."""

from __future__ import annotations

import pytest

from experiments.harness.claim import Times, claims
from tests.builders import ROOT
from tests.commands import run

ALWAYS = "frame_contrast"  # one that takes a second runs among the quick tests too

LONG = ("identify_arch25", "dry_map", "speed_accuracy")  # parts of the last: test_harness


def marks(name):
    """Whether a claim is for every day, or for a release."""
    if name == ALWAYS:
        return []
    return [pytest.mark.slow, pytest.mark.long] if name in LONG else pytest.mark.slow


def printed_by(name, capsys):
    """What a quick run prints, as a user runs it where that is soon done, else in this process."""
    if name == ALWAYS:
        return run(name, "--quick")
    claims()[name].main(["--quick"])
    return capsys.readouterr().out


@pytest.mark.parametrize("name", [pytest.param(n, marks=marks(n)) for n in claims()])
def test_a_quick_run_ends_with_a_verdict(name, capsys):
    claim = claims()[name]
    for extra in claim.needs:
        pytest.importorskip(extra.module)
    before = sorted((ROOT / "experiments" / "results").glob("*"))
    times = [path.stat().st_mtime_ns for path in before]
    verdict = printed_by(name, capsys).splitlines()[-1]
    assert verdict.startswith("verdict: the claim")
    if claim.times is not Times.JUDGED:  # else it depends on the machine
        assert "the claim holds" in verdict
    assert [path.stat().st_mtime_ns for path in before] == times  # a quick run writes nothing
