"""Collapse loads against linear programs of plane blocks, written here from their corners."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

import seqopt
from experiments.stability.parts.blocks import ring
from seqopt.contact.assembly import PartialAssemblies, step_assembly
from seqopt.contact.mortar import DRY, Mortar
from seqopt.errors import SceneError
from seqopt.scene import Load
from seqopt.scene.library import WallShape, wall
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability import Margins, Screen, Verdict, load_factors
from seqopt.stability._steps import each_verdict
from seqopt.stability.assessment import bonded, load_factor
from seqopt.stability.failure_map import BuildProver
from seqopt.stability.limit_analysis import CAP, EXACT, Sense, bound, compile_equilibrium, violation
from tests.builders import block

ROUGH = Mortar(friction=2.0)


def collapse(centroids, weights, contacts, loads, friction):
    """The largest multiple of loads, forces in N at points in the plane.

    ``contacts``: pairs of blocks, -1 for the ground, and both ends of the line where they touch;
    ``loads``: block, point and force. Unknown are pushes and slides at ends, and the multiple.
    """
    ends = [(pair, line, end) for pair, line in contacts for end in line]
    balance = np.zeros((len(centroids), 3, 2 * len(ends) + 1))
    slides = []
    for i, ((first, second), line, end) in enumerate(ends):
        along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
        normal = np.array([-along[1], along[0]])
        middle = line.mean(axis=0)
        normal *= np.sign(normal @ (centroids[second] - middle))
        for column, way in ((2 * i, normal), (2 * i + 1, along)):
            for body, sign in ((first, -1.0), (second, 1.0)):
                if body >= 0:
                    arm = end - centroids[body]
                    turn = arm[0] * way[1] - arm[1] * way[0]
                    balance[body, :, column] += sign * np.array([*way, turn])
        for sign in (-1.0, 1.0):
            row = np.zeros(2 * len(ends) + 1)
            row[2 * i], row[2 * i + 1] = -friction, sign
            slides.append(row)
    for body, point, force in loads:
        arm = np.subtract(point, centroids[body])
        balance[body, :, -1] += [*force, arm[0] * force[1] - arm[1] * force[0]]
    dead = np.array([[0.0, weight, 0.0] for weight in weights]).ravel()
    bounds = [(0, None), (None, None)] * len(ends) + [(0, None)]
    found = linprog(
        -np.eye(2 * len(ends) + 1)[-1],
        np.array(slides),
        np.zeros(len(slides)),
        balance.reshape(-1, balance.shape[2]),
        dead,
        bounds=bounds,
    )
    assert found.status in (0, 3)
    return -found.fun if found.status == 0 else np.inf


def voussoirs(count, thickness, at, friction):
    """An arch with a force down on one block's extrados: its assembly, and the program's answer."""
    blocks = ring(count, 2.0, thickness, half_angle=1.2)
    bare = blocks.assembly(2000.0)
    point = 0.5 * (blocks.vertex[at, 1] + blocks.vertex[at, 5])  # middle of the extrados
    force = np.array([0.0, 0.0, -1000.0])
    arm = (point - bare.centroid[at]) * [1.0, 0.0, 1.0]
    applied = np.zeros((count, 6))
    applied[at] = *force, *np.cross(arm, force)
    flat = [0, 2]
    lines = [(tuple(c.bodies), c.corner[:2][:, flat]) for c in blocks.contacts]
    loads = [(at, point[flat], force[flat])]
    answer = collapse(bare.centroid[:, flat], -bare.weight[:, 2], lines, loads, friction)
    return replace(bare, applied=applied), answer


@pytest.mark.parametrize("friction", [0.5, 2.0])
@pytest.mark.parametrize(("count", "at"), [(11, 3), (9, 4)])
def test_an_arch_under_a_force(count, at, friction):
    """Pippard, Tranter and Chitty (1936) loaded arches of voussoirs like these until they fell."""
    assembly, expected = voussoirs(count, 0.3, at, friction)
    found = load_factor(assembly, Mortar(friction=friction))
    assert found.unloaded is Verdict.STANDS
    assert found.factor == pytest.approx(expected, rel=1e-6)
    assert found.bound == pytest.approx(expected, rel=1e-6)
    assert found.load == 1000.0
    if np.isinf(expected):
        assert not found.motion.any()
        return
    assert np.abs(found.motion).max() > 0
    for share, verdict in ((0.999, Verdict.STANDS), (1.001, Verdict.FALLS)):
        loaded = replace(assembly, applied=share * expected * assembly.applied)
        assert seqopt.stability.assess(loaded, Mortar(friction=friction)).verdict is verdict


def test_a_larger_factor_is_not_believed():
    """Forces of one multiple do not prove another, and no motion proves too small a bound."""
    assembly, expected = voussoirs(11, 0.3, 3, 0.5)
    unit = replace(assembly, applied=expected * assembly.applied)
    case = bonded(unit, Mortar(friction=0.5)).fixed()
    case = replace(case, sense=Sense.LARGEST, applied=(0.0, 1.0))
    answer = compile_equilibrium(unit)(case, 0)
    assert violation(unit, case, answer) <= EXACT
    assert violation(unit, case, replace(answer, value=1.001)) > 10 * EXACT
    assert violation(unit, replace(case, applied=(0.0, 0.0)), answer) > 10 * EXACT
    assert bound(unit, case, answer) == pytest.approx(1.0, abs=1e-6)
    rng = np.random.default_rng(0)
    for size in (1e-3, 1e-1, 1.0):
        other = answer.motion + size * rng.normal(size=answer.motion.shape)
        assert bound(unit, case, replace(answer, motion=other)) >= 1 - 1e-6
    assert bound(unit, case, replace(answer, motion=-answer.motion)) == CAP


def pushed_wall(columns, courses, force):
    """A dry wall with a force along it on the first brick of its top course."""
    scene = wall(WallShape(columns=columns, courses=courses))
    name = columns * (courses - 1) + 1
    return replace(scene, loads=(Load(brick=name, force=force),))


def plane_collapse(scene, friction):
    """The largest multiple of a wall's loads, from where its bricks and joints are."""
    bricks, dims = scene.placed, scene.placed[0].dimensions
    place = {brick.name: i for i, brick in enumerate(bricks)}
    at = np.array([brick.position for brick in bricks])[:, [0, 2]]
    half = 0.5 * np.array(dims)[[0, 2]]
    lines = [
        ((-1, place[ground.brick]), at[place[ground.brick]] + half * [[-1, -1], [1, -1]])
        for ground in scene.grounds
    ]
    for joint in scene.joints:
        pair = sorted(place[name] for name in joint.bricks)
        low, high = (at[pair] - half).max(axis=0), (at[pair] + half).min(axis=0)
        lines.append((tuple(pair), np.array([low, high])))
    weights = [brick.mass * 9.81 for brick in bricks]
    loads = [
        (place[load.brick], at[place[load.brick]], np.array(load.force)[[0, 2]])
        for load in scene.loads
    ]
    return collapse(at, weights, lines, loads, friction)


