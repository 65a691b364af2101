"""Loads of scenes and scenarios drawn of them."""

import json
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt import Prop
from seqopt._cli.main import main
from seqopt.errors import SceneError, SceneWarning, StepError
from seqopt.exchange.imports import as_built, read_measured
from seqopt.network.network import build_network
from seqopt.report.page import Build, report_page
from seqopt.scene import Load, load_scene
from seqopt.scene.library.wall import WallShape, wall
from seqopt.scene.scenarios import scenarios
from seqopt.scene.scene import _from_all_ends, _parse_order, in_order
from seqopt.scene.scene_file import save_scene, scene_to_dict
from seqopt.sequence.schedule import islands
from tests.builders import six_bricks, small_arch, with_part
from tests.refusals import one_line
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


@pytest.mark.slow
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


# loads; orders of a scene
def loaded():
    scene = six_bricks()
    first, second = scene.grounds
    return replace(
        scene,
        loads=(
            Load(brick=2, force=(1.0, 2.0, -30.0)),
            Load(brick=3, force=(0.0, 0.0, -5.0), position=scene.bricks[2].position, since=6),
        ),
        wind=(0.1, 0.0, 0.0),
        weight_factor=1.35,
        grounds=(first, replace(second, movement=(0.0, 0.0, -0.002))),
    )


def test_a_load_far_from_its_brick_is_doubted(tmp_path):
    far = replace(six_bricks(), loads=(Load(brick=1, force=(0, 0, -1), position=(0, 0, 9.0)),))
    save_scene(far, tmp_path / "own.json")
    with pytest.warns(SceneWarning, match=r"load on brick 1: it lies 8\.\d+ m from brick 1"):
        load_scene(tmp_path / "own.json")


def test_scenarios_take_loads_along():
    scene = loaded()
    for each in seqopt.scenarios(scene, count=3).scenes:
        step = np.subtract(each.bricks[2].position, scene.bricks[2].position)
        assert np.abs(step).max() > 1e-5
        assert each.loads[1].position == pytest.approx(step + scene.loads[1].position)
        assert each.loads[0] == scene.loads[0]
        assert each.grounds[1].movement == scene.grounds[1].movement


def test_what_acts_depends_on_what_stands():
    scene = loaded()
    network = build_network(replace(scene, wind=(0.0, 0.0, 0.0)))
    acting = [np.flatnonzero(network.applied(b).any(axis=1)).tolist() for b in range(1, 7)]
    assert acting == [[], [1], [1], [1], [1], [1, 2]]
    backward = build_network(scene.with_robots(*scene.robots), "reversed")
    assert np.flatnonzero(backward.loads[1]).size == 8
    assert backward.loads[1][:2].tolist() == [5, 4]
    assert network.applied(6, before=5)[:, 2].tolist() == [0, 0, -5, 0, 0, 0]


def test_it_is_told(tmp_path, capsys):
    scene = loaded()
    said = "2 forces, up to 30.0832 N, wind of (0.1, 0, 0) times the weight"
    assert scene.loading.startswith(said)
    assert scene.loading.endswith("weights times 1.35, movement of 1 ground end")
    assert six_bricks().loading == ""
    assert "2 forces, up to" in scene._repr_html_()
    assert "Beside the weight" not in six_bricks()._repr_html_()
    save_scene(scene, tmp_path / "own.json")
    assert main(["scene", str(tmp_path / "own.json")]) == 0
    assert "beside the weight: 2 forces, up to" in " ".join(capsys.readouterr().out.split())
    engine = seqopt.make_engine("compliance", scene)
    steps = seqopt.sequential(engine.network)
    build = Build("own", steps, seqopt.analyze(engine, steps))
    assert "Counted, and not drawn: 2 forces" in report_page(engine, [build], "A build.")


# props as parts of scenes: what they take, where they stand, and what files say of them
def test_props_stand_from_their_bricks_until_the_whole_is_let_go():
    scene = small_arch(5)
    nodes = [scene.placed[k].nodes[0] for k in (3, 1)]
    scene = scene.with_props(*(Prop(node=node) for node in nodes))

    def standing(bricks, held):
        return [prop.node for prop in scene.standing_props(bricks, held=held)]

    assert [standing(k, held=False) for k in range(6)] == [[], [], nodes[1:], nodes[1:], nodes, []]
    assert standing(5, held=True) == nodes
    assert not {*nodes} & {n for own in scene.within_reach(scene.robots[0]) for n in own}


def test_a_file_keeps_props_and_scenes_without_say_nothing(tmp_path):
    scene = small_arch(4)
    assert "props" not in scene_to_dict(scene)
    props = Prop(node=3, stiffness=1e6, direction=(0, 0, 1), capacity=90), Prop(node=5)
    save_scene(scene.with_props(*props), tmp_path / "own.json")
    assert load_scene(tmp_path / "own.json").props == props
    document = json.loads((tmp_path / "own.json").read_text("utf-8"))
    assert document["props"][1] == {"node": 5}
    document["props"][1] = {"node": 5, "position": [0, 0, 0]}
    (tmp_path / "own.json").write_text(json.dumps(document), "utf-8")
    with pytest.raises(SceneError, match=r"props\[1\]"):
        load_scene(tmp_path / "own.json")


