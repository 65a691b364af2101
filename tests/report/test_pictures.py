"""Pictures and charts show what they should, notebooks too; what is drawn last hides the rest."""

from dataclasses import replace

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_rgba

import seqopt
from seqopt.engines.interface import Want
from seqopt.engines.registry import make_engine
from seqopt.errors import StepError
from seqopt.network.network import build_network
from seqopt.plan.build import GivenSequence
from seqopt.report._gantt import gantt_picture
from seqopt.report._style import look, looks, new_figure, picture_files, plain
from seqopt.report.charts import front_figure
from seqopt.report.comparison import compare
from seqopt.report.draw import View, _drawing_order, draw_bricks, draw_grips
from seqopt.scene.boxes import _boxes, box_corners
from seqopt.scene.library import WallShape, wall
from seqopt.sequence.methods import sequential
from seqopt.sequence.schedule import holds
from seqopt.study import EQUATIONS
from tests.blocks import with_shapes
from tests.builders import six_bricks, small_arch


@pytest.fixture(scope="module")
def build(engine25):
    return GivenSequence(engine25, sequential(engine25.network), "sequential")


def test_points_with_as_many_steps_have_one_color():
    """One point was dark in all panels but the last, whose color bar had halves of steps."""
    front = seqopt.pareto(small_arch(3), aim="F_largest,D_max,steps")
    figure = front_figure(front, {})
    dots = [each for axes in figure.axes for each in axes.collections if each.get_cmap()]
    scales = {(each.norm.vmin, each.norm.vmax) for each in dots if each.get_array() is not None}
    assert len(scales) == 1
    ((low, high),) = scales
    assert float(low).is_integer()
    assert float(high).is_integer()


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


@pytest.mark.slow
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


# pictures, charts and comparisons hold what they should show; what is drawn last hides the rest
mpl.use("Agg")


@pytest.fixture
def axes():
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


def test_twists_move_bricks_and_magnify(axes, engine25):
    twist = engine25.solve(18, [[35]], Want.ALL).brick_twist[0]
    spans = []
    for magnify in (0.0, 1000.0, 2000.0):
        draw_bricks(axes, engine25.network, 18, View(), twist=twist, magnify=magnify)
        faces = axes.collections[-1].get_paths()
        spans.append(np.max([path.vertices.max(axis=0) for path in faces], axis=0))
    assert np.abs(spans[1] - spans[0]).max() > 0.01
    assert np.abs(spans[2] - spans[0]).max() == pytest.approx(
        2 * np.abs(spans[1] - spans[0]).max(), rel=0.5
    )


def test_blocks_of_any_shape_show_the_faces_that_look_at_the_viewer(axes):
    network = build_network(with_shapes(six_bricks()))
    draw_bricks(axes, network, 6, View(), twist=np.zeros((6, 6)), marked=(2,))
    (drawn,) = axes.collections
    assert len(drawn.get_paths()) == 6 * 3  # half of each box is turned away


def test_names_of_neighbors_stand_in_lines_and_a_name_alone_beside_its_mark(axes, engine25):
    draw_bricks(axes, engine25.network, 18, View())
    draw_grips(axes, engine25.network, (31, 33, 4), View())
    up = {text.get_text(): text.xyann[1] for text in axes.texts}
    assert up["rob3 at 4"] == 0
    assert abs(up["rob1 at 31"] - up["rob2 at 33"]) >= 11


@pytest.mark.slow
def test_without_weight_nothing_is_above_the_best():
    """Found by fuzzing: all responses are zero, and so is what gaps are relative to."""
    scene = replace(small_arch(4), gravity=(0.0, 0.0, 0.0))
    table = compare(make_engine("compliance", scene), EQUATIONS).table
    assert table.loc["free", ["objective", "gap"]].tolist() == [0.0, 0.0]


def test_seventy_series_differ_and_ten_do_without_color():
    every = [look(number) for number in range(70)]
    assert len({(one.color, one.marker) for one in every}) == 70
    assert len({one.marker for one in every[:10]}) == 10
    assert len({one.color for one in every[:7]}) == 7
    assert list(looks(["a", "b", "a"])) == ["a", "b"]


def test_a_figure_is_written_twice_and_always_alike():
    def files():
        figure = new_figure(1.0)
        figure.subplots().plot([1, 2])
        return picture_files("name", figure)

    once, again = files(), files()
    assert list(once) == ["name.png", "name.svg"]
    assert once == again
    assert once["name.png"].startswith(b"\x89PNG")
    assert b"<svg" in once["name.svg"]


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ((0.01, 1000), ["0.01", "0.1", "1", "10", "100", "1,000"]),
        ((3, 80), ["5", "10", "20", "50"]),
        ((1e5, 1e9), ["100,000", "$10^{6}$", "$10^{7}$", "$10^{8}$", "$10^{9}$"]),
    ],
)
def test_logarithmic_axes_have_plain_numbers(limits, words):
    axes = new_figure(1.0).subplots()
    axes.set(xscale="log", xlim=limits)
    plain(axes.xaxis)
    low, high = limits
    ticks = [tick for tick in axes.get_xticks() if low <= tick <= high]
    assert [axes.xaxis.get_major_formatter()(tick) for tick in ticks] == words
    assert len(axes.xaxis.get_minorticklocs()) == 0


# what is drawn last hides the rest: held against what a ray to the viewer meets first
WALL = wall(WallShape(columns=4, courses=4, gap=0.01))


def meets(shapes, start, toward):
    """Return where rays leave boxes toward the viewer, (n,); NaN for boxes that one misses."""
    place, frame, half = shapes
    ray = frame @ toward
    here = (frame @ (start - place)[:, :, None])[:, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-half - here) / ray, (half - here) / ray
    enters = np.minimum(one, other).max(axis=1)
    leaves = np.maximum(one, other).min(axis=1)
    return np.where(enters < leaves, leaves, np.nan)


def hidden_wrongly(scene, view, order, rays):
    """Count rays on which a box that is drawn later is farther from the viewer."""
    shapes, axes = _boxes(scene.bricks), view.axes()
    seen = box_corners(scene.bricks) @ axes.T
    low, high = seen.reshape(-1, 3).min(axis=0), seen.reshape(-1, 3).max(axis=0)
    rng = np.random.default_rng(1)
    rank = np.argsort(order)
    wrong = met = 0
    for x, y in rng.uniform(low[:2], high[:2], (rays, 2)):
        far = meets(shapes, x * axes[0] + y * axes[1], axes[2])
        hit = np.flatnonzero(~np.isnan(far))
        if len(hit) > 1:
            met += 1
            wrong += hit[rank[hit].argmax()] != hit[far[hit].argmax()]
    assert met > 10
    return wrong


@given(azimuth=st.integers(-180, 180), elevation=st.integers(20, 80))
def test_bricks_of_a_wall_hide_what_is_behind(azimuth, elevation):
    view = View(azimuth, elevation)
    order = _drawing_order(box_corners(WALL.bricks), view.axes())
    assert sorted(order) == [*range(16)]
    assert hidden_wrongly(WALL, view, order, 80) == 0


def test_depth_of_the_middles_alone_draws_a_wall_wrongly():
    """Negative control: the order of the middles hides what is in front."""
    view = View(35, 22)
    depth = _boxes(WALL.bricks)[0] @ view.axes()[2]
    assert hidden_wrongly(WALL, view, np.argsort(depth).tolist(), 300) > 0
