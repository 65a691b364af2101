"""Robots' columns and responses collide with nothing, whatever the robots are called."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt._cli.main import main
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.graph.decisions import pose_decisions
from seqopt.network.build import build_network
from seqopt.plan.solve import solve
from seqopt.responses._choices import CHOICE_RESPONSES
from seqopt.responses.quantities import RESPONSES, robot_response
from seqopt.responses.table import analyze
from seqopt.scene.scene_file import save_scene
from seqopt.sequence.methods import sequential, three_robot_loop
from seqopt.study.published import EQUATIONS, WORST_RATIO
from tests.builders import six_bricks

NAMES = ["each", "[sup]", "a,b"]
PAYLOAD = 40.0  # N
ALSO = ("F_move", "F_largest", "T_max", "M_sup")
EVERY = replace(EQUATIONS, before=(("F_each", 1.0),), after=(("F_each", 1.0),))


def called(*names):
    """The arch of six bricks with robots of other names and payloads that bind.

    They can carry a brick, of 36 N.
    """
    scene = six_bricks()
    robots = [replace(r, name=n, payload=PAYLOAD) for n, r in zip(names, scene.robots, strict=True)]
    return replace(scene, robots=tuple(robots))


def posed(scene, criterion, **more):
    network = build_network(scene)
    return pose_decisions(ComplianceEngine(network), three_robot_loop(network), criterion, **more)


@cache
def tabled(name):
    network = build_network(called(name, "two", "three"))
    return analyze(ComplianceEngine(network), sequential(network))


@cache
def plainly(criterion):
    """The problem and its plan where names are not odd."""
    problem = posed(called("one", "two", "three"), criterion, also=ALSO)
    return problem, solve(problem, "overlap_dp")


@pytest.mark.parametrize("name", NAMES)
def test_a_name_changes_no_number(name):
    tables = [tabled("one"), tabled(name)]
    assert len(tables[0].columns) == len(set(tables[1].columns))
    for first, second in zip(tables[0], tables[1], strict=True):
        pd.testing.assert_series_equal(tables[0][first], tables[1][second], check_names=False)
    assert {response.column for response in RESPONSES.values()} <= set(tables[1])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("criterion", [EVERY, WORST_RATIO], ids=lambda c: c.name)
def test_a_name_changes_no_choice(name, criterion):
    plain, chosen = plainly(criterion)
    odd = posed(called("one", name, "three"), criterion, also=ALSO)
    for first, second in zip(plain.sums.single, odd.sums.single, strict=True):
        np.testing.assert_array_equal(first, second)
    for first, second in zip(plain.evaluation.steps, odd.evaluation.steps, strict=True):
        for response in ALSO:
            np.testing.assert_array_equal(first.responses[response], second.responses[response])
    other = solve(odd, "overlap_dp")
    assert chosen.selection == other.selection


@settings(max_examples=10)
@given(first=st.text(max_size=4), second=st.text(max_size=4))
def test_no_two_robots_share_a_name(first, second):
    taken = {*RESPONSES, *CHOICE_RESPONSES, "F_each", "F_rob", "F_max"}
    assert robot_response(first) not in taken
    assert (robot_response(first) == robot_response(second)) == (first == second)


def test_the_command_line_offers_them(capsys, tmp_path):
    save_scene(called("sup", "max", "each"), tmp_path / "s.json")
    words = ["optimize", str(tmp_path / "s.json"), "--formulation", "overlap_dp"]
    out = ["--out", str(tmp_path / "out")]
    assert main([*words, *out, "--limit", "F_sup=9"]) == 2
    assert "F_[each], F_[max], F_[sup]" in capsys.readouterr().err
    assert main([*words, *out, "--criteria", "F_[sup],T_max", "--limit", "F_[max]=900"]) == 0
    table = pd.read_csv(tmp_path / "out" / "plan.csv")
    assert {"F_sup_N", "F_[sup]_N", "F_max_N", "F_[max]_N"} <= set(table)
