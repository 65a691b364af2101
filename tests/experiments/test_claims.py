"""Claims; counterparts of the paper's figures and tables."""

import re
import subprocess
import sys

import pandas as pd
import pytest

from experiments.__main__ import main
from experiments.harness import claim as harness
from experiments.harness.claim import Claim, ClaimError, Finding, find_claim, modules
from experiments.harness.results import RESULTS
from experiments.placement import formulations
from experiments.study.paper_counterparts import ITEMS, KNOWN, faults, page
from experiments.study.parts.counterpart_rows import COUNTERPARTS, ours, tabulate
from tests.builders import ROOT

ALWAYS = "criteria_variants"  # one that takes a second runs among the quick tests too
LONG = ("identify_arch25", "dry_map", "dry_methods", "paper_counterparts")  # rows: below


def marks(name):
    """Whether a claim is for every day, or for a release."""
    if name == ALWAYS:
        return []
    return [pytest.mark.slow, pytest.mark.long] if name in LONG else pytest.mark.slow


def written():
    """When stored files were written."""
    files = [*RESULTS.glob("*"), *(ROOT / "docs").rglob("*.[pm][nd]*")]
    return {path: path.stat().st_mtime_ns for path in files}


@pytest.mark.parametrize("name", [pytest.param(n, marks=marks(n)) for n in modules()])
def test_a_quick_run_ends_with_a_verdict_and_stores_nothing(name, capsys):
    claim = find_claim(name)
    for extra in claim.needs:
        pytest.importorskip(extra.module)
    before = written()
    claim.main(["--quick", "--store"])
    verdict = capsys.readouterr().out.splitlines()[-1]
    assert verdict.startswith("verdict: the claim")
    if not claim.timed:  # else it depends on the machine
        assert "the claim holds" in verdict
    assert written() == before


@pytest.mark.slow
def test_listing_takes_no_import_of_an_experiment():
    command = "import sys; from experiments.__main__ import main; main([]); print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", command], cwd=ROOT, capture_output=True, text=True, check=True
    )
    *lines, loaded = done.stdout.splitlines()
    assert [line.split()[0] for line in lines] == [*modules()]
    assert {"engine_speed", "dry_map", "formulations"} <= {*modules()}
    assert "seqopt" not in loaded.split()


@pytest.mark.slow
def test_every_claim_is_found_by_its_plain_name_and_starts_its_module():
    for name, (module, text) in modules().items():
        assert find_claim(name).name == name == module.rpartition(".")[2]
        assert text.endswith(".")


def test_no_claims_are_an_error_and_not_an_empty_list(tmp_path, monkeypatch, capsys):
    (tmp_path / "parts.py").write_text('"""What makes no claim."""')
    with pytest.raises(ClaimError, match="no experiments found in"):
        modules(tmp_path)
    monkeypatch.setattr("experiments.__main__.modules", lambda: modules(tmp_path))
    for arguments in ([], ["all", "--quick"]):
        assert main(arguments) == 1
        assert len(capsys.readouterr().err.splitlines()) == 1


def test_two_experiments_of_one_name_are_an_error(tmp_path):
    for folder in ("engines", "discrete"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "speed.py").write_text('"""Claim: it is fast."""')
    with pytest.raises(ClaimError, match="two experiments are named speed"):
        modules(tmp_path)


def test_a_module_that_claims_and_declares_nothing_is_an_error(monkeypatch, capsys):
    helper = "experiments.harness.scenes"
    monkeypatch.setattr(harness, "modules", lambda: {"scenes": (helper, "")})
    with pytest.raises(ClaimError, match=f"{helper} declares no CLAIM"):
        find_claim("scenes")
    assert main(["--help"]) == 0
    assert "python -m experiments NAME" in capsys.readouterr().out
    assert main(["perrs"]) == 1
    assert "perrs: there is no such experiment; give one of scenes" in capsys.readouterr().err


def stand_in(finding, **words):
    """A claim that finds what is given."""

    def experiment(options):
        return finding

    experiment.__module__ = "experiments.figures"
    return Claim(experiment, quick="little", **words)


@pytest.mark.parametrize(
    ("finding", "words", "line"),
    [
        (Finding(holds=True), {}, "the claim holds"),
        (Finding(holds=False, note=": 79 numbers"), {}, "the claim does not hold: 79 numbers"),
        (Finding(holds=False), {"timed": True}, "the claim does not hold on this run"),
        (Finding({"near": True, "far": False}), {}, "the claim does not hold"),
    ],
)
def test_the_last_line_and_the_exit_status_are_the_verdict(capsys, finding, words, line):
    assert stand_in(finding, **words).main() == ("not hold" in line)
    *parts, last = capsys.readouterr().out.splitlines()
    assert last == f"verdict: {line}"
    if isinstance(finding.holds, dict):
        assert parts == [f"{'yes' if v else 'NO'}: {k}" for k, v in finding.holds.items()]


