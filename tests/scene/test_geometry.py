"""Where the parts of a scene lie: what leaves nothing to compute is refused in the scene."""

from __future__ import annotations

from dataclasses import replace

import pytest

from seqopt.errors import SceneError
from tests.builders import six_bricks


def with_part(scene, kind, index, **change):
    """The scene with one brick, joint or ground end changed."""
    parts = list(getattr(scene, kind))
    parts[index] = replace(parts[index], **change)
    return replace(scene, **{kind: tuple(parts)})


SCENE = six_bricks()
NODE = SCENE.node_position(3)


@pytest.mark.parametrize(
    ("kind", "index", "change", "named"),
    [
        (
            "joints",
            1,
            {"position": tuple(x + 1e-9 for x in NODE)},
            r"joint \(2, 3\): position is that of node 3",
        ),
        ("grounds", 0, {"position": SCENE.node_position(0)}, "ground end of brick 1: .* node 0"),
        ("grounds", 0, {"anchor": (1e-200, 0.0, 0.0)}, "anchor and position are one point"),
        ("bricks", 1, {"position": (1e308, 1e308, 0.0)}, "brick 2: position .* move the scene"),
        ("bricks", 1, {"dimensions": (1e-200,) * 3}, "brick 2: dimensions .* give meters"),
        ("bricks", 1, {"density": 1e308}, r"brick 2: it weighs .*1e\+308 kg/m³"),
        (
            "joints",
            1,
            {"translational_stiffness": (1e300,) * 3},
            r"joint \(2, 3\): a stiffness is 1e\+300",
        ),
        (
            "joints",
            1,
            {"rotational_stiffness": (1e-160, 1e6, 1e6)},
            r"joint \(2, 3\): a stiffness is 1e-160; give 0",
        ),
    ],
)
def test_what_leaves_nothing_to_compute_is_refused(kind, index, change, named):
    with pytest.raises(SceneError, match=named):
        with_part(SCENE, kind, index, **change)


@pytest.mark.parametrize("pull", [1e160, 1e-160])
def test_a_weight_beyond_all_bounds_is_refused(pull):
    with pytest.raises(SceneError, match=r"brick 1: it weighs .* gravity (1e.|9.99989e-)[13]"):
        replace(SCENE, gravity=(0.0, 0.0, -pull))
