"""The door: what ``import seqopt`` gives, and that it stays light."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import seqopt

HEAVY = ("matplotlib", "cvxpy")
LOADED = f"import sys; print(*[name for name in {HEAVY} if name in sys.modules])"


def loaded_by(code):
    """Return which heavy packages a fresh interpreter has loaded after running some code."""
    command = [sys.executable, "-c", f"{code}\n{LOADED}"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1].split()


def type_checked():
    """Return, by name, the modules of what type checkers are told that the door has."""
    text = Path(seqopt.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    imports = [part for part in ast.parse(text).body if isinstance(part, ast.ImportFrom)]
    assert all(alias.asname == alias.name for part in imports for alias in part.names)
    return {alias.name: part.module for part in imports for alias in part.names}


def test_the_door_shows_its_names_and_no_others():
    assert dir(seqopt) == sorted(seqopt.__all__)
    assert 25 <= len(seqopt.__all__) <= 52
    assert len({*seqopt.__all__}) == len(seqopt.__all__)
    assert all(getattr(seqopt, name) is not None for name in seqopt.__all__)


def test_both_tables_name_the_same_homes():
    lazy = {name: f"seqopt.{home}" for name, home in seqopt._HOME_OF.items()}
    assert type_checked() == lazy
    assert {*lazy, "__version__"} == {*seqopt.__all__}


def test_an_unknown_name_is_an_error():
    with pytest.raises(AttributeError, match="module 'seqopt' has no attribute 'nothing'"):
        seqopt.nothing  # noqa: B018


@pytest.mark.parametrize(
    "code",
    [
        "import seqopt",
        "import seqopt.report; [getattr(seqopt, name) for name in seqopt.__all__]",
        "import runpy, sys; sys.argv[1:] = ['--help']\n"
        "try: runpy.run_module('seqopt', run_name='__main__')\nexcept SystemExit: pass",
    ],
    ids=["import", "every name", "help"],
)
def test_nothing_heavy_is_loaded(code):
    assert loaded_by(code) == []


def test_importing_the_door_loads_none_of_its_rooms():
    code = "import sys, seqopt; print(*[m for m in sys.modules if m.startswith('seqopt.')])"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


FREE = ["optimize", "chain:bricks=7", "--schedule", "free", "--quiet"]


def loaded_by_command(*words):
    """Return which libraries a command has loaded that wait until they are asked for."""
    late = ("pandas.core", "scipy.optimize", "seqopt.exchange.imports", "seqopt.report.page")
    code = (
        f"import sys\nfrom seqopt._cli.main import load, main\nload({words})\n"
        f"assert main({words}) in (0, 1)\n"
        f"print()\nprint(*[name for name in {late} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1].split()


def test_a_free_plan_loads_no_tables_and_no_programs(tmp_path):
    assert loaded_by_command(*FREE) == []
    assert loaded_by_command(*FREE, "--out", str(tmp_path / "out")) == [
        "pandas.core",
        "seqopt.report.page",
    ]


def test_verdicts_load_no_tables_and_no_pages():
    asked = ("assess", "chain:bricks=7", "--method", "cantilever")
    assert loaded_by_command(*asked) == []
    pages = loaded_by_command(*asked, "--map", "tilt=0", "--holds", "epoxy")
    assert "seqopt.report.page" in pages


@pytest.mark.slow
def test_a_heavy_import_is_seen():
    assert loaded_by("import seqopt.report.charts") == ["matplotlib"]
    assert "cvxpy" in loaded_by("import seqopt; seqopt.formulations()")
