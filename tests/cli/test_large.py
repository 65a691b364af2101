"""Large problems from the command line: workers, little memory, interrupts; a line each."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from functools import partial

import pytest

from seqopt import workflow
from seqopt._cli.main import main
from seqopt.plan import _answers as paths
from seqopt.scene.scene_file import save_scene
from seqopt.workflow import _parse_size
from tests.builders import ROOT, small_arch
from tests.commands import beside_models

WORDS = ["optimize", "--no-stability", "--formulation"]
posix = pytest.mark.skipif(os.name != "posix", reason="signals and limits of POSIX")


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
    assert _parse_size(text) == size


def test_what_does_not_fit_is_refused_before(capsys, tmp_path):
    out = ["--out", str(tmp_path / "out")]
    assert main([*WORDS, "overlap_dp", *out, "--max-memory", "100kB"]) == 4
    err = capsys.readouterr().err
    assert re.fullmatch(
        r"seqopt: out of memory: the responses of all choices take about [0-9.e-]+ GB, and "
        r"0\.0001 GB may be used; .*search without proof\n",
        err,
    )
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


def test_an_interrupted_choice_is_written_with_its_bound(capsys, monkeypatch, tmp_path):
    """As ctrl-C at the first finding; what is written is whole."""
    came = []

    def interrupt(_):  # in the place of what shows how far it is
        came.append(1)
        if len(came) == 1:
            signal.raise_signal(signal.SIGINT)

    real = workflow.Run
    monkeypatch.setattr(
        workflow, "Run", lambda seconds, _, *rest, **more: real(seconds, interrupt, *rest, **more)
    )
    words = [*WORDS, "labels", "--budget", "travel=0.8"]
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
    selected = paths._selected

    def interrupted(instance, formulation, run, watch, *more):
        watch.interrupt()
        return selected(instance, formulation, run, watch, *more)

    monkeypatch.setattr(paths, "_selected", interrupted)
    assert main(["compare"]) == 130
    assert capsys.readouterr().err == "seqopt: interrupted\n"
