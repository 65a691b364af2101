"""What is taken where nothing is asked for: the same in Python and on the command line."""

from __future__ import annotations

import inspect
import json

import pytest

import seqopt
from seqopt import doors
from seqopt._cli.main import main
from seqopt._cli.signatures import signature_of
from seqopt._cli.words import HIDDEN
from seqopt._registry import COMMANDS
from seqopt.scene.scene_file import save_scene
from tests.builders import small_arch

UNLIKE = ("seconds", "models_paper_count", "stability")  # of one run, or added by the command


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
    ("words", "given"),
    [
        ((), {}),
        (("--schedule", "free"), {"schedule": "free"}),
        (("--budget", "travel=0.9"), {"budgets": ["travel=0.9"]}),
        (("--robots", "rob3,rob1"), {"robots": ["rob3", "rob1"]}),
        (("--candidates", "near:2"), {"candidates": "near:2"}),
    ],
)
def test_python_and_the_command_line_answer_alike(capsys, arch, words, given):
    found = answered(capsys, "optimize", arch, *words)
    plan = seqopt.optimize(arch, **given)
    assert same(found["summary"]) == same(plan.summary())
    assert [row["step"] for row in found["plan"]] == [step.number for step in plan.steps]
    assert (found["written"], found["exit_status"]) == ([], 0)


def test_optimize_alone_says_what_it_found_and_how_to_keep_it(capsys):
    assert main(["optimize", "arch25"]) == 0
    said = capsys.readouterr().out
    first, second, *_ = said.splitlines()
    best = "largest force 375 N (95.7 % of payload), displacement 14.1 µm"
    assert first == f"{best}; sum 657.465, optimal"
    assert second.startswith("overlap_dp (exact): 90 steps, ")
    assert "--out DIR writes the plan" in second


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
    assert functions == COMMANDS.keys() - {"scene", "import", "completion"}
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