# orders of a scene: by name, by words, and what is said of those that are none
def test_orders_by_name():
    scene = small_arch(5)
    assert _parse_order(scene, "reversed") == (5, 4, 3, 2, 1)
    assert _parse_order(scene, "ends") == (1, 5, 2, 4, 3)
    assert _parse_order(scene, "1..2, 5..4,3") == (1, 2, 5, 4, 3)
    assert in_order(scene, None) is scene
    network = build_network(scene, (2, 1, 3, 4, 5))
    assert network.scene.build_order == (2, 1, 3, 4, 5)
    assert [len(islands(network, count)) for count in (1, 2)] == [1, 0]


def test_from_all_ends_leaves_nothing_that_hangs():
    scene = wall(WallShape(courses=3, columns=3))
    network = build_network(scene, "ends")
    assert sorted(_from_all_ends(scene)) == sorted(scene.build_order)
    assert not any(islands(network, count) for count in range(1, len(scene.bricks) + 1))


# orders after words
def test_a_vault_closes_from_both_springings():
    scene = load_scene("vault:span=1.5,rise=0.5,columns=2,order=ends")
    courses = len(scene.bricks) // 2
    assert {ground.brick for ground in scene.grounds} == {1, 2, 2 * courses - 1, 2 * courses}
    assert {*scene.build_order[:4]} == {ground.brick for ground in scene.grounds}
    (crown,) = {(name - 1) // 2 for name in scene.build_order[-2:]}
    assert crown == courses // 2
    bent = [brick.position[2] for brick in scene.bricks]
    assert max(bent) == pytest.approx(0.5, rel=0.02)
    assert bent == pytest.approx(bent[::-1])  # it is symmetric


def propped(*props):
    return load_scene("arch25").with_props(*(Prop(**each) for each in props))


def loads(**given):
    return replace(SCENE, loads=(Load(**{"brick": 1, "force": (0, 0, 1), **given}),))


END = "ground end of brick 1: movement is "
drawn = partial(scenarios, SCENE)
order = partial(build_network, small_arch(5))
sunk = partial(with_part, SCENE, "grounds", 0)
WRONG = {  # what is said, and what it is said of
    "stiffness is": lambda: drawn(stiffness=(3, 1)),
    "stiffness is 3.0; give the least and the largest factor": lambda: drawn(stiffness=3.0),
    "density is 1.0; give a number from 0 to below 1": lambda: drawn(density=1.0),
    "position is nan; give a number from 0": lambda: drawn(position=math.nan),
    "scenario 1 of .* is not a valid scene": lambda: drawn(position=1e20),
    "count is 0; give a whole number from 1": lambda: drawn(count=0),
    "seed is": lambda: drawn(seed=-1),
    "grips is 3; give the least and the largest": lambda: drawn(grips=3),
    "has no such brick": lambda: as_built(SCENE, {99: (0.0, 0.0, 0.0)}),
    "from where it was planned": lambda: as_built(SCENE, measured_at({1: (5.0, 0.0, 0.0)})),
    "load on brick 9: there is no brick 9": lambda: loads(brick=9),
    "there is no brick 8": lambda: loads(since=8),
    "load on brick 1: position is .*; move it to its brick": lambda: loads(position=(0, 0, 1e10)),
    "give three finite numbers": lambda: loads(force=(0, 0, np.inf)),
    "wind is .*; give shares of the weight": lambda: replace(SCENE, wind=(1e7, 0.0, 0.0)),
    "brick 1: it weighs .*; correct its density": lambda: replace(SCENE, weight_factor=1e150),
    f"{END}.*; move it to its bricks": lambda: sunk(movement=(0, 0, 1e30)),
    f"{END}.*; give three or six numbers": lambda: sunk(movement=(0, 0)),
    f"{END}.*; give three finite numbers": lambda: sunk(movement=(0, 0, np.nan)),
    f"{END}0.1; give three or six numbers": lambda: sunk(movement=0.1),
    "prop at node 99: there is no free node 99; known are": lambda: propped({"node": 99}),
    "a prop at node 3 occurs twice; give each its own": lambda: propped({"node": 3}, {"node": 3}),
    "prop at node 0: there is no free node 0": lambda: propped({"node": 0}),  # it is blocked
    "prop: node is 0.5; give a whole number": lambda: Prop(node=0.5),
    "direction is .* give one that is not zero": lambda: Prop(node=3, direction=(0, 0, 0)),
    "prop at node 3: stiffness is -1; give one number or three": lambda: Prop(node=3, stiffness=-1),
    "order 'backwards': give reversed, ends, or names of bricks": lambda: order("backwards"),
    "order: 2 bricks are missing, 4 among them": lambda: order("1,2,3"),
    "order: brick 5 is missing; name every brick once": lambda: order("1,2,3,4"),
    "order: 4 occurs twice": lambda: order("1,2,3,4,4"),
    "order: 7 is no brick": lambda: order((1, 2, 3, 4, 7)),
    "order is 7; give whole numbers": lambda: order(7),
}


@pytest.mark.parametrize("said", WRONG)
def test_what_cannot_be_meant_is_one_line(said):
    with one_line(SceneError, said):
        WRONG[said]()
