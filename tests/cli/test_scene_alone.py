"""Every command runs with a scene alone, and says what it takes for the rest."""

from __future__ import annotations

import argparse

import pytest

from seqopt._cli.arguments import parser
from seqopt._registry import COMMANDS
from seqopt.scene.scene_file import save_scene
from tests.builders import small_arch
from tests.commands import command

OF_OTHERS = {"import", "judge"}  # of files
ALONE = sorted(COMMANDS.keys() - OF_OTHERS)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Return a folder to write to, in which there is a small arch."""
    save_scene(small_arch(4), tmp_path / "arch.json")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ALONE)
def test_a_command_runs_with_a_scene_alone(capsys, here, name):
    status, out, err = command(capsys, name, "arch.json")
    assert (status, bool(out)) == (0, True), err


def positional(name):
    """Return what stands for the words of a command that need no option before them."""
    commands = parser(name)._subparsers._group_actions[0]
    assert isinstance(commands, argparse._SubParsersAction)
    actions = commands.choices[name]._actions
    return [action.metavar or "" for action in actions if not action.option_strings]


def test_no_command_that_takes_a_scene_is_left_out():
    takes = {name for name in COMMANDS if any("SCENE" in word for word in positional(name))}
    assert takes == {*ALONE}


def test_what_is_taken_is_said_in_one_line(capsys, here):
    _, _, err = command(capsys, "analyze", "arch.json")
    assert err.startswith("steps: of the sequential method; --method, --plan or a plan's folder")
    _, _, err = command(capsys, "times", "arch.json")
    assert "durations: not known, taken as fetch=30,place=10" in err
    _, _, err = command(capsys, "analyze", "arch.json", "--method", "cantilever")
    assert "steps: of" not in err


def test_files_are_named_by_the_scene(capsys, here):
    _, _, err = command(capsys, "instance", "arch.json")
    (written,) = here.glob("*.npz")
    assert f"file: {written.name}; --out names another" in err
    command(capsys, "report", "arch.json")
    assert (here / "arch.html").is_file()


@pytest.mark.parametrize("name", ["analyze", "export"])
def test_a_folder_of_a_plan_is_its_scene_and_its_steps(capsys, here, name):
    command(capsys, "optimize", "arch.json", "--schedule", "free", "--out", "plan")
    alone = command(capsys, name, "arch.json")
    status, out, err = command(capsys, name, "plan")
    assert status == 0, err
    assert "steps: of" not in err
    assert out != alone[1]
    if name != "export":
        assert command(capsys, name, "arch.json", "--plan", "plan")[1] == out


def test_where_no_method_fits_a_plan_is_made(capsys, here, monkeypatch):
    monkeypatch.setattr("seqopt._cli.inputs.METHODS", {})
    status, _, err = command(capsys, "analyze", "arch.json")
    assert status == 0
    assert err.startswith("steps: of the best free schedule, minmax")
