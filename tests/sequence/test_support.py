"""What stands by itself: islands, and methods on builds that are not chains."""

from __future__ import annotations

from dataclasses import replace

import pytest

from experiments.harness.scenes import running_bond
from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.sequence.methods import cantilever, open_schedule, sequential, three_robot_loop
from seqopt.sequence.schedule import OpenGrip, OpenStep, islands
from seqopt.sequence.steps import StepKind
from tests.builders import anywhere, branch, from_both_ends, small_arch


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