@pytest.mark.parametrize("friction", [0.3, 0.8])
@pytest.mark.parametrize("force", [(10.0, 0.0, 0.0), (-10.0, 0.0, 6.0)])
def test_a_wall_that_is_pushed_along(force, friction):
    scene = pushed_wall(2, 3, force)
    (found,) = load_factors(scene, last_step(scene), Mortar(friction=friction))
    assert found.factor == pytest.approx(plane_collapse(scene, friction), rel=1e-6)


def last_step(scene):
    """The last step of a build that nobody holds."""
    free = (None,) * len(scene.robots)
    return [Step(1, StepKind.RELEASE, len(scene.bricks), free)]


@pytest.mark.parametrize("courses", [2, 5])
def test_a_wall_that_wind_tips(courses):
    """Across it, weight times half the width against wind times half the height."""
    scene = replace(wall(WallShape(columns=3, courses=courses)), wind=(0.0, 0.05, 0.0))
    (found,) = load_factors(scene, last_step(scene), ROUGH)
    assert 0.05 * found.factor == pytest.approx(0.1 / (0.06 * courses), rel=1e-6)


def test_a_block_slides_or_tips():
    """Friction times weight, or its moment about an edge, against the force; nothing else does."""
    bare = block(size=(0.4, 0.3, 0.2))
    weight = bare.bricks[0].mass * 9.81
    for mortar, force, position, expected in (
        (DRY, (10.0, 0.0, 0.0), None, DRY.friction * weight / 10.0),
        (DRY, (0.0, 6.0, 8.0), None, DRY.friction * weight / (6.0 + 8.0 * DRY.friction)),
        (ROUGH, (10.0, 0.0, 0.0), (0.0, 0.0, 0.2), weight * 0.2 / (10.0 * 0.2)),
        (ROUGH, (0.0, 0.0, -10.0), (0.3, 0.0, 0.2), weight * 0.2 / (10.0 * 0.1)),
        (ROUGH, (0.0, 0.0, -10.0), (0.1, 0.0, 0.2), np.inf),
    ):
        scene = replace(bare, loads=(Load(brick=1, force=force, position=position),))
        (found,) = load_factors(scene, last_step(scene), mortar)
        assert found.factor == pytest.approx(expected, rel=1e-6)
        assert found.bound == pytest.approx(expected, rel=1e-6)
        heavier = replace(scene, weight_factor=2.0)
        (twice,) = load_factors(heavier, last_step(heavier), mortar)
        assert twice.factor == pytest.approx(2 * expected, rel=1e-6)


