"""What is taken where nothing is asked for; scenes on the command line."""

import inspect
import json
import math

import pandas as pd
import pytest

import seqopt
from seqopt._cli.arguments import request
from seqopt._cli.main import main
from seqopt._cli.registry import COMMANDS
from seqopt._cli.signatures import Call, signature_of
from seqopt._cli.words import HIDDEN
from seqopt.contact.mortar import DRY, EPOXY, find_mortar
from seqopt.scene.scene_file import ABOUT, KINDS, builtin_scenes, load_scene, save_scene
from seqopt.workflow import optimize, pose_build
from tests.builders import small_arch
from tests.commands import command

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


@pytest.mark.slow
def test_pareto_and_replan_are_what_python_finds(capsys, arch, tmp_path):
    words = ("--aim", "F_largest,steps", "--rule", "least_grips=1")
    found = answered(capsys, "pareto", arch, *words)["points"]
    front = seqopt.pareto(arch, aim="F_largest,steps", rules="least_grips=1")
    assert [row["F_largest"] for row in found] == [*front.table["F_largest"]]
    plan, folder = seqopt.optimize(arch, "free"), tmp_path / "p"
    assert main(["optimize", str(arch), "--schedule", "free", "--out", str(folder)]) == 0
    capsys.readouterr()
    words = ("--at", "4", "--lost", "rob3", "--rule", "least_grips=1")
    again = answered(capsys, "replan", folder, *words)["plan"]
    begin = seqopt.Site.after(plan.steps, 4)
    part = seqopt.Part(schedule="free", begin=begin, lost=["rob3"])
    rest = seqopt.optimize(arch, part, rules=["least_grips=1"])
    assert [row["step"] for row in again] == [step.number for step in rest.steps]
    for given in (plan, folder):
        new = seqopt.replan(given, 4, lost=["rob3"], rules=["least_grips=1"])
        assert new.steps == rest.steps
    assert plan.replan(4, lost=["rob3"], rules="least_grips=1").changes == new.changes
    with pytest.raises(seqopt.SeqoptError, match=r"^missing 2: a build that goes on"):
        seqopt.optimize(arch, seqopt.Part(schedule="free", missing=[2]))


def test_options_are_said_in_docstrings():
    for name, each in COMMANDS.items():
        known = signature_of(each.load())
        assert {*known.options} <= {*known.texts(), *HIDDEN}, name


def test_a_build_begins_where_python_says(arch):
    plan = seqopt.optimize(arch, seqopt.Part(schedule="free", begin=2))
    assert (plan.steps[0].bricks, plan.problem.moves.begin.bricks) == (2, 2)
    assert seqopt.optimize(arch, "free").steps[0].bricks == 1
    with pytest.raises(seqopt.SeqoptError, match=r"^direction take-down: it goes with schedule="):
        seqopt.optimize(arch, seqopt.Part(direction="take-down"))


def test_help_is_what_docstrings_say():
    compared, chosen = (signature_of(COMMANDS[n].load()).texts() for n in ("compare", "optimize"))
    assert compared["speed"][1].startswith("Also chart speed against regret")
    assert compared["mortar"] == ("optional", chosen["mortar"][1])
    assert "(default: auto)" in chosen["engine"][1]


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (seqopt.optimize, {"engine": "auto"}),
        (seqopt.assess, {"workers": "1"}),
        (seqopt.export, {"format": "tasks"}),
        (seqopt.pareto, {"aim": "F_largest,M_sup,T_max,D_max"}),
        (seqopt.replan, {"at": "1"}),
        (seqopt.Search, {"workers": "1"}),
        (seqopt.Robust, {"count": "30", "seed": "0"}),
    ],
)
def test_defaults_that_docstrings_say_are_those_of_signatures(function, words):
    texts, taken = signature_of(function).texts(), inspect.signature(function).parameters
    assert "{" not in function.__doc__.partition("Examples")[0]  # no placeholder
    for name, default in words.items():
        assert f"(default: {default})" in texts[name][1], name
        assert str(taken[name].default) == default


def test_messages_about_parameters_name_options():
    said = request(["optimize"]).spoken
    assert said("limit x: none; give schedule='free'") == "--limit x: none; give --schedule free"
    assert said("brick 3: name='x'") == "brick 3: name='x'"


FREE, SCENE = {"schedule": "free"}, "chain:bricks=6"
QUESTIONS = [
    {},
    {"limits": ["payload", "F_largest=300"], "budgets": ["travel=0.9"]},
    {"criterion": "T_max,M_sup=2", "robots": "rob1,rob2", "candidates": "near:12"},
    FREE,
    {**FREE, "aim": "minmax,steps", "rules": ["newest=free"], "budgets": ["regrips=3"]},
    pytest.param({**FREE, "order": "search", "aim": "sum"}, marks=pytest.mark.slow),
]


