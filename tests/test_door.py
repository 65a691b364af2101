"""The door: what ``import seqopt`` gives; it, help and commands load what they need alone."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import seqopt
from tests.builders import ROOT


def test_the_door_shows_its_names_and_no_others():
    assert dir(seqopt) == sorted(seqopt.__all__)
    assert 25 <= len(seqopt.__all__) <= 53
    assert all(getattr(seqopt, name) is not None for name in seqopt.__all__)
    with pytest.raises(AttributeError, match="module 'seqopt' has no attribute 'nothing'"):
        seqopt.nothing  # noqa: B018


def test_both_tables_name_the_same_homes():
    lazy = {name: f"seqopt.{home}" for name, home in seqopt._HOME_OF.items()}
    text = Path(seqopt.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    imports = [part for part in ast.parse(text).body if isinstance(part, ast.ImportFrom)]
    assert all(alias.asname == alias.name for part in imports for alias in part.names)
    assert {alias.name: part.module for part in imports for alias in part.names} == lazy
    assert {*lazy, "__version__"} == {*seqopt.__all__}


LIGHT = ("numpy", "pandas", "scipy", "networkx")
LATE = ("pandas.core", "scipy.optimize", "seqopt.exchange.imports", "seqopt.report.page")
SELDOM = (
    *("scipy.optimize", "scipy.spatial", "cvxpy", "highspy", "numba", "matplotlib"),
    *("seqopt.arms._tables", "seqopt.engines.discrete", "seqopt.engines.frame"),
    *("seqopt.engines.rigid._refinement", "seqopt.graph._spaces"),
    *("seqopt.plan._answers", "seqopt.judge._proof", "seqopt.scene.library"),
    "seqopt.sequence._space",
)
FREE = ["optimize", "chain:bricks=7", "--schedule", "free", "--quiet"]
ASSESS = ["assess", "chain:bricks=7", "--method", "cantilever"]
MAIN = "from seqopt._cli.main import load, main\n"
STAGES = {  # what one interpreter does, one after the other, and what is not loaded then
    "import seqopt": ("numpy", "seqopt.scene", "seqopt._files"),
    "from seqopt._cli.start import run\nsys.argv[1:] = ['--version']\nassert run() == 0": LIGHT,
    f"{MAIN}main([])": LIGHT,
    "main(['--help'])": LIGHT,
    "main(['--version'])": LIGHT,
    "load(['optimize'])": SELDOM,
    "main(['optimize', 'chain:bricks=6'])": ("pandas.core", "seqopt.report.comparison"),
    f"load({FREE})\nassert main({FREE}) == 0": LATE,
    f"load({ASSESS})\nassert main({ASSESS}) in (0, 1)": LATE,
    "import seqopt.report\n[getattr(seqopt, n) for n in seqopt.__all__]": ("matplotlib", "cvxpy"),
    "assert main(['optimize', 'chain:bricks=6', '--json']) == 0": (),  # a table is made
}


@pytest.mark.slow
def test_nothing_is_loaded_before_it_is_needed():
    """In a fresh interpreter; in the end a table of pandas shows that loading is seen."""
    code = "import contextlib, io, sys\n"
    for stage, late in STAGES.items():
        quiet = "\n    ".join(stage.splitlines())
        code += f"with contextlib.redirect_stdout(io.StringIO()):\n    {quiet}\n"
        code += f"print(*[name for name in {late} if name in sys.modules])\n"
    code += "print('pandas.core' in sys.modules)"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    *loaded, seen = done.stdout.splitlines()
    assert dict(zip(STAGES, loaded, strict=True)) == dict.fromkeys(STAGES, "")
    assert seen == "True"


@pytest.mark.slow
def test_a_heavy_import_is_seen():
    code = "import sys, seqopt.report.charts, seqopt; seqopt.formulations()"
    code += "\nprint(*[name for name in ('cvxpy', 'matplotlib') if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["cvxpy", "matplotlib"]
