"""Speed against accuracy: what is stored, what is charged, and the profiles that are drawn."""

from __future__ import annotations

import signal

import numpy as np
import pandas as pd
import pytest

from experiments.harness.runs import ENGINES, NO_PROOF, REFERENCE, rows
from experiments.placement.parts.speed_charts import (
    data_profile,
    pareto,
    performance_profile,
    profile_charts,
    shifted_mean,
    worst_step_chart,
)
from experiments.placement.parts.speed_points import ending_by_processor, points, speed_tables
from experiments.placement.speed_accuracy import (
    COMPARED,
    KEY,
    RATIOS,
    collect,
    holds,
    measure,
    specs,
    summarize,
)
from seqopt.graph.formulation import formulations

STAGES = ["assemble", "respond", "rank", "compile", "solve", "verify"]


CASES = [(e, c) for e in ENGINES for c in COMPARED if e == REFERENCE or c == COMPARED[0]]


@pytest.fixture(scope="session")
def smoke():
    """Every engine with every formulation on the smallest arch, the reference by all criteria."""
    table = pd.concat([pd.DataFrame(rows("chain7", *case, repeats=1)) for case in CASES])
    return table.reset_index(drop=True)


@pytest.mark.slow
@pytest.mark.xdist_group("smoke")
def test_everything_runs_and_is_a_row(smoke):
    assert len(smoke) == len(CASES) * (len(formulations("costs")) + 1)
    assert smoke[[*STAGES, "gap", "error", "objective", "models"]].notna().all(axis=None)
    assert smoke["total"].to_numpy() == pytest.approx(smoke[STAGES].sum(axis=1).to_numpy())
    exact = smoke[(smoke["engine"] == REFERENCE) & (smoke["formulation"] == "overlap_dp")]
    assert (exact["gap"] <= 1e-12).all()
    assert (exact["error"] == 0).all()
    errors = smoke.groupby("engine")["error"].max()
    assert errors["auto"] < 1e-11  # few sets here, many there: they are solved on two routes
    assert errors["auto"] < errors["discrete"] < 1e-8
    assert errors["discrete"] < errors["frame 1e7"] < 1e-5 < errors["frame 1e3"]
    windows = smoke[smoke["formulation"] == "cascade"]
    assert windows["models"].max() < exact["models"].min()
    alone = smoke[smoke["formulation"] == NO_PROOF].reset_index(drop=True)
    proven = smoke[smoke["formulation"] == "cascade"].reset_index(drop=True)
    pd.testing.assert_series_equal(alone["objective"], proven["objective"], rtol=1e-9)
    compiled = smoke[smoke["formulation"].isin(["overlap_lp", "overlap_mip"])]
    assert (compiled["compile"] > 0).all()


@pytest.mark.slow
@pytest.mark.xdist_group("smoke")
def test_stored_runs_are_not_repeated(smoke, monkeypatch):
    calls = []
    monkeypatch.setattr(
        "experiments.placement.speed_accuracy.measure",
        lambda spec: calls.append(spec) or measured(smoke, spec),
    )
    wanted = [("chain7", REFERENCE, c, 1) for c in COMPARED]
    first = collect(wanted[:2], pd.DataFrame())
    again = collect(wanted, first)
    assert calls == [*wanted[:2], *wanted[2:]]
    assert not again.duplicated([*KEY, "formulation"]).any()


def measured(smoke, spec):
    from importlib.metadata import version  # noqa: PLC0415

    part = smoke[(smoke["engine"] == spec[1]) & (smoke["criterion"] == spec[2])]
    return part.assign(version=version("seqopt")).to_dict("records")


@pytest.mark.slow
def test_a_run_out_of_time_is_charged_its_limit():
    charged = pd.DataFrame(measure(("chain7", REFERENCE, "weighted-published", 1), limit=0.01))
    assert (charged["status"] == "time limit").all()
    assert (charged["total"] == 0.01).all()
    assert (charged["gap"] == 1.0).all()
    failed = pd.DataFrame(measure(("chain7", "no such engine", "weighted-published", 1)))
    assert (failed["status"] == "failed").all()


