"""Postures of arms: where they are, what they hit, who keeps them; MuJoCo is the witness."""

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.arms import find_postures
from seqopt.arms._judge import PostureRules, check_postures
from seqopt.arms._kept import plan_postures
from seqopt.arms._model import ArmModel
from seqopt.arms._permits import permits
from seqopt.arms._reached import Site, reached_alone
from seqopt.arms._tables import _compute_table, _stored_table
from seqopt.errors import InfeasibleError, SceneError, StepError
from seqopt.scene.scene import in_order
from seqopt.sequence._space import StateRows
from tests.arms.scenes import beside, two_arms

pytest.importorskip("pinocchio")
pytest.importorskip("coal")
pytest.importorskip("compas_fab")
mujoco = pytest.importorskip("mujoco")
from tests.arms.witness import Site as Witness  # noqa: E402

STIFF = (2e6, 2e6, 1e6, 5e5, 4e5, 2e5)  # N m/rad


@pytest.fixture(scope="module")
def scene():
    return two_arms()


@pytest.fixture(scope="module")
def table(scene):
    return find_postures(scene)


@pytest.fixture(scope="module")
def witness(scene, table):
    return Witness(scene, table)


@pytest.fixture(scope="module")
def tight():
    """Both arms on one side, so close that they are often in each other's way."""
    return beside(two_arms(), 0.9)


def whose(table, row):
    return table.robots[table.robot[row]]


def test_flanges_are_where_the_table_says(table, witness):
    for row in range(len(table.robot)):
        axes, place = witness.pose(whose(table, row), row)
        assert np.allclose(axes, table.axes[row], atol=5e-6)
        assert np.allclose(place, table.place[row], atol=5e-6)


def test_postures_touch_what_the_table_says_and_nothing_else(table, witness):
    assert table.hits.any()
    assert not table.hits.all()
    for row in range(len(table.robot)):
        found = witness.touching({whose(table, row): row}, len(table.bricks))
        bricks = {what for pair in found for kind, what in pair if kind == "brick"}
        assert bricks == {
            name for name, hit in zip(table.bricks, table.hits[row], strict=True) if hit
        }
        assert all("brick" in (one[0], two[0]) for one, two in found)  # never itself


@pytest.mark.parametrize("kind", ["facing", "beside"])
def test_pairs_collide_where_the_table_says(kind, scene, tight):
    scene = {"facing": scene, "beside": tight}[kind]
    table = find_postures(scene)
    witness, draws = Witness(scene, table), np.random.default_rng(3)
    one, two = np.nonzero(table.robot[:, None] < table.robot)
    some = draws.choice(len(one), 150, replace=False)
    found = []
    for i, j in zip(one[some], two[some], strict=True):
        pairs = witness.touching({whose(table, i): i, whose(table, j): j}, 0)
        found.append(any(a[0] != b[0] and "brick" not in (a[0], b[0]) for a, b in pairs))
    assert found == table.collide[one[some], two[some]].tolist()
    assert 0 < sum(found) < len(found)


def test_what_joints_move_is_what_another_program_says(scene, witness):
    table = find_postures(scene)
    for row in range(0, len(table.robot), 9):
        name = whose(table, row)
        witness.pose(name, row)
        jacobian = np.zeros((6, witness.model.nv))
        node = np.array(scene.node_position(table.nodes[table.node[row]]))
        body = witness.model.body(f"{name}/tool0").id
        mujoco.mj_comPos(witness.model, witness.data)
        args = (witness.model, witness.data, jacobian[:3], jacobian[3:], node, body)
        mujoco.mj_jac(*args)
        own = jacobian[:, [j for j in range(witness.model.nv) if jacobian[:, j].any()]]
        arm = next(robot.arm for robot in scene.robots if robot.name == name)
        assert np.allclose(ArmModel(arm).jacobian(table.joints[row]), own, rtol=1e-4, atol=1e-4)


def test_a_stiffness_is_needed_for_every_joint():
    with pytest.raises(SceneError, match="2 joint stiffnesses for 6 joints"):
        find_postures(two_arms(joint_stiffness=(1e6, 1e6)))
    with pytest.raises(SceneError, match="robot north: 2 joint stiffnesses for 6 joints"):
        seqopt.make_engine("compliance", two_arms(joint_stiffness=(1e6, 1e6)))


@pytest.mark.slow
def test_a_table_is_the_same_each_time_in_any_order_and_from_a_folder(scene, table, tmp_path):
    reached_alone.cache_clear()
    site = Site.of(scene)
    assert _compute_table(site) == table
    assert find_postures(scene, tmp_path) is table
    (file,) = tmp_path.iterdir()
    assert _stored_table(tmp_path, site, lambda: pytest.fail("computed again")) == table
    assert find_postures(in_order(scene, "reversed")) is table
    whole = file.read_bytes()
    locked = bytearray(whole)
    for mark, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):  # as if it had a password
        for at in [k for k in range(len(whole)) if whole.startswith(mark, k)]:
            locked[at + flags] |= 1
    for damaged in (whole[:-50], bytes(locked)):
        file.write_bytes(damaged)
        assert _stored_table(tmp_path, site, lambda: table) is table


def test_search_and_judge_ask_the_table_in_two_ways(tight):
    draws = np.random.default_rng(1)
    for postures in (1, 3, 8):
        robots = [
            r if r.arm is None else replace(r, arm=replace(r.arm, postures=postures))
            for r in tight.robots
        ]
        scene = tight.with_robots(*robots)
        found, rules = permits(scene), PostureRules(scene, range(3))
        for bricks in (1, 3, 5):
            held = draws.integers(0, 2 * bricks + 1, (200, 3))
            allowed = found.allowed(bricks, held)
            assert (allowed == rules.allow(bricks, held)).all()
            assert allowed.any()
            assert not allowed.all()


