"""Commands of packages and users: a function whose signature and docstring say its options."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated, Literal

import pytest

import seqopt
from seqopt import doors
from seqopt._registry import ADDED, COMMANDS, every_command
from seqopt.errors import ProblemError
from tests.builders import ROOT
from tests.commands import command

PACKAGE = '''
import pandas as pd
import seqopt
from seqopt.doors import Command


def weigh(
    scene: str = "arch25", *, per: str = "scene", least: float = 0.0, names: tuple[str, ...] = ()
):
    """Say what the bricks of a scene weigh.

    Usage
    [SCENE] [--per brick]

    Parameters
    ----------
    scene : SCENE
        what is weighed
    per : WORD
        scene, or brick for a table
    least : KG
        leave out lighter bricks
    names : NAME
        bricks to weigh

    Examples
    --------
    seqopt weigh arch25 --per brick
    """
    found = seqopt.load_scene(scene)
    weights = {str(brick.name): brick.mass for brick in found.placed if brick.mass >= least}
    weights = {name: each for name, each in weights.items() if not names or name in names}
    if per == "brick":
        return pd.DataFrame({"brick": [*weights], "kg": [*weights.values()]})
    return f"{found.name}: {len(weights)} bricks weigh {sum(weights.values()):.4g} kg"


WEIGH = Command("weigh", weigh)
'''
POINTS = "[seqopt.parts]\nweigh = my_package:WEIGH\n"


@pytest.fixture
def package(tmp_path):
    """A folder with an installed package that has a command; return how seqopt runs beside it."""
    (tmp_path / "my_package.py").write_text(PACKAGE, encoding="utf-8")
    info = tmp_path / "my_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(POINTS)

    def run(*words):
        paths = (
            f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]; sys.argv[0] = 'seqopt'"
        )
        code = f"{paths}\nfrom seqopt.__main__ import run\nsys.exit(run())"
        return subprocess.run(
            [sys.executable, "-c", code, *words], capture_output=True, text=True, check=False
        )

    return run


@pytest.mark.slow
def test_a_package_adds_a_command(package):
    assert "    weigh     Say what the bricks of a scene weigh." in package("--help").stdout
    page = package("weigh", "--help")
    assert "usage: seqopt weigh [SCENE] [--per brick]" in page.stdout
    assert "--least KG" in page.stdout
    assert "seqopt weigh arch25 --per brick" in page.stdout
    assert package("weigh", "chain:bricks=7").stdout == "chain 7: 7 bricks weigh 25.62 kg\n"
    table = package("weigh", "chain:bricks=7", "--per", "brick", "--names", "1", "--names", "3")
    assert table.stdout.splitlines()[0] == "brick,kg"
    assert len(table.stdout.splitlines()) == 3
    assert '"text": "chain 7' in package("weigh", "chain:bricks=7", "--json").stdout
    wrong = package("weigh", "arch26")
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)
    assert "--least: 'x' is not a positive number" in package("weigh", "--least", "x").stderr
    assert "did you mean --least?" in package("weigh", "--leest", "1").stderr
    assert "did you mean weigh?" in package("weig").stderr


@pytest.mark.slow
def test_a_package_that_fails_is_left_out(package, tmp_path):
    (tmp_path / "my_package.py").write_text("import nothing_of_this_name\n", encoding="utf-8")
    page = package("--help")
    assert (page.returncode, "weigh" in page.stdout) == (0, False)
    assert "plug-in my_package:WEIGH" in page.stderr
    assert package("scene", "chain:bricks=7").stderr == ""  # nobody asks for plug-ins there


@pytest.fixture
def alone():
    """Forget what a test registers."""
    before = {**ADDED}
    yield
    ADDED.clear()
    ADDED.update(before)


def count(
    folder: Path,
    *,
    kind: Literal["all", "odd"] = "all",
    most: Annotated[int, {"least": 0, "most": 5}] = 3,
    loud: bool = False,
):
    """Count.

    What is counted?
    folder : DIR
        where
    kind : CHOICE
        which
    most : N
        up to
    loud :
        say it louder
    """
    return doors.Answer({"kind": kind}, f"{folder.name} {kind} {most}{'!' * loud}")


@pytest.mark.usefixtures("alone")
def test_a_function_is_registered_as_a_command(capsys, tmp_path):
    seqopt.register(doors.Command("count", count))
    assert {*every_command()} == {*COMMANDS, "count"}
    assert command(capsys, "count", tmp_path / "a", "--loud")[1] == "a all 3!\n"
    assert command(capsys, "count", tmp_path, "--most", "0", "--kind", "odd")[0] == 0
    assert "from 0 to 5" in command(capsys, "count", tmp_path, "--most", "6")[2]
    assert "did you mean odd?" in command(capsys, "count", tmp_path, "--kind", "od")[2]
    assert "arguments are required: DIR" in command(capsys, "count")[2]
    with pytest.raises(ProblemError, match="this name has a meaning already"):
        seqopt.register(doors.Command("scene", count))
    own = doors.Command("say", lambda scene="arch25", *, engine="x": f"{scene} {engine}")
    seqopt.register(own)  # what these words mean elsewhere is not meant
    assert command(capsys, "say", "mine", "--engine", "own")[1] == "mine own\n"
    seqopt.register(doors.Command("five", lambda: 5))
    assert "it returns int; return a text, a table or an Answer" in command(capsys, "five")[2]
