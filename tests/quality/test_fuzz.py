"""Input changed at random, and the judge of it; another kernel is named, and runs where asked."""

import io
import os
import subprocess
import sys
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from seqopt.errors import SeqoptError
from seqopt.responses.quantities import RESPONSES
from tests.builders import ROOT
from tests.quality import fuzz
from tests.quality.fuzz import judge, main, run
from tests.quality.fuzz_cases import Mutator
from tests.quality.fuzz_files import read_damaged, right_files
from tests.quality.kernels import other, running

CASES = 120


@pytest.fixture(scope="module")
def mutator():
    return Mutator()


@pytest.mark.slow
def test_a_small_run_of_the_command_finds_no_fault(capsys, monkeypatch):
    assert main(["--cases", "5", "--files", "2"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "no fault: 5 cases"
    monkeypatch.setattr(fuzz, "judge", lambda _: (2, "any"))  # the control
    assert main(["--cases", "1", "--files", "0"]) == 1
    assert "fault: case 0: any" in capsys.readouterr().out


@pytest.mark.slow
def test_changed_input_leaves_no_fault():
    rows = [*run(0, CASES), *run(733, 734)]  # the last one has no answer
    assert [fault for _, _, fault in rows if fault] == []
    assert {case.kind for case, _, _ in rows} == {"scene", "plan", "words", "nothing"}
    assert {status for _, status, _ in rows} >= {0, 2, 3}


def test_a_case_that_was_a_fault_is_none_now(mutator):
    assert judge(mutator.case(17131))[1] == ""  # bricks of 1e9 m: no answer was finite


def case_of(mutator, *words):
    return replace(
        next(c for c in map(mutator.case, range(99)) if c.kind == "nothing"), words=words
    )


def test_a_traceback_is_seen(mutator, monkeypatch):
    def fails(_):
        raise ZeroDivisionError

    monkeypatch.setattr(fuzz, "run_command", fails)
    assert judge(case_of(mutator, "scene"))[1].startswith("traceback: ZeroDivisionError")


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
    monkeypatch.setattr(fuzz, "run_command", lambda _: does())
    assert seen in judge(case_of(mutator, "scene"))[1]


@pytest.mark.parametrize("lost", ["T_max", "F_rob1_N"])
def test_a_result_that_is_not_finite_is_seen(mutator, monkeypatch, lost):
    case = case_of(mutator, "analyze", "scene.json", "--method", "sequential")
    assert judge(case)[1] == ""
    columns = [each.column for each in RESPONSES.values()]
    values = ["{}" if name == "F_max_N" else "1" for name in columns]
    text = ",".join(["step,type,bricks,rob1_brick,rob1_node,F_rob1_N", *columns])
    text += ",".join(["\n1,place,1,1,1,{}", *values]) + "\n"
    cells = ("", 1) if lost == "F_rob1_N" else (1, "inf")
    monkeypatch.setattr(fuzz, "run_command", lambda _: print(text.format(*cells), end="") or 0)
    said = "a robot that grips has no force" if lost == "F_rob1_N" else "response is not finite"
    assert said in judge(case)[1]


@pytest.mark.slow
def test_a_hang_ends_the_run():
    """Nothing is as fast as a millisecond."""
    code = "from tests.quality import fuzz; fuzz.LONGEST = 1e-3; print([*fuzz.run(0, 1)])"
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert "Timeout (0:00:00.001" in done.stderr


KINDS = (
    *("instance", "timed instance", "answer", "answer as text", "bound 1", "bound 2", "bound 3"),
    *("scene", "plan", "schedule", "measured", "summary", "compas_assembly", "boxes"),
    *("obj", "postures"),
)


def test_files_of_every_kind_are_right_before_they_are_damaged(tmp_path):
    assert {*right_files()} == {*KINDS}
    for name, right, read in right_files().values():
        (tmp_path / name).write_bytes(right)
        assert read(tmp_path / name) is not None


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_file_is_read_or_one_line_says_why_not(tmp_path, kind):
    assert [f for n in range(12) if (f := read_damaged(kind, n, tmp_path))] == []


def test_a_reader_that_fails_otherwise_is_seen(tmp_path, monkeypatch):
    def fails(path):
        raise KeyError(path.name)

    name, right, _ = right_files()["plan"]
    monkeypatch.setitem(right_files(), "plan", (name, right, fails))
    assert "KeyError" in read_damaged("plan", 0, tmp_path)


def with_part(content, name, part):
    """Return an archive with one part in place of its own."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts = {each: archive.read(each) for each in archive.namelist()} | {name: part}
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for each, own in parts.items():
            archive.writestr(each, own)
    return out.getvalue()


MANY, SOME = 260_000_000, 120_000_000  # zeros: in an archive a megabyte
MOST = 80e6  # bytes; a file may take 64 MB before anything is unpacked


@pytest.mark.parametrize(("name", "size"), [("amount_0.npy", MANY), ("more.npy", SOME)])
def test_no_more_is_unpacked_than_may_be(tmp_path, name, size):
    file, right, read = right_files()["instance"]
    (tmp_path / file).write_bytes(with_part(right, name, bytes(size)))
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


# another kernel is named, and runs where it is asked for
CODE = "from tests.quality.kernels import running; print(*running().values())"


@pytest.mark.skipif(not other(), reason="no OpenBLAS, or no other kernel by name")
def test_the_other_kernel_runs_where_it_is_asked_for():
    asked = os.environ | {"OPENBLAS_CORETYPE": other()}
    command = [sys.executable, "-c", CODE]
    ran = subprocess.run(command, env=asked, cwd=ROOT, capture_output=True, text=True, check=True)
    assert {*ran.stdout.split()} == {other()}
    assert other() not in running().values()  # the control


def test_every_run_says_which_kernels_it_has(pytestconfig):
    (line,) = (
        line
        for line in pytestconfig.hook.pytest_report_header(config=pytestconfig, start_path=ROOT)
        if "kernels" in line
    )
    for package, kernel in running().items():
        assert f"{package} {kernel}" in line
