"""Pictures hold what they should show."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
import trimesh

from seqopt.engines.interface import Want
from seqopt.network.build import build_network
from seqopt.report.draw import View, _inner_edges, draw_bricks, draw_grips, draw_network
from tests.blocks import with_shapes
from tests.builders import six_bricks

mpl.use("Agg")
import matplotlib.pyplot as plt


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


def test_cuts_of_flat_faces_are_no_edges_of_a_block():
    block = trimesh.creation.box((1.0, 2.0, 3.0))
    faces = tuple(map(tuple, block.faces.tolist()))
    inner = _inner_edges(block.vertices, faces)
    ways = [int((np.ptp(block.vertices[[*edge]], axis=0) > 0).sum()) for edge in inner]
    assert ways == [2] * 6  # a diagonal of each side
    bent = block.vertices + np.array([0.0, 0.0, 0.1]) * (block.vertices[:, :1] > 0)
    bent[0] += 0.2  # the control: a corner out of the plane of three sides
    assert len(_inner_edges(bent, faces)) < 6
