"""Scenarios: what varies, by how much, and what stays."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.errors import SceneError, StepError
from seqopt.exchange.imports import read_measured
from seqopt.scene.scenarios import as_built, scenarios
from tests.builders import six_bricks
from tests.strategies import arches


def springs(scene):
    return (*scene.joints, *scene.grounds)


def factors(nominal, scene, name):
    """The factors of a stiffness, (springs, 3)."""
    pairs = zip(springs(scene), springs(nominal), strict=True)
    return np.array([np.divide(getattr(a, name), getattr(b, name)) for a, b in pairs])


def shifts(nominal, scene):
    """How far bricks, joints and ground ends moved along every axis, m."""
    return np.array(
        [
            np.subtract(a.position, b.position)
            for part in ("bricks", "joints", "grounds")
            for a, b in zip(getattr(scene, part), getattr(nominal, part), strict=True)
        ]
    )


@given(
    scene=arches(),
    factor=st.floats(1.0, 5.0),
    density=st.floats(0.0, 0.5),
    position=st.floats(0.0, 0.002),
    seed=st.integers(0, 2**40),
)
@settings(max_examples=8)
def test_what_varies_stays_in_its_bounds_and_all_else_as_it_is(
    scene, factor, density, position, seed
):
    drawn = scenarios(
        scene,
        stiffness=(1 / factor, factor),
        density=density,
        position=position,
        count=3,
        seed=seed,
    )
    for each in drawn.scenes:
        for name in ("translational_stiffness", "rotational_stiffness"):
            found = factors(scene, each, name)
            assert np.ptp(found, axis=1) == pytest.approx(0, abs=1e-9)  # one for all three axes
            assert (np.abs(np.log(found)) <= math.log(factor) + 1e-9).all()
        pairs = zip(each.bricks, scene.bricks, strict=True)
        assert all(abs(a.density / b.density - 1) <= density + 1e-9 for a, b in pairs)
        assert np.abs(shifts(scene, each)).max() <= position * (1 + 1e-9) + 1e-12
        assert [b.nodes for b in each.placed] == [b.nodes for b in scene.placed]
        assert [j.bricks for j in each.joints] == [j.bricks for j in scene.joints]
        assert (each.robots, each.blocked_nodes) == (scene.robots, scene.blocked_nodes)
        for ours, theirs in zip(each.grounds, scene.grounds, strict=True):  # stubs keep their shape
            stub = np.subtract(ours.anchor, ours.position)
            assert stub == pytest.approx(np.subtract(theirs.anchor, theirs.position), abs=1e-12)


def test_draws_spread_as_they_are_said_to():
    """Log-uniform factors and uniform shares: means and spreads of many draws."""
    scene = six_bricks()
    drawn = scenarios(scene, count=300, seed=3)
    stiff = np.array([factors(scene, s, "rotational_stiffness")[:, 0] for s in drawn.scenes])
    logs = np.log(stiff) / math.log(3)
    dense = np.array([[b.density for b in s.bricks] for s in drawn.scenes])
    shares = (dense / [b.density for b in scene.bricks] - 1) / 0.1
    moved = np.array([shifts(scene, s) for s in drawn.scenes]) / 0.002
    for draws in (logs, shares, moved):
        assert abs(draws.mean()) < 0.05
        assert draws.std() == pytest.approx(1 / math.sqrt(3), rel=0.05)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"stiffness": (3, 1)}, "stiffness is"),
        ({"stiffness": 3.0}, "stiffness is 3.0; give the least and the largest factor"),
        ({"density": 1.0}, "density is 1.0; give a number from 0 to below 1"),
        ({"position": math.nan}, "position is nan; give a number from 0"),
        ({"position": 1e20}, "scenario 1 of .* is not a valid scene"),
        ({"count": 0}, "count is 0; give a whole number from 1"),
        ({"seed": -1}, "seed is"),
    ],
)
def test_numbers_that_cannot_be_meant(given, match):
    with pytest.raises(SceneError, match=match):
        scenarios(six_bricks(), **given)


def test_grips_vary_by_kind_and_leave_all_else():
    """Rigid ones stay rigid, equally stiff ones equally stiff."""
    scene = six_bricks()
    first, *others = scene.robots
    soft = [replace(robot, stiffness=1e6, rotational_stiffness=1e4) for robot in others]
    scene = scene.with_robots(first, *soft)
    plain = scenarios(scene, count=20, seed=1)
    drawn = scenarios(scene, grips=(0.5, 4.0), count=20, seed=1)
    ratios = []
    for before, after in zip(plain.scenes, drawn.scenes, strict=True):
        assert replace(after, robots=scene.robots) == before
        rigid, *rest = after.robots
        assert rigid == first
        assert len({(robot.stiffness, robot.rotational_stiffness) for robot in rest}) == 1
        assert after.grip_kinds.of_robot.tolist() == scene.grip_kinds.of_robot.tolist()
        ratios.append(rest[0].stiffness[0] / 1e6)
        assert rest[0].rotational_stiffness[2] == pytest.approx(1e4 * ratios[-1])
    assert 0.5 <= min(ratios) < 0.8
    assert 2.5 < max(ratios) <= 4.0
    assert drawn.settings["grips"] == [0.5, 4.0]
    assert "grips times 0.5 to 4, seed 1" in repr(drawn)
    with pytest.raises(SceneError, match="grips is 3; give the least and the largest"):
        scenarios(scene, grips=3)


# bricks that stand where they were measured


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
