"""The comparison harness: what it stores, what it charges, and the profiles it draws."""

from __future__ import annotations

import re
import signal
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.__main__ import TOGETHER, claims, main, run, run_all
from experiments.harness.claim import (
    Claim,
    ClaimError,
    Extra,
    Finding,
    Option,
    modules,
    on_this_run,
)
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
from tests.builders import ROOT

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


@pytest.mark.parametrize(
    ("printed", "status", "verdict"),
    [
        ("verdict: the claim holds", 0, "holds"),
        ("verdict: the claim holds: all pictures drawn", 0, "holds"),
        ("verdict: the claim does not hold on this run", 0, "does not hold on this run"),
        ("no verdict", 0, "failed: no verdict"),
        ("verdict: the claim holds", 1, "failed: verdict: the claim holds"),
        ("pip install extra", 2, "left out: pip install extra"),
    ],
)
def test_a_verdict_is_the_last_line_of_a_run_that_ended_well(monkeypatch, printed, status, verdict):
    done = subprocess.CompletedProcess([], status, f"table\n{printed}\n", "")
    monkeypatch.setattr("experiments.__main__.subprocess.run", lambda *_, **__: done)
    assert run("figures")[0] == verdict


def test_all_claims_are_listed(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["experiments"])
    assert main() == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == list(claims())
    assert {"engine_speed", "dry_map", "speed_accuracy"} <= set(claims())
    assert "blocks" not in claims()


TIMED = {name for name, claim in claims().items() if claim.takes_time}


def test_every_claim_is_found_by_its_plain_name_and_starts_its_module():
    for name, claim in claims().items():
        assert claim.module == modules()[name]
        assert claim.module.split(".")[-1] == name
        assert claim.text.endswith(".")


def test_no_claims_are_an_error_and_not_an_empty_list(tmp_path, monkeypatch, capsys):
    (tmp_path / "engines" / "parts").mkdir(parents=True)
    (tmp_path / "engines" / "__init__.py").touch()
    (tmp_path / "engines" / "parts" / "chart.py").touch()
    with pytest.raises(ClaimError, match="no experiments found in"):
        modules(tmp_path)
    monkeypatch.setattr("experiments.harness.claim.modules", lambda: modules(tmp_path))
    for arguments in ([], ["all", "--quick"]):
        monkeypatch.setattr("sys.argv", ["experiments", *arguments])
        assert main() == 1
        assert len(capsys.readouterr().err.splitlines()) == 1


def test_two_experiments_of_one_name_are_an_error(tmp_path):
    for folder in ("engines", "discrete"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "speed.py").touch()
    with pytest.raises(ClaimError, match="two experiments are named speed"):
        modules(tmp_path)


def test_a_module_among_the_claims_that_declares_none_is_an_error(monkeypatch):
    helper = "experiments.harness.scenes"
    monkeypatch.setattr("experiments.harness.claim.modules", lambda: {"scenes": helper})
    with pytest.raises(ClaimError, match=f"{helper} declares no CLAIM"):
        claims()


@pytest.mark.parametrize(
    ("finding", "line"),
    [
        (Finding(holds=True), "verdict: the claim holds"),
        (Finding(holds=False, note=": 79 numbers"), "verdict: the claim does not hold: 79 numbers"),
        (on_this_run(holds=True), "verdict: the claim holds"),
        (on_this_run(holds=False), "verdict: the claim does not hold on this run"),
        (None, ""),
    ],
)
def test_the_verdict_line(capsys, finding, line):
    Claim(stand_in(finding), quick="").main([])
    assert capsys.readouterr().out == (f"{line}\n" if line else "")


def test_options_are_switches_or_texts():
    options = (Option("--fresh", ""), Option("--python", "", "python3"))
    claim = Claim(stand_in(None), quick="", options=options)
    assert vars(claim.parse([])) == {"quick": False, "fresh": False, "python": "python3"}
    assert claim.parse(["--quick", "--fresh", "--python", "x"]).python == "x"


