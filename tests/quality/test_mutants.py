"""Mutants: what is changed, and what tests make of it."""

from __future__ import annotations

import ast
import os
import subprocess
import sys

import pytest

from tests.builders import ROOT
from tests.quality.kernels import other, running
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


# another kernel is named, and runs where it is asked for


CODE = "from tests.quality.kernels import running; print(*running().values())"


@pytest.mark.skipif(not other(), reason="no OpenBLAS, or no other kernel by name")
def test_the_other_kernel_runs_where_it_is_asked_for():
    asked = os.environ | {"OPENBLAS_CORETYPE": other()}
    command = [sys.executable, "-c", CODE]
    ran = subprocess.run(command, env=asked, cwd=ROOT, capture_output=True, text=True, check=True)
    assert {*ran.stdout.split()} == {other()}
    assert other() not in running().values()  # the control


def test_every_run_says_which_kernels_it_has(pytestconfig):
    (line,) = (
        line
        for line in pytestconfig.hook.pytest_report_header(config=pytestconfig, start_path=ROOT)
        if "kernels" in line
    )
    for package, kernel in running().items():
        assert f"{package} {kernel}" in line
