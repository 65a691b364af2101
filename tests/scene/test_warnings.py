"""What is probably not meant gets a warning that names it; ordinary scenes get none."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.harness.scenes import running_bond
from seqopt._cli.main import main
from seqopt.errors import SceneWarning
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene_file import _find_warnings, load_scene, save_scene
from tests.builders import six_bricks
from tests.strategies import arches, flat_arches, walls

SCENE = six_bricks()


def with_part(kind, index, **change):
    parts = list(getattr(SCENE, kind))
    parts[index] = replace(parts[index], **change)
    return replace(SCENE, **{kind: tuple(parts)})


ODD = {
    "joint (2, 3): it lies 1e+06 m from brick 2": with_part("joints", 1, position=(1e6, 0.0, 0.0)),
    "ground end of brick 1: it lies": with_part("grounds", 0, position=(0.0, 3.0, 0.0)),
    "bricks 2 and 4 interpenetrate by 89.6 mm": with_part(
        "bricks", 3, position=SCENE.bricks[1].position
    ),
    "brick 1: dimensions of (246.0, 116.0, 53.0) m look like millimeters": with_part(
        "bricks", 0, dimensions=(246.0, 116.0, 53.0)
    ),
    "brick 3: a density of 2.42 kg/m³ is odd": with_part("bricks", 2, density=2.42),
    "gravity is 9810 m/s²": replace(SCENE, gravity=(0.0, 0.0, -9810.0)),
}


@pytest.mark.parametrize("said", ODD)
def test_what_is_odd_is_named(capsys, tmp_path, said):
    assert any(doubt.startswith(said) for doubt in _find_warnings(ODD[said]))
    path = tmp_path / "scene.json"
    save_scene(ODD[said], path)
    with pytest.warns(SceneWarning) as heard:
        assert load_scene(str(path)) == ODD[said]
    assert any(said in str(warning.message) for warning in heard)
    assert main(["scene", str(path)]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert all(line.startswith("seqopt: warning: scene ") for line in lines)
    assert any(said in line for line in lines)


@given(scene=st.one_of(arches(), walls(), flat_arches()))
def test_scenes_of_tests_are_not_odd(scene):
    assert not [*_find_warnings(scene)]


@pytest.mark.parametrize(
    "scene", [load_scene("arch25"), running_bond(6, 4)], ids=lambda scene: scene.name
)
def test_ordinary_scenes_are_not_odd(tmp_path, scene):
    save_scene(scene, tmp_path / "scene.json")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_scene(str(tmp_path / "scene.json")) == scene


@pytest.mark.parametrize("name", ["pitch", "yaw"])
def test_degrees_are_noticed(name):
    angles = {"pitch": [0.5, 0.0, -0.5]} | {name: [60.0, 0.0, -60.0]}
    with pytest.warns(SceneWarning, match=f"{name} has 60 rad, more than a turn; give radians"):
        ArchShape(**angles)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        arch_scene(ArchShape(pitch=np.linspace(1.5, -1.5, 7)))
