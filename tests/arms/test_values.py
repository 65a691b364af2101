"""Arms as values; arms whose joints give way."""

import json
import re
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import seqopt
from seqopt.arms import Arm, _model, find_postures
from seqopt.arms._judge import check_postures
from seqopt.arms._model import ArmModel, model_path
from seqopt.arms._permits import permits
from seqopt.engines.registry import make_engine
from seqopt.errors import ExtraError, GripError, SceneError, StepError
from seqopt.problem.criteria import WorstRatio
from seqopt.responses.table import force_column
from seqopt.scene.scene import in_order
from seqopt.sequence.methods import three_robot_loop
from tests.arms.scenes import beside, two_arms
from tests.brute_force import least_peak, peaks, shortest, whole_graph
from tests.refusals import one_line
from tests.soft_bodies import SoftBodies

ARM = {"urdf": "robot.urdf", "position": (0.0, 1.0, 0.0), "tool_length": 0.3, "tool_radius": 0.05}


WRONG = {
    "urdf is 3; give the path of a URDF, or package:path": {"urdf": 3},
    "tool_length is 0.0; give a positive number of m": {"tool_length": 0.0},
    "give perpendicular unit vectors": {"x_axis": (1.0, 1.0, 0.0)},
    "fingers stand out 0.3 m from a brick": {"fingers": 0.3},
    "faces are ('top',); give some of length, width, thickness": {"faces": ("top",)},
    "joint_stiffness is 0.0; give a positive number": {"joint_stiffness": (1e6, 0.0)},
}
NOWHERE = {
    "there is no file nowhere.urdf; give a URDF, or package:path": "nowhere.urdf",
    "package no_such_package is not installed": "no_such_package:robot.urdf",
    "package seqopt has no file robot.urdf": "seqopt:robot.urdf",
}


@pytest.mark.parametrize("said", WRONG)
def test_a_wrong_value_is_a_line(said):
    with one_line(SceneError, re.escape(said)):
        Arm(**ARM | WRONG[said])


@pytest.mark.parametrize("said", NOWHERE)
def test_a_model_that_is_not_there_is_named(said):
    with one_line(SceneError, re.escape(said)):
        model_path(Arm(**ARM | {"urdf": NOWHERE[said]}))


def test_a_scene_with_arms_comes_back_from_its_file(tmp_path):
    scene = two_arms(postures=2, joint_stiffness=(1e6,) * 6)
    seqopt.save_scene(scene, tmp_path / "mine.json")
    assert seqopt.load_scene(tmp_path / "mine.json") == scene
    assert scene.has_arms


def test_a_model_is_found_beside_the_scene_file(tmp_path):
    scene = two_arms()
    first, *others = scene.robots
    own = str(tmp_path / "models" / "own.urdf")
    scene = scene.with_robots(replace(first, arm=replace(first.arm, urdf=own)), *others)
    seqopt.save_scene(scene, tmp_path / "mine.json")
    written = json.loads((tmp_path / "mine.json").read_text())["robots"][0]["arm"]["urdf"]
    assert Path(written) == Path("models/own.urdf")
    assert seqopt.load_scene(tmp_path / "mine.json") == scene


def test_a_file_with_a_wrong_arm_is_refused(tmp_path):
    seqopt.save_scene(two_arms(), tmp_path / "mine.json")
    text = (tmp_path / "mine.json").read_text().replace('"tool_radius"', '"tool_width"')
    (tmp_path / "mine.json").write_text(text)
    with pytest.raises(SceneError, match="tool_"):
        seqopt.load_scene(tmp_path / "mine.json")


def test_without_the_extra_it_is_named(monkeypatch):
    monkeypatch.setattr(_model, "find_spec", lambda name: None)
    with pytest.raises(ExtraError, match=re.escape("pip install 'seqopt[arms]'")):
        find_postures(two_arms(tool_radius=0.049))
    assert find_postures(seqopt.load_scene("arch25")) is None


