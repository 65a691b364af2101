"""What the program says to whoever starts: examples, its version, the word that was meant."""

from __future__ import annotations

import re

import pytest

import seqopt
from seqopt.cli.arguments import parser
from seqopt.cli.hints import EXAMPLES
from seqopt.cli.main import main


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
    ],
)
def test_the_word_that_was_meant_is_named(capsys, words, meant):
    assert main(words.split()) == 2
    err = capsys.readouterr().err
    assert f"(did you mean {meant}?)" in err
    assert err.count("\n") == 1


def test_nothing_is_named_where_nothing_is_near(capsys):
    assert main(["qqqq"]) == 2
    assert "did you mean" not in capsys.readouterr().err
