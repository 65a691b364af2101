"""Input changed at random, at small size; and the judge of it, which must see faults."""

from __future__ import annotations

import io
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from seqopt.errors import SeqoptError
from tests.quality import fuzz_judge
from tests.quality.fuzz import BLOCKS, _left, holds, is_clean, killed, main, summary
from tests.quality.fuzz_cases import Mutator
from tests.quality.fuzz_files import read_damaged, right_files
from tests.quality.fuzz_judge import judge, judged, run

CASES = 120


@pytest.fixture(scope="module")
def mutator():
    return Mutator()


@pytest.mark.slow
def test_a_small_run_of_the_command_finds_no_fault(capsys):
    assert main(["--cases", "5", "--kills", "2", "--files", "2"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "no fault: 5 cases, 2 kills"


@pytest.mark.slow
def test_changed_input_leaves_no_fault_and_one_that_would_is_told():
    rows = list(run(0, CASES))
    assert [row for row in rows if row["fault"]] == []
    cases, kills = pd.DataFrame(rows), pd.DataFrame({"left": ["whole"], "signal": ["SIGKILL"]})
    assert holds(summary(cases), kills)
    assert not holds(summary(cases.assign(fault=["any", *[""] * (CASES - 1)])), kills)
    assert not holds(summary(cases), kills.assign(left="a part"))
    assert {row["kind"] for row in rows} == {"scene", "plan", "words", "nothing"}
    assert {row["status"] for row in rows} >= {0, 2, 3}


@pytest.mark.parametrize("number", [5793, 17131])  # bricks of 1e9 m: no answer was finite
def test_cases_that_were_faults_are_none_now(mutator, number):
    assert judge(mutator.case(number)).fault == ""


def case_of(mutator, *words):
    return replace(
        next(c for c in map(mutator.case, range(99)) if c.kind == "nothing"), words=words
    )


def test_a_traceback_is_seen(mutator, monkeypatch):
    def fails(_):
        raise ZeroDivisionError

    monkeypatch.setattr(fuzz_judge, "main", fails)
    assert judge(case_of(mutator, "scene")).fault.startswith("traceback: ZeroDivisionError")


@pytest.mark.parametrize(
    ("does", "seen"),
    [
        (lambda: 7, "status 7"),
        (lambda: 2, "status 2 without a reason"),
        (lambda: Path(".left").touch() or 0, "left over"),
        (lambda: Path("scene.json").write_text("", encoding="utf-8") or 0, "input was changed"),
        (lambda: print("\x1b[2J") or 0, "steers a terminal"),
    ],
)
def test_an_end_that_is_wrong_is_seen(mutator, monkeypatch, does, seen):
    monkeypatch.setattr(fuzz_judge, "main", lambda _: does())
    assert seen in judge(case_of(mutator, "scene")).fault


@pytest.mark.parametrize("lost", ["T_max", "F_rob1_N"])
def test_a_result_that_is_not_finite_is_seen(mutator, monkeypatch, lost):
    case = case_of(mutator, "analyze", "scene.json", "--method", "sequential")
    assert judge(case).fault == ""
    text = "step,type,bricks,rob1_brick,rob1_node,F_rob1_N,F_sup_N,M_sup_Nm,F_min_N,F_max_N,F_avg_N"
    text += ",T_pct,D_max_1e-3mm,D_avg_1e-3mm,D_std_1e-3mm\n1,place,1,1,1,{},1,1,1,{},1,1,1,1,1\n"
    cells = ("", 1) if lost == "F_rob1_N" else (1, "inf")
    monkeypatch.setattr(fuzz_judge, "main", lambda _: print(text.format(*cells), end="") or 0)
    said = "a robot that grips has no force" if lost == "F_rob1_N" else "response is not finite"
    assert said in judge(case).fault


def test_a_hang_is_seen():
    """Nothing is as fast as a millisecond."""
    (row,) = judged(0, 1, longest=1e-3)
    assert row["fault"] == "hangs: more than 0.001 s"


def test_a_part_of_a_folder_is_seen(tmp_path):
    assert _left(tmp_path / "none", BLOCKS) == "nothing"
    (tmp_path / "0").mkdir()
    for name in BLOCKS[1:]:
        (tmp_path / "0" / name).write_bytes(np.zeros(500_000, np.uint8).tobytes())
    assert _left(tmp_path, BLOCKS) == "a part"
    (tmp_path / "0" / BLOCKS[0]).write_bytes(b"")
    assert _left(tmp_path, BLOCKS) == "a part"
    (tmp_path / "0" / BLOCKS[0]).write_bytes(bytes(500_000))
    assert _left(tmp_path, BLOCKS) == "whole"
    (tmp_path / ".hidden").mkdir()
    assert _left(tmp_path, BLOCKS) == "whole, and a hidden folder"
    assert not is_clean({"left": "a part", "signal": "SIGKILL"})
    assert not is_clean({"left": "whole, and a hidden folder", "signal": "SIGTERM"})


@pytest.mark.slow
@pytest.mark.parametrize(
    "number", [0, 1, 2, *(pytest.param(number, marks=pytest.mark.long) for number in (3, 4, 5))]
)
def test_a_program_that_is_killed_leaves_nothing_or_a_whole(number):
    assert is_clean(killed("optimize" if number % 2 else "write", number))


KINDS = (
    *("instance", "timed instance", "answer", "answer as text", "bound 1", "bound 2", "bound 3"),
    *("scene", "plan", "schedule", "state", "measured", "summary", "compas_assembly", "boxes"),
    *("obj", "ply", "stl", "postures"),
)


def test_files_of_every_kind_are_right_before_they_are_damaged(tmp_path):
    assert {*right_files()} == {*KINDS}
    for name, right, read in right_files().values():
        (tmp_path / name).write_bytes(right)
        assert read(tmp_path / name) is not None


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_file_is_read_or_one_line_says_why_not(tmp_path, kind):
    assert [f for n in range(60) if (f := read_damaged(kind, n, tmp_path))] == []


def test_a_reader_that_fails_otherwise_is_seen(tmp_path, monkeypatch):
    def fails(path):
        raise KeyError(path.name)

    name, right, _ = right_files()["plan"]
    monkeypatch.setitem(right_files(), "plan", (name, right, fails))
    assert "KeyError" in read_damaged("plan", 0, tmp_path)


def with_part(content, name, part, announced=None):
    """Return an archive with one part in place of its own, of which its directory may lie."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts = {each: archive.read(each) for each in archive.namelist()} | {name: part}
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for each, own in parts.items():
            archive.writestr(each, own)
    packed = bytearray(out.getvalue())
    if announced is not None:  # in the directory, and before the part itself
        size = len(part).to_bytes(4, "little")
        packed = packed.replace(size, announced.to_bytes(4, "little"))
    return bytes(packed)


MANY, SOME = 260_000_000, 120_000_000  # zeros: in an archive a megabyte
MOST = 80e6  # bytes; a file may take 64 MB before anything is unpacked


@pytest.mark.parametrize(
    ("kind", "name", "size", "announced"),
    [
        ("instance", "amount_0.npy", MANY, None),
        ("instance", "amount_0.npy", SOME, 900),
        ("instance", "more.npy", SOME, None),
    ],
)
def test_no_more_is_unpacked_than_may_be(tmp_path, kind, name, size, announced):
    file, right, read = right_files()[kind]
    (tmp_path / file).write_bytes(with_part(right, name, bytes(size), announced))
    assert _takes(tmp_path / file, read) < MOST


def _takes(path, read):
    """Return the most memory that it takes to refuse a file, bytes."""
    tracemalloc.start()
    try:
        with pytest.raises(SeqoptError):
            read(path)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_what_only_counts_takes_no_memory(tmp_path):
    """A table has a cell for every column of every row."""
    name, _, read = right_files()["plan"]
    (tmp_path / name).write_bytes(b"a," * 20_000 + b"\n1" * 20_000)
    assert _takes(tmp_path / name, read) < MOST