@pytest.mark.slow
@pytest.mark.xdist_group("smoke")
def test_the_claim_can_fail(smoke):
    assert holds(smoke)["dynamic programming has no gap"]
    corner = (smoke["formulation"] == "overlap_dp") & (smoke["engine"] == REFERENCE)
    slow = smoke.assign(total=smoke["total"].where(~corner, 10 * smoke["total"]))
    assert not holds(slow)["nothing proves its plan sooner by more than a tenth"]
    worse = smoke.assign(gap=smoke["gap"].where(~corner, 0.1))
    assert not holds(worse)["dynamic programming has no gap"]
    arch = smoke.assign(scene="arch25")
    text = "rigid bricks spend half of their time or less on the proof"
    without = (arch["formulation"] == NO_PROOF) & (arch["engine"] == REFERENCE)
    assert not holds(arch.assign(total=arch["total"].where(~without, 0.0)))[text]
    assert holds(arch.assign(total=arch["total"].where(~without, 9.0)))[text]


@pytest.mark.slow
@pytest.mark.xdist_group("smoke")
def test_charts_and_table_come_from_rows(smoke):
    table = smoke.assign(scene="arch25")
    for figure in (worst_step_chart(table, pd.read_csv(RATIOS)), profile_charts(table)):
        figure.canvas.draw()
    means = summarize(smoke).set_index("formulation")
    assert means.loc["overlap_dp", "optimal"] == means.loc["overlap_dp", "runs"] == len(COMPARED)
    assert set(specs(quick=True)) < {
        (s, e, "weighted-published", 1) for s in ("chain7",) for e in ENGINES
    }


@pytest.mark.slow
def test_points_are_read_as_they_were_measured():
    measured = points("wall:columns=2,courses=2", 20.0)
    (table,) = speed_tables(measured)
    assert (table.reference, table.limit) == ("compliance", 20.0)
    assert table.table["seconds"].equals(measured["seconds"])
    assert table.take["exact"]
    worse = measured.assign(gap=measured["gap"].where(~measured["exact"], 0.5))
    (other,) = speed_tables(worse)
    assert other.sentence != table.sentence


def burn():
    while True:
        sum(range(1000))


def test_processor_time_ends_what_takes_too_long():
    with pytest.raises(TimeoutError), ending_by_processor(0.02):
        burn()
    with pytest.raises(KeyboardInterrupt), ending_by_processor(60.0):
        signal.raise_signal(signal.SIGINT)


def test_pareto_front():
    cost, loss = np.array([1.0, 2.0, 3.0, 2.0, 4.0]), np.array([3.0, 1.0, 1.0, 2.0, 0.0])
    assert pareto(cost, loss).tolist() == [True, True, False, False, True]
    assert pareto(np.ones(2), np.ones(2)).all()  # equals do not beat each other


def test_profiles():
    costs = pd.DataFrame({"a": [1.0, 4.0, np.inf], "b": [2.0, 2.0, 3.0]})
    profile = performance_profile(costs, np.array([1.0, 2.0]))
    assert profile["a"].tolist() == pytest.approx([1 / 3, 2 / 3])
    assert profile["b"].tolist() == pytest.approx([2 / 3, 1.0])
    assert data_profile(costs, np.array([1.0, 3.0]))["b"].tolist() == [0.0, 1.0]


def test_shifted_mean():
    """Equal values keep their mean; a large shift makes it the arithmetic one."""
    assert shifted_mean(np.full(3, 0.2), 0.01) == pytest.approx(0.2)
    assert shifted_mean(np.array([1.0, 3.0]), 1e6) == pytest.approx(2.0, rel=1e-5)
    assert shifted_mean(np.array([1.0, 4.0]), 0.0) == pytest.approx(2.0)
