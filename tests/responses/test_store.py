"""Stored answers: found again by content, believed only if whole, whoever else writes there."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace

import pytest

from seqopt._cli.main import main
from seqopt.engines.registry import make_engine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import FileError, SceneError
from seqopt.graph.decisions import pose_decisions
from seqopt.graph.states.states import of_decisions, over_scenarios
from seqopt.plan.solve import solve
from seqopt.problem.criteria import WeightedSum
from seqopt.problem.problem import WORST_TOTAL
from seqopt.responses import _blocks as blocks
from seqopt.responses._blocks import Store
from seqopt.responses._choices import Evaluation
from seqopt.responses.resources import Resources
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.published import EQUATIONS
from tests.builders import ROOT, six_bricks

SCENE = six_bricks()


def wanted(_):
    return {"T_max", "M_sup", "F_move"}


@pytest.fixture
def asked(monkeypatch):
    """What engines are asked in this process."""
    calls = []
    plain = blocks.answer

    def counted(engine, block):
        calls.append(block.key)
        return plain(engine, block)

    monkeypatch.setattr("seqopt.responses._grip_sets.answer", counted)
    return calls


def evaluation(cache, name="auto", scene=SCENE, **resources):
    engine = make_engine(name, scene)
    schedule = three_robot_loop(scene)
    return Evaluation(engine, schedule, wanted, Resources(cache=cache, **resources))


def test_what_is_stored_is_not_computed_again(tmp_path, asked):
    plain = evaluation(None)
    first, again = evaluation(tmp_path), evaluation(str(tmp_path))
    assert first.steps == plain.steps
    blocks = len(asked) // 2
    asked.clear()
    assert again.steps == plain.steps
    assert (again.models, again.engine.tally) == (plain.models, plain.engine.tally)
    assert not asked
    files = list(tmp_path.glob("*/*"))
    assert len(files) == blocks > 5


@pytest.mark.parametrize("workers", [2, 5])
def test_workers_leave_out_what_is_stored(tmp_path, asked, workers):
    whole = evaluation(tmp_path).steps
    for path in sorted(tmp_path.glob("*/*"))[::3]:
        path.unlink()
    asked.clear()
    with ThreadPoolExecutor(2) as executor:
        found = evaluation(tmp_path, executor=executor, workers=workers)
        assert found.steps == whole
    assert 0 < len(asked) < len(list(tmp_path.glob("*/*"))) / 2


def flipped(content, at):
    return content[:at] + bytes([content[at] ^ 255]) + content[at + 1 :]


DAMAGE = {
    "empty": lambda content, _: b"",
    "cut short": lambda content, _: content[: len(content) // 2],
    "a byte short": lambda content, _: content[:-1],
    "its start changed": lambda content, _: flipped(content, 0),
    "its middle changed": lambda content, _: flipped(content, len(content) // 2),
    "a number changed": lambda content, _: flipped(content, 32),
    "its end changed": lambda content, _: flipped(content, len(content) - 1),
    "a byte long": lambda content, _: content + b"]",
    "text": lambda content, _: b"no archive at all\n" * 20,
    "of another block": lambda _, other: other,
}


@pytest.mark.parametrize("how", DAMAGE)
def test_what_is_damaged_is_computed_again(tmp_path, asked, how):
    whole = evaluation(tmp_path).steps
    files = sorted(tmp_path.glob("*/*"))
    contents = {path: path.read_bytes() for path in files}
    for path in files[:4]:
        path.write_bytes(DAMAGE[how](contents[path], contents[files[-1]]))
    asked.clear()
    assert evaluation(tmp_path).steps == whole
    assert len(asked) == 4
    assert {path: path.read_bytes() for path in files} == contents  # and is mended


def test_no_more_is_read_than_an_answer_can_be(tmp_path, asked):
    """A terabyte, of which nothing but the start is on the disk."""
    whole = evaluation(tmp_path).steps
    path = next(iter(tmp_path.glob("*/*")))
    content = path.read_bytes()
    os.truncate(path, 2**40)
    asked.clear()
    assert evaluation(tmp_path).steps == whole
    assert len(asked) == 1
    assert path.read_bytes() == content


def test_a_folder_in_the_place_of_a_file_is_named(tmp_path):
    _ = evaluation(tmp_path).steps
    path = next(iter(tmp_path.glob("*/*")))
    path.unlink()
    path.mkdir()
    with pytest.raises(FileError, match=r"cannot write .*: it is a folder"):
        _ = evaluation(tmp_path).steps


@pytest.fixture
def halved(monkeypatch):
    """Stores keep half of what is true, and its checksum."""
    keep = Store.keep

    def keep_half(store, block, answers):
        values = {name: 0.5 * found for name, found in answers.values.items()}
        keep(store, block, replace(answers, values=values, forces=0.5 * answers.forces))

    monkeypatch.setattr(Store, "keep", keep_half)


@pytest.mark.usefixtures("halved")
def test_whole_but_false_answers_are_believed(tmp_path):
    """So that the tests above see that files are read at all."""
    whole = evaluation(tmp_path).steps
    assert evaluation(tmp_path).steps != whole


SEARCHES = {
    "all": lambda problem: solve(problem, "overlap_dp"),
    "lazy": lambda problem: solve(problem, "overlap_dp", lazy=True),
    "without proof": lambda problem: solve(problem, "cascade", proof=False),
    "over scenarios": lambda problem: solve(
        over_scenarios(of_decisions(problem), [SCENE], WORST_TOTAL)
    ),
}


def posed(cache):
    engine, schedule = make_engine("compliance", SCENE), three_robot_loop(SCENE)
    criterion = WeightedSum("all", tuple((name, 1.0, 1.0) for name in ("T_max", "M_sup", "F_move")))
    return pose_decisions(engine, schedule, criterion, resources=Resources(cache=cache))


@pytest.mark.parametrize("how", SEARCHES)
@pytest.mark.usefixtures("halved")
def test_a_plan_by_false_answers_is_refused(tmp_path, how):
    with suppress(FileError):  # some read what they wrote
        SEARCHES[how](posed(tmp_path))
    false = r"cache .*: \w+ of step \d+ is \S+ in a file, and \S+ when it is computed; delete"
    with pytest.raises(FileError, match=false):
        SEARCHES[how](posed(tmp_path))


@pytest.mark.parametrize("how", SEARCHES)
def test_a_plan_by_true_answers_is_the_same(tmp_path, how):
    """The negative control: a cache changes nothing."""
    plain = SEARCHES[how](posed(None))
    assert {SEARCHES[how](posed(tmp_path)).steps for _ in range(2)} == {plain.steps}


def test_answers_are_those_of_scene_engine_and_responses(tmp_path, asked, monkeypatch):
    """Whatever changes an answer finds nothing; what changes none finds all."""
    _ = evaluation(tmp_path).steps
    blocks = len(asked)

    def computed(**changes):
        asked.clear()
        assert evaluation(tmp_path, **changes).steps
        return len(asked)

    robots = tuple(replace(robot, payload=2 * robot.payload) for robot in SCENE.robots)
    renamed = replace(SCENE, name="other", provenance="elsewhere", robots=robots)
    heavy = tuple(replace(brick, density=1.1 * brick.density) for brick in SCENE.bricks)
    assert computed(scene=renamed) == 0
    assert computed(scene=replace(SCENE, bricks=heavy)) == blocks
    assert computed(name="compliance") == blocks
    monkeypatch.setattr(sys.modules[__name__], "wanted", lambda _: {"D_max"})
    assert computed() == blocks
    monkeypatch.setattr("seqopt.engines.registry._arithmetic", lambda: "of another version")
    assert computed() == blocks


def test_an_engine_that_nobody_knows_is_refused(tmp_path):
    engine = ComplianceEngine(SCENE)
    cached = Evaluation(engine, three_robot_loop(SCENE), wanted, Resources(cache=tmp_path))
    with pytest.raises(SceneError, match="a ComplianceEngine does not say what its answers depend"):
        _ = cached.steps


def test_what_runs_that_were_killed_left_is_tidied(tmp_path):
    _ = evaluation(tmp_path).steps
    folder = next(tmp_path.iterdir())
    old, new = folder / ".seqopt-old", folder / ".seqopt-new"
    for path in (old, new):
        path.touch()
    os.utime(old, (1e9, 1e9))
    _ = evaluation(tmp_path).steps
    assert not old.exists()
    assert new.exists()  # another run may be writing it


def test_a_search_without_proof_uses_it_too(tmp_path, asked):
    def plan():
        engine = make_engine("compliance", SCENE)
        resources = Resources(cache=tmp_path)
        problem = pose_decisions(engine, three_robot_loop(SCENE), EQUATIONS, resources=resources)
        return solve(problem, "cascade", proof=False)

    first = plan()
    blocks = len(asked)
    asked.clear()
    assert plan().alternatives().equals(first.alternatives())
    open_steps = sum(len(step.moves) > 0 for step in first.decisions.schedule.steps)
    assert 0 < len(asked) <= open_steps  # those of the plan itself are computed anew
    assert len(asked) < blocks


RUN = """
import sys
from seqopt._cli.main import main
if __name__ == "__main__":
    words = ["optimize", sys.argv[1], "--formulation", "cascade", "--no-stability"]
    sys.exit(main([*words, "--out", sys.argv[2], "--cache", sys.argv[3], *sys.argv[4:]]))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("workers", [pytest.param("1", marks=pytest.mark.long), "2"])
