"""Pictures, charts and comparisons hold what they should show, in one style."""

from __future__ import annotations

from dataclasses import replace

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

from seqopt.engines.interface import Want
from seqopt.engines.registry import make_engine
from seqopt.network.build import build_network
from seqopt.report._style import look, looks, new_figure, picture_files, plain
from seqopt.report.comparison import compare
from seqopt.report.draw import View, draw_bricks, draw_grips, draw_network
from seqopt.study import EQUATIONS
from tests.blocks import with_shapes
from tests.builders import six_bricks, small_arch

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


def test_tension_and_compression_differ_in_color(axes, engine25):
    force = engine25.solve(12, [[19]]).edge_force[0]
    draw_network(axes, engine25.network, 12, View(), edge_force=force, numbers=True)
    colors = axes.collections[0].get_colors()
    assert len({tuple(color) for color in colors}) == 2
    assert len(axes.collections[0].get_segments()) == engine25.network.count_edges(12)


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