def test_a_load_that_nothing_holds_and_one_that_must_act():
    """A leaning block stands with a push alone: as much as it takes, and no more."""
    lean = block(lean=0.6)
    push = Load(brick=1, force=(-100.0, 0.0, 0.0))
    scene = replace(lean, loads=(push,))
    (found,) = load_factors(scene, last_step(scene), DRY)
    assert found.unloaded is Verdict.FALLS
    away = replace(lean, loads=(replace(push, force=(100.0, 0.0, 0.0)),))
    (none,) = load_factors(away, last_step(away), DRY)
    assert (none.factor, none.bound, none.first_block) == (0.0, 0.0, "1")
    assert found.factor > 0


def test_what_acts_since_a_later_brick_and_what_does_not():
    scene = pushed_wall(2, 2, (5.0, 0.0, 0.0))
    late = replace(scene, loads=tuple(replace(load, since=4) for load in scene.loads))
    steps = seqopt.sequential(seqopt.build_network(late))
    results = load_factors(late, steps, DRY)
    acts = np.array([step.bricks >= 4 for step in steps])
    assert acts.any()
    assert not acts.all()
    assert [found.load for found in results] == np.where(acts, 5.0, 0.0).tolist()
    assert (np.isnan([found.factor for found in results]) == ~acts).all()
    with pytest.raises(SceneError, match="no load acts on it"):
        load_factors(replace(late, loads=()), steps, DRY)


@pytest.mark.parametrize(("share", "sign"), [(0.99, 1), (1.01, -1)])
def test_every_way_to_a_verdict_counts_the_loads(share, sign):
    scene = pushed_wall(2, 2, (10.0, 0.0, 0.0))
    expected = Verdict.STANDS if sign > 0 else Verdict.FALLS
    factor = share * plane_collapse(scene, DRY.friction)
    pushed = replace(scene, loads=(Load(brick=3, force=(10.0 * factor, 0.0, 0.0)),))
    network, steps = seqopt.build_network(pushed), last_step(pushed)
    assert seqopt.assess(network, steps, DRY)[0].verdict is expected
    assert next(each_verdict(network, steps, DRY)).verdict is expected
    assert Screen(network, DRY).stands(4, [[0, 0, 0]]).tolist() == [sign]
    assert (Margins(network, DRY).bond(4, [[0, 0, 0]])[0, 0] > 0) == (sign < 0)
    (builds,) = BuildProver(network, {"dry": DRY}).of_builds({"own": steps})["own"]
    assert builds.verdicts == (expected,)
    whole, part = step_assembly(network, 4, steps[0].grips), PartialAssemblies(network, 4)
    assert np.array_equal(whole.applied, part(4, steps[0].grips).applied)
    assert not len(part(2, steps[0].grips).applied)
    light = seqopt.build_network(scene)
    assert Screen(light, DRY).stands(4, [[0, 0, 0]]).tolist() == [1]