# arms whose joints give way: the posture that is kept, plans of them, and who checks which


for extra in ("pinocchio", "coal", "compas_fab"):
    pytest.importorskip(extra)

JOINTS = (2e6, 2e6, 1e6, 5e5, 4e5, 2e5)  # N m/rad
CRANE = 3e5  # N/m
FORCE = WorstRatio("force", (("F_largest", 100.0),))
LINK = """<link name="{0}"><collision><origin xyz="{1} 0 0"/><geometry><box size="0.02 0.02 0.02"/>
</geometry></collision></link>"""
HINGE = """<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>
<origin xyz="{3} 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>
</joint>"""


@cache
def soft(bricks=5, robots=3):
    """An arch between two arms of other stiffnesses, and a crane that gives way as well."""
    scene = two_arms(bricks, joint_stiffness=JOINTS)
    north, south, crane = scene.robots
    arm = replace(south.arm, joint_stiffness=tuple(0.3 * k for k in JOINTS))
    made = (north, replace(south, arm=arm), replace(crane, stiffness=CRANE))
    return scene.with_robots(*made[:robots])


def by_springs(model, joints):
    """How a force or moment at the node moves and turns it, by the joints alone: J diag(1/k) Jᵀ."""
    jacobian = model.jacobian(joints)
    return jacobian / np.array(model.arm.joint_stiffness) @ jacobian.T


def by_joints(scene, grips):
    """How each grip of a step gives way, from the table; that of the crane is a number."""
    held, out = scene.held_postures, []
    table = find_postures(scene)
    for i, (robot, node) in enumerate(zip(scene.robots, grips, strict=True)):
        if node is not None and robot.arm is None:
            out.append(np.eye(3) / CRANE)
        elif node is not None:
            joints = table.joints[held.row(i, node)]
            out.append(by_springs(ArmModel(robot.arm), joints)[:3, :3])
    return out


def forces(scene, bricks, grips):
    """The forces of the grips of a state by a dense solver."""
    nodes = [node for node in grips if node is not None]
    hands = by_joints(scene, grips)
    return SoftBodies(scene, bricks).solve(nodes, hands, np.zeros((len(nodes), 3)))[0][:, :3]


def largest(scene, bricks, grips):
    held = any(node is not None for node in grips)
    return np.linalg.norm(forces(scene, bricks, grips), axis=1).max() if held else 0.0


def allowed(scene):
    """The largest force of a state as `whole_graph` asks for it; None where arms cannot be."""
    table, held = find_postures(scene), scene.held_postures

    def allow(bricks, grips):
        rows = [
            held.row(i, node)
            for i, node in enumerate(grips)
            if node is not None and scene.robots[i].arm is not None
        ]
        standing = [name in scene.build_order[:bricks] for name in table.bricks]
        if any(row < 0 or (table.hits[row] & standing).any() for row in rows):
            return None
        if any(table.collide[a, b] for a, b in product(rows, rows)):
            return None
        force = largest(scene, bricks, grips)
        return None if force > 400.0 else np.array([force, 0.0, 0.0, 0.0])

    return allow


def arm_of(tmp_path, lengths, stiffness):
    """An arm in a plane: hinges about z, so far apart."""
    links = ["base", *(f"link_{k}" for k in range(len(lengths)))]
    parts = [LINK.format(name, 0.0) for name in links]
    places = [0.0, *lengths[:-1]]
    triples = zip(links, links[1:], places, strict=False)
    parts += [HINGE.format(f"j{k}", a, b, x) for k, (a, b, x) in enumerate(triples)]
    parts.append(
        f'<link name="tool0"/><joint name="end" type="fixed"><parent link="{links[-1]}"/>'
        f'<child link="tool0"/><origin xyz="{lengths[-1] - 0.1} 0 0" rpy="0 1.5707963267948966 0"/>'
        "</joint>"
    )
    path = tmp_path / "plane.urdf"
    path.write_text(f'<robot name="plane">{"".join(parts)}</robot>')
    where = {"position": (0.0, 0.0, 0.0), "tool_length": 0.1, "tool_radius": 0.01}
    return Arm(urdf=path, **where, joint_stiffness=stiffness)


