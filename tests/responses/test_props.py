"""What props do to responses: none that are soft, robots' grips where robots hold, stiff centering.

Engines are asked about props as about grips, whose agreement other tests show.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from scipy import linalg

import seqopt
from experiments.placement.parts.staged import Placing, analyze_staged, spring_maps, staged_fields
from seqopt import Prop, Robot
from seqopt.engines.interface import Want
from seqopt.engines.registry import make_engine
from seqopt.errors import MechanismError, StepError
from seqopt.network._mechanics import node_motion
from seqopt.network.network import build_network
from seqopt.responses.quantities import _excess_of
from seqopt.scene.parts import Joint
from seqopt.sequence.methods import cantilever, sequential
from seqopt.sequence.steps import Step, StepKind
from seqopt.study import published_plan
from tests.builders import anywhere, block, from_both_sides, largest_difference, small_arch
from tests.strategies import arches

UP = (0.0, 0.0, 1.0)


def other_node(scene, place):
    """The node of a brick at which it is not placed."""
    brick = scene.placed[place]
    return next(node for node in brick.nodes if node != brick.placing_node)


def sequence(scene, engine="compliance"):
    network = seqopt.build_network(scene)
    return seqopt.make_engine(engine, network), seqopt.sequential(network)


def alike(one, other, **how):
    names = [n for n in other if other[n].dtype == float and n in one and "prop" not in n]
    np.testing.assert_allclose(one[names], other[names], **how)


@pytest.mark.parametrize("engine", ["compliance", "frame"])
def test_a_prop_that_gives_way_is_none(engine):
    scene = small_arch(6)
    node = other_node(scene, 3)
    bare = seqopt.analyze(*sequence(scene, engine))
    soft = seqopt.analyze(*sequence(scene.with_props(Prop(node=node, stiffness=1e-3)), engine))
    alike(soft, bare, rtol=1e-4, atol=1e-5)
    assert soft["F_prop_N"].max() < 1e-4
    stiff = seqopt.analyze(*sequence(scene.with_props(Prop(node=node)), engine))
    assert stiff["F_prop_N"].max() > 1.0  # the control: it is not the test that sees nothing


@pytest.mark.parametrize("stiffness", [None, 1e6])
def test_a_prop_is_the_grip_of_a_robot_that_holds_all_the_time(stiffness):
    scene = small_arch(6)
    node = other_node(scene, 2)
    engine, steps = sequence(scene.with_props(Prop(node=node, stiffness=stiffness)))
    held = [replace(s, grips=(*s.grips, node if s.held and s.bricks >= 3 else None)) for s in steps]
    more = Robot(name="more", payload=1e6, stiffness=stiffness)
    beside = seqopt.make_engine("compliance", scene.with_robots(*scene.robots, more))
    alike(seqopt.analyze(engine, steps), seqopt.analyze(beside, held), rtol=1e-9, atol=1e-9)


def test_stiff_props_at_every_brick_hold_the_structure_still():
    """Displacements go to those between props as their stiffness grows: to far less than without.

    A brick of weight W on springs k at both ends, and on nothing else, sinks by W / 2k.
    """
    scene = small_arch(6)
    nodes = [n for b in scene.placed for n in b.nodes if n not in scene.blocked_nodes]
    bare = seqopt.make_engine("compliance", scene).solve(5, np.zeros((1, 0), int))
    most = []
    for stiffness in (1e3, 1e5, 1e7, 1e9):
        props = [Prop(node=node, stiffness=stiffness) for node in nodes]
        engine = seqopt.make_engine("compliance", scene.with_props(*props))
        found = engine.solve(5, [engine.network.scene.prop_numbers(5, held=False)])
        most.append(np.linalg.norm(found.displacement, axis=2).max())
    assert most == sorted(most, reverse=True)
    assert most[-1] < 1e-3 * np.linalg.norm(bare.displacement, axis=2).max()
    weight = np.linalg.norm(engine.network.weight, axis=1).max()
    assert most[-1] < weight / 1e9  # joints carry a part of it


def test_excess_is_a_pull_or_what_is_beyond_a_capacity():
    force = np.array([[[0.0, 3.0, 4.0]], [[0.0, 0.0, -2.0]], [[0.0, 0.0, 9.0]]])
    assert _excess_of([Prop(node=1)], force).tolist() == [0, 0, 0]
    assert _excess_of([Prop(node=1, direction=UP)], force).tolist() == [0, 2, 0]
    assert _excess_of([Prop(node=1, capacity=5)], force).tolist() == [0, 0, 4]
    assert _excess_of([Prop(node=1, direction=UP, capacity=1)], force).tolist() == [4, 2, 8]


def test_staged_construction_knows_props():
    """They bear what comes after them, and nothing is left of them at the end."""
    scene = small_arch(6)
    node = other_node(scene, 2)
    network = seqopt.build_network(scene.with_props(Prop(node=node)))
    table = analyze_staged(network, seqopt.sequential(network))
    assert table["F_prop_N"].max() > 1.0
    assert table["props"].tolist()[-1] == 0


def test_a_table_of_props_says_what_each_bears():
    scene = small_arch(6)
    node = other_node(scene, 3)
    engine, steps = sequence(scene.with_props(Prop(node=node, direction=(0, 0, -1))))
    build = seqopt.GivenSequence(engine, steps)
    (row,) = build.props().to_dict("records")
    table = seqopt.analyze(engine, steps)
    assert row["node"] == node
    assert row["largest_force_N"] == pytest.approx(table["F_prop_N"].max())
    assert -row["least_push_N"] == pytest.approx(table["prop_excess_N"].max())
    assert steps[row["from_step"] - 1].bricks == 4
    assert steps[row["to_step"]].held == ()
    assert engine.solve(2, [[1]], Want(0)).grip_force.shape == (1, 1, 3)


def test_centering_leaves_robots_their_nodes():
    scene = small_arch(5)
    nodes = [prop.node for prop in scene.with_centering().props]
    assert not {*nodes} & {brick.placing_node for brick in scene.placed}
    assert len(nodes) >= 4


# staged construction: closed forms, laws, and a second route that keeps every reference itself
PLACE, RELEASE, HOLD = StepKind.PLACE, StepKind.RELEASE, StepKind.REPOSITION


def numbered(*steps):
    return tuple(Step(i, *step) for i, step in enumerate(steps, 1))


def tower(count, soft=1e6):
    """Bricks on one another on joints that give way up and down alone."""
    first = block(translational_stiffness=(soft,) * 3, rotational_stiffness=(1e12,) * 3)
    brick, ground = first.bricks[0], first.grounds[0]
    height = brick.dimensions[2]
    bricks = [
        replace(
            brick,
            name=i + 1,
            position=(0.0, 0.0, (i + 0.5) * height),
            nodes=(2 * i + 1, 2 * i + 2),
            placing_node=2 * i + 1,
        )
        for i in range(count)
    ]
    joints = [
        Joint(
            bricks=(i, i + 1),
            position=(0.0, 0.0, i * height),
            along=ground.along,
            across=ground.across,
            translational_stiffness=(soft,) * 3,
            rotational_stiffness=(1e12,) * 3,
        )
        for i in range(1, count)
    ]
    return replace(
        first,
        bricks=tuple(bricks),
        joints=tuple(joints),
        build_order=tuple(range(1, count + 1)),
        robots=anywhere(3),
    )


def scratch(network, step):
    return make_engine("compliance", network).solve(
        step.bricks, np.array([step.held], dtype=np.int64).reshape(1, -1), Want.ALL
    )


# closed forms
def test_two_bricks_by_hand():
    """Weights w on springs k: the second is placed on the first as it hangs free, and held.

    From scratch the held brick stays where the plan has it, so half of the first one's weight
    hangs on it: its robot carries 3/2 w. Staged, the joint between them is free of stress: it
    carries w. Let go, both springs carry what lies on them.
    """
    soft = 1e6
    network = build_network(tower(2, soft))
    steps = numbered(
        (PLACE, 1, (1, None, None)),
        (RELEASE, 1, (None, None, None)),
        (PLACE, 2, (None, 3, None)),
        (RELEASE, 2, (None, None, None)),
    )
    w = float(np.linalg.norm(network.weight[0]))
    once = [scratch(network, step).grip_force[0, :, 2].sum() for step in steps]
    assert once == pytest.approx([w, 0, 1.5 * w, 0], abs=1e-4 * w)
    for placing, lost in ((Placing.FITTED, 0.0), (Placing.PLANNED, w / soft)):
        fields = list(staged_fields(network, steps, placing))
        forces = [f.grip_force[0, :, 2].sum() for f in fields]
        assert forces == pytest.approx([w, 0, w, 0], abs=1e-4 * w)
        heights = [f.brick_twist[0, :, 2] * soft / w for f in fields]
        start = 0.0 if placing is Placing.PLANNED else -1.0
        np.testing.assert_allclose(heights[0], [0.0], atol=1e-4)
        np.testing.assert_allclose(heights[1], [-1.0], atol=1e-4)
        np.testing.assert_allclose(heights[2], [-1.0, start], atol=1e-4)
        np.testing.assert_allclose(heights[3], [-2.0, -3.0 + lost * soft / w], atol=1e-4)
        np.testing.assert_allclose(fields[3].joint_wrench[0, :, 2], [2 * w, w], rtol=1e-6)


# laws
def released_in_between(scene):
    """One brick after the other, each held when it is placed and let go at once."""
    network = build_network(scene)
    names = [brick.nodes[1] for brick in scene.placed]
    steps, nobody = [], (None,) * (len(scene.robots) - 1)
    for count, node in enumerate(names, 1):
        steps += [(PLACE, count, (*nobody, node)), (RELEASE, count, (*nobody, None))]
    return network, numbered(*steps)


@settings(max_examples=6)
@given(arches(max_bricks=5))
def test_without_loops_nothing_is_locked_in_once_all_let_go(scene):
    """Statically determinate: forces follow from weight alone; fitted bricks follow the joints."""
    scene = replace(scene, grounds=scene.grounds[:1])
    network, steps = released_in_between(scene)
    for step, fields in zip(steps, staged_fields(network, steps), strict=True):
        if step.kind is RELEASE:
            assert largest_difference(fields, scratch(network, step), network) < 1e-7


@pytest.mark.slow
def test_a_closed_arch_remembers_how_it_was_built(arch25):
    """Both build the same structure; what is locked in differs, the weight does not."""
    network = build_network(arch25)
    last = []
    for method in (sequential, cantilever):
        *_, fields = staged_fields(network, method(network))
        last.append(fields)
        total = fields.support[0, :, :3].sum(axis=0) + network.weight.sum(axis=0)
        assert np.abs(total).max() < 1e-6
    once = scratch(network, sequential(network)[-1])
    moments = [f.support[0, :, 3:] for f in (*last, once)]
    assert all(np.abs(moments[i] - moments[j]).max() > 1.0 for i, j in ((0, 1), (0, 2)))


# a second route: not increments, but every spring's and grip's own reference
def by_references(network, steps):
    """Yield twists and grip forces from total equilibrium with initial strains, densely."""
    scene = network.scene
    at = {n: i for i, n in enumerate(n for b in scene.placed for n in b.nodes)}
    rest, targets, twist = {}, {}, np.zeros(0)
    for step in steps:
        acting, gap, stiffness = spring_maps(network, step.bricks)
        twist = np.concatenate([twist, np.zeros(6 * step.bricks - len(twist))])  # as planned
        for s, g in zip(acting.tolist(), gap, strict=True):
            rest.setdefault(s, g @ twist)
        inner = network.inner[: step.bricks].ravel()
        moves = node_motion(network, step.bricks).toarray().reshape(-1, 3, 6 * step.bricks)[inner]
        targets = {n: targets.get(n, moves[at[n]] @ twist) for n in step.held}
        matrix = np.einsum("sik,sij,sjl->kl", gap, stiffness, gap)
        pull = np.einsum("nik,ni->k", moves, network.inner_weight[: len(moves)])
        start = np.array([rest[s] for s in acting.tolist()])
        pull = pull + np.einsum("sik,sij,sj->k", gap, stiffness, start)
        ties = np.concatenate([np.zeros((0, len(twist))), *(moves[at[n]] for n in step.held)])
        goal = np.concatenate([np.zeros(0), *(targets[n] for n in step.held)])
        size = 1 / np.sqrt(np.diag(matrix))
        zero = np.zeros((len(ties), len(ties)))
        scaled = np.block([[matrix * np.outer(size, size), (ties * size).T], [ties * size, zero]])
        answer = linalg.lstsq(scaled, np.concatenate([pull * size, goal]), cond=1e-13)[0]
        twist = size * answer[: len(twist)]
        force = -answer[len(twist) :].reshape(-1, 3)
        stress = np.einsum("sij,sj->si", stiffness, np.einsum("sik,k->si", gap, twist) - start)
        yield twist.reshape(-1, 6), force, acting, -stress


BUILDS = {
    "cantilever": lambda: (net := build_network(small_arch(8)), cantilever(net)),
    "from both sides": lambda: released_in_between(from_both_sides(6, "VL")),
}


@pytest.mark.parametrize("build", BUILDS)
def test_references_give_the_same(build):
    network, steps = BUILDS[build]()
    planned, own = staged_fields(network, steps, Placing.PLANNED), by_references(network, steps)
    weight = np.linalg.norm(network.weight, axis=1).mean()
    for _, fields, (twist, force, acting, wrench) in zip(steps, planned, own, strict=True):
        scale = np.abs(fields.brick_twist).max()
        np.testing.assert_allclose(fields.brick_twist[0], twist, atol=1e-6 * scale)
        np.testing.assert_allclose(fields.joint_wrench[0, acting], wrench, atol=1e-5 * weight)
        np.testing.assert_allclose(fields.grip_force[0], force, atol=1e-5 * weight)


def test_references_from_another_start_differ():
    """The second route can tell: bricks that are fitted move elsewhere, under the same forces."""
    network, steps = BUILDS["cantilever"]()
    planned, fitted = (list(staged_fields(network, steps, way)) for way in Placing)
    assert np.abs(planned[-1].brick_twist - fitted[-1].brick_twist).max() > 1e-8
    for a, b in zip(planned, fitted, strict=True):
        np.testing.assert_allclose(a.grip_force, b.grip_force, atol=1e-6)


def test_every_step_of_the_published_plan_is_in_equilibrium(arch25):
    """Weights, grips and reactions cancel at every step, brick pairs held twice included."""
    network = build_network(arch25)
    steps = published_plan(arch25)
    for step, fields in zip(steps, staged_fields(network, steps), strict=True):
        total = network.weight[: step.bricks].sum(axis=0)
        total = total + fields.grip_force[0].sum(axis=0) + fields.support[0, :, :3].sum(axis=0)
        assert np.abs(total).max() < 1e-6
        assert len(fields.grip_force[0]) == len(step.held)


def test_wrong_questions_get_a_line(arch25):
    network = build_network(arch25)
    steps = sequential(network)
    with pytest.raises(StepError):
        analyze_staged(network, steps[3:])
    loose = build_network(replace(arch25, joints=arch25.joints[1:]))
    with pytest.raises(MechanismError, match="step 2"):
        analyze_staged(loose, cantilever(loose))
