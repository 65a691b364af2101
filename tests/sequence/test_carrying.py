"""Who places a brick, or takes it away, carries all of it: in every schedule, search and judge."""

import re
from dataclasses import replace

import pytest

import seqopt
from seqopt.arms import Arm
from seqopt.errors import InfeasibleError, StepError
from seqopt.graph.formulation import formulations
from seqopt.judge._proof import Proof
from seqopt.judge._schedules import judge_schedule
from seqopt.plan.front import find_front
from seqopt.plan.solve import graph_of
from seqopt.problem.requirements import _carrying_excesses, overloads
from seqopt.scene.scene import _too_heavy, can_carry, loads
from seqopt.sequence.rules import FreeRules, _check_carried
from seqopt.sequence.steps import StepKind
from tests.brute_force import ONES, best_values
from tests.builders import turned_round
from tests.commands import command

LIGHT = 23.544  # N; of a brick of the wall
HEAVY = 9 * LIGHT  # of its last one
ANYHOW = FreeRules(least_grips=0, newest="free")
DOWN = replace(ANYHOW, direction="take-down")
WORST = seqopt.CRITERIA["worst-ratio"]
TOO_HEAVY = r"brick 4 weighs 211\.9 N, more than the payload of .*rob1 \(150 N\)"


def wall(*payloads, heavy=True):
    """Two courses of two bricks, of which the last is heavy, and robots that reach everything."""
    scene = seqopt.load_scene("wall:columns=2,courses=2")
    *others, last = scene.bricks
    if heavy:
        scene = replace(scene, bricks=(*others, replace(last, density=9 * last.density)))
    own = scene.robots[0]
    names = ("rob1", "rob2", "rob3")
    return scene.with_robots(
        *(replace(own, name=n, payload=p) for n, p in zip(names, payloads, strict=False))
    )


def posed(scene, rules=ANYHOW, goals="minmax", **more):
    return seqopt.pose(seqopt.make_engine("compliance", scene), rules, WORST, goals, **more)


def carriers(scene, steps):
    """By brick, the payload of who placed it or took it away: by the step before and after."""
    out, before = {}, (None,) * len(scene.robots)
    for step in steps:
        changed = [
            r for r, pair in enumerate(zip(before, step.grips, strict=True)) if len({*pair}) == 2
        ]
        if step.kind is StepKind.PLACE:
            out[scene.placed[step.bricks - 1].name] = scene.robots[changed[0]].payload
        if step.kind is StepKind.REMOVE:
            out[scene.placed[step.bricks].name] = scene.robots[changed[0]].payload
        before = step.grips
    return out


def newtons(error):
    """The payload that an error says is enough."""
    return float(re.search(r"a payload of (\d+) N \(--payload \1\)", str(error))[1])


@pytest.mark.parametrize("name", ["schedule_search", "overlap_lp"])
def test_every_formulation_of_states_refuses_what_nobody_carries(name):
    with pytest.raises(InfeasibleError, match=TOO_HEAVY) as caught:
        seqopt.solve(posed(wall(150.0, 150.0)), name)
    assert newtons(caught.value) == 212
    assert seqopt.solve(posed(wall(212.0, 212.0)), name).steps


@pytest.mark.parametrize(("rules", "goals"), [(ANYHOW, "steps"), (DOWN, "regrips,minmax")])
def test_whatever_is_aimed_at(goals, rules):
    done = "removed" if rules is DOWN else "placed"
    with pytest.raises(InfeasibleError, match=f"is never {done}: {TOO_HEAVY}") as caught:
        seqopt.solve(posed(wall(150.0, 150.0), rules, goals))
    assert newtons(caught.value) == 212
    assert seqopt.solve(posed(wall(212.0, 212.0), rules, goals)).steps


def test_an_advice_is_no_less_than_the_heaviest_brick_and_no_more_than_is_needed():
    with pytest.raises(InfeasibleError) as caught:
        seqopt.solve(posed(wall(30.0, 30.0), goals="steps"))
    enough = newtons(caught.value)
    assert HEAVY <= enough <= HEAVY + 1
    with pytest.raises(InfeasibleError, match="more than the payload"):
        seqopt.solve(posed(wall(HEAVY * (1 - 1e-6), 30.0)))
    assert seqopt.solve(posed(wall(HEAVY * (1 - 1e-12), 400.0))).steps  # the last bit is not asked


