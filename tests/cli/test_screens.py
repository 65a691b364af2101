"""Help, its examples, and the word that was meant."""

from __future__ import annotations

import argparse
import re

import pytest

from seqopt._cli.arguments import EXAMPLES, parser
from seqopt._cli.main import main
from seqopt._cli.signatures import signature_of
from seqopt._registry import COMMANDS
from seqopt.errors import ProblemError


@pytest.fixture
def printed(capsys, monkeypatch):
    """What a command prints on a terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")

    def run(*words):
        assert main(words) == 0
        return capsys.readouterr().out

    return run


def command_of(name):
    """The parser of one command."""
    commands = next(
        a for a in parser(name)._actions if isinstance(a, argparse._SubParsersAction)
    ).choices
    return commands[name]


def defined(text):
    """The words that begin a line of a list of options, and whatever stands in its place."""
    begins = (line[2:] for line in text.splitlines() if line[:2] == "  " and line[2:3] > " ")
    return [line.split()[0].rstrip(",") for line in begins]


def flags(command):
    """The options and arguments of a command, as help lists them."""
    named = (action.option_strings or [action.metavar] for action in command._actions)
    return [names[0] for names in named if names[0] is not None]


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_every_option_once_and_examples_on_lines_of_their_own(printed, name):
    out = printed(name, "--help")
    assert max(map(len, out.splitlines())) <= 80
    command = command_of(name)
    about = "\n".join(group.description or "" for group in command._action_groups)
    said = {line.strip() for line in about.splitlines()}
    kept = [line for line in out.splitlines() if line.strip() not in said]
    body = defined("\n".join(kept).partition("\nexample")[0])
    for flag in flags(command):
        assert body.count(flag) == 1, flag
    examples = signature_of(COMMANDS[name].load()).examples
    assert [example for example in examples if f"\n  {example}\n" not in out] == []


def test_help_without_a_command_fits_one_screen(printed):
    lines = printed("--help").splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80


def test_numbers_are_read_where_they_are_given():
    """At once: no command meets one that is wrong."""
    options = signature_of(COMMANDS["assess"].load()).options
    found = [options[name].parse(value) for name, value in (("workers", "2"), ("friction", "0"))]
    assert found == [2, 0.0]
    for wrong in ({"workers": "0"}, {"workers": "two"}, {"friction": "x"}, {"friction": "-1"}):
        with pytest.raises(ProblemError, match=r"^--(workers|friction)"):
            [options[name].parse(value) for name, value in wrong.items()]


def test_the_payload_that_is_said_to_be_enough_is(capsys):
    words = ["optimize", "arch25", "--robots", "2", "--no-stability"]
    assert main(words) == 0
    out = capsys.readouterr().out
    least = int(out.partition("payload of ")[2].partition("--payload ")[2].partition(",")[0])
    for newton, over in ((least, False), (least - 1, True)):
        assert main([*words, "--payload", str(newton)]) == 0
        assert ("payload exceeded" in capsys.readouterr().out) is over


def test_a_mesh_is_answered_by_the_command_that_imports_it(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my wall.obj").write_text("v 0 0 0", encoding="utf-8")
    assert main(["optimize", "my wall.obj"]) == 2
    said = "seqopt import 'my wall.obj' --unit m --density 2400 --out 'my wall.json'"
    assert said in capsys.readouterr().err


def test_without_words_it_shows_three_examples_that_are_commands(capsys):
    assert main([]) == 0
    out, err = capsys.readouterr()
    assert (out, err) == (EXAMPLES, "")
    commands = re.findall(r"^  seqopt (.*)$", EXAMPLES, re.M)
    assert len(commands) == 3
    for command in commands:
        parser().parse_args(command.split())


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("optimise", "optimize"),
        ("analyze --method sequentiel", "sequential"),
        ("scene arch:spn=2", "span"),
        ("scene wal:columns=3", "wall"),
        ("optimize --formlation beam", "--formulation"),
        ("optimize --schedule free --formulation schedule_serch --out x", "schedule_search"),
        ("optimize --schedule free --rule newst=free --out x", "newest"),
        ("optimize --schedule free --rule newest=fre --out x", "free"),
        ("optimize --formulation beam --option widht=3 --out x", "width"),
        ("optimize --formulation beam --limit F_larges=3 --out x", "F_largest"),
        ("optimize --formulation beam --criteria t_max --out x", "T_max"),
        ("optimize --robust worst-peak --vary stifness=2 --out x", "stiffness"),
        ("pareto chain:bricks=7 --aim D_mx --out x", "D_max"),
        ("import a.obj --unit mmm --out x", "mm"),
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


def test_every_example_of_help_can_be_parsed():
    for name, command in COMMANDS.items():
        examples = signature_of(command.load()).examples
        assert len(examples) >= 1
        for example in examples:
            assert parser(name).parse_args(example.split()[1:]).command == name
