"""Scenes on the command line: those that are built in, grips and props of one's own."""

from __future__ import annotations

import json

import pandas as pd
import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.scene.scene_file import ABOUT, KINDS, builtin_scenes, load_scene, save_scene
from tests.builders import small_arch
from tests.commands import command

ARCH = "arch:span=1,rise=0.4,bricks=6"


def test_all_built_in_scenes_are_listed_a_line_each(capsys):
    _, out, err = command(capsys, "scene", "--list")
    count = len(builtin_scenes())
    lines, words = out.splitlines()[:count], out.splitlines()[count:]
    assert (words, err) == ([*KINDS.values()], "")
    assert [line.split(":")[0] for line in lines] == [*builtin_scenes()]
    for line, name in zip(lines, builtin_scenes(), strict=True):
        scene = load_scene(name)
        assert f"{len(scene.bricks)} bricks, {len(scene.joints)} joints" in line
        assert line.endswith(ABOUT[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", builtin_scenes())
def test_a_built_in_scene_is_exported_and_read_again(capsys, tmp_path, name):
    path = tmp_path / "scene.json"
    out = command(capsys, "scene", name, "--export", path)[1]
    assert f"{name}: {len(load_scene(name).bricks)} bricks" in out
    assert load_scene(path) == load_scene(name)


def test_a_stiffness_is_that_of_all_robots(tmp_path, capsys):
    path = tmp_path / "soft.json"
    words = ("scene", "arch25", "--grips", "1e6x1e6x5e5,turning=2e4", "--export", path)
    said = "grip of 1e+06 x 1e+06 x 500000 N/m, which resists turning by 20000 N m/rad"
    assert said in command(capsys, *words)[1]
    assert load_scene(path) == load_scene("arch25").with_grips((1e6, 1e6, 5e5), 2e4)
    out = command(capsys, "scene", path, "--grips", "rigid", "--json")[1]
    assert {*json.loads(out)["scene"]["grips_N_per_m"].values()} == {None}


def test_analyses_follow_the_grips(capsys, tmp_path):
    path = tmp_path / "steps.csv"
    words = ["analyze", ARCH, "--method", "cantilever", "--grips", "1e5", "--out", str(path)]
    assert main(words) == 0
    network = seqopt.build_network(load_scene(ARCH).with_grips(1e5))
    wanted = seqopt.analyze(seqopt.make_engine("compliance", network), seqopt.cantilever(network))
    name = "D_max_1e-3mm"
    assert pd.read_csv(path)[name].to_numpy() == pytest.approx(wanted[name].to_numpy(), rel=1e-5)


def test_props_are_said_in_words(capsys, tmp_path):
    arch, own = tmp_path / "arch.json", tmp_path / "own.json"
    save_scene(small_arch(6), arch)
    out = command(capsys, "scene", arch, "--props", "3,5:1e6,push,capacity=300", "--json")[1]
    assert json.loads(out)["scene"]["props"] == [3, 5]
    out = command(capsys, "scene", arch, "--props", "3,push,capacity=300")[1]
    assert "rigid, pushes along (0, 0, 1) only, up to 300 N" in out
    command(capsys, "scene", arch, "--props", "every:1e5", "--export", own)
    props = load_scene(own).props
    assert len(props) >= 5
    assert {prop.stiffness for prop in props} == {(1e5,) * 3}