def test_a_missing_extra_ends_with_its_own_status(capsys):
    claim = Claim(stand_in(None), quick="", needs=(Extra("no_such_module", "pip install it"),))
    with pytest.raises(SystemExit) as ended:
        claim.main([])
    assert ended.value.code == 2
    assert capsys.readouterr().out == "no_such_module is not installed: pip install it\n"


def test_a_claim_without_its_sentence_is_an_error():
    with pytest.raises(ClaimError, match="starts with 'The comparison"):
        _ = Claim(test_options_are_switches_or_texts, quick="").text


def stand_in(finding):
    """Return an experiment with a text of its own."""

    def experiment(options):
        return finding

    experiment.__module__ = "experiments.figures"
    return experiment


def test_commands_that_are_written_down_exist():
    """In the documentation and in the experiments' own texts."""
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    pages += (ROOT / "experiments").rglob("*.py")
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    named = set(re.findall(r"-m\s+(experiments(?:\.\w+)+)", text))
    assert set(modules().values()) <= named
    for module in named:
        assert (ROOT / Path(*module.split("."))).with_suffix(".py").exists(), module


def test_timed_experiments_run_alone_the_others_two_at_a_time(monkeypatch, capsys):
    running, seen, lock = set(), {}, threading.Lock()

    def pretend(name, *arguments):
        assert arguments == ("--quick",)
        with lock:
            running.add(name)
            for other in running:
                seen.setdefault(other, set()).update(running)
            assert len(running) <= TOGETHER
        time.sleep(0.02)
        with lock:
            running.remove(name)
        return "holds", 1.0

    monkeypatch.setattr("experiments.__main__.run", pretend)
    table = run_all("--quick")
    assert table["experiment"].tolist() == list(claims())
    assert all(seen[name] == {name} for name in TIMED)
    assert any(len(seen[name]) == TOGETHER for name in set(claims()) - TIMED)
    assert len(capsys.readouterr().out.splitlines()) == len(claims())


def test_the_longest_start_first(monkeypatch):
    order = []
    seconds = {name: float(place) for place, name in enumerate(claims()) if name != "figures"}
    monkeypatch.setattr("experiments.__main__.stored", lambda _: seconds)
    monkeypatch.setattr("experiments.__main__.TOGETHER", 1)
    monkeypatch.setattr(
        "experiments.__main__.run", lambda name, *_: (order.append(name), ("holds", 1.0))[1]
    )
    run_all()
    others = [name for name in order if name not in TIMED]
    assert others[0] == "figures"  # what never ran may take long
    assert others[1:] == sorted(others[1:], reverse=True)
    assert set(order[len(others) :]) == TIMED


@pytest.mark.parametrize(
    ("verdict", "status"),
    [("holds", 0), ("holds, by one witness", 0), ("left out: pip", 0), ("does not hold", 1)],
)
def test_the_exit_status_says_whether_all_claims_hold(monkeypatch, verdict, status):
    monkeypatch.setattr("experiments.__main__.run", lambda *_: (verdict, 1.0))
    monkeypatch.setattr("sys.argv", ["experiments", "all", "--quick"])
    assert main() == status


def test_named_experiments_renew_their_own_verdicts(monkeypatch, tmp_path, capsys):
    before = pd.DataFrame(
        {
            "experiment": ["figures", "peers"],
            "verdict": "holds",
            "seconds": 2.0,
            "claim": "an old one",
        }
    )
    before.to_csv(tmp_path / "verdicts.csv", index=False)
    monkeypatch.setattr("experiments.__main__.STORE", tmp_path / "verdicts.csv")
    monkeypatch.setattr("experiments.__main__.run", lambda *_: ("does not hold", 1.0))
    monkeypatch.setattr("sys.argv", ["experiments", "peers", "calibration"])
    assert main() == 1
    after = pd.read_csv(tmp_path / "verdicts.csv")
    assert after["experiment"].tolist() == ["calibration", "figures", "peers"]
    assert after["verdict"].tolist() == ["does not hold", "holds", "does not hold"]
    monkeypatch.setattr("sys.argv", ["experiments", "perrs"])
    assert main() == 1
    assert "perrs: there is no such experiment" in capsys.readouterr().err
