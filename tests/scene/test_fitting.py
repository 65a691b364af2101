"""Numbers that do not fit are answered by near ones that do: each is tried."""

from __future__ import annotations

import re

import pytest

from seqopt.errors import SceneError
from seqopt.scene._fitting import which_fit
from seqopt.scene.scene_file import load_scene


def refusal(words):
    with pytest.raises(SceneError) as error:
        load_scene(words)
    return str(error.value)


def replaced(words, name, value):
    """Return words with another number."""
    return re.sub(rf"\b{name}=[^,]+", f"{name}={value}", words)


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("chain:bricks=4", {"bricks"}),
        ("arch:span=2,rise=1.4", {"span", "rise"}),
        ("arch:span=2,rise=0.8,bricks=13,dimensions=0.3x0.1x0.06", {"span", "dimensions"}),
        ("arch:span=2,rise=0.8,bricks=30", {"bricks"}),
        ("dome:courses=4,around=7,bond=herringbone", {"around"}),
        ("wall:columns=4,courses=3,corbel=0.2", {"corbel"}),
    ],
)
def test_what_is_said_to_fit_fits(words, names):
    found = dict(re.findall(r"(\w+)=([\dx.]+)", refusal(words).partition("; it fits with ")[2]))
    assert {*found} >= names
    for name, value in found.items():
        assert load_scene(replaced(words, name, value)).bricks


def test_the_least_change_is_named():
    assert "it fits with bricks=6" in refusal("chain:bricks=4")
    assert "interpenetrate" in refusal("chain:bricks=5")
    assert "rise=1" in refusal("arch:span=2,rise=1.4")
    assert "rises at most half" in refusal("arch:span=2,rise=1.01")


def test_where_nothing_near_fits_nothing_is_named():
    def never(_):
        raise SceneError("no")

    assert which_fit(never, {"span": 2.0, "bricks": 3, "curve": "pointed"}) == ""
    assert which_fit(lambda _: 1, {"curve": "pointed"}) == ""
