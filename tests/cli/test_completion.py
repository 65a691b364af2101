"""Completion: what the Tab key would offer."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip("argcomplete")


@pytest.mark.parametrize(
    ("line", "want"),
    [
        ("seqopt op", {"optimize"}),
        pytest.param("seqopt compare --engine dis", {"discrete"}, marks=pytest.mark.slow),
        pytest.param("seqopt optimize --formul", {"--formulation"}, marks=pytest.mark.slow),
        pytest.param("seqopt compare --engine qqq", set(), marks=pytest.mark.slow),
    ],
)
def test_the_tab_key_offers_what_there_is(tmp_path, line, want):
    asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    asked |= {"_ARGCOMPLETE_STDOUT_FILENAME": str(tmp_path / "said"), "_ARGCOMPLETE_IFS": "\n"}
    program = [sys.executable, "-m", "seqopt"]
    subprocess.run(program, env={**os.environ, **asked}, check=True, capture_output=True)
    said = (tmp_path / "said").read_text(encoding="utf-8").split("\n")
    assert {word.strip() for word in said} - {""} == want
