"""What is drawn last hides the rest: held against what a ray to the viewer meets first."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seqopt.report.draw import View, _drawing_order
from seqopt.scene.boxes import _boxes, box_corners
from seqopt.scene.library import WallShape, wall
from seqopt.scene.scene_file import load_scene

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


@pytest.mark.parametrize("name", ["arch25", "dome163"])
def test_built_in_scenes_are_drawn_in_order(name):
    scene, view = load_scene(name), View(35, 22)
    order = _drawing_order(box_corners(scene.bricks), view.axes())
    assert sorted(order) == [*range(len(scene.bricks))]
    rays = 4000 if name == "arch25" else 400
    assert hidden_wrongly(scene, view, order, rays) == 0


def test_depth_of_the_middles_alone_draws_a_wall_wrongly():
    """Negative control: the order of the middles hides what is in front."""
    view = View(35, 22)
    depth = _boxes(WALL.bricks)[0] @ view.axes()[2]
    assert hidden_wrongly(WALL, view, np.argsort(depth).tolist(), 300) > 0