@pytest.mark.parametrize("rules", [ANYHOW, DOWN])
def test_a_heavy_brick_is_for_a_strong_robot(rules):
    scene = wall(300.0, 20.0, 150.0)
    plan = seqopt.solve(replace(posed(scene, rules, "minmax,steps"), criterion=ONES))
    found = carriers(scene, plan.steps)
    assert found.keys() == {1, 2, 3, 4}
    assert found[4] == 300
    assert min(found.values()) >= LIGHT
    assert plan.overloads == ()
    if rules is not DOWN:
        best = best_values(plan.engine, rules, "minmax,steps")
        assert plan.certificate.values == pytest.approx(best, rel=1e-6)


@pytest.mark.slow
def test_orders_put_the_heavy_brick_into_strong_hands():
    scene = wall(150.0, 300.0)
    plan = seqopt.solve(posed(scene, orders="any"))
    assert carriers(plan.engine.network.scene, plan.steps)[4] == 300
    with pytest.raises(InfeasibleError, match=f"no order .* in the scene's own, .*{TOO_HEAVY}"):
        seqopt.solve(posed(wall(150.0, 150.0), orders="any"))
    with pytest.raises(InfeasibleError, match=f"no order .* in the scene's own, .*{TOO_HEAVY}"):
        find_front(posed(wall(150.0, 150.0), goals="F_largest,D_max", orders="tied"))


AIMED = [n for n, f in formulations("goals").items() if f.aim]


@pytest.mark.slow
@pytest.mark.parametrize("name", AIMED)
def test_every_formulation_of_a_loop_refuses_it(name):
    said = r"in step 1 brick 1 weighs 23\.5 N, more than the payload of rob1 \(22 N\)"
    with pytest.raises(InfeasibleError, match=said) as caught:
        seqopt.solve(seqopt.pose(*loop(22.0, 22.0, 22.0), WORST), name)
    assert newtons(caught.value) == 24


def loop(*payloads):
    scene = seqopt.load_scene("wall:columns=3,courses=2")
    pairs = zip(scene.robots, payloads, strict=True)
    engine = seqopt.make_engine(
        "compliance", scene.with_robots(*(replace(r, payload=p) for r, p in pairs))
    )
    return engine, seqopt.three_robot_loop(engine.network)


@pytest.mark.slow
def test_states_of_a_loop_are_refused_and_judged_too():
    engine, schedule = loop(141.0, 22.0, 141.0)
    said = r"in step 2 brick \d weighs 23\.5 N, more than the payload of rob2 \(22 N\)"
    weak = seqopt.pose(engine, schedule, WORST, "minmax")
    with pytest.raises(InfeasibleError, match=said) as caught:
        seqopt.solve(weak)
    assert newtons(caught.value) == 24
    strong = seqopt.pose(*loop(141.0, 24.0, 141.0), WORST, "minmax")
    plan = seqopt.solve(strong)
    assert Proof(graph_of(weak)).is_impossible()
    assert not Proof(graph_of(strong)).is_impossible()
    with pytest.raises(StepError, match=r"step 2: brick \d weighs"):
        judge_schedule(graph_of(weak), plan.selection, plan.steps)
    assert judge_schedule(graph_of(strong), plan.selection, plan.steps).gap == 0
    with pytest.raises(StepError, match=r"step 2: brick \d weighs"):
        _check_carried(engine.network.scene, plan.steps)


@pytest.mark.parametrize("rules", [ANYHOW, DOWN])
def test_the_judge_knows_it_by_itself(rules):
    weak, strong = (graph_of(posed(wall(150.0, most), rules)) for most in (150.0, 300.0))
    assert Proof(weak).is_impossible()
    assert not Proof(strong).is_impossible()
    plan = seqopt.solve(posed(wall(150.0, 300.0), rules))
    with pytest.raises(
        StepError, match=r"weighs 211\.9 N, more than the payload of rob2 \(150 N\)"
    ):
        judge_schedule(weak, plan.selection, plan.steps)
    assert judge_schedule(strong, plan.selection, plan.steps).gap == 0
    other = {0: 1, 1: 0}  # the same grips by the other robot
    swapped = [replace(s, grips=tuple(s.grips[other[r]] for r in (0, 1))) for s in plan.steps]
    with pytest.raises(StepError, match=r"weighs 211\.9 N, more than the payload of rob1"):
        judge_schedule(strong, plan.selection, swapped)


