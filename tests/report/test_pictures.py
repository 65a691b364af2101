"""Scenes, networks, plans and their grips draw what they are, in notebooks too."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_rgba

import seqopt
from seqopt.errors import StepError
from seqopt.plan.build import GivenSequence
from seqopt.report._gantt import gantt_picture
from seqopt.sequence.methods import sequential
from seqopt.sequence.schedule import holds


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
    with pytest.raises(StepError, match="a picture shows one of them"):
        build.plot(30, forces=True, magnify=2000.0)


@pytest.mark.parametrize("wrong", [0, "all", [], range(1, 30)])
def test_steps_that_are_none_get_one_line(build, wrong):
    with pytest.raises(StepError, match=r"the build has steps 1 to 49|give 1 to 24"):
        build.plot(wrong)


@pytest.fixture(scope="module")
def plan25(problem25):
    return seqopt.solve(problem25, "overlap_dp")


def bars(figure):
    """Return robot, first and last step of every framed bar."""
    patches = [p for p in figure.axes[0].patches if (p.get_gid() or "").startswith("hold")]
    return sorted(
        (
            round(p.get_y() + p.get_height() / 2),
            round(p.get_x() + 0.5),
            round(p.get_x() + p.get_width() - 0.5),
        )
        for p in patches
    )


def expected(scene, steps):
    return sorted((hold.robot, hold.first, hold.last) for hold in holds(scene, steps))


def test_bars_are_the_grips_of_the_steps(plan25, arch25, loop25):
    assert bars(plan25.gantt()) == expected(arch25, plan25.steps)
    assert bars(loop25.gantt()) == expected(arch25, loop25.steps)


def test_shades_follow_the_forces(engine25):
    build = seqopt.GivenSequence(engine25, seqopt.sequential(engine25.network))
    figure = build.gantt()
    table = build.responses()
    shaded = [p for p in figure.axes[0].patches if p.get_gid() is None]
    scale = figure.axes[1]._colorbar.mappable if hasattr(figure.axes[1], "_colorbar") else None
    assert scale is not None
    for patch in shaded[::7]:
        robot = build.engine.network.scene.robots[round(patch.get_y() + patch.get_height() / 2)]
        force = table.set_index("step").loc[round(patch.get_x() + 0.5), f"F_{robot.name}_N"]
        assert patch.get_facecolor() == pytest.approx(to_rgba(scale.to_rgba(force)))
    assert len(shaded) == int(np.isfinite(table[["F_rob1_N", "F_rob2_N"]].to_numpy()).sum())


def test_part_of_the_steps_is_drawn_and_others_are_refused(plan25, arch25):
    drawn = bars(plan25.gantt(10, 20))
    assert drawn == [bar for bar in expected(arch25, plan25.steps) if bar[1] <= 20 and bar[2] >= 10]
    for first, last in ((0, 5), (5, 4), (1, 91)):
        with pytest.raises(
            StepError, match=f"steps {first} to {last}: the build has steps 1 to 90"
        ):
            gantt_picture(arch25, plan25.steps, None, (first, last))
