"""Laws every engine obeys; laws of the free schedule; units and scale change no choice."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError
from seqopt.graph.states import build_states
from seqopt.network.network import build_network
from seqopt.problem.criteria import WorstRatio
from seqopt.responses.quantities import responses_of
from seqopt.scene.parts import Anywhere, Robot, Sphere
from seqopt.sequence.methods import three_robot_loop
from seqopt.sequence.rules import FreeRules
from seqopt.study import EQUATIONS, RESOLUTION
from tests.builders import about_vertical, moved, rescaled, scaled
from tests.strategies import arches, both_sided, free_builds, states, walls

SCALES = (("F_largest", 100.0), ("M_sup", 10.0), ("T_max", 30.0), ("D_max", 1e-5))


def best(scene, rules, aim="minmax", scales=SCALES):
    """The optimum, infinite where there is none."""
    engine = ComplianceEngine(build_network(scene))
    problem = build_states(engine, rules, WorstRatio("ones", scales), aim)
    try:
        return np.array(seqopt.solve(problem, "schedule_search").certificate.values)
    except InfeasibleError:
        return np.full(aim.count(",") + 1, np.inf)


few = settings(max_examples=3, deadline=None)
builds = free_builds(most_bricks=4, most_robots=3)


def not_worse(new, old):
    return bool((new <= old * (1 + 1e-9)).all())


@given(build=builds)
@few
def test_one_more_robot_never_worsens_the_optimum(build):
    scene, rules = build
    more = (*scene.robots, Robot(name="extra", payload=500.0, reach=Anywhere()))
    assert not_worse(best(replace(scene, robots=more), rules), best(scene, rules))


@given(build=builds, data=st.data())
@few
def test_more_reach_never_worsens_the_optimum(build, data):
    scene, rules = build
    which = data.draw(st.integers(0, len(scene.robots) - 1))
    rules = replace(rules, newest="either")  # where a robot places depends on its reach otherwise
    robots = [replace(r, reach=Anywhere()) if i == which else r for i, r in enumerate(scene.robots)]
    assert not_worse(best(replace(scene, robots=tuple(robots)), rules), best(scene, rules))


@pytest.mark.slow
@given(build=builds)
@few
def test_a_looser_rule_never_worsens_the_optimum(build):
    scene, rules = build
    value = best(scene, rules)
    for _, loose in rules.loosened(scene):
        assert not_worse(best(scene, loose), value)


@given(build=builds, data=st.data())
@few
def test_the_order_of_robots_changes_nothing(build, data):
    scene, rules = build
    order = data.draw(st.permutations(scene.robots))
    other = replace(scene, robots=tuple(order))
    a, b = best(scene, rules, "minmax,steps"), best(other, rules, "minmax,steps")
    assert a == pytest.approx(b, rel=1e-9)


@given(
    build=builds,
    length=st.floats(0.2, 5.0),
    force=st.floats(0.1, 10.0),
    softness=st.floats(0.1, 10.0),
)
@few
def test_scaling_changes_nothing(build, length, force, softness):
    scene, rules = build
    robots = (
        replace(r, reach=Anywhere()) if isinstance(r.reach, Sphere) else r for r in scene.robots
    )
    scene = replace(scene, robots=tuple(robots))  # spheres are not scaled with the scene
    factor = {"F": force, "M": force * length, "T": force, "D": force * softness}
    scales = tuple((name, scale * factor[name[0]]) for name, scale in SCALES)
    a = best(scene, rules, "minmax")
    b = best(rescaled(scene, length, force, softness), rules, "minmax", scales)
    assert a == pytest.approx(b, rel=1e-5)


def test_a_worse_optimum_is_seen():
    """The negative control of all laws above."""
    assert not not_worse(np.array([1.1]), np.array([1.0]))
    assert not_worse(np.array([1.0]), np.array([np.inf]))
    with pytest.raises(TypeError):
        FreeRules(2)


@pytest.mark.slow
def test_a_resolution_in_other_units_is_another_criterion(arch25):
    """The control of choices that know no units: forces in kN rounded to 1 kN decide nothing."""

    def chosen(scene, criterion):
        network = build_network(scene)
        problem = seqopt.pose(ComplianceEngine(network), three_robot_loop(network), criterion)
        return seqopt.solve(problem, "overlap_dp").nodes

    absolute, other = replace(EQUATIONS, resolution=RESOLUTION), rescaled(arch25, 1, 1e-3, 1)
    nodes = chosen(arch25, EQUATIONS)
    assert chosen(arch25, absolute) == chosen(other, EQUATIONS) == nodes
    assert chosen(other, absolute) != nodes


# laws every engine obeys, as property tests


any_scene = st.one_of(arches(), walls(), both_sided())
NAMES = [f"F_{k}" for k in ("rob", "sup", "min", "max", "avg")] + [
    "M_sup",
    "D_max",
    "D_avg",
    "D_std",
]


def close(a, b, tolerance, scale=None):
    """Equal within a tolerance relative to a scale, by default the largest entry."""
    scale = max(np.abs(b).max(initial=0), np.abs(a).max(initial=0)) if scale is None else scale
    return (
        np.shape(a) == np.shape(b) and np.abs(np.subtract(a, b)).max(initial=0) <= tolerance * scale
    )


def imbalance(net, bricks, grips, fields):
    """Force and moment left over on every brick, (b, 6): weight, grips and springs summed."""
    out = np.zeros((bricks, 6))
    center = net.node_position[net.inner].mean(axis=1)

    def add(brick, point, force, moment=0.0):
        out[brick, :3] += force
        out[brick, 3:] += moment + np.cross(point - center[brick], force)

    for b in range(bricks):
        add(b, center[b], net.weight[b])
    for node, force in zip(grips[0], fields.grip_force[0], strict=True):
        i = net.node_name.index(int(node))
        add(net.node_brick[i], net.node_position[i], force)
    for s, wrench in enumerate(fields.joint_wrench[0]):
        for body, sign in zip(net.springs.bodies[s], (-1.0, 1.0), strict=True):
            if 0 <= body < bricks:
                add(body, net.springs.position[s], sign * wrench[:3], sign * wrench[3:])
    return out


@pytest.mark.parametrize(("engine", "tolerance"), [(ComplianceEngine, 1e-9), (FrameEngine, 1e-4)])
@given(state=states(any_scene))
def test_every_brick_is_in_equilibrium(engine, tolerance, state):
    scene, bricks, grips = state
    net = build_network(scene)
    fields = engine(net).solve(bricks, grips, Want.ALL)
    scale = max(np.abs(fields.joint_wrench).max(), np.abs(net.weight).max())
    assert np.abs(imbalance(net, bricks, grips, fields)).max() <= tolerance * scale


@given(state=states(arches()))
def test_imbalance_is_seen(state):
    scene, bricks, grips = state
    net = build_network(scene)
    fields = ComplianceEngine(net).solve(bricks, grips, Want.ALL)
    wrong = replace(fields, joint_wrench=1.01 * fields.joint_wrench)
    scale = max(np.abs(fields.joint_wrench).max(), np.abs(net.weight).max())
    assert np.abs(imbalance(net, bricks, grips, wrong)).max() > 1e-6 * scale


@given(scene=any_scene, data=st.data())
def test_reciprocity(scene, data):
    """Maxwell-Betti: the flexibility between any two nodes is the same both ways."""
    net = build_network(scene)
    bricks = data.draw(st.integers(1, len(scene.bricks)))
    matrix = OperatorBuilder(net, grow_tree(net)).operator(bricks).flexibility
    assert close(matrix, matrix.T, 1e-12)


@given(state=states(any_scene, max_grips=2), data=st.data())
def test_a_further_grip_never_raises_compliance(state, data):
    """The work of the weight, which is the compliance, can only fall."""
    scene, bricks, grips = state
    net = build_network(scene)
    nodes = [n for b in scene.placed[:bricks] for n in b.nodes if n not in scene.blocked_nodes]
    more = data.draw(st.sampled_from(nodes))
    if more in grips:
        return
    engine = ComplianceEngine(net)
    inner = net.inner[:bricks].ravel()
    half_weight = 0.5 * np.repeat(net.weight[:bricks], 2, axis=0)
    work = [
        float((engine.solve(bricks, g).displacement[0, inner] * half_weight).sum())
        for g in (grips, np.append(grips, [[more]], axis=1), np.zeros((1, 0), dtype=np.int64))
    ]
    assert -1e-9 * work[2] <= work[1] <= work[0] + 1e-9 * work[2]


@given(state=states(any_scene))
def test_gripped_nodes_stay(state):
    scene, bricks, grips = state
    net = build_network(scene)
    engine = ComplianceEngine(net)
    motion = engine.solve(bricks, grips).displacement[0]
    free = engine.solve(bricks, np.zeros((1, 0), dtype=np.int64)).displacement[0]
    held = [net.node_name.index(int(n)) for n in grips[0]]
    assert np.abs(motion[held]).max(initial=0) <= 1e-9 * np.abs(free).max()


def scalars(scene, bricks, grips):
    engine = ComplianceEngine(build_network(scene))
    answer = responses_of(engine.network, engine.solve(bricks, grips))
    points = engine.network.node_position
    extent = np.linalg.norm(points - points[0], axis=1).max()
    values = {name: answer["T_max" if name == "F_max" else name][0] for name in NAMES}
    largest = max(float(np.abs(values[name]).max(initial=0)) for name in NAMES[:5])
    free = engine.solve(bricks, np.zeros((1, 0), dtype=np.int64)).displacement
    return values | {"M_extent": extent * largest, "D_free": np.linalg.norm(free, axis=2).max()}


def assert_same(a, b, factors=None, tolerance=1e-8):
    for name, value in a.items():
        factor = (factors or {}).get(name[0], 1.0)
        kind = [n for n in b if n[0] == name[0]]  # forces, moments or displacements
        scale = max(float(np.abs(b[n]).max(initial=0)) for n in kind)
        assert close(np.multiply(value, factor), b[name], tolerance, scale), name


@given(state=states(any_scene))
def test_mirroring_changes_nothing(state):
    scene, bricks, grips = state
    mirrored = moved(scene, lambda p: p * np.array([1.0, -1.0, 1.0]))
    assert_same(scalars(scene, bricks, grips), scalars(mirrored, bricks, grips))


@given(state=states(any_scene), angle=st.floats(-3, 3))
def test_turning_about_the_vertical_changes_nothing(state, angle):
    scene, bricks, grips = state
    turn = about_vertical(angle)
    turned = moved(scene, lambda p: turn @ p + np.array([3.0, -2.0, 1.0]))
    assert_same(scalars(scene, bricks, grips), scalars(turned, bricks, grips))


@given(state=states(any_scene), seed=st.randoms(use_true_random=False))
def test_renumbering_changes_nothing(state, seed):
    scene, bricks, grips = state
    names = [b.name for b in scene.bricks]
    nodes = [n for b in scene.bricks for n in b.nodes]
    new_name = dict(zip(names, seed.sample(range(1000), len(names)), strict=True))
    new_node = dict(zip(nodes, seed.sample(range(1000), len(nodes)), strict=True))
    renamed = [
        replace(
            b,
            name=new_name[b.name],
            nodes=tuple(new_node[n] for n in b.nodes),
            placing_node=new_node[b.placing_node],
        )
        for b in scene.bricks
    ]
    joints = [replace(j, bricks=tuple(new_name[n] for n in j.bricks)) for j in scene.joints]
    seed.shuffle(renamed)
    seed.shuffle(joints)
    other = replace(
        scene,
        bricks=tuple(renamed),
        joints=tuple(joints),
        grounds=tuple(replace(g, brick=new_name[g.brick]) for g in scene.grounds),
        build_order=tuple(new_name[n] for n in scene.build_order),
        blocked_nodes=tuple(new_node[n] for n in scene.blocked_nodes),
    )
    same = np.array([[new_node[int(n)] for n in grips[0]]], dtype=np.int64).reshape(1, -1)
    assert_same(scalars(scene, bricks, grips), scalars(other, bricks, same))


@pytest.mark.parametrize(
    ("what", "factor"), [("length", 1e3), ("density", 1e-3), ("stiffness", 1e3)]
)
@given(state=states(any_scene))
def test_scaling(what, factor, state):
    """Forces follow the weight, moments weight times length, motions weight over stiffness."""
    scene, bricks, grips = state
    other = scaled(scene, **{what: factor})
    force = {"length": factor**3, "density": factor, "stiffness": 1.0}[what]
    factors = {
        "F": force,
        "M": force * (factor if what == "length" else 1.0),
        "D": force / (factor if what == "stiffness" else 1.0),
    }
    assert_same(scalars(scene, bricks, grips), scalars(other, bricks, grips), factors)


@given(state=states(arches()))
def test_scaling_is_not_blind(state):
    scene, bricks, grips = state
    a, b = scalars(scene, bricks, grips), scalars(scaled(scene, density=2.0), bricks, grips)
    with pytest.raises(AssertionError):
        assert_same(a, b)
