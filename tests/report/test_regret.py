"""Speed against regret: what plans cost in the reference, what to take, and the chart."""

from contextlib import contextmanager, nullcontext
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import seqopt
from seqopt.errors import NothingFoundError
from seqopt.plan.solve import graph_of
from seqopt.report._regret._chart import PALE, regret_chart
from seqopt.report._regret._measure import RIGID_GRIPS, Timer, measure_regret
from seqopt.report._regret._table import CUT, DONE, FALLS, SAME, RegretTable, dominated
from seqopt.report.comparison import _plans
from seqopt.responses.quantities import RESPONSES
from seqopt.responses.table import force_column
from seqopt.sequence.rules import FREE
from seqopt.sequence.steps import Step, StepKind
from seqopt.work import Clock
from tests.builders import small_arch
from tests.pictures import flaws

RANKS, WORST = seqopt.CRITERIA["equations-2-3"], seqopt.CRITERIA["worst-ratio"]
ONCE = {"seconds": 600.0, "timer": Timer(within=lambda _: nullcontext(), times=1)}
COLUMNS = ["engine", "schedule", "formulation", "without", "exact", "seconds", "regret"]


def made(*rows):
    about = "arch", 7, "compliance", "compliance", "worst-ratio", 9.0
    table = pd.DataFrame(rows, columns=COLUMNS)
    known = {"status": DONE, "why": "", "gap": 0.0, "error": 0.0, "value": 1.0, "own": 1.0}
    return RegretTable(*about, table.assign(**known, models=1))


FOUR = (
    ("compliance", FREE, "schedule_search", "", True, 0.1, 0.0),
    ("compliance", "loop", "cascade", "no proof", False, 0.05, 0.18),
    ("frame", FREE, "schedule_search", "", True, 30.0, 0.0),
    ("compliance", FREE, "overlap_mip", "", True, 0.3, 0.0),
)


def beats(one, other):
    """Return whether a row of time, regret and lack of proof beats another, by the definition."""
    pairs = [*zip(one[1:], other[1:], strict=True)]
    no_worse = one[0] <= SAME * other[0] and all(a <= b for a, b in pairs)
    return no_worse and (SAME * one[0] < other[0] or any(a < b for a, b in pairs))


@pytest.mark.parametrize("seed", range(2))
def test_what_is_beaten_is_so_by_the_definition(seed):
    rng = np.random.default_rng(seed)
    size = 25
    values = {"seconds": 10 ** rng.uniform(-1, 1, size), "regret": rng.integers(0, 3, size) / 100}
    table = pd.DataFrame(values | {"exact": rng.integers(0, 2, size) == 1})
    rows = table.assign(exact=~table["exact"]).to_numpy(float)
    found = dominated(table)
    assert found.tolist() == [any(beats(one, other) for one in rows) for other in rows]
    assert not found.all()  # somebody stays: beating goes in no circle
    table.loc[0, ["seconds", "regret", "exact"]] = [1e-3, 0.0, True]
    assert dominated(table)[1:].all()  # by one that is best in everything
    for lost in (np.nan, np.inf):  # without a plan, or with one that falls
        table.loc[0, "regret"] = lost
        assert dominated(table)[0]


