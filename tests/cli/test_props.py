"""Props on the command line: words for them, how few are needed, and what is written."""

from __future__ import annotations

import json
from dataclasses import dataclass

import pandas as pd
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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--props", "evry"), "'evry' is no node (did you mean every?); give nodes, as 13,27"),
        (("--props", "99"), "prop at node 99: there is no such node"),
        (("--props", "3:soft"), "'soft' is not a positive number"),
        (("--props", "3,3"), "prop at node 3: another one holds it"),
        (("--props-among", "3"), "--props-among: it goes with --aim props,minmax"),
        (("--aim", "minmax,props"), "aim props: it comes first"),
        (("--aim", "props", "--props", "3"), "without props that are given"),
        (("--aim", "props", "--order", "search"), "aim props: they are chosen for one order"),
        (("--aim", "props", "--no-proof"), "--no-proof: props are compared by proven plans"),
    ],
)
def test_what_does_not_fit_is_said_in_a_line(cli, arch, words, said):
    found = cli("optimize", arch, *FREE, *words)
    assert found.status == 2
    assert said in found.err


def test_as_few_props_as_can_be_are_found(cli, arch, tmp_path):
    few = (
        "--robots",
        "2",
        "--rule",
        "least_grips=1",
        "--aim",
        "props,minmax",
        "--props-among",
        "4,6,8,10",
    )
    found = cli("optimize", arch, *FREE, *few, "--out", str(tmp_path / "out"))
    assert found.status == 0
    assert "props: " in found.out
    assert "no set of as many or fewer is better" in " ".join(found.out.split())
    summary = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))
    tried = pd.read_csv(tmp_path / "out" / "fewest_props.csv")
    assert summary["fewest_props"]["solved"] == tried["outcome"].str.startswith("solved").sum() > 0
    own = load_scene(tmp_path / "out" / "scene.json").props
    assert [prop.node for prop in own] == summary["fewest_props"]["nodes"]
    if own:
        assert pd.read_csv(tmp_path / "out" / "props.csv")["node"].tolist() == [p.node for p in own]
