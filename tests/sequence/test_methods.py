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
from seqopt.sequence.methods import (
    METHODS,
    cantilever,
    lies_along,
    open_schedule,
    sequential,
    three_robot_loop,
)
from seqopt.sequence.schedule import OpenGrip, OpenStep, holds, islands
from seqopt.sequence.steps import StepKind, check_sequence
from seqopt.study import published_plan
from tests.builders import anywhere, branch, from_both_ends, running_bond, small_arch


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


# what stands by itself: islands, and methods on builds that are not chains


def ordered(scene, *names):
    return build_network(replace(scene, build_order=names))


def test_islands_are_the_parts_that_no_joint_ties_to_the_ground():
    network = ordered(small_arch(6), 1, 3, 5, 4, 6, 2)
    found = [[sorted(part) for part in islands(network, count)] for count in range(1, 7)]
    assert found == [[], [[3]], [[3], [5]], [[3, 4, 5]], [], []]  # brick 6 stands on the far end


def test_a_joint_that_resists_nothing_ties_nothing():
    scene = replace(small_arch(3), grounds=small_arch(3).grounds[:1])
    turning = replace(scene.joints[0], translational_stiffness=(0.0,) * 3)
    nothing = replace(turning, rotational_stiffness=(0.0,) * 3)
    for joint, found in ((turning, ()), (nothing, (frozenset({2, 3}),))):
        network = build_network(replace(scene, joints=(joint, scene.joints[1])))
        assert islands(network, 3) == found


@pytest.mark.parametrize("method", [sequential, cantilever])
def test_two_islands_are_too_many_for_two_robots(method):
    network = ordered(small_arch(6), 1, 3, 5, 2, 4, 6)
    with pytest.raises(StepError, match=r"step 5 \(release\): brick 3 hangs free"):
        method(network)


def test_an_open_grip_holds_an_island_only_if_every_candidate_is_on_it():
    network = ordered(small_arch(5), 1, 3, 2, 4, 5)
    first = OpenStep(1, StepKind.PLACE, 1, (1, None, None))
    second = OpenStep(2, StepKind.PLACE, 2, (1, OpenGrip(0), None))
    assert len(open_schedule("x", network, [first, second]).moves[0].candidates) == 2
    held = replace(second, grips=(1, 4, None))
    let_go = OpenStep(3, StepKind.RELEASE, 2, (None, 4, None))
    third = OpenStep(4, StepKind.REPOSITION, 2, (None, 4, OpenGrip(0)))
    loose = OpenStep(5, StepKind.RELEASE, 2, (None, None, OpenGrip(0)))
    steps = [first, held, let_go, third]
    assert open_schedule("x", network, steps).moves[0].candidates == (1, 5)
    with pytest.raises(StepError, match=r"step 5 \(release\): brick 3 hangs free"):
        open_schedule("x", network, [*steps, loose])


def grows_from_what_is_held(network, steps):
    """Return at which steps the newest brick extends no held one.

    It must be reached from a held brick over joints between bricks placed since that one.
    """
    scene = network.scene
    index = {brick.name: k for k, brick in enumerate(scene.placed)}
    pairs = [{index[b] for b in joint.bricks} for joint in scene.joints]
    out = []
    for step in steps:
        if not any(step.grips):
            continue
        newest = step.bricks - 1
        held = {index[scene.brick_of_node[node].name] for node in step.grips if node is not None}
        if not any(newest in _since(pairs, start, newest) for start in held):
            out.append(step.number)
    return out


def _since(pairs, start, newest):
    found = {start}
    for _ in range(start, newest + 1):
        found |= {b for pair in pairs if pair & found for b in pair if start <= b <= newest}
    return found


CROSS = [*range(1, 7), *range(12, 6, -1)]  # one side of an arch, then the other


@pytest.mark.parametrize(
    "scene",
    [
        small_arch(12),
        from_both_ends(11),
        from_both_ends(12, order=CROSS),
        running_bond(3, 3),
        running_bond(4, 2),
        branch(),
        replace(branch(), build_order=(1, 2, 3, 5, 4, 6)),
    ],
    ids=lambda s: s.name,
)
def test_the_cantilever_method_holds_where_the_build_goes_on(scene):
    network = build_network(replace(scene, robots=anywhere(2)))
    assert grows_from_what_is_held(network, cantilever(network)) == []
    assert grows_from_what_is_held(network, sequential(network)) == []


def test_three_robots_hold_an_island_while_they_can():
    ahead = ordered(replace(small_arch(6), robots=anywhere(3)), 1, 3, 2, 4, 5, 6)
    assert three_robot_loop(ahead).steps
    one_end = replace(small_arch(6), grounds=small_arch(6).grounds[:1], robots=anywhere(3))
    with pytest.raises(StepError, match="free: no joint connects to the ground"):
        three_robot_loop(ordered(one_end, 1, 3, 5, 6, 2, 4))
