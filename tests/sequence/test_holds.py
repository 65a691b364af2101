"""Holds are the grips of the steps, no more and no less."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from seqopt.network.build import build_network
from seqopt.scene.library import WallShape, wall
from seqopt.sequence.methods import METHODS
from seqopt.sequence.schedule import OpenGrip, holds
from seqopt.sequence.steps import StepKind


def unrolled(found):
    """Return what every robot holds in every step, from holds."""
    return {
        (hold.robot, number): hold.node if hold.move is None else OpenGrip(hold.move)
        for hold in found
        for number in range(hold.first, hold.last + 1)
    }


def as_listed(steps):
    return {
        (robot, step.number): grip
        for step in steps
        for robot, grip in enumerate(step.grips)
        if grip is not None
    }


def placing(steps):
    return [step.number for step in steps if step.kind is StepKind.PLACE]


def require_same(scene, steps):
    found = holds(scene, steps)
    assert unrolled(found) == as_listed(steps)
    assert sorted(hold.first for hold in found if hold.places is not None) == placing(steps)
    placed = sorted((hold.first, hold.places) for hold in found if hold.places is not None)
    assert [name for _, name in placed] == [brick.name for brick in scene.placed]


@given(columns=st.integers(2, 4), courses=st.integers(1, 3), name=st.sampled_from([*METHODS]))
def test_holds_of_a_method_are_its_grips(columns, courses, name):
    scene = wall(WallShape(columns=columns, courses=courses))
    require_same(scene, METHODS[name](build_network(scene)))


def test_holds_of_a_schedule_are_its_grips(loop25):
    require_same(loop25.scene, loop25.steps)
    open_ones = [hold.move for hold in holds(loop25.scene, loop25.steps) if hold.move is not None]
    assert sorted(open_ones) == list(range(len(loop25.moves)))


def test_a_grip_that_is_left_out_is_seen(arch25, engine25):
    steps = list(METHODS["sequential"](engine25.network))
    steps[3] = replace(steps[3], grips=(None, None, None))
    found = holds(arch25, METHODS["sequential"](engine25.network))
    assert unrolled(found) != as_listed(steps)