def posed(words):
    """The problem that words of the command line pose."""
    return pose_build(Call(optimize, {"scene": SCENE, **words}).values())


@pytest.mark.parametrize("words", QUESTIONS, ids=str)
def test_both_pose_the_same_problem(words):
    asked = posed(words)
    values = {**words, "robots": words["robots"].split(",")} if "robots" in words else words
    found = seqopt.optimize(SCENE, **values).problem
    assert repr(asked) == repr(found)
    for name in ("moves", "criterion", "goals", "limits", "budgets", "stands", "over", "orders"):
        assert getattr(asked, name) == getattr(found, name), name


def test_another_question_is_another_problem():
    asked = [posed(each) for each in (FREE, {})]
    assert asked[0].criterion != asked[1].criterion
    assert asked[0].goals != asked[1].goals


# scenes on the command line: those that are built in, grips and props of one's own
ARCH = "arch:span=1,rise=0.4,bricks=6"


def test_all_built_in_scenes_are_listed_a_line_each(capsys):
    _, out, err = command(capsys, "scene", "--list")
    count = len(builtin_scenes())
    lines, words = out.splitlines()[:count], out.splitlines()[count:]
    assert (words, err) == ([*KINDS.values()], "")
    assert [line.split(":")[0] for line in lines] == [*builtin_scenes()]
    for line, name in zip(lines, builtin_scenes(), strict=True):
        scene = load_scene(name)
        assert f"{len(scene.bricks)} bricks, {len(scene.joints)} joints" in line
        assert line.endswith(ABOUT[name])


def test_a_stiffness_is_that_of_all_robots(tmp_path, capsys):
    path = tmp_path / "soft.json"
    words = ("scene", "arch25", "--grips", "1e6x1e6x5e5,turning=2e4", "--export", path)
    said = "grip of 1e+06 x 1e+06 x 500000 N/m, which resists turning by 20000 N m/rad"
    assert said in command(capsys, *words)[1]
    assert load_scene(path) == load_scene("arch25").with_grips((1e6, 1e6, 5e5), 2e4)
    out = command(capsys, "scene", path, "--grips", "rigid", "--json")[1]
    assert {*json.loads(out)["scene"]["grips_N_per_m"].values()} == {None}


def test_analyses_follow_the_grips(capsys, tmp_path):
    path = tmp_path / "steps.csv"
    words = ["analyze", ARCH, "--method", "cantilever", "--grips", "1e5", "--out", str(path)]
    assert main(words) == 0
    network = seqopt.build_network(load_scene(ARCH).with_grips(1e5))
    wanted = seqopt.analyze(seqopt.make_engine("compliance", network), seqopt.cantilever(network))
    name = "D_max_1e-3mm"
    assert pd.read_csv(path)[name].to_numpy() == pytest.approx(wanted[name].to_numpy(), rel=1e-5)


def test_props_are_said_in_words(capsys, tmp_path):
    arch, own = tmp_path / "arch.json", tmp_path / "own.json"
    save_scene(small_arch(6), arch)
    out = command(capsys, "scene", arch, "--props", "3,5:1e6,push,capacity=300", "--json")[1]
    assert json.loads(out)["scene"]["props"] == [3, 5]
    out = command(capsys, "scene", arch, "--props", "3,push,capacity=300")[1]
    assert "rigid, pushes along (0, 0, 1) only, up to 300 N" in out
    command(capsys, "scene", arch, "--props", "every:1e5", "--export", own)
    props = load_scene(own).props
    assert len(props) >= 5
    assert {prop.stiffness for prop in props} == {(1e5,) * 3}


def test_a_pareto_set_takes_a_criterion_as_others_do(capsys):
    scene, aim, ends = "chain:bricks=6", "minmax,steps", set()
    for name in ("worst-ratio-published", "weighted"):
        plan = seqopt.optimize(scene, "free", name, aim=aim)
        front = seqopt.pareto(scene, aim=aim, criterion=name)
        assert front.table["minmax"][0] == pytest.approx(plan.objective["minmax"], rel=1e-9)
        words = ("pareto", scene, "--aim", aim, "--criterion", name, "--json", "--no-stability")
        (row, *_) = json.loads(command(capsys, *words)[1])["points"]
        assert row["minmax"] == pytest.approx(plan.objective["minmax"], rel=1e-9)
        ends.add(front.table["minmax"][0])
    assert len(ends) == 2  # else the criterion would count for nothing


def test_help_says_the_friction_that_is_taken():
    (friction,) = {mortar.friction for mortar in (DRY, EPOXY, find_mortar("bond=1e4"))}
    said = f"{friction:.3g}, of {math.degrees(math.atan(friction)):.3g}°"
    texts = signature_of(seqopt.assess).texts()
    assert f"default: {said}, with every mortar" in texts["friction"][1]
    assert "°" not in texts["mortar"][1]
