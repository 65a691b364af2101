"""Large problems from the command line; how a command ends."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from seqopt import workflow
from seqopt._cli.answer import Status
from seqopt._cli.main import main
from seqopt.graph.formulation import Finding
from seqopt.plan import _answers as answers
from seqopt.scene.scene_file import load_scene, save_scene
from seqopt.workflow import Search
from tests.builders import ROOT, small_arch
from tests.commands import beside_models

WORDS = ["optimize", "--no-stability", "--formulation"]
posix = pytest.mark.skipif(os.name != "posix", reason="signals, limits, devices of POSIX")


def start(*words, **more):
    """Start the program in a session of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "seqopt", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        start_new_session=True,
        **more,
    )


def contents(folder):
    """Return the files of a folder, times left out."""
    out = {path.name: path.read_text("utf-8") for path in folder.iterdir()}
    out.pop("trace.csv", None)  # when what was known
    summary = json.loads(out["summary.json"])
    del summary["seconds"]
    return out | {"summary.json": summary}


@pytest.mark.parametrize(
    ("text", "size"), [("500 MB", 5e8), ("1.5GiB", 1.5 * 2**30), ("2e9", 2e9), ("1k", 1000)]
)
def test_sizes(text, size):
    assert Search(max_memory=text).memory == size


def test_what_does_not_fit_is_refused_before(capsys, tmp_path):
    out = ["--out", str(tmp_path / "out")]
    assert main([*WORDS, "overlap_dp", *out, "--max-memory", "100kB"]) == 2
    said = "--max-memory: it is too little to find a plan; give more"
    assert capsys.readouterr().err == f"seqopt: error: {said}\n"
    assert not (tmp_path / "out").exists()


@posix
@pytest.mark.slow
def test_a_run_under_a_memory_limit_ends_in_a_line(tmp_path):
    import resource  # noqa: PLC0415  # POSIX has it alone

    scene = tmp_path / "scene.json"
    save_scene(small_arch(25), scene)
    words = [*WORDS, "overlap_dp", scene, "--workers", "2"]
    statuses = set()
    for mebibytes in (300, 4096):
        limit = (mebibytes * 2**20,) * 2
        out = tmp_path / str(mebibytes)
        limited = partial(resource.setrlimit, resource.RLIMIT_AS, limit)
        run = start(*words, "--out", out, preexec_fn=limited)
        _, err = run.communicate(timeout=120)
        statuses.add(run.returncode)
        assert run.returncode in (0, 4), (mebibytes, err)
        assert out.exists() == (run.returncode == 0)
        assert beside_models(err).count("\n") == bool(run.returncode), (mebibytes, err)
    assert statuses == {0, 4}


