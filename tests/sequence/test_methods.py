"""Methods on other arches, impossible steps."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.library import WallShape, wall
from seqopt.scene.parts import Robot, Sphere
from seqopt.sequence.methods import METHODS, cantilever, lies_along, sequential
from seqopt.sequence.schedule import OpenGrip, holds
from seqopt.sequence.steps import StepKind, check_sequence
from seqopt.study.published import published_plan


def test_where_all_bricks_lie_along_the_methods_are_one():
    net = build_network(arch_scene(ArchShape(pitch=[1.0, 0.6, 0.2, -0.2], pattern="V")))
    assert lies_along(net) == {1, 2, 3, 4}
    assert sequential(net) == cantilever(net)


def test_methods_say_what_they_lack(arch25):
    with pytest.raises(StepError, match="1 robots; this method needs two"):
        sequential(build_network(replace(arch25, robots=arch25.robots[:1])))
    near = Sphere(center=(0.0, 0.0, 0.0), radius=0.5)
    short = tuple(Robot(name=f"rob{i}", payload=300.0, reach=near) for i in (1, 2))
    with pytest.raises(StepError, match="brick 4: rob1 and rob2 reach none of its free nodes"):
        sequential(build_network(replace(arch25, robots=short)))


def edited(plan, number, **changes):
    return [replace(s, **changes) if s.number == number else s for s in plan]


@pytest.mark.parametrize(
    ("number", "changes", "named"),
    [
        (4, {"grips": (None, 2)}, "step 4: 2 grips for 3 robots"),
        (4, {"bricks": 0}, "step 4: 0 bricks"),
        (4, {"grips": (None, 2, 99)}, "step 4: rob3 at node 99: there is no such node"),
        (4, {"grips": (None, 2, 9)}, "step 4: rob3 at node 9: brick 5 is not placed yet"),
        (4, {"grips": (None, 2, 2)}, "step 4: rob3 at node 2: rob2 holds it"),
        (9, {"grips": (7, 8, None)}, "step 9: rob2 at node 8: the node is out of its reach"),
        (4, {"grips": (1, 2, 4)}, r"step 4 \(release\): it takes grips \[\] and drops \[\]"),
        (4, {"grips": (None, 1, 4)}, "step 4 .*: rob2 moves from node 2 to 1"),
        (4, {"kind": StepKind.PLACE}, r"step 4 \(place\): 3 bricks after 3; give 4"),
        (5, {"grips": (1, 2, 4)}, r"step 5 \(place\): its new grip is on node 1; hold brick 4"),
    ],
)
def test_impossible_steps(arch25, number, changes, named):
    with pytest.raises(StepError, match=named) as caught:
        check_sequence(arch25, edited(published_plan(arch25), number, **changes))
    assert "\n" not in str(caught.value)


# holds are the grips of the steps, no more and no less


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
