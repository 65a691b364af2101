"""Mutants: what is changed, what tests make of it, and what is called equivalent."""

from __future__ import annotations

import subprocess
import sys
from fnmatch import fnmatch

import pytest

from tests.builders import ROOT
from tests.quality.mutation_testing import MODULES, files, holds, stored

pytest.importorskip("cosmic_ray")

from tests.quality import mutants as made
from tests.quality.equivalents import EQUIVALENT, reason
from tests.quality.mutants import Mutant, mutants, path_of

TEXT = '''"""A module."""
from __future__ import annotations

LIMIT = 1e-6


class Box:
    @property
    def full(self: Box | None, *, most: int | None = 3) -> bool | None:
        """A property, 1 + 1."""
        return self.values.any() and most > LIMIT
'''


@pytest.fixture
def changes(monkeypatch, tmp_path):
    """What becomes of a module's lines, by line."""
    path = tmp_path / "box.py"
    path.write_text(TEXT, encoding="utf-8")
    monkeypatch.setattr(made, "path_of", lambda module: path)
    return {line: {m.after for m in mutants("box") if m.line == line} for line in range(1, 13)}


def test_constants_properties_and_calls_are_changed(changes):
    assert changes[4] == {"LIMIT = 1.000001", "LIMIT = -0.999999"}
    assert changes[8] == {""}
    swapped = "return self.values.all() and most > LIMIT"
    assert {swapped, "return self.values.any() or most > LIMIT"} <= changes[11]
    assert len(changes[11]) == 7  # the others compare otherwise


def test_annotations_texts_and_what_is_no_python_are_not(changes):
    defaults = {text.replace(" ", "").split("=")[1][0] for text in changes[9]}
    assert defaults == {"2", "4"}  # of `most`; neither its type nor the star before it
    assert not changes[1] | changes[2] | changes[10]


def test_every_module_has_mutants_and_test_files():
    for module in MODULES:
        assert all((ROOT / name).exists() for name in files(module)), module
    assert len(list(mutants("formulations.rank_search"))) > 20


def mutant(module, before, after):
    return Mutant(module, "Any", 1, before, after, "")


def test_what_is_called_equivalent_is_one_change_of_one_line():
    line, module = "for a, b in zip(x, y, strict=True):", "formulations.beam"
    assert reason(mutant(module, line, line.replace("True", "False")))
    assert not reason(mutant(module, line, line.replace("a, b", "b, a")))
    assert not reason(mutant(module, line, line.replace("True", "False").replace("x", "z")))
    costs = "seqopt.graph.decision_costs"
    assert reason(mutant(costs, "out, before = [], 0", "out, before = [], -1"))
    assert not reason(mutant(costs, "out, before = [], 0", "out, before = [], 1"))
    assert not reason(mutant(module, "out, before = [], 0", "out, before = [], -1"))


def test_every_reason_is_that_of_a_line():
    """None is left over from lines that are gone."""
    for known in EQUIVALENT:
        assert known.reason
        lines = [
            line
            for module in MODULES
            if fnmatch(module, known.module)
            for line in path_of(module).read_text(encoding="utf-8").splitlines()
        ]
        assert any(
            known.line in line and known.old.replace(" ", "") in line.replace(" ", "")
            for line in lines
        ), known


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("as_it_is", "killed"),
        ("with_a_broken_line", "survived"),
        ("equivalent_but_killed", 1),
        ("survived", 10**4),
    ],
)
def test_the_check_of_the_stored_rows_can_fail(column, value):
    table, survivors = stored()
    assert holds(table, survivors)
    assert not holds(table.assign(**{column: value}), survivors)
    assert not holds(table, survivors.assign(reason="none could"))
    named = survivors[survivors["reason"] != ""]
    assert not holds(table, survivors.drop(index=named.index[0]))


@pytest.mark.long
@pytest.mark.slow
def test_a_quick_run_kills_enough():
    words = [sys.executable, "-W", "error", "-m", "tests.quality.mutation_testing", "--quick"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "mutants killed" in done.stdout.splitlines()[-1]


OUTCOMES = """
from tests.quality.mutant_trials import limit, preload, trial
from tests.quality.mutants import path_of
preload()
module, tests = "seqopt.problem.criteria", ["tests/problem/test_criteria.py"]
text = path_of(module).read_text(encoding="utf-8")
line = "    place = np.arange(values.shape[1])\\n"
assert line in text
print(trial(module, text, tests, 60))
for new, seconds in (("raise RuntimeError", 60), ("place = -np.arange(values.shape[1])", 60),
                     ("while True: pass", 2), ("__import__('os').abort()", 60)):
    print(trial(module, text.replace(line, f"    {new}\\n"), tests, seconds))
print(trial(module, text + "\\nraise RuntimeError\\n", tests, 60))
try:
    trial("seqopt.report.draw", "raise RuntimeError", tests, 60)
except RuntimeError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.long  # of a tool for releases
def test_what_becomes_of_a_module_that_is_changed():
    """As it is, one that raises, is wrong, never ends, dies, cannot be imported, is never used."""
    before = (ROOT / "seqopt" / "problem" / "criteria.py").read_text(encoding="utf-8")
    words = [sys.executable, "-W", "error", "-c", OUTCOMES]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n") == [
        *("survived", "killed", "killed", "timed out", "ended", "killed"),
        *("no test imports seqopt.report.draw", ""),
    ]
    assert (ROOT / "seqopt" / "problem" / "criteria.py").read_text(encoding="utf-8") == before
