"""Completion: what the Tab key would offer."""

import os
import subprocess
import sys

import pytest

pytest.importorskip("argcomplete")
pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("line", "want"),
    [
        ("seqopt op", {"optimize"}),
        ("seqopt compare --engine dis", {"discrete"}),
        ("seqopt optimize --formul", {"--formulation"}),
        ("seqopt compare --engine qqq", set()),
    ],
)
def test_the_tab_key_offers_what_there_is(tmp_path, line, want):
    asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    asked |= {"_ARGCOMPLETE_STDOUT_FILENAME": str(tmp_path / "said"), "_ARGCOMPLETE_IFS": "\n"}
    program = [sys.executable, "-m", "seqopt"]
    subprocess.run(program, env={**os.environ, **asked}, check=True, capture_output=True)
    said = (tmp_path / "said").read_text(encoding="utf-8").split("\n")
    assert {word.strip() for word in said} - {""} == want
