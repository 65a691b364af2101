"""How far grips may be off: against closed forms, the engine itself, and every plan of a build."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.problem.amounts import parse_goals
from seqopt.responses._tolerance import (
    Misplaced,
    misfits,
    proven_rates,
    step_tolerance,
    worst_misplacement,
    worst_rates,
)
from seqopt.responses.quantities import NO_TOLERANCE
from tests.builders import block, small_arch

EXACT = 1e-9


@pytest.fixture(scope="module")
def engine():
    return seqopt.make_engine("compliance", seqopt.load_scene("arch25"))


def reached(engine, step, moved):
    """Largest share of payloads in misplacements (n, r, 3)."""
    robots = engine.network.scene.robots
    payload = [r.payload for r, node in zip(robots, step.grips, strict=True) if node is not None]
    numbers = engine.network.scene.grip_numbers(step.grips)
    grips = np.repeat([numbers], len(moved), axis=0)
    found = engine.solve(step.bricks, grips, moved=moved)
    return (np.linalg.norm(found.grip_force, axis=2) / payload).max(axis=1)


@pytest.mark.parametrize("which", ["sequential", "cantilever"])
def test_the_worst_direction_reaches_the_payload_and_none_exceeds_it(engine, which):
    rng, steps = np.random.default_rng(1), getattr(seqopt, which)(engine.network)
    tried = 0
    for step in steps[:46:5]:
        found = step_tolerance(engine, step)
        assert found.what.startswith("payload of rob")
        assert found.proven <= found.distance <= (1 + 2e-4) * found.proven
        share = reached(engine, step, np.array([found.misplacement]))
        assert share[0] == pytest.approx(1.0, abs=EXACT)
        off = rng.standard_normal((1000, len(step.held), 3))
        off *= found.distance / np.linalg.norm(off, axis=2, keepdims=True)
        share = reached(engine, step, off)
        assert share.max() <= 1 + EXACT
        share = reached(engine, step, 1.001 * np.array([found.misplacement]))
        assert share[0] > 1  # the control: a little farther is too far
        tried += 1
    assert tried == 10


def test_a_weightless_block_on_a_spring_is_a_closed_form():
    scene = replace(block(size=(0.4, 0.3, 0.1)), gravity=(0.0, 0.0, 0.0))
    scene = scene.with_robots(seqopt.Robot(name="one", payload=500.0))
    engine = seqopt.make_engine("compliance", scene)
    (spring,) = scene.grounds
    arm = np.subtract(scene.node_position(2), spring.position)
    x, y, z = arm
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])  # r × f
    axes = np.stack([spring.along, spring.across, np.cross(spring.along, spring.across)])
    flexible = axes.T @ np.diag(1 / np.array(spring.translational_stiffness)) @ axes
    turning = axes.T @ np.diag(1 / np.array(spring.rotational_stiffness)) @ axes
    flexible += cross.T @ turning @ cross
    least = np.linalg.eigvalsh(flexible)[0]  # of the stiffest direction
    found = misfits(engine, 1, np.array([[2]]))
    assert 1 / found[0] == pytest.approx(500.0 * least, rel=1e-9)


def test_two_rigid_grips_on_a_brick_fit_in_one_place_alone(engine):
    node, other = engine.network.scene.placed[4].nodes
    found = misfits(engine, 9, np.array([[1, node, other], [1, 4, node]]))
    assert found[0] == NO_TOLERANCE
    assert found[1] < NO_TOLERANCE


def forces(own, change, most):
    """Forces (n, 3) that misplacements change by matrices (n, r, 3, 3)."""
    return Misplaced(own, change.transpose(0, 2, 1, 3).reshape(len(own), 3, -1), most)


@settings(max_examples=10)
@given(st.integers(0, 10**9), st.integers(1, 4), st.sampled_from([0.0, 1e-3, 1.0, 50.0]))
def test_no_direction_is_worse_than_the_worst(seed, grips, weight):
    rng = np.random.default_rng(seed)
    own = weight * rng.standard_normal((20, 3))
    change = rng.standard_normal((20, grips, 3, 3)) * 10 ** rng.uniform(-2, 2, (20, 1, 1, 3))
    most = np.linalg.norm(own, axis=1) * rng.uniform(1.001, 5, 20) + 1e-3
    changed = forces(own, change, most)
    rate, direction = worst_rates(changed)
    low, high = proven_rates(changed, direction)
    assert (rate <= low * (1 + 1e-9)).all()
    assert (low <= rate * (1 + 1e-6)).all()
    assert (high <= low * 1.1).all()
    off = rng.standard_normal((20, 200, grips, 3))
    off /= np.linalg.norm(off, axis=3, keepdims=True) * high[:, None, None, None]
    sizes = np.linalg.norm(own[:, None] + np.einsum("ngij,nsgj->nsi", change, off), axis=2)
    assert (sizes <= most[:, None] * (1 + EXACT)).all()
    worst = worst_misplacement(changed, direction) / rate[:, None, None]
    size = np.linalg.norm(own + np.einsum("ngij,ngj->ni", change, worst), axis=1)
    assert np.allclose(size, most, rtol=EXACT)


def test_a_direction_that_is_not_the_worst_is_found_out():
    rng = np.random.default_rng(5)
    own, change = rng.standard_normal((30, 3)), rng.standard_normal((30, 3, 3, 3))
    most = 2 * np.linalg.norm(own, axis=1)
    rate, _ = worst_rates(forces(own, change, most))
    start = rng.standard_normal((30, 3))
    low, high = proven_rates(forces(own, change, most), start)
    assert (high >= rate * (1 - 1e-9)).all()  # whatever was thought to be the worst
    assert (low > 0.99 * rate).all()


def test_soft_grips_may_be_farther_off_and_unequal_robots_carry_their_own(engine):
    scene = engine.network.scene
    step = seqopt.cantilever(engine.network)[20]
    rigid = step_tolerance(engine, step).distance
    found = []
    for stiffness in (1e9, 1e7, 1e5):
        soft = seqopt.make_engine("compliance", scene.with_grips(stiffness))
        tolerance = step_tolerance(soft, step)
        share = reached(soft, step, np.array([tolerance.misplacement]))
        assert share[0] == pytest.approx(1.0, abs=EXACT)
        found.append(tolerance.distance)
    assert rigid < found[0] < found[1] < found[2]
    one, two, three = scene.robots
    strong = scene.with_robots(one, replace(two, payload=2 * two.payload), three)
    mixed = seqopt.make_engine("compliance", strong)
    for each in seqopt.cantilever(engine.network)[5:30:6]:
        at = step_tolerance(mixed, each)
        share = reached(mixed, each, np.array([at.misplacement]))
        assert share[0] == pytest.approx(1.0, abs=EXACT)
        numbers = np.array([strong.grip_numbers(each.grips)])
        assert 1 / misfits(mixed, each.bricks, numbers)[0] == pytest.approx(at.distance)
        assert at.distance >= step_tolerance(engine, each).distance * (1 - EXACT)
    with_two = np.array([strong.grip_numbers((None, *strong.placed[4].nodes))])
    assert misfits(mixed, 9, with_two)[0] == NO_TOLERANCE
    gives = seqopt.make_engine("compliance", scene.with_grips(1e6))
    assert misfits(gives, 9, np.array([strong.placed[4].nodes]))[0] < NO_TOLERANCE


SCENE = small_arch(4)


def test_no_plan_has_more_tolerance_than_the_best():
    plan = seqopt.optimize(SCENE, "free", aim="tolerance,steps")
    assert plan.status.value == "optimal"
    best = plan.objective["tolerance"]
    along = [step_tolerance(plan.engine, step).distance for step in plan.steps]
    assert best == pytest.approx(min(along), rel=1e-6)
    within = seqopt.optimize(SCENE, "free", limits=[seqopt.Limit("tolerance", 0.999 * best)])
    assert within.steps
    with pytest.raises(InfeasibleError, match="tolerance of"):
        seqopt.optimize(SCENE, "free", limits=[seqopt.Limit("tolerance", 1.01 * best)])


def test_a_loop_keeps_to_a_tolerance():
    scene = SCENE
    free = seqopt.optimize(scene, formulation="minimax", criterion="worst-ratio")
    usual = min(step_tolerance(free.engine, step).distance for step in free.steps)
    limits = [seqopt.Limit("tolerance", 0.99 * usual)]
    asked = {"formulation": "minimax", "criterion": "worst-ratio", "limits": limits}
    plan = seqopt.optimize(scene, **asked)
    least = min(step_tolerance(plan.engine, step).distance for step in plan.steps)
    assert least >= 0.99 * usual
    asked["limits"] = [seqopt.Limit("tolerance", 1.05 * usual)]
    with pytest.raises(InfeasibleError, match="becomes possible with a tolerance of"):
        seqopt.optimize(scene, **asked)


def test_what_cannot_be_asked_is_a_line(engine):
    with pytest.raises(ProblemError, match="above zero"):
        seqopt.Limit("tolerance", 0.0)
    with pytest.raises(ProblemError, match="no ranks"):
        seqopt.pose(
            engine,
            seqopt.three_robot_loop(engine.network),
            seqopt.problem.criteria.RankSum("own", (("tolerance", 1.0),), (("tolerance", 1.0),)),
        )
    discrete = seqopt.make_engine("discrete", SCENE)
    with pytest.raises(ProblemError, match="not linear"):
        misfits(discrete, 1, np.array([[SCENE.placed[0].nodes[1]]]))
    assert [str(goal) for goal in parse_goals("tolerance,steps")] == ["tolerance", "steps"]
