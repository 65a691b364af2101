"""Methods of the study and any other loop of robots."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import seqopt
from seqopt.errors import StepError
from seqopt.network.network import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.library import WallShape, wall
from seqopt.scene.parts import Robot, Sphere
from seqopt.sequence.methods import (
    METHODS,
    SCHEDULES,
    _two_robot_loop,
    cantilever,
    lies_along,
    modified_sequential,
    open_schedule,
    placing_node,
    robot_loop,
    sequential,
    three_robot_loop,
)
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule, holds, islands, thin
from seqopt.sequence.steps import StepKind, check_sequence, idle_robots
from seqopt.study import EQUATIONS, WEIGHTED, printed, published_plan
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
    plan = published_plan(arch25)
    with pytest.raises(StepError, match=named) as caught:
        check_sequence(arch25, [replace(s, **changes) if s.number == number else s for s in plan])
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


def require_same(scene, steps):
    found = holds(scene, steps)
    assert unrolled(found) == as_listed(steps)
    assert sorted(hold.first for hold in found if hold.places is not None) == [
        step.number for step in steps if step.kind is StepKind.PLACE
    ]
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
        joined = set()
        for start in held:  # what is linked to it by bricks that came since
            found = {start}
            for _ in range(start, newest + 1):
                found |= {b for pair in pairs if pair & found for b in pair if start <= b <= newest}
            joined |= found
        if newest not in joined:
            out.append(step.number)
    return out


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
    with pytest.raises(StepError, match="free: no joint leads to the ground, and no robot"):
        three_robot_loop(ordered(one_end, 1, 3, 5, 6, 2, 4))


# loops of two robots and more: who grips when, and that an optimization can fill them
@pytest.mark.parametrize(("count", "word"), [(3, "three"), (4, "four"), (5, "five")])
def test_the_roles_of_any_number_of_robots_rotate(count, word):
    scene = replace(small_arch(11), robots=anywhere(count))
    schedule = robot_loop(build_network(scene))
    assert schedule.method == f"{word}-robot"
    assert len(schedule.moves) == 11 - count
    assert idle_robots(scene, schedule.steps) == ()
    for step in schedule.steps[count - 1 :]:
        held = [grip for grip in step.grips if grip is not None]
        assert len(held) >= count - 1
        newest = {scene.brick_of_node[g].name for g in held if isinstance(g, int)}
        recent = scene.build_order[step.bricks - count + 2 : step.bricks]
        assert {*recent} - newest <= {scene.build_order[count - 1]}  # the first open grip's brick
    whole = {frozenset(m.robot for m in schedule.moves)}
    assert len(schedule.moves) < count or whole == {frozenset(r.name for r in scene.robots)}


def test_two_robots_filled_with_placing_nodes_are_the_sequential_method(engine25, arch25):
    network = engine25.network
    schedule = _two_robot_loop(network)
    robots = {robot.name: robot for robot in arch25.robots}
    nodes = [
        placing_node(network, robots[move.robot], brick)
        for move, brick in zip(schedule.moves, arch25.placed, strict=True)
    ]
    assert schedule.fill(nodes) == sequential(network)


@pytest.mark.parametrize(("count", "criterion"), [(2, WEIGHTED), (5, EQUATIONS)])
def test_any_loop_can_be_optimized(count, criterion):
    scene = replace(small_arch(9), robots=anywhere(count))
    plan = seqopt.optimize(scene, "loop", criterion)
    assert plan.certificate.gap <= 1e-9
    assert plan.summary()["idle_robots"] == []
    exact = seqopt.optimize(scene, "loop", criterion, "overlap_lp")
    assert exact.certificate.objective == pytest.approx(plan.certificate.objective, rel=1e-6)


def test_too_few_robots_or_bricks_are_counted():
    for bricks, robots, wanted in ((5, 5, "five robots and six"), (2, 3, "three robots and four")):
        scene = replace(small_arch(bricks), robots=anywhere(robots))
        with pytest.raises(StepError, match=f"{robots} robots and {bricks} bricks; .* {wanted}"):
            SCHEDULES["loop"](build_network(scene))
    with pytest.raises(StepError, match="3 robots and 7 bricks; this method needs four robots"):
        robot_loop(build_network(replace(small_arch(7), robots=anywhere(3))), 4)


# the three-robot loop and the modified sequential method as schedules
def test_who_moves_when(loop25):
    """Table B.1: 22 moves, at step 3 and every fourth after it, by robots 3, 2, 1 in turn."""
    assert [m.step for m in loop25.moves] == list(range(3, 88, 4))
    assert [m.robot for m in loop25.moves] == [f"rob{3 - k % 3}" for k in range(22)]
    printed_robots = printed("three_robot_plan").set_index("step")["optimized_robot"]
    for step in loop25.steps[2:]:
        named = {f"rob{number}" for number in str(printed_robots[step.number]).split(";")}
        assert {loop25.moves[m].robot for m in step.moves} == named


def test_the_modified_sequential_method(engine25):
    """A third support for three steps; without it the sequential method is left."""
    schedule = modified_sequential(engine25.network)
    assert len(schedule.moves) == 23
    for k in range(len(schedule.moves)):
        kinds = [s.kind for s in schedule.steps if k in s.moves]
        assert kinds == [StepKind.REPOSITION, StepKind.RELEASE, StepKind.PLACE]
    plain = [(s.bricks, s.grips[:2]) for s in sequential(engine25.network)]
    bare = [(s.bricks, s.grips[:2]) for s in schedule.steps if s.kind is not StepKind.REPOSITION]
    assert [b for i, b in enumerate(bare) if i == 0 or b != bare[i - 1]] == plain
    nodes = [m.candidates[0] for m in schedule.moves]
    assert len(schedule.fill(nodes)) == len(schedule.steps)


def test_schedules_are_checked(loop25):
    with pytest.raises(StepError, match="3 nodes for 22 moves"):
        loop25.fill((1, 2, 3))
    far = replace(loop25.steps[0], grips=(OpenGrip(0), OpenGrip(5), None))
    with pytest.raises(StepError, match="at most two neighboring"):
        Schedule("x", loop25.scene, (far,), loop25.moves).names_robots(in_pairs=True)


# fewer candidates: those near the newest bricks, never none, and the schedule says so
@pytest.mark.parametrize("method", SCHEDULES)
def test_on_a_chain_joints_are_counted(arch25, method):
    schedule = SCHEDULES[method](build_network(replace(arch25, robots=anywhere(5))))
    thinned = thin(schedule, "near:4")
    place = {brick.name: i for i, brick in enumerate(arch25.placed)}
    for few, whole in zip(thinned.moves, schedule.moves, strict=True):
        newest = range(max(0, whole.bricks - 2), whole.bricks)
        away = {
            node: min(abs(place[arch25.brick_of_node[node].name] - end) for end in newest)
            for node in whole.candidates
        }
        limit = max(4, min(away.values()))
        assert few.candidates == tuple(n for n in whole.candidates if away[n] <= limit)
    assert thinned.steps == schedule.steps


@pytest.mark.parametrize("rule", ["near:", "near:-1", "far:3", 3])
def test_what_is_no_rule_is_refused(loop25, rule):
    with pytest.raises(StepError, match="give near:JOINTS, as near:12"):
        thin(loop25, rule)


# who places and who holds: from reach, or by name
def placers(scene, steps):
    """Return who places every brick."""
    found = []
    for before, step in zip((None, *steps), steps, strict=False):
        if step.kind is StepKind.PLACE:
            taken = [
                robot.name
                for i, robot in enumerate(scene.robots)
                if step.grips[i] is not None and (before is None or before.grips[i] is None)
            ]
            found += taken
    return found


def near(scene, name, *bricks):
    """A robot that reaches some neighboring bricks and no others."""
    nodes = {n: np.array(b.node_position(n)) for b in scene.bricks for n in b.nodes}
    own = [nodes[n] for b in scene.bricks if b.name in bricks for n in b.nodes]
    center = np.mean(own, axis=0)
    radius = max(np.linalg.norm(p - center) for p in own) + 1e-6
    robot = Robot(name=name, payload=400.0, reach=Sphere(center=tuple(center), radius=radius))
    reached = {b.name for b in scene.bricks if robot.reach.covers(b.node_position(b.nodes[0]))}
    assert set(bricks) <= reached
    return robot


def with_robots(scene, *robots):
    return build_network(replace(scene, robots=robots))


def test_the_first_two_that_reach_build():
    """A robot that reaches nothing comes first, and is left out."""
    scene = small_arch(5)
    far = Robot(name="far", payload=1.0, reach=Sphere(center=(50.0, 0.0, 0.0), radius=1.0))
    net = with_robots(scene, far, *anywhere(2))
    for method in METHODS.values():
        steps = method(net)
        assert placers(net.scene, steps)[:2] == ["rob1", "rob2"]
        assert idle_robots(net.scene, steps) == ("far",)
    three = with_robots(scene, far, *anywhere(3))
    for name in ("three-robot", "modified-sequential"):
        assert idle_robots(three.scene, SCHEDULES[name](three).steps) == ("far",)
    with pytest.raises(
        StepError, match="one places bricks 1, 5, all within reach of rob1, rob2, rob3;"
    ):
        robot_loop(with_robots(scene, far, *anywhere(3)))


def test_robots_by_name_take_the_roles_in_their_order():
    net = build_network(replace(small_arch(7), robots=anywhere(5)))
    for method in (*METHODS.values(), _two_robot_loop):
        made = method(net, ("rob4", "rob2"))
        steps = made if isinstance(made, tuple) else made.steps
        assert placers(net.scene, steps)[:2] == ["rob4", "rob2"]
        assert idle_robots(net.scene, steps) == ("rob1", "rob3", "rob5")
    for method in (three_robot_loop, robot_loop, modified_sequential):
        schedule = method(net, ("rob5", "rob1", "rob3"))
        assert placers(net.scene, schedule.steps)[:2] == ["rob5", "rob1"]
        assert schedule.moves[0].robot == "rob3"
        assert idle_robots(net.scene, schedule.steps) == ("rob2", "rob4")
    assert robot_loop(net, ("rob5", "rob1", "rob3", "rob2")).method == "four-robot"


@pytest.mark.parametrize(
    ("method", "names", "named"),
    [
        ("sequential", ("rob1", "robot"), "robot 'robot' does not exist; give some of rob1, rob2"),
        ("sequential", ("rob1", "rob1"), "robots rob1, rob1: one occurs twice"),
        ("two-robot", ("rob1", "rob2", "rob3"), "3 named; two-robot takes two"),
        ("three-robot", ("rob1", "rob2"), "2 named; three-robot takes three"),
        ("loop", ("rob1",), "1 named; two-robot takes two"),
    ],
)
def test_wrong_names_get_one_line(arch25, method, names, named):
    with pytest.raises(StepError, match=named) as caught:
        (METHODS | SCHEDULES)[method](build_network(arch25), names)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", [*METHODS, *SCHEDULES])
@pytest.mark.parametrize(("bricks", "robots"), [(2, 1), (1, 2), (2, 5)])
def test_few_bricks_and_few_robots_work_or_get_one_line(method, bricks, robots):
    net = build_network(replace(small_arch(bricks), robots=anywhere(robots)))
    enough = {**dict.fromkeys(METHODS, (2, 1)), "modified-sequential": (3, 1)}
    enough |= {"three-robot": (3, 4), "loop": (2, 1) if robots < 3 else (robots, robots + 1)}
    most, least = enough.get(method, (robots, bricks))  # of another one either will do
    bricks_at_end, said = None, "this method needs"
    try:
        made = (METHODS | SCHEDULES)[method](net)
        bricks_at_end = (made if isinstance(made, tuple) else made.steps)[-1].bricks
    except StepError as error:
        said = str(error)
    assert bricks_at_end in (None, bricks)
    assert re.fullmatch(".*this method needs.*", said)
    works = robots >= most and bricks >= least
    assert (bricks_at_end is not None) == works or method not in enough


@pytest.mark.parametrize("method", ["three-robot", "loop"])
def test_where_the_robots_of_a_scene_do_not_fit_the_scene_is_named(method):
    scene = small_arch(6)
    net = with_robots(scene, near(scene, "a", 1, 2), near(scene, "b", 1, 2), *anywhere(1))
    with pytest.raises(StepError) as caught:  # no option that was not given
        SCHEDULES[method](net)
    said = f"scene {scene.name}: not every role has a robot of its own of a, b, rob1: one places"
    assert str(caught.value).startswith(said)


def test_a_brick_that_nobody_reaches_is_named():
    scene = small_arch(5)
    net = with_robots(scene, near(scene, "a", 1, 2), near(scene, "b", 1, 2))
    with pytest.raises(
        StepError, match=r"brick 3: a and b reach none of its free nodes \[4, 5\]; extend a reach"
    ):
        sequential(net)
    mixed = with_robots(scene, near(scene, "a", 1, 2), *anywhere(1))
    with pytest.raises(
        StepError, match=r"a reaches none .*; rob1 does, and holds the brick before"
    ):
        sequential(mixed)