def test_one_joint_gives_way_across_its_lever(tmp_path):
    """L² / k along the tangent and nothing else; 1 / k in turning, L / k between them."""
    found = by_springs(ArmModel(arm_of(tmp_path, [1.5], (2e5,))), np.array([0.6]))
    tangent = np.array([-np.sin(0.6), np.cos(0.6), 0.0])
    assert found[:3, :3] == pytest.approx(1.5**2 / 2e5 * np.outer(tangent, tangent), abs=1e-18)
    assert found[:3, 5] == pytest.approx(1.5 / 2e5 * tangent, abs=1e-18)
    assert np.diag(found)[3:] == pytest.approx([0.0, 0.0, 1 / 2e5], abs=1e-18)


def test_two_joints_add_what_each_does(tmp_path):
    first, second, (a, b) = 2e5, 5e4, (0.4, -1.1)
    model = ArmModel(arm_of(tmp_path, [1.0, 0.7], (first, second)))
    found = by_springs(model, np.array([a, b]))
    elbow = np.array([np.cos(a), np.sin(a)])
    tip = elbow + 0.7 * np.array([np.cos(a + b), np.sin(a + b)])
    turned = [np.array([-r[1], r[0]]) for r in (tip, tip - elbow)]
    sums = [np.outer(t, t) / k for t, k in zip(turned, (first, second), strict=True)]
    assert found[:2, :2] == pytest.approx(sum(sums), rel=1e-12)
    assert found[5, 5] == pytest.approx(1 / first + 1 / second, rel=1e-12)


def test_an_arm_holds_each_node_in_one_posture_whatever_the_order():
    scene, back = soft(), in_order(soft(), "reversed")
    held, table = scene.held_postures, find_postures(scene)
    assert (back.held_postures.rows == held.rows).all()
    for own, name in enumerate(("north", "south")):
        for node, row in zip(held.nodes.tolist(), held.rows[own].tolist(), strict=True):
            assert (row in table.rows(name, node)) == (row >= 0)
            assert (row < 0) == (len(table.rows(name, node)) == 0)
    for each in (scene, back):
        found = permits(each)
        assert found.rows.shape[2] == 1
        nodes = [node for brick in each.placed for node in brick.nodes]
        rows = [[held.row(r, node) for node in nodes] for r in range(2)]
        assert found.rows[:2, 1:, 0].tolist() == rows
    assert two_arms().held_postures is None


@pytest.mark.slow
def test_the_stiffest_is_taken_of_those_that_are_as_good():
    """Where a posture hits nothing and is in no one's way, no such one is stiffer."""
    scene = soft()
    held, table = scene.held_postures, find_postures(scene)
    give = np.zeros(len(table.robot))
    for row, (robot, joints) in enumerate(zip(table.robot.tolist(), table.joints, strict=True)):
        arm = next(r.arm for r in scene.robots if r.name == table.robots[robot])
        give[row] = (ArmModel(arm).jacobian(joints)[:3] ** 2 / arm.joint_stiffness).sum()
    good = ~table.hits.any(axis=1) & ~table.collide.any(axis=1)
    rows = held.rows[held.rows >= 0]
    for row in rows[good[rows]].tolist():
        rivals = (table.robot == table.robot[row]) & (table.node == table.node[row]) & good
        assert give[row] == give[rivals].min()


def brute_force(scene, aim):
    """The least largest force over a free schedule, or the least sum of them, by a dense solver."""
    engine, rules = make_engine("compliance", scene), seqopt.FreeRules(least_grips=1)
    graph, start = whole_graph(engine, rules, allow=allowed(scene))
    costs = peaks(graph)
    if aim == "minmax":
        return least_peak(graph, start, costs)[0]
    return shortest(graph, start, lambda _, after, __: 0.0 if after == "end" else costs[after])[0]