@pytest.mark.parametrize("schedule", ["free", "three-robot"])
def test_no_step_of_a_plan_has_a_contact(schedule, scene, table, witness):
    plan = seqopt.optimize(scene, schedule)
    assert plan.arms.best
    assert not plan.arms.postures.unreached
    assert "no plan is better with up to 8 postures at a node" in str(plan.arms)
    assert plan.summary()["arms"]["cannot"] == []
    names = [robot.name for robot in scene.robots]
    for step, rows in zip(plan.steps, plan.arms.postures.steps, strict=True):
        held = {n: row for n, row in zip(names, rows, strict=True) if row is not None}
        assert witness.touching(held, step.bricks) == set()
        at = [table.nodes[table.node[row]] for row in held.values()]
        assert at == [node for node in step.grips[:2] if node is not None]
    for before, after in zip(plan.steps, plan.steps[1:], strict=False):
        for k in range(2):  # who goes on holding keeps the posture
            if before.grips[k] is not None and before.grips[k] == after.grips[k]:
                rows = [plan.arms.postures.steps[s.number - 1][k] for s in (before, after)]
                assert rows[0] == rows[1]


def test_the_judge_finds_a_search_that_forgets_arms(tight, monkeypatch):
    pair = tight.with_robots(*tight.robots[:2])
    assert seqopt.optimize(pair, "free", aim="minmax", rules="least_grips=1").arms.best
    monkeypatch.setattr(StateRows, "for_arms", lambda self, n, rows: np.ones(len(rows), bool))
    with pytest.raises(StepError, match="arms cannot hold"):
        seqopt.optimize(pair, "free", aim="minmax", rules="least_grips=1")


def test_the_judge_finds_a_search_that_allows_arms_too_little(scene, monkeypatch):
    never_both = lambda self, n, rows: ~(rows[:, :2] > 0).all(axis=1)  # noqa: E731
    monkeypatch.setattr(StateRows, "for_arms", never_both)
    with pytest.raises(InfeasibleError, match="claimed by schedule_search, and not proven"):
        seqopt.optimize(scene.with_robots(*scene.robots[:2]), "free", rules="least_grips=1")


def test_steps_are_checked_by_themselves(scene):
    states = [step for step in seqopt.sequential(without(scene)) if len(step.held) == 2]
    check_postures(scene, states[:1])
    with pytest.raises(StepError, match=f"step {states[0].number}: arms cannot hold"):
        check_postures(
            hostile(scene.with_robots(*scene.robots[:2])),
            [replace(states[0], grips=states[0].grips[:2])],
        )


def without(scene):
    return scene.with_robots(*(replace(robot, arm=None) for robot in scene.robots))


def hostile(scene):
    """The same scene with arms that reach nothing."""
    far = [
        replace(r, arm=replace(r.arm, position=(40.0 * i, 9.0, 0.0)))
        for i, r in enumerate(scene.robots, 1)
    ]
    return scene.with_robots(*far)


def test_given_steps_say_who_is_in_the_way(tight):
    steps = seqopt.sequential(without(tight))
    found = plan_postures(tight, steps)
    stuck = [fault for fault in found.unreached if "in each other's way" in fault.why]
    table, held = found.table, {s.number: s for s in steps}
    for fault in stuck:
        nodes = held[fault.step].grips[:2]
        rows = [table.rows(n, node) for n, node in zip(("north", "south"), nodes, strict=True)]
        standing = [name in tight.build_order[: held[fault.step].bricks] for name in table.bricks]
        free = [own[~table.hits[own][:, standing].any(axis=1)] for own in rows]
        assert table.collide[np.ix_(*free)].all()
    assert not {s.number for s in steps if len(s.held) < 2} & {f.step for f in stuck}


def test_no_plan_is_said_where_arms_reach_nothing(scene):
    far = hostile(scene.with_robots(*scene.robots[:2]))
    with pytest.raises(InfeasibleError, match=r"brick 1 .* with arms that reach more, or stand"):
        seqopt.optimize(far, "free", aim="steps", rules="least_grips=1")


@pytest.mark.slow
def test_no_plan_is_said_where_arms_are_in_each_others_way():
    """That is told from arms that do not reach, and computed with the postures of each alone."""
    close = beside(two_arms(), 0.6)
    both = close.with_robots(*close.robots[:2])
    with pytest.raises(
        InfeasibleError, match=r"newest=free \(--rule newest=free\) or arms that are out of each"
    ) as error:
        seqopt.optimize(both, "free", aim="steps", rules="least_grips=1")
    assert "reach more" not in str(error.value)
    apart = [replace(r, arm=replace(r.arm, keeps_apart=False)) for r in both.robots]
    alone = find_postures(both.with_robots(*apart))
    assert find_postures(both).collide.any()
    assert not alone.collide.any()
    assert (alone.found == find_postures(both).found).all()
    plan = seqopt.optimize(both.with_robots(*apart), "free", aim="steps", rules="least_grips=1")
    assert plan.steps  # the control: what is said to help does


@pytest.mark.slow
def test_bases_must_not_stand_in_each_other(scene):
    with pytest.raises(SceneError, match="the base of its arm hits that of"):
        find_postures(beside(scene, 0.1))
    with pytest.raises(SceneError, match="robot north: the base of its arm hits brick"):
        find_postures(two_arms(apart=0.2))