def test_what_to_take_is_computed():
    later = "compliance", "loop", "beam", "", True, 0.09, 0.17  # and hardly better
    wrong = "rigid grips", FREE, "schedule_search", "", True, 0.09, 2.0  # in its model the best
    found = made(*FOUR, later, wrong)
    assert found.kept.tolist() == [True, True, False, False, True, False]
    assert found.sentence == (
        "Take compliance with schedule_search on the free schedule: no plan of the free schedule "
        "is better, which is proven, in 0.100 s; sooner is compliance with cascade, no proof, on "
        "the loop in 0.0500 s: its plan is 18 % worse."
    )
    others = made(*FOUR[2:])  # other rows, another sentence
    assert others.sentence.startswith("Take compliance with overlap_mip on the free schedule")
    assert "nothing else is sooner" in others.sentence
    unproven = made(FOUR[1])
    assert not unproven.is_proven
    assert "no plan known is better" not in unproven.sentence  # it is not the best known
    stopped = replace(unproven, table=unproven.table.assign(status=CUT))
    assert stopped.take["formulation"] == "cascade"  # nothing else has a plan
    luck = made(FOUR[0], ("compliance", FREE, "path_beam", "", False, 0.05, 0.0))
    assert luck.take["formulation"] == "schedule_search"  # what proves comes first
    assert luck.sentence.endswith(
        "sooner is compliance with path_beam on the free schedule in 0.0500 s: its plan is as "
        "good, without a proof."
    )
    heads = "engine|schedule|formulation|time, s|regret|gap to its bound|error of its model"
    assert "|".join(luck.shown) == f"{heads}|proven|models|outcome"
    assert [*luck.shown.iloc[1]] == [*FOUR[0][:2], "path_beam", 0.05, *"000", "", 1, DONE]


@pytest.fixture(scope="module")
def measured():
    return measure_regret(seqopt.make_engine("compliance", small_arch(4)), RANKS, **ONCE)


@pytest.mark.slow
def test_regret_is_that_of_the_worst_step_in_the_reference(measured):
    """A second route: the worst of all steps, and of the end, by the table of responses."""
    engine = seqopt.make_engine("compliance", small_arch(4))
    problem = seqopt.pose(engine, seqopt.FreeRules(), WORST, "minmax")
    best = seqopt.solve(problem)
    rows = measured.table.set_index(["engine", "schedule", "formulation", "without"])["value"]
    assert rows["compliance", FREE, "schedule_search", ""] == best.objective["minmax"]
    loop = seqopt.solve(seqopt.pose(engine, seqopt.three_robot_loop(engine.network), RANKS))
    limits = dict(graph_of(problem).criterion.limits)
    bare = Step(1, StepKind.RELEASE, 4, (None, None, None))
    table = pd.concat([seqopt.analyze(engine, loop.steps), seqopt.analyze(engine, [bare])])
    grips = table[[force_column(robot) for robot in engine.network.scene.robots]].to_numpy(float)
    shares = [np.nanmax(np.abs(grips)) / limits["F_largest"]]
    for name in ("M_sup", "T_max", "D_max"):
        shares.append(table[RESPONSES[name].column].max() / RESPONSES[name].scale / limits[name])
    assert rows["compliance", "loop", "overlap_dp", "ranks"] == pytest.approx(max(shares))


@pytest.mark.slow
def test_every_way_is_a_row_and_nothing_is_drawn_wrong(measured):
    table = measured.table
    assert {"loop", FREE} == {*table["schedule"]}
    assert {"compliance", "frame"} <= {*table["engine"]}
    assert {"cascade", "beam", "overlap_mip", "overlap_dp", "minimax"} <= {*table["formulation"]}
    assert {"", "no proof", "near:6", "ranks"} == {*table["without"]}
    assert (table["status"] == DONE).all()
    assert (table["regret"] >= 0).all()
    assert measured.is_proven
    exact = table["exact"] & (table["schedule"] == FREE) & (table["engine"] == "compliance")
    assert (table.loc[exact, "regret"] == 0).all()
    assert (table.loc[table["engine"] == "compliance", "error"].dropna() == 0).all()
    frame = table.loc[table["engine"] == "frame", "error"].dropna()
    assert frame.between(1e-9, 1e-4).any()
    assert all(len(line) <= 80 for line in measured.lines())
    assert flaws(regret_chart(measured)) == []
    assert flaws(regret_chart(measured, made(*FOUR), width=3.9)) == []


@pytest.mark.slow
def test_incumbents_over_time_are_drawn_where_a_way_tells_them(measured):
    curves = [found for found in measured.curves if len(found) > 1]
    assert curves
    lines = {line.get_linestyle() for line in regret_chart(measured).axes[0].get_lines()}
    assert ":" in lines  # what bounds leave open
    bare = replace(measured, curves=())
    assert ":" not in {line.get_linestyle() for line in regret_chart(bare).axes[0].get_lines()}


