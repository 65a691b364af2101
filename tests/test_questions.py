"""Python's functions, one for each question: what they take, and that commands answer alike."""

import inspect
import io
import json
from dataclasses import replace

import pandas as pd
import pytest

import seqopt
from seqopt._cli.main import main
from seqopt._cli.registry import COMMANDS
from seqopt._cli.signatures import signature_of
from seqopt.instances import instance
from seqopt.plan.plan import Plan
from seqopt.questions import find_build
from seqopt.report import report
from seqopt.scene.parts import Prop
from seqopt.scene.scene_file import save_scene
from seqopt.times import times
from tests.builders import small_arch

ASKED = (seqopt.optimize, seqopt.pareto, seqopt.replan, seqopt.compare, seqopt.analyze)
ASKED += (seqopt.assess, seqopt.export, seqopt.reach, times, report, find_build)
ASKED += (instance, seqopt.judge_instance)
SECONDS = "fetch=30,place=10,approach=10,grip=5,release=5"


@pytest.fixture
def arch(tmp_path):
    path = tmp_path / "arch.json"
    save_scene(small_arch(5), path)
    return path


@pytest.mark.parametrize("asked", ASKED)
def test_signatures_are_explicit_and_short(asked):
    taken = inspect.signature(asked).parameters.values()
    assert len(taken) <= 20
    gathers = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
    assert not [each for each in taken if each.kind in gathers]


@pytest.mark.parametrize(
    ("command", "asked"), [(each.__name__, each) for each in ASKED if each.__name__ in COMMANDS]
)
def test_commands_have_the_options_of_functions(command, asked):
    known = signature_of(COMMANDS[command].load())
    taken = {each.made_by for each in known.spread.values() if each.called}
    assert taken == {asked}


def test_a_table_and_a_text_are_those_of_the_command(arch, capsys):
    assert main(["analyze", str(arch), "--method", "cantilever"]) == 0
    table = pd.read_csv(io.StringIO(capsys.readouterr().out))
    own = seqopt.analyze(arch, "cantilever")
    assert table["D_max_1e-3mm"].to_numpy() == pytest.approx(own["D_max_1e-3mm"], rel=1e-5)
    assert main(["export", str(arch), "--method", "cantilever", "--format", "tasks_csv"]) == 0
    assert capsys.readouterr().out == seqopt.export(arch, "cantilever", "tasks_csv")
    assert main(["assess", str(arch), "--mortar", "dry", "--friction", "0.3", "--json"]) in (0, 1)
    rows = json.loads(capsys.readouterr().out)["steps"]
    found = seqopt.assess(arch, mortar="dry", friction=0.3)
    assert [row["verdict"] for row in rows] == [each.verdict.value for each in found]


def test_a_plan_answers_for_its_scene(arch, tmp_path):
    assert main(["optimize", str(arch), "--schedule", "free", "--out", str(tmp_path / "p")]) == 0
    plan, folder = seqopt.optimize(arch, "free"), str(tmp_path / "p")
    for given in (plan, folder):
        assert find_build(given).steps == plan.steps
        assert len(seqopt.analyze(given)) == len(plan.steps)
        assert seqopt.assess(given) == seqopt.assess(plan.engine.network, plan.steps)
    assert plan.export("tasks_csv") == seqopt.export(folder, format="tasks_csv")
    assert "report.html" in repr(report(folder, stability=False))
    timed = times(plan.engine.network.scene.with_durations(SECONDS), plan.steps)
    assert timed.makespan == timed.times()["end_s"].iloc[-1]


def test_a_plan_is_replanned_with_the_words_of_the_function():
    own, whole = (inspect.signature(f).parameters for f in (Plan.replan, seqopt.replan))
    assert [*own][1:] == [*whole][1:]
    for name in {*own} - {"self", "search"}:
        assert (own[name].default, own[name].annotation) == (
            whole[name].default,
            whole[name].annotation,
        )


def test_an_instance_is_asked_for_and_judged_by_name(tmp_path):
    """As the commands do: with the words of `optimize`, and by files."""
    found = instance("chain:bricks=7", "free", aim="minmax,steps", below=40.0)
    words = ["chain:bricks=7", "--schedule", "free", "--aim", "minmax,steps", "--below", "40"]
    assert main(["instance", *words, "--out", str(tmp_path / "own.npz")]) == 0
    assert replace(
        seqopt.read_instance(tmp_path / "own.npz"), name=found.name, facts={}
    ) == replace(found, facts={})
    answer = tmp_path / "answer.txt"
    answer.write_text(" ".join(map(str, seqopt.solve(found).nodes)))
    given = seqopt.judge_instance(str(tmp_path / "own.npz"), answer)
    assert given == seqopt.judge_instance(found, answer)
    assert given.gap == 0


def test_words_make_grips_props_and_payloads():
    scene = small_arch(5)
    assert scene.with_grips("1e6x1e6x5e5,turning=2e4") == scene.with_grips((1e6, 1e6, 5e5), 2e4)
    assert scene.with_grips(1e6).with_grips("rigid") == scene
    props = scene.with_props("3:1e6,push,capacity=300").props
    assert props == (Prop(node=3, stiffness=1e6, direction=scene.up, capacity=300.0),)
    assert scene.with_props("every:1e5") == scene.with_centering(1e5)
    loads = [robot.payload for robot in scene.with_payloads(300, "rob1=250").robots]
    assert (loads[0], {*loads[1:]}) == (250.0, {300.0})


WRONG = {
    "steps 'cantilver' do not exist (did you mean cantilever?)": lambda arch: seqopt.analyze(
        arch, "cantilver"
    ),
    "robots rob1: a plan says itself who holds": lambda arch: seqopt.analyze(
        arch, "published", robots=["rob1"]
    ),
    "payload rob9=3: give ROBOT=NEWTON": lambda arch: seqopt.replan(arch, payload=["rob9=3"]),
    "round T_maxx=1 does not exist": lambda arch: seqopt.pareto(
        arch, aim="T_max,steps", rounding=["T_maxx=1"]
    ),
    "mortar glue: give epoxy": lambda arch: seqopt.assess(arch, mortar="glue"),
    "stands: here it goes with curing": lambda arch: times(arch, stands="dry"),
    "reference: it values the plans": lambda arch: seqopt.compare(arch, reference="frame"),
    "props 3,capacity=x: capacity is 'x'": lambda _: small_arch(5).with_props("3,capacity=x"),
}


@pytest.mark.parametrize("said", WRONG)
def test_what_is_wrong_is_said_in_one_line(arch, said):
    given = seqopt.optimize(arch, "free") if said.startswith("payload") else arch
    with pytest.raises(seqopt.SeqoptError) as error:
        WRONG[said](given)
    assert said in str(error.value)
    assert "\n" not in str(error.value)
