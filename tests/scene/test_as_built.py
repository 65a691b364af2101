"""Bricks that stand where they were measured."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seqopt.errors import SceneError, StepError
from seqopt.exchange.imports import read_measured
from seqopt.scene.scenarios import as_built
from tests.builders import six_bricks

SCENE = six_bricks()
STEP = st.tuples(*[st.floats(-0.01, 0.01)] * 3)


def measured_at(steps):
    own = {brick.name: brick.position for brick in SCENE.bricks}
    return {name: tuple(np.add(own[name], step)) for name, step in steps.items()}


@given(st.dictionaries(st.sampled_from(SCENE.build_order), STEP))
def test_what_was_measured_moves_with_half_of_its_joints(steps):
    built = as_built(SCENE, measured_at(steps))
    for old, new in zip(SCENE.bricks, built.bricks, strict=True):
        assert np.allclose(np.subtract(new.position, old.position), steps.get(old.name, (0, 0, 0)))
    for old, new in zip(SCENE.joints, built.joints, strict=True):
        own = [np.array(steps.get(name, (0.0, 0.0, 0.0))) for name in old.bricks]
        assert np.allclose(np.subtract(new.position, old.position), 0.5 * sum(own))
    assert [g.anchor for g in built.grounds] == [g.anchor for g in SCENE.grounds]
    if not steps:
        assert built == SCENE


def test_what_was_measured_wrong_is_named(tmp_path):
    with pytest.raises(SceneError, match="has no such brick"):
        as_built(SCENE, {99: (0.0, 0.0, 0.0)})
    with pytest.raises(SceneError, match="from where it was planned"):
        as_built(SCENE, measured_at({1: (5.0, 0.0, 0.0)}))
    path = tmp_path / "built.csv"
    for text, said in (
        ("brick,x,y\n1,0,0\n", "give a CSV file with columns"),
        ("brick,x,y,z\n1,a,0,0\n", "line 2: give numbers"),
        ("brick,x,y,z\n1.5,0,0,0\n", "line 2: give numbers"),
    ):
        path.write_text(text)
        with pytest.raises(StepError, match=said):
            read_measured(SCENE, path)
    path.write_text("brick,x,y,z\n2,0.1,0.2,0.3\n")
    assert read_measured(SCENE, path) == {2: (0.1, 0.2, 0.3)}