@pytest.mark.slow
def test_bricks_are_carried_in_every_scenario():
    scene = wall(30.0, 30.0, heavy=False)
    bricks = tuple(replace(brick, density=1.5 * brick.density) for brick in scene.bricks)
    worlds = [scene, replace(scene, bricks=bricks)]
    said = r"weighs 35\.3 N, more than the payload of rob1 \(30 N\)"
    with pytest.raises(InfeasibleError, match=said):
        seqopt.solve(posed(scene, scenarios=worlds))
    assert seqopt.solve(posed(scene, scenarios=worlds[:1])).steps
    assert Proof(graph_of(posed(scene, scenarios=worlds))).is_impossible()
    engine, schedule = loop(30.0, 30.0, 30.0)
    own = engine.network.scene
    heavier = replace(own, weight_factor=1.5)
    for over in ("worst-peak", "worst-total"):
        with pytest.raises(InfeasibleError, match=said):
            seqopt.solve(seqopt.pose(engine, schedule, WORST, scenarios=[own, heavier], over=over))


def test_a_tool_is_carried_as_well():
    tool = {
        "urdf": "some.urdf",
        "position": (0.0, 1.0, 0.0),
        "tool_length": 0.3,
        "tool_radius": 0.05,
    }
    scene = wall(24.0, 24.0, heavy=False)
    arms = (Arm(**tool, tool_mass=mass) for mass in (0.01, 0.1))
    pairs = zip(scene.robots, arms, strict=True)
    armed = scene.with_robots(*(replace(robot, arm=arm) for robot, arm in pairs))
    assert loads(armed, armed.robots[0]) == pytest.approx([LIGHT + 0.0981] * 4)
    assert [can_carry([armed], r).tolist() for r in (0, 1)] == [[True] * 4, [False] * 4]
    said = _too_heavy([armed], 0, (0, 1))
    assert (
        said == "brick 1 weighs 23.5 N, more than the payload of rob2 (24 N, its tool weighs 1.0 N)"
    )
    with pytest.raises(seqopt.errors.SceneError, match="tool_mass"):
        Arm(**tool, tool_mass=-1.0)


def test_steps_that_are_given_are_reported():
    scene = wall(150.0, 22.0)
    engine = seqopt.make_engine("compliance", scene)
    steps = seqopt.sequential(engine.network)
    lifted = carriers(scene, steps)
    weights = dict.fromkeys((1, 2, 3), LIGHT) | {4: HEAVY}
    heavy = {brick for brick, payload in lifted.items() if weights[brick] > payload}
    assert {2, 4} <= heavy
    table = seqopt.analyze(engine, steps)
    found = [each for each in overloads(scene, table) if each.brick is not None]
    assert found == [*_carrying_excesses(scene, steps)]
    assert max(each.largest for each in found) == pytest.approx(HEAVY)
    assert sum(len(each.steps) for each in found) == len(heavy)
    assert _carrying_excesses(wall(400.0, 400.0), steps) == ()
    down = _carrying_excesses(scene, turned_round(scene, steps))
    assert sum(len(each.steps) for each in down) == len(heavy)


@pytest.mark.parametrize(("payload", "places"), [(20.0, False), (24.0, True)])
def test_a_robot_takes_over_only_what_it_carries(payload, places):
    """A third robot is much quicker, and bears what first grips hold, but not what they lift."""
    words = "fetch=30,place=10,approach=10,grip=5,release=5"
    scene = wall(400.0, 400.0, payload).with_durations(
        words, "rob3:fetch=0.3,place=0.1,approach=0.1,grip=0.05,release=0.05"
    )
    engine = seqopt.make_engine("compliance", scene)
    build = seqopt.plan.build.GivenSequence(engine, seqopt.sequential(engine.network))
    assert build.responses()[["F_rob1_N", "F_rob2_N"]][:3].abs().max().max() < 20 < LIGHT < 24
    assert (payload in carriers(scene, build.reassigned()).values()) == places


def test_the_command_line_names_brick_weight_and_robot(capsys, tmp_path):
    wall_words = ("wall:columns=2,courses=2", "--payload", "22")
    for asked in ("analyze", "assess"):
        _, _, err = command(capsys, asked, *wall_words, "--out", tmp_path / f"{asked}.csv")
        assert "payload exceeded: rob1 carries up to 23.5 N (brick 3)" in err, err
