"""What the program says to whoever starts: examples, its version, the word that was meant."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

import seqopt
from seqopt._cli.arguments import EXAMPLES, parser
from seqopt._cli.commands.completion import _commands
from seqopt._cli.main import main
from seqopt._cli.signatures import signature_of
from seqopt._registry import COMMANDS
from tests.builders import ROOT


def test_without_words_it_shows_three_examples_that_are_commands(capsys):
    assert main([]) == 0
    out, err = capsys.readouterr()
    assert (out, err) == (EXAMPLES, "")
    commands = re.findall(r"^  seqopt (.*)$", EXAMPLES, re.M)
    assert len(commands) == 3
    for command in commands:
        parser().parse_args(command.split())


def test_it_says_its_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"seqopt {seqopt.__version__}\n"


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("optimise", "optimize"),
        ("optimize --formulaton beam --out x", "--formulation"),
        ("analyze --method sequentiel", "sequential"),
        ("compare --engine fram", "frame"),
        ("optimize --formulation overlap_dpp --out x", "overlap_dp"),
        ("optimize --formulation overlap_dp --criteria worst-ration --out x", "worst-ratio"),
        ("scene arch26", "arch25"),
        ("scene arch:spn=2", "span"),
        ("scene wal:columns=3", "wall"),
        ("optimize --formlation beam", "--formulation"),
        ("optimize --schedule fre --out x", "free"),
        ("optimize --formulation beam --schedule three-robt --out x", "three-robot"),
        ("optimize --schedule free --formulation schedule_serch --out x", "schedule_search"),
        ("optimize --schedule free --aim minmx --out x", "minmax"),
        ("optimize --schedule free --rule newst=free --out x", "newest"),
        ("optimize --schedule free --rule newest=fre --out x", "free"),
        ("optimize --schedule free --stands dyr --out x", "dry"),
        ("optimize --schedule free --option widht=3 --out x", "width"),
        ("optimize --formulation beam --option widht=3 --out x", "width"),
        ("optimize --formulation beam --limit payloadd --out x", "payload"),
        ("optimize --formulation beam --limit F_larges=3 --out x", "F_largest"),
        ("optimize --formulation beam --criteria t_max --out x", "T_max"),
        ("optimize --formulation beam --robots rob1,rob2,rb3 --out x", "rob3"),
        ("optimize --formulation beam --candidates nere:3 --out x", "near"),
        ("optimize --formulation labels --budget travl=0.5 --out x", "travel"),
        ("optimize --robust worst-pek --out x", "worst-peak"),
        ("optimize --robust worst-peak --vary stifness=2 --out x", "stiffness"),
        ("compare --order reversd", "reversed"),
        ("pareto chain:bricks=7 --aim D_max --pick D_mx --out x", "D_max"),
        ("pareto chain:bricks=7 --aim D_max --pick D_max --under D_mx=1 --out x", "D_max"),
        ("pareto chain:bricks=7 --round D_mx=1 --out x", "D_max"),
        ("import a.obj --unit mmm --out x", "mm"),
        ("export best --format cvs --out x", "csv"),
        ("completion bahs", "bash"),
    ],
)
def test_the_word_that_was_meant_is_named(capsys, monkeypatch, tmp_path, words, meant):
    monkeypatch.chdir(tmp_path)
    assert main(words.split()) == 2
    err = capsys.readouterr().err
    assert f"(did you mean {meant}?)" in err
    assert err.count("\n") == 1


def test_nothing_is_named_where_nothing_is_near(capsys):
    assert main(["qqqq"]) == 2
    assert "did you mean" not in capsys.readouterr().err
    assert main(["compare", "--qqqq"]) == 2
    assert "did you mean" not in capsys.readouterr().err


def test_an_option_before_its_command_is_told_where_it_stands(capsys):
    assert main(["--json", "compare"]) == 2
    assert "--json (options stand after the command)" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words", ["assess --load-factor", "analyze --staged fitted", "optimize --unseen 3"]
)
def test_an_option_that_is_gone_is_told_what_takes_its_place(capsys, words):
    assert main(words.split()) == 2
    err = capsys.readouterr().err
    assert re.search(r"is no more; in Python seqopt(\.\w+)+ has it", err)
    assert err.count("\n") == 1


def test_a_missing_argument_is_named_where_nothing_is_mistyped(capsys):
    assert main(["judge", "problem.npz"]) == 2
    assert "arguments are required: " in capsys.readouterr().err


def test_every_example_of_help_can_be_parsed():
    for name, command in COMMANDS.items():
        examples = signature_of(command.load()).lines["Examples"]
        assert len(examples) >= 1
        for example in examples:
            if name != "completion":  # whose examples are lines of a shell
                assert parser().parse_args(example.split()[1:]).command == name


def test_every_option_stands_in_a_group_with_a_title():
    for command in _commands(parser()):
        titles = [group.title for group in command._action_groups if group._group_actions]
        if command.prog != "seqopt completion":
            assert len(titles) >= 3, command.prog
            assert all(title.endswith("?") for title in titles[1:] if title), command.prog
        loose = [a.dest for a in command._optionals._group_actions]
        assert loose == ["help", "help_all"], command.prog


HEAVY = ("numpy", "pandas", "scipy", "networkx", "shtab")
LOADED = f"print(*[name for name in {HEAVY} if name in sys.modules], file=sys.stderr)"


SELDOM = (
    *("networkx", "scipy.optimize", "scipy.spatial", "cvxpy", "highspy", "numba", "matplotlib"),
    *("seqopt.arms._tables", "seqopt.engines.discrete.engine", "seqopt.engines.frame"),
    *("seqopt.engines.rigid._refinement", "seqopt.graph._orders"),
    *("seqopt.plan._states", "seqopt.judge._proof", "seqopt.scene.library"),
    "seqopt.sequence._rule_space",
)


def test_a_command_loads_what_it_needs():
    said = f"print(*[name for name in {SELDOM} if name in sys.modules])"
    program = f"import sys\nfrom seqopt._cli.main import load\nload(['optimize'])\n{said}"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.split() == []


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_pandas_is_loaded_where_a_table_is_made(form):
    words = ["optimize", "chain:bricks=6", *form]
    said = "print('pandas.core' in sys.modules, file=sys.stderr)"
    program = f"import sys\nfrom seqopt._cli.main import load, main\nload({words})"
    program += f"\nassert main({words}) == 0"
    done = subprocess.run(
        [sys.executable, "-c", f"{program}\n{said}"],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    assert done.stderr.split()[-1] == str(bool(form))


@pytest.mark.parametrize(
    ("words", "light"),
    [([], True), (["--help"], True), (["--version"], True), (["scene", "--help"], False)],
)
def test_what_needs_no_library_loads_none(words, light):
    program = f"import sys\nfrom seqopt._cli.main import main\nmain({words})\n{LOADED}"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert (done.stderr.split() == []) is light