@pytest.mark.slow
def test_plans_are_valued_by_a_model_of_ones_own(measured):
    """How many steps a plan has as a model: which no way knew, and in which none is proven."""
    counts = np.array([len(steps) for steps in measured.plans])
    found = measured.valued_by("steps", len)
    assert found.table["regret"].to_numpy() == pytest.approx(counts / counts.min() - 1)
    assert not found.is_proven
    assert found.take["regret"] == 0
    short = measured.valued_by("short", lambda steps: {counts.min(): 1.0}.get(len(steps), np.inf))
    assert ((short.table["status"] == FALLS) == (counts > counts.min())).all()
    with pytest.raises(NothingFoundError, match="mine: no plan holds in it"):
        measured.valued_by("mine", lambda _: np.inf)


@pytest.mark.slow
def test_softer_grips_are_the_reference_and_rigid_ones_a_way():
    scene = small_arch(3).with_grips(1e5)
    found = measure_regret(seqopt.make_engine("compliance", scene), WORST, **ONCE)
    assert found.valued == "compliance, soft grips"
    rigid = found.table[found.table["engine"] == RIGID_GRIPS]
    assert (rigid["error"].dropna() > 0.01).all()  # what they promise is not what comes
    assert not {"ranks"} & {*found.table["without"]}  # nothing ranks here


@pytest.mark.slow
def test_a_plan_that_falls_has_no_regret():
    dry = seqopt.make_engine("auto", small_arch(4), mortar="dry")
    found = measure_regret(dry, WORST, **ONCE)
    assert found.valued == "compliance, where every step stands"
    fallen = found.table["status"] == FALLS
    assert fallen.any()
    assert not np.isfinite(found.table.loc[fallen, "regret"]).any()
    assert found.table.loc[fallen, "why"].str.contains("does not stand|unstable").all()
    stands = found.table[found.table["without"] == "stands"]
    assert (stands["status"] == DONE).all()
    assert found.take["without"] == "stands" or not fallen.all()
    assert " fall" in regret_chart(found).axes[0].get_xlabel()
    epoxy = seqopt.make_engine("auto", small_arch(3))  # the control
    assert not (measure_regret(epoxy, WORST, **ONCE).table["status"] == FALLS).any()


def test_the_chart_shows_both_and_pales_what_is_beaten():
    figure = regret_chart(made(*FOUR))
    regrets, parts = figure.axes
    assert len(parts.get_yticks()) == 3  # plans that are alike are one
    points = [line for line in regrets.get_lines() if len(line.get_xdata()) == 1]
    assert sum(line.get_alpha() == PALE for line in points) == 2
    (ring,) = (line for line in points if line.get_markersize() > 10)
    assert list(ring.get_xdata()) == [0.1]
    assert "take compliance, schedule search: 0.100\xa0s" in regrets.get_title(loc="left")
    assert "proven 0" in [tick.get_text() for tick in regrets.get_yticklabels()]


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


def test_what_is_stopped_is_said():
    engine = seqopt.make_engine("compliance", small_arch(4))
    found = measure_regret(engine, WORST, seconds=60.0, timer=Timer(within=_Late(9).within))
    late = found.table["status"] == CUT
    assert 0 < late.sum() < len(late)
    assert found.table.loc[late, "regret"].isna().all()
    assert not found.kept[late].any()
    assert any("stopped" in line for line in found.lines())
    with pytest.raises(NothingFoundError, match="give more seconds"):
        measure_regret(engine, WORST, seconds=60.0, timer=Timer(within=_Late(0).within))
    plans, _, _, notes = _plans(engine, WORST, lambda _: None, (), Clock(-9.0))  # it is over
    assert plans == {}
    assert notes[0].startswith("left out, for lack of time: modified-sequential, beam, cascade")
