"""What the program says to whoever starts: examples, its version, the word that was meant."""

from __future__ import annotations

import re

import pytest

from seqopt._cli.arguments import EXAMPLES, parser
from seqopt._cli.main import main
from seqopt._cli.signatures import signature_of
from seqopt._registry import COMMANDS


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