def test_a_run_that_was_killed_goes_on(tmp_path, workers):
    """Killed without warning while answers come in; then run again, with others at work beside."""
    script = tmp_path / "run.py"
    script.write_text(RUN, encoding="utf-8")
    cache, environment = tmp_path / "cache", {**os.environ, "PYTHONPATH": str(ROOT)}

    def start(out, workers="1"):
        words = ["arch25", str(tmp_path / out), str(cache), "--workers", workers, "--no-proof"]
        return subprocess.Popen([sys.executable, str(script), *words], env=environment)

    killed = start("killed", workers)
    while len(list(cache.glob("*/*.answers"))) < 5 and killed.poll() is None:
        time.sleep(0.002)
    killed.send_signal(signal.SIGKILL)
    assert killed.wait() == -signal.SIGKILL
    assert not (tmp_path / "killed").exists()
    kept = {path: path.stat().st_mtime_ns for path in cache.glob("*/*.answers")}
    runs = [start("one", workers), start("other")]
    assert [run.wait() for run in runs] == [0, 0]
    assert {path: path.stat().st_mtime_ns for path in kept} == kept  # used as they were
    plain = ["arch25", "--formulation", "cascade", "--no-stability", "--no-proof"]
    assert main(["optimize", *plain, "--out", str(tmp_path / "plain")]) == 0
    for name in ("plan.csv", "selection.csv"):
        texts = {(tmp_path / out / name).read_text("utf-8") for out in ("one", "other", "plain")}
        assert len(texts) == 1
