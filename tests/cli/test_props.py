"""Props on the command line: words for them, and what is written."""

from __future__ import annotations

import json
from dataclasses import dataclass

import pytest

from seqopt._cli.main import main
from seqopt.scene.scene_file import load_scene, save_scene
from tests.builders import small_arch

FREE = ("--schedule", "free", "--no-stability")


@pytest.fixture
def arch(tmp_path):
    path = tmp_path / "arch.json"
    save_scene(small_arch(6), path)
    return str(path)


@dataclass
class Said:
    """What a command said, and how it ended."""

    status: int
    out: str
    err: str


@pytest.fixture
def cli(capsys):
    def run(*arguments):
        try:
            status = main([*arguments])
        except SystemExit as stop:
            status = int(stop.code or 0)
        return Said(status, *capsys.readouterr())

    return run


def test_props_are_said_in_words(cli, arch, tmp_path):
    found = cli("scene", arch, "--props", "3,5:1e6,push,capacity=300", "--json")
    assert json.loads(found.out)["scene"]["props"] == [3, 5]
    assert (
        "rigid, pushes along (0, 0, 1) only, up to 300 N"
        in cli("scene", arch, "--props", "3,push,capacity=300").out
    )
    cli("scene", arch, "--props", "every:1e5", "--export", str(tmp_path / "own.json"))
    props = load_scene(tmp_path / "own.json").props
    assert len(props) >= 5
    assert {prop.stiffness for prop in props} == {(1e5,) * 3}
    bare = cli("scene", str(tmp_path / "own.json"), "--props", "none", "--json")
    assert json.loads(bare.out)["scene"]["props"] == []
