"""Scenes, networks and plans draw what they are, in notebooks too."""

from __future__ import annotations

import pytest

from seqopt.errors import StepError
from seqopt.plan.build import GivenSequence
from seqopt.sequence.methods import sequential


@pytest.fixture(scope="module")
def build(engine25):
    return GivenSequence(engine25, sequential(engine25.network), "sequential")


def test_a_scene_draws_as_many_bricks_as_are_asked_for(arch25):
    (whole,) = arch25.plot().axes
    assert whole.get_title(loc="left") == "arch25: 25 of 25 bricks"
    (part,) = arch25.plot(7).axes
    assert len(part.collections) == 2  # the others are pale
    for wrong in (0, 26, 2.5, "all"):
        with pytest.raises(StepError, match="scene arch25 has 1 to 25"):
            arch25.plot(wrong)


def test_a_network_draws_its_edges(engine25):
    network = engine25.network
    (axes,) = network.plot(8).axes
    assert len(axes.collections[0].get_segments()) == network.count_edges(8)
    assert len(axes.texts) == 16  # numbers of the nodes to hold


def test_every_step_that_is_asked_for_has_a_panel_with_its_grips(build):
    figure = build.plot([3, 30])
    assert [axes.get_title() for axes in figure.axes] == [
        "step 3 of 49: a robot lets go",
        "step 30 of 49: brick 16 is placed",
    ]
    for axes, number in zip(figure.axes, (3, 30), strict=True):
        named = [line.get_gid() for line in axes.lines]
        scene, step = build.engine.network.scene, build.steps[number - 1]
        pairs = zip(scene.robots, step.grips, strict=True)
        assert named == [f"{robot.name} at {node}" for robot, node in pairs if node is not None]
    assert len(build.plot().axes) == 6
    (key,) = figure.legends
    assert [text.get_text() for text in key.get_texts()] == ["rob1 holds", "rob2 holds"]
    (alone,) = build.plot(30).axes
    assert [text.get_text() for text in alone.texts] == named  # words where there is room


def test_forces_and_motion_are_drawn(build):
    (plain,), (forces,), (moved,) = (
        build.plot(30, **given).axes for given in ({}, {"forces": True}, {"magnify": 2000.0})
    )
    assert len({tuple(c) for c in forces.collections[0].get_colors()}) == 2
    assert len(moved.collections) == len(plain.collections) + 1  # where it would be, pale


@pytest.mark.parametrize("wrong", [0, "all", [], range(1, 30)])
def test_steps_that_are_none_get_one_line(build, wrong):
    with pytest.raises(StepError, match=r"the build has steps 1 to 49|give 1 to 24"):
        build.plot(wrong)