def test_tables_and_verdicts_are_stored_when_asked(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.harness.results.RESULTS", tmp_path)
    monkeypatch.setattr(harness, "VERDICTS", tmp_path / "verdicts.csv")
    known = pd.DataFrame({"verdict": ["holds", "holds"], "seconds": 2.0}, ["gone", "makespan"])
    known.rename_axis("experiment").to_csv(tmp_path / "verdicts.csv")
    claim = stand_in(Finding(holds=False, tables={"rows": pd.DataFrame({"x": [1 / 3]})}), digits=2)
    for arguments in ([], ["--quick"], ["--quick", "--store"]):
        claim.main(arguments)
        assert not (tmp_path / "rows.csv").exists()
    claim.main(["--store"])
    assert (tmp_path / "rows.csv").read_text() == "x\n0.33\n"
    after = pd.read_csv(tmp_path / "verdicts.csv")
    assert after["experiment"].tolist() == ["figures", "makespan"]
    assert after["verdict"].tolist() == ["does not hold", "holds"]


def test_commands_that_are_written_down_exist():
    """In the documentation and in the experiments' own texts."""
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    pages += (ROOT / "experiments").rglob("*.py")
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    named = {*re.findall(r"python -m\s+experiments (\w+)", text)}
    assert named - {"all", "NAME"} == {*modules()}
    for module in re.findall(r"-m\s+(experiments(?:\.\w+)+)", text):
        assert (ROOT / module.replace(".", "/")).with_suffix(".py").exists(), module


ROW = (formulations.FREE, 7, "overlap_lp", 0.0)


@pytest.mark.slow
def test_a_formulation_is_limited_in_memory_and_ended_in_time():
    """A process of its own: what breaks its limits is a row, and other rows are as without it."""
    assert formulations.alone(*ROW)["ended"] == "optimal"
    assert formulations.alone(*ROW, memory=2**28)["ended"] not in formulations.PLANS
    assert formulations.alone(*ROW, most=0.01)["ended"] in ("out of time", "killed")


# counterparts of the paper's figures and tables: none is missing, the page says what is stored
STORED = pd.read_csv(ROOT / "experiments" / "results" / "paper_counterparts.csv")
PAGE = (ROOT / "docs" / "counterparts.md").read_text(encoding="utf-8")
WITH_NUMBERS = [item for item in ITEMS if item.numbers]


def test_whatever_has_numbers_has_a_counterpart():
    labels = {item.label for item in WITH_NUMBERS}
    assert labels == set(COUNTERPARTS) == set(STORED["id"])
    assert STORED[["printed", "ours", "difference", "error_pct"]].notna().all(axis=None)
    for item in ITEMS:
        assert f"`{item.label}`" in PAGE


@pytest.mark.slow
def test_what_is_computed_is_what_is_stored():
    own = ours()
    values = pd.concat([tabulate(item.label, own) for item in WITH_NUMBERS], ignore_index=True)
    for column in ("id", "quantity", "at"):
        assert [*values[column]] == [*STORED[column]]
    assert values["ours"].to_numpy(float) == pytest.approx(
        STORED["ours"].to_numpy(float), rel=1e-4, abs=1e-4
    )


def test_an_item_without_counterpart_is_found():
    missing = WITH_NUMBERS[3].label
    assert faults(WITH_NUMBERS, STORED) == []
    assert faults(WITH_NUMBERS, STORED[STORED["id"] != missing]) == [
        f"{missing} has no counterpart"
    ]


def test_a_fourth_disagreement_fails_the_claim_and_so_does_one_less():
    item = next(item for item in WITH_NUMBERS if item.label == "table:2robot_forces")
    bad = STORED.assign(error_pct=STORED["error_pct"].where(STORED["id"] != item.label, 50.0))
    assert len(faults(WITH_NUMBERS, bad)) == 1
    good = STORED.assign(error_pct=STORED["error_pct"].where(~STORED["id"].isin(KNOWN), 0.0))
    assert len(faults(WITH_NUMBERS, good)) == len(KNOWN)


def test_the_page_is_what_is_stored():
    assert page(STORED) == PAGE
    assert page(STORED.assign(ours=1.1 * STORED["ours"])) != PAGE  # the control
