"""What people read first, and that what messages call enough is enough."""

from __future__ import annotations

import re
from dataclasses import replace

import pandas as pd
import pytest

import seqopt
from seqopt.errors import InfeasibleError, StepError
from seqopt.sequence.rules import FreeRules
from tests.commands import command as run

WALL = "wall:columns=2,courses=2"
FEW = "rules: least_grips=1, as 2 robots take part"


def test_optimize_begins_with_what_robots_hold(capsys, tmp_path):
    out = tmp_path / "out"
    status, said, _ = run(capsys, "optimize", WALL, "--schedule", "free", "--out", out)
    first, second, *_ = said.splitlines()
    number = r"([0-9.,]+)"
    found = re.match(
        rf"largest force {number} N \({number} % of payload\), displacement {number} µm", first
    )
    force, share, moved = map(float, found.groups())
    table = pd.read_csv(out / "plan.csv")
    most = table[[f"F_rob{k}_N" for k in (1, 2, 3)]].abs().max().max()
    payload = seqopt.load_scene(WALL).robots[0].payload
    assert (status, force) == (0, pytest.approx(most, rel=5e-3))
    assert share == pytest.approx(100 * most / payload, rel=5e-3)
    assert moved == pytest.approx(table["D_max_1e-3mm"].max(), rel=5e-3)
    assert all(len(digits.replace(".", "").lstrip("0")) <= 3 for digits in found.groups())
    assert re.search(r"; minmax [0-9.]+, optimal$", first)
    assert second.startswith("schedule_search (exact): ")


@pytest.mark.parametrize(
    ("words", "says"), [(["2"], True), (["3"], False), (["2", "--rule", "least_grips=1"], False)]
)
def test_two_robots_build_by_themselves(capsys, words, says):
    for asked in (["optimize"], ["pareto", "--aim", "F_largest,D_max"]):
        line = [asked[0], WALL, *asked[1:], "--schedule", "free", "--robots", *words]
        status, _, err = run(capsys, *line, "--no-stability")
        assert (status, FEW in err.splitlines()) == (0, says), err


def test_a_limit_that_helps_has_three_digits_and_does_help():
    engine = seqopt.make_engine("auto", seqopt.load_scene(WALL))

    def asked(bound):
        limits = [seqopt.Limit("F_largest", bound)]
        rules, criterion = FreeRules(), seqopt.CRITERIA["worst-ratio"]
        return seqopt.solve(seqopt.pose(engine, rules, criterion, "minmax", limits))

    with pytest.raises(InfeasibleError) as error:
        asked(10.0)
    enough = re.search(r"F_largest=([0-9.]+) instead of 10", str(error.value))[1]
    assert len(enough.replace(".", "")) <= 3
    assert asked(float(enough)).steps
    with pytest.raises(InfeasibleError):
        asked(0.99 * float(enough))


ARCH = "arch:span=1.2,rise=0.5"


def refusal(make, *given, **options):
    """Return what an error says."""
    with pytest.raises((InfeasibleError, StepError)) as error:
        make(*given, **options)
    return str(error.value)


def said(text, pattern):
    """Return the values that a message names."""
    found = re.findall(pattern, text)
    assert found, text
    return found


@pytest.mark.parametrize("asked", [{}, pytest.param({"stands": "dry"}, marks=pytest.mark.slow)])
def test_a_payload_that_is_enough_for_a_free_schedule(asked):
    def make(payload):
        scene = seqopt.load_scene(ARCH)
        robots = (replace(robot, payload=payload) for robot in scene.robots)
        return seqopt.optimize(scene.with_robots(*robots), "free", aim="steps", **asked)

    (newton,) = said(refusal(make, 20.0), r"a payload of (\d+) N \(--payload \1\)")
    assert make(float(newton)).steps
    refusal(make, float(newton) - 1)
