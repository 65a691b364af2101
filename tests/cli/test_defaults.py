"""What is taken where nothing is asked for: the same in Python and on the command line."""

from __future__ import annotations

import inspect
import json

import pytest

import seqopt
from seqopt import doors
from seqopt._cli.arguments import request
from seqopt._cli.main import main
from seqopt._cli.signatures import signature_of
from seqopt._cli.words import HIDDEN
from seqopt._registry import COMMANDS
from seqopt.scene.scene_file import save_scene
from seqopt.workflow import Part
from tests.builders import small_arch

UNLIKE = (  # of one run, or added by the command
    *("seconds", "models_paper_count", "stability", "spent_on_showing"),
)


def answered(capsys, *arguments):
    """Return the JSON document of a command that ends well."""
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def same(summary):
    """Return a summary as JSON has it, without what need not be the same."""
    plain = json.loads(json.dumps(summary))
    return {name: value for name, value in plain.items() if name not in UNLIKE}


@pytest.fixture
def arch(tmp_path):
    path = tmp_path / "arch.json"
    save_scene(small_arch(6), path)
    return path


@pytest.mark.parametrize(
    ("words", "given"), [((), {}), (("--schedule", "free"), {"schedule": "free"})]
)
def test_python_and_the_command_line_answer_alike(capsys, arch, words, given):
    found = answered(capsys, "optimize", arch, *words)
    plan = seqopt.optimize(arch, **given)
    assert same(found["summary"]) == same(plan.summary())
    assert [row["step"] for row in found["plan"]] == [step.number for step in plan.steps]
    assert (found["written"], found["exit_status"]) == ([], 0)


def test_pareto_in_python_is_the_command(capsys, arch, tmp_path):
    words = ("--aim", "F_largest,steps", "--rule", "least_grips=1")
    found = answered(capsys, "pareto", arch, *words)["points"]
    same = seqopt.pareto(seqopt.load_scene(arch), aim="F_largest,steps", rules="least_grips=1")
    assert [row["F_largest"] for row in found] == [*same.table["F_largest"]]
    seqopt.pareto(
        arch, aim="F_largest,M_sup", limits=[seqopt.Limit("F_largest", 1e6)], out=tmp_path / "set"
    )
    assert (tmp_path / "set" / "pareto.csv").is_file()


def test_assess_and_replan_in_python_are_the_commands(capsys, arch, tmp_path):
    """Of a plan, and of the folder that it is written to."""
    plan, folder = seqopt.optimize(arch, "free"), tmp_path / "p"
    assert main(["optimize", str(arch), "--schedule", "free", "--out", str(folder)]) == 0
    capsys.readouterr()
    found = answered(capsys, "assess", folder, "--mortar", "epoxy", "--margins", "bond")["steps"]
    words = ("--at", "4", "--lost", "rob3", "--rule", "least_grips=1")
    again = answered(capsys, "replan", folder, *words)["plan"]
    for built in (plan, folder):
        same = seqopt.assess(built, mortar=seqopt.EPOXY, margins="bond")
        assert [row["verdict"] for row in found] == [*same["verdict"]]
        rest = seqopt.replan(built, at=4, lost=["rob3"], rules="least_grips=1")
        assert [row["step"] for row in again] == [step.number for step in rest.steps]


def test_every_command_has_a_function_of_python():
    """Those that describe a scene, read one or look a move up have values that do the same."""
    functions = {*doors.__all__} - {"Answer", "Command"}
    assert functions == COMMANDS.keys() - {"scene", "import"}
    for name in functions:
        taken = inspect.signature(getattr(doors, name)).parameters.values()
        assert all(each.kind is not each.VAR_KEYWORD for each in taken), name
        assert len(taken) <= 20, name


def test_what_functions_take_is_written_once():
    """Commands are functions of Python: parameters are options, or values that options make."""
    for name in {*doors.__all__} - {"judge", "optimize", "sweep", "Answer", "Command"}:
        function = getattr(doors, name)
        assert COMMANDS[name].load() is function
        known = signature_of(function)
        taken = {*inspect.signature(function).parameters} - {"progress"}
        assert taken <= {*known.options, *known.spread}
        assert {*known.options} <= {*known.texts(), *HIDDEN}, name


def test_words_that_make_a_value_stand_beside_it(arch):
    """As `grips` of a scene; what nothing is made of is refused."""
    soft = seqopt.load_scene(arch).with_grips(1e6)
    own, same = (
        doors.analyze(scene, method="cantilever", **words)
        for scene, words in ((soft, {}), (arch, {"grips": 1e6}))
    )
    assert own.equals(same)
    assert not own.equals(doors.analyze(arch, method="cantilever"))
    with pytest.raises(TypeError, match="unexpected keyword argument 'grip'"):
        doors.analyze(arch, grip=1e6)


def test_a_build_begins_where_python_says(arch):
    plan = seqopt.optimize(arch, Part(schedule="free", begin=2))
    assert (plan.steps[0].bricks, plan.problem.moves.begin.bricks) == (2, 2)
    assert seqopt.optimize(arch, "free").steps[0].bricks == 1
    with pytest.raises(seqopt.SeqoptError, match=r"^direction take-down: it goes with schedule="):
        seqopt.optimize(arch, Part(direction="take-down"))


def test_help_is_what_docstrings_say():
    compared, chosen = (signature_of(each).texts() for each in (seqopt.compare, seqopt.optimize))
    assert "reference : str, optional" in inspect.getdoc(seqopt.compare)
    assert compared["reference"][2].startswith("With ``speed``: the engine that values plans")
    assert compared["mortar"] == ("Parameters", "optional", chosen["mortar"][2])
    assert "(default: auto)" in compared["engine"][2]


def test_messages_about_parameters_name_options():
    said = request(["optimize"]).spoken
    assert said("limit x: none; give schedule='free'") == "--limit x: none; give --schedule free"
    assert said("brick 3: name='x'") == "brick 3: name='x'"