@pytest.mark.slow
def test_an_interrupted_choice_is_written_with_its_bound(capsys, monkeypatch, tmp_path):
    """As ctrl-C at the first finding; what is written is whole."""
    came = []

    def interrupt(found):  # in the place of what shows how far it is
        if isinstance(found, Finding) and not came:
            came.append(found)
            signal.raise_signal(signal.SIGINT)

    real = workflow.Run
    monkeypatch.setattr(
        workflow, "Run", lambda seconds, _, *rest, **more: real(seconds, interrupt, *rest, **more)
    )
    words = [*WORDS, "labels", "chain:bricks=8", "--budget", "travel=0.9"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 130
    out, err = capsys.readouterr()
    assert err == "seqopt: interrupted; the plan is the best that was met\n"
    assert "written to" in out
    written = contents(tmp_path / "out")
    assert set(written) >= {"plan.csv", "tasks.csv"}
    assert (tmp_path / "out" / "trace.csv").exists()
    summary = written["summary.json"]
    assert summary["ended"] == "interrupted"
    assert summary["bound"]["sum"] <= summary["objective"]["sum"]


def test_an_interrupt_ends_all_that_is_compared(capsys, monkeypatch):
    """One plan that was interrupted does not let the next begin."""
    selected = answers._choose_states

    def interrupted(formulation, problem, options, run):
        options["watch"].interrupt()
        return selected(formulation, problem, options, run)

    monkeypatch.setattr(answers, "_choose_states", interrupted)
    assert main(["compare"]) == 130
    assert capsys.readouterr().err == "seqopt: interrupted\n"


# how a command ends: one table of statuses, and never a traceback
def shell(line):
    """A line of the shell, in which ``seqopt`` is this one."""
    program = f"{sys.executable} -W error -m seqopt"
    return subprocess.run(
        line.replace("seqopt", program),
        shell=True,
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )


@pytest.mark.slow
@posix
@pytest.mark.parametrize(
    ("line", "status", "said"),
    [
        ("seqopt analyze --method sequential | head -1 >&2", 0, "step,type,bricks"),
        ("seqopt analyze --method sequential >/dev/full", 2, "No space left on device"),
        ("seqopt analyze --method sequential >&-", 2, "standard output is closed"),
        ("seqopt scene arch52 >&- 2>&- <&-", 2, ""),
        ("PYTHONIOENCODING=ascii seqopt assess --help", 0, ""),
    ],
)
def test_streams_that_are_closed_or_full(line, status, said):
    done = shell(line)
    assert done.returncode == status
    assert said in done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert "Exception ignored" not in done.stderr
    told = beside_models(done.stderr).splitlines()
    notes = [line for line in told if not line.startswith(("robots: ", "payload exceeded: "))]
    assert len(notes) <= 1


@pytest.mark.slow
@posix
def test_a_closed_stream_does_not_spoil_a_file(tmp_path):
    out = tmp_path / "out.csv"
    assert shell(f"seqopt analyze --method sequential --out {out} >&-").returncode == 0
    assert out.read_text(encoding="utf-8").startswith("step,type")
    assert "written" not in out.read_text(encoding="utf-8")


@posix
@pytest.mark.slow
@pytest.mark.parametrize(
    ("which", "after"), [(signal.SIGINT, 0.3), (signal.SIGTERM, 0.3), (signal.SIGHUP, 1.5)]
)
def test_an_interrupt_is_one_line(tmp_path, which, after):
    """Also where who runs the tests ignores signals, as ``nohup`` does."""
    words = ["optimize", "--formulation", "overlap_dp", "--engine", "frame"]  # takes minutes
    words += ["--out", str(tmp_path / "out")]
    program = start(*words, preexec_fn=partial(signal.signal, which, signal.SIG_DFL))
    time.sleep(after)
    program.send_signal(which)
    out, err = program.communicate(timeout=30)
    assert (program.returncode, out, err) == (130, "", "seqopt: interrupted\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (KeyboardInterrupt(), Status.INTERRUPTED, "seqopt: interrupted"),
        (MemoryError("Unable to allocate 5 GiB"), Status.FAILED, "Unable to allocate 5 GiB; take"),
        (OSError(28, "No space left on device"), Status.BAD_INPUT, "standard output: No space"),
    ],
)
def test_what_ends_a_command_is_one_line(capsys, monkeypatch, error, status, said):
    def fails():
        raise error

    monkeypatch.setattr("seqopt._cli.commands.scene.run", fails)
    assert main(["scene"]) == status
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_a_fault_of_the_program_has_a_status_that_no_answer_has():
    """Python ends with 1, which is the status of what does not hold."""
    program = """
import sys
import seqopt._cli.commands.instances
from seqopt.__main__ import run

def fails(path):
    raise KeyError(chr(27) + "[2J")

seqopt._cli.commands.instances.read_instance = fails
sys.argv = ["seqopt", "judge", "a", "b"]
sys.exit(run())
"""
    words = {"capture_output": True, "text": True, "cwd": ROOT, "timeout": 30}
    done = subprocess.run([sys.executable, "-c", program], check=False, **words)
    assert (done.returncode, done.stdout) == (Status.CRASHED, "")
    assert "Traceback" in done.stderr
    assert done.stderr.splitlines()[-1].startswith("seqopt: internal error: KeyError: ")
    assert chr(27) not in done.stderr


def test_statuses():
    """The table of docs/command_line.md is this one."""
    page = Path(ROOT, "docs", "command_line.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| ")]
    assert [row for row in rows if row.isdigit()] == [str(status.value) for status in Status]


def test_a_mechanism_has_no_answer(capsys, tmp_path):
    plan = tmp_path / "plan.csv"
    plan.write_text("step,type,bricks,rob1_node\n1,place,1,1\n", encoding="utf-8")
    arch = load_scene("arch25")
    loose = replace(arch.grounds[0], translational_stiffness=(0.0, 0.0, 0.0))
    grounds = (replace(loose, rotational_stiffness=(0.0, 0.0, 0.0)), arch.grounds[1])
    save_scene(replace(arch, grounds=grounds, robots=arch.robots[:1]), tmp_path / "s.json")
    assert main(["analyze", str(tmp_path / "s.json"), "--plan", str(plan)]) == Status.NO_ANSWER
    assert "nothing resists" in capsys.readouterr().err