LONG = (pytest.mark.slow, pytest.mark.long)


@pytest.mark.parametrize(
    ("aim", "size"),
    [pytest.param(aim, (3, 2), marks=pytest.mark.slow) for aim in ("minmax", "sum")]
    + [pytest.param(aim, (5, 2), marks=LONG) for aim in ("minmax", "sum")]
    + [pytest.param("minmax", (4, 3), marks=LONG)],
)
def test_free_schedules_agree_with_brute_force(aim, size):
    scene = soft(*size)
    plan = seqopt.optimize(scene, "free", FORCE, aim=aim, rules="least_grips=1")
    assert plan.status == "optimal"
    assert plan.objective[aim] == pytest.approx(brute_force(scene, aim), rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("aim", ["minmax", "sum"])
def test_the_loop_agrees_with_brute_force(aim):
    scene = soft()
    engine = make_engine("compliance", scene)
    problem = seqopt.pose(engine, three_robot_loop(engine.network), FORCE, aim)
    schedule, known, values = problem.schedule, {}, []
    for nodes in product(*(move.candidates for move in schedule.moves)):
        try:
            steps = schedule.fill(nodes)
            check_postures(scene, steps)
        except StepError:
            continue
        for step in steps:
            key = step.bricks, step.grips
            if key not in known:
                known[key] = largest(scene, *key) / 100.0
        costs = [known[s.bricks, s.grips] for s in steps]  # also where no grip is open
        values.append(max(costs) if aim == "minmax" else sum(costs))
    plan = seqopt.solve(problem, {"minmax": "minimax", "sum": "overlap_dp"}[aim])
    assert len(values) > 3
    assert plan.objective[aim] == pytest.approx(min(values), rel=1e-8)
    assert plan.arms.best


@pytest.mark.parametrize("schedule", ["three-robot", "free"])
def test_a_plan_keeps_the_postures_by_which_its_grips_give_way(schedule):
    scene = soft()
    plan = seqopt.optimize(scene, schedule, FORCE)
    held = scene.held_postures
    assert "no plan is better with one posture at a node" in str(plan.arms)
    for step, rows in zip(plan.steps, plan.arms.postures.steps, strict=True):
        wanted = [
            None if node is None or robot.arm is None else held.row(i, node)
            for i, (robot, node) in enumerate(zip(scene.robots, step.grips, strict=True))
        ]
        assert list(rows) == wanted
    table = seqopt.analyze(make_engine("compliance", scene), plan.steps)
    found = table[[force_column(robot) for robot in scene.robots]].max(axis=1).fillna(0.0)
    dense = [largest(scene, step.bricks, step.grips) for step in plan.steps]
    assert found.to_numpy() == pytest.approx(dense, rel=1e-8, abs=1e-9)


def test_the_judge_finds_grips_that_give_way_in_another_way():
    """Its own route moves every joint a little; a tenth more in one joint is another grip."""
    scene = soft()
    plan = seqopt.optimize(scene, "free", FORCE)
    check_postures(scene, plan.steps)
    found = scene.held_postures
    changed = [jacobian.copy() for jacobian in found.jacobians]
    for jacobian in changed:
        jacobian[:, :, 1] *= 1.1
    scene = scene.holding(replace(found, jacobians=tuple(changed)))
    with pytest.raises(StepError, match=r"the grip of .* another compliance than its joints"):
        check_postures(scene, plan.steps)


def test_a_node_that_an_arm_cannot_hold_is_a_line():
    scene = beside(soft(), 9.0)
    node = scene.placed[0].nodes[1]
    with pytest.raises(GripError, match=f"robot south has no posture at node {node}"):
        make_engine("compliance", scene).solve(1, [scene.grip_numbers((None, node, None))])
