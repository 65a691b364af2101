"""Bars are the grips of the steps, shaded by their forces."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_rgba

import seqopt
from seqopt.errors import StepError
from seqopt.report._gantt import gantt_picture
from seqopt.sequence.schedule import holds


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
