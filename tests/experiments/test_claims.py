"""Claims: every experiment at reduced size ends with its verdict."""

from __future__ import annotations

import pytest

from tests.builders import ROOT
from tests.commands import run

TIMED = {
    "engine_speed",
    "formulation_cost",
    "speed_accuracy",
}  # their verdicts depend on the machine
QUICK = [
    "engine_speed",
    "frame_contrast",
    "identify_arch25",
    "criteria_variants",
    "formulation_cost",
    "failing_steps",
    "decision_sensitivity",
    "degenerate_placement",
    "calibration",
    "discrete_arches",
    "speed_accuracy",
    "paper_counterparts",
    "fidelity_ladder",
    "contact_steps",
]


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_a_quick_run_ends_with_a_verdict(name):
    before = sorted((ROOT / "experiments" / "results").glob("*"))
    times = [path.stat().st_mtime_ns for path in before]
    verdict = run(name, "--quick").splitlines()[-1]
    assert verdict.startswith("verdict: the claim")
    if name not in TIMED:
        assert "the claim holds" in verdict
    assert [path.stat().st_mtime_ns for path in before] == times  # a quick run writes nothing
