"""Speed against accuracy: what is beaten, what is taken, gaps and errors, and the chart."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest

import seqopt
from seqopt.engines.frame import FrameEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import ProblemError, TimeUpError
from seqopt.graph.formulation import formulations
from seqopt.plan.pose import decisions_of
from seqopt.problem.problem import Aim
from seqopt.report._speed._chart import PALE, speed_chart
from seqopt.report._speed._measure import Reference, Timer, speed_accuracy
from seqopt.report._speed._table import CUT, DONE, SAME, SpeedTable, dominated
from seqopt.sequence.schedule_file import find_schedule
from tests.builders import small_arch
from tests.pictures import flaws

CRITERION = seqopt.CRITERIA["weighted-published"]
SUMS = [name for name, each in formulations("costs").items() if each.aim is not Aim.PEAK]


def table_of(*rows):
    names = ["engine", "formulation", "proof", "exact", "seconds", "gap", "error"]
    return pd.DataFrame(rows, columns=names).assign(status=DONE, why="")


def made(*rows):
    return SpeedTable("arch", 7, "loop", "compliance", 9.0, table_of(*rows))


FOUR = (
    ("compliance", "overlap_dp", True, True, 0.1, 0.0, 0.0),
    ("compliance", "cascade", False, False, 0.05, 0.02, 0.0),
    ("frame", "overlap_dp", True, True, 30.0, 0.0, 2e-6),
    ("compliance", "overlap_mip", True, True, 0.3, 0.0, 0.0),
)


def beats(one, other):
    """Return whether a row beats another, by the definition."""
    pairs = [*zip(one[1:], other[1:], strict=True)]
    no_worse = one[0] <= SAME * other[0] and all(a <= b for a, b in pairs)
    better = SAME * one[0] < other[0] or any(a < b for a, b in pairs)
    return no_worse and better


@pytest.mark.parametrize("seed", range(8))
def test_what_is_beaten_is_so_by_the_definition(seed):
    rng = np.random.default_rng(seed)
    size = 25
    values = {"seconds": 10 ** rng.uniform(-1, 1, size), "gap": rng.integers(0, 3, size) / 100}
    values |= {"error": rng.integers(0, 3, size) * 1e-6, "exact": rng.integers(0, 2, size) == 1}
    table = pd.DataFrame(values)
    found = dominated(table)
    rows = table.assign(exact=~table["exact"]).to_numpy(float)
    assert found.tolist() == [any(beats(one, other) for one in rows) for other in rows]
    assert not found.all()  # somebody stays: beating goes in no circle
    table.loc[0, ["seconds", "gap", "error", "exact"]] = [1e-3, 0.0, 0.0, True]
    assert dominated(table)[1:].all()  # by one that is best in everything
    table.loc[0, "gap"] = np.nan
    assert dominated(table)[0]  # without a plan


def test_noise_beats_nobody():
    twins = [(0.1, True), (0.1 * (1 + 0.9 * (SAME - 1)), False), (0.1 * SAME * 1.01, True)]
    rows = [("a", "x", True, True, seconds, 0.0, 0.0) for seconds, _ in twins]
    assert dominated(table_of(*rows)).tolist() == [False, False, True]


def test_what_to_take_is_computed():
    found = made(*FOUR)
    assert found.kept.tolist() == [True, True, False, False]
    assert found.sentence == (
        "Take compliance with overlap_dp: the proven best plan in 0.100 s; sooner is compliance "
        "with cascade (no proof) in 0.0500 s: its plan is 2 % above the best."
    )
    others = made(*FOUR[2:])  # other rows, another sentence
    assert others.sentence.startswith("Take compliance with overlap_mip: the proven best plan")
    assert "nothing else is sooner" in others.sentence
    luck = made(FOUR[0], ("compliance", "cascade", False, False, 0.05, 0.0, 0.0))
    assert luck.take["formulation"] == "overlap_dp"  # a heuristic does not know that it is right
    assert "which it does not prove" in luck.sentence


def test_long_reasons_are_wrapped():
    table = table_of(*FOUR)
    table.loc[2, ["gap", "error", "why"]] = [np.nan, np.nan, "brick 5: " + "it is too far " * 9]
    refused = {"planar": "brick 11: its centroid lies outside the middle plane; " * 3}
    lines = [*SpeedTable("arch", 7, "loop", "compliance", 9.0, table, refused).lines()]
    assert max(map(len, lines)) <= 80
    assert sum("too far" in line for line in lines) > 1


@pytest.fixture(scope="module")
def loop():
    network = seqopt.build_network(small_arch(5))
    return seqopt.pose(ComplianceEngine(network), find_schedule(network), CRITERION)


def test_the_gap_is_that_of_the_judge(loop):
    reference = Reference(loop)
    reference.prepare()
    for name in SUMS:
        plan = seqopt.solve(loop, name)
        assert reference.gap(plan) == pytest.approx(plan.certificate.gap, abs=1e-9)
    sums = decisions_of(loop).sums
    choices = [*product(*(range(len(single)) for single in sums.single))]
    worst = max((c for c in choices if np.isfinite(sums.cost(c))), key=sums.cost)
    plan = seqopt.solve(loop)
    rows = decisions_of(loop).rows(worst)
    bad = replace(plan, selection=replace(plan.selection, states=rows))
    assert reference.gap(bad) > 0.01  # a choice that is not the best has one


def test_the_gap_of_states_is_that_of_the_judge():
    network = seqopt.build_network(small_arch(4))
    worst = seqopt.CRITERIA["worst-ratio"]
    problem = seqopt.pose(ComplianceEngine(network), seqopt.FreeRules(), worst, "minmax,steps")
    reference = Reference(problem)
    reference.prepare()
    assert reference.gap(seqopt.solve(problem)) == 0
    longest = seqopt.solve(problem.but(goals="steps,minmax"))
    value, best = longest.objective["minmax"], seqopt.solve(problem).objective["minmax"]
    wanted = (value - best) / value
    assert reference.gap(longest) == pytest.approx(wanted if wanted > 1e-9 else 0.0, abs=1e-9)


def test_the_error_is_none_of_the_reference_and_grows_with_what_is_wrong(loop):
    reference, steps = Reference(loop), seqopt.solve(loop).steps
    network = loop.engine.network
    assert reference.error(ComplianceEngine(network), steps) == 0
    fine, coarse = (reference.error(FrameEngine(network, k), steps) for k in (1e7, 1e3))
    assert 0 < fine < 1e-4 < coarse


def test_every_way_is_a_row_and_nothing_is_drawn_wrong(loop):
    found = speed_accuracy(loop, 60.0)
    assert found.table["formulation"].tolist() == [*SUMS, "cascade"]
    assert (found.table["status"] == DONE).all()
    assert (found.table["error"] == 0).all()
    assert found.take["exact"]
    assert found.take["gap"] == 0
    assert all(len(line) <= 80 for line in found.lines())
    assert flaws(speed_chart(made(*FOUR), made(*FOUR))) == []


@pytest.mark.slow
def test_states_are_measured_too():
    engine = ComplianceEngine(seqopt.build_network(small_arch(3)))
    worst = seqopt.CRITERIA["worst-ratio"]
    found = speed_accuracy(seqopt.pose(engine, seqopt.FreeRules(), worst, "minmax,steps"), 60.0)
    assert {"schedule_search", "path_dp", "flow_lp"} <= {*found.table["formulation"]}
    assert (found.table["gap"] == 0).all()
    assert len({line.index("%") for line in found.lines() if "%" in line}) == 1  # columns


def test_the_chart_shows_both_and_pales_what_is_beaten():
    figure = speed_chart(made(*FOUR))
    gaps, errors = figure.axes
    points = [line for line in gaps.get_lines() if len(line.get_xdata()) == 1]
    assert sum(line.get_alpha() == PALE for line in points) == 2
    (ring,) = (line for line in points if line.get_markersize() > 10)
    assert list(ring.get_xdata()) == [0.1]
    words = {text.get_text() for text in (*gaps.texts, *errors.texts)}
    assert {"dynamic programming", "cascade, no proof", "compliance", "frame: 2e-6"} <= words
    assert gaps.get_title(loc="left").replace("\n", " ").endswith(made(*FOUR).sentence)


class _Late:
    """A clock whose time is over in every call after some."""

    def __init__(self, calls):
        self.left = calls

    @contextmanager
    def within(self, _):
        self.left -= 1
        if self.left < 0:
            raise TimeoutError
        yield


def test_what_is_cut_off_is_said(loop):
    found = speed_accuracy(loop, 60.0, timer=Timer(within=_Late(8).within))
    late = found.table["status"] == CUT
    assert late.tolist() == [False] + [True] * len(SUMS)  # all but the first, and its error
    assert found.table.loc[late, "gap"].isna().all()
    assert not found.kept[late].any()
    assert any("not ready after 60 s" in line for line in found.lines())
    words = " ".join(text.get_text() for text in speed_chart(found).axes[0].texts)
    assert "stopped" in words
    with pytest.raises(TimeUpError, match="give more seconds"):
        speed_accuracy(loop, 60.0, timer=Timer(within=_Late(0).within))


def test_other_problems_are_refused():
    engine, rules = seqopt.make_engine("compliance", small_arch(4)), seqopt.FreeRules()
    orders = seqopt.pose(engine, rules, seqopt.CRITERIA["worst-ratio"], orders="tied")
    with pytest.raises(ProblemError, match="speed: it is measured where grips or states"):
        speed_accuracy(orders)
