"""Mutants: what is changed, and what tests make of it."""

from __future__ import annotations

import ast
import subprocess
import sys

import pytest

from tests.builders import ROOT
from tests.quality.mutants import mutants

TEXT = '''"""A module."""
LIMIT = 1e-6


def full(self: Box | None, most: int = 3) -> bool | None:
    """A property, 1 + 1."""
    if most < 0:
        raise ValueError("ö" + str(most))
    return self.values.any() and -most > LIMIT
'''


def test_operators_numbers_calls_and_statements_are_changed_and_nothing_else():
    found = [*mutants(TEXT)]
    assert {(m.line, m.after) for m in found} == {
        (2, "1.000002"),
        (5, "7"),  # neither types nor what only documents
        *((7, text) for text in ("(most <= 0)", "1")),
        (8, "pass"),
        *((9, text) for text in ("return None", "(self.values.any() or -most > LIMIT)")),
        *((9, text) for text in ("(self.values.all())", "(-most >= LIMIT)", "(most)")),
    }
    for each in found:
        ast.parse(each.text)
        assert each.text.splitlines()[: each.line - 1] == TEXT.splitlines()[: each.line - 1]


OUTCOMES = """
from tests.quality.mutants import passes, path_of
module, tests = "seqopt.problem.criteria", ["tests/problem/test_criteria.py"]
text = path_of(module).read_text(encoding="utf-8")
line = "    return ranks\\n"
assert line in text
print(passes(module, text, tests))
for new in ("raise RuntimeError", "return -ranks", "while True: pass",
            "__import__('os').abort()"):
    print(passes(module, text.replace(line, f"    {new}\\n"), tests, 5))
try:
    passes("seqopt.report.draw", "raise RuntimeError", tests)
except RuntimeError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.long  # of a tool for releases
def test_what_becomes_of_a_module_that_is_changed():
    """As it is, one that raises, is wrong, never ends, dies, is never used."""
    words = [sys.executable, "-W", "error", "-c", OUTCOMES]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    wanted = ["True", *["False"] * 4, "no test imports seqopt.report.draw", ""]
    assert done.stdout.split("\n") == wanted
