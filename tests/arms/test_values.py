"""Arms as values, in scene files, and what is said where they cannot be."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

import seqopt
from seqopt.arms import _model, find_postures
from seqopt.arms._urdf import model_path
from seqopt.errors import ExtraError, SceneError
from seqopt.scene.arm import Arm
from tests.arms.scenes import TOOL, two_arms

ARM = {"urdf": "robot.urdf", "position": (0.0, 1.0, 0.0), "tool_length": 0.3, "tool_radius": 0.05}


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"urdf": 3}, "urdf is 3; give the path of a URDF, or package:path"),
        ({"tool_length": 0.0}, "tool_length is 0.0; give a positive number of m"),
        ({"x_axis": (1.0, 1.0, 0.0)}, "give perpendicular unit vectors"),
        ({"fingers": 0.3}, "fingers stand out 0.3 m from a brick"),
        ({"faces": ("top",)}, "faces are ('top',); give some of length, width, thickness"),
        ({"joint_stiffness": (1e6, 0.0)}, "joint_stiffness is 0.0; give a positive number"),
    ],
)
def test_a_wrong_value_is_a_line(wrong, said):
    with pytest.raises(SceneError, match=re.escape(said)):
        Arm(**ARM | wrong)


def test_a_scene_with_arms_comes_back_from_its_file(tmp_path):
    scene = two_arms(postures=2, joint_stiffness=(1e6,) * 6)
    seqopt.save_scene(scene, tmp_path / "mine.json")
    assert seqopt.load_scene(tmp_path / "mine.json") == scene
    assert scene.has_arms


def test_a_model_is_found_beside_the_scene_file(tmp_path):
    scene = two_arms()
    first, *others = scene.robots
    own = str(tmp_path / "models" / "own.urdf")
    scene = scene.with_robots(replace(first, arm=replace(first.arm, urdf=own)), *others)
    seqopt.save_scene(scene, tmp_path / "mine.json")
    written = json.loads((tmp_path / "mine.json").read_text())["robots"][0]["arm"]["urdf"]
    assert Path(written) == Path("models/own.urdf")
    assert seqopt.load_scene(tmp_path / "mine.json") == scene


def test_a_file_with_a_wrong_arm_is_refused(tmp_path):
    seqopt.save_scene(two_arms(), tmp_path / "mine.json")
    text = (tmp_path / "mine.json").read_text().replace('"tool_radius"', '"tool_width"')
    (tmp_path / "mine.json").write_text(text)
    with pytest.raises(SceneError, match="tool_"):
        seqopt.load_scene(tmp_path / "mine.json")


def test_without_the_extra_it_is_named(monkeypatch):
    monkeypatch.setattr(_model, "find_spec", lambda name: None)
    with pytest.raises(ExtraError, match=re.escape("pip install 'seqopt[arms]'")):
        find_postures(two_arms(tool_radius=0.049))
    assert find_postures(seqopt.load_scene("arch25")) is None


@pytest.mark.parametrize(
    ("urdf", "said"),
    [
        ("nowhere.urdf", "there is no file nowhere.urdf; give a URDF, or package:path"),
        ("no_such_package:robot.urdf", "package no_such_package is not installed"),
        ("seqopt:robot.urdf", "package seqopt has no file robot.urdf"),
    ],
)
def test_a_model_that_is_not_there_is_named(urdf, said):
    with pytest.raises(SceneError, match=re.escape(said)):
        model_path(Arm(**TOOL | {"urdf": urdf, "position": (0.0, 0.0, 0.0)}))
