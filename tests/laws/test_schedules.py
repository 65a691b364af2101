"""Laws of methods and schedules, of the ground ends, and of verdicts."""

import re
from contextlib import suppress
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st

from experiments.stability.parts.blocks import stack
from seqopt.arrays import skew
from seqopt.contact.mortar import DRY, Mortar, bond_mortar
from seqopt.engines.discrete import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, SceneError, StepError
from seqopt.exchange.schedules import parse_schedule, schedule_text
from seqopt.network.network import GROUND, build_network
from seqopt.responses.quantities import CHOSEN_BY, lengths, responses_of
from seqopt.sequence.methods import _NUMBERS, METHODS, SCHEDULES
from seqopt.sequence.schedule import islands
from seqopt.sequence.steps import StepKind, check_sequence
from seqopt.stability._screens import FALLS, OPEN, STANDS, Screen
from seqopt.stability.assessment import assess
from seqopt.stability.verdict import Verdict
from tests.builders import (
    HERE,
    about_vertical,
    anywhere,
    branch,
    from_both_ends,
    from_both_sides,
    held,
    moved,
    running_bond,
    scaled,
    small_arch,
)
from tests.strategies import arches, both_sided, builds, states, walls


def adrift(network, step):
    """Return the parts that joints tie to no ground end and that nobody holds."""
    springs, graph = network.springs, nx.Graph()
    graph.add_nodes_from([GROUND, *range(step.bricks)])
    graph.add_edges_from(springs.bodies[springs.since <= step.bricks].tolist())
    held = {network.scene.placed.index(network.scene.brick_of_node[n]) for n in step.held}
    return [part for part in nx.connected_components(graph) if not part & (held | {GROUND})]


def newest_held(scene, step):
    return bool(set(step.held) & set(scene.placed[step.bricks - 1].nodes))


def possible(make, network, choose):
    """Return the steps of a method, open grips chosen; none where it refuses."""
    try:
        made = make(network)
    except StepError:
        return []
    if isinstance(made, tuple):
        return made
    again = parse_schedule(network, schedule_text(made), "x.csv")
    assert (again.steps, again.moves) == (made.steps, made.moves)
    nodes = []
    for move in made.moves:
        free = [node for node in move.candidates if node not in nodes[-1:]]
        if not free:
            return []
        nodes.append(choose(free))
    return made.fill(nodes)


def broken(network, name, steps):
    """Return what is wrong with the steps of a method."""
    scene, out = network.scene, []
    check_sequence(scene, steps)
    for step in steps:
        let_go = step.bricks == len(scene.bricks) and not step.held
        if name != "cantilever" and not let_go and not newest_held(scene, step):
            out.append(f"step {step.number}: the newest brick is not held")
        out += [f"step {step.number}: {part} is adrift" for part in adrift(network, step)]
    placed = [step.bricks for step in steps if step.kind is StepKind.PLACE]
    return out + ["bricks are left"] * (placed != [*range(1, len(scene.bricks) + 1)])


@pytest.mark.parametrize("name", [*METHODS, *SCHEDULES])
@settings(max_examples=8)
@given(scene=builds(), data=st.data())
def test_with_any_robots_steps_are_possible_and_all_is_held(name, scene, data):
    network = build_network(scene)
    make = (METHODS | SCHEDULES)[name]
    steps = possible(make, network, lambda free: data.draw(st.sampled_from(free)))
    assert not steps or broken(network, name, steps) == []


ALL = METHODS | SCHEDULES
LEAST = dict.fromkeys([*METHODS, "two-robot", "loop"], 2)  # robots
LEAST |= dict.fromkeys(["three-robot", "modified-sequential"], 3)


@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.parametrize(
    "scene", [running_bond(3, 3), from_both_ends(9), branch()], ids=lambda s: s.name
)
@pytest.mark.parametrize("name", [*METHODS, *SCHEDULES])
def test_robots_that_reach_everything_build_everything(name, scene, count):
    network, make = build_network(replace(scene, robots=anywhere(count))), ALL[name]
    try:
        make(network)
    except StepError as error:
        needs = _NUMBERS.index(re.search(r"needs (\w+)", str(error))[1])
        assert count < needs == LEAST.get(name, needs)
        return
    steps = possible(make, network, lambda free: free[0])
    assert steps
    assert broken(network, name, steps) == []


def test_what_is_wrong_is_seen():
    scene = replace(small_arch(5), build_order=(1, 3, 2, 4, 5))
    network = build_network(scene)
    steps = SCHEDULES["two-robot"](network).fill([1, 4, 2, 6, 8])
    assert broken(network, "two-robot", steps) == []
    bare = [replace(s, grips=(None,) * 3) if s.number == 3 else s for s in steps]
    assert adrift(network, bare[2]) == [{1}]
    assert not newest_held(scene, bare[2])
    assert "bricks are left" in broken(network, "two-robot", steps[:3])


# laws of the order: what stands whole does not know it, and any order builds what is held


few = settings(max_examples=8, deadline=None)
scenes = st.one_of(arches(max_bricks=6, min_bricks=3), both_sided())
NAMES = ("T_max", "M_sup", "D_max", "C_max")


def worst(engine, bricks, grips):
    """The responses of a state by name, and the force at every grip."""
    fields = engine.solve(bricks, np.array([grips], dtype=int).reshape(1, -1), Want.ALL)
    found = [float(CHOSEN_BY[name].of(engine.network, fields)[0]) for name in NAMES]
    return np.array([*found, *lengths(fields.grip_force)[0]])


@given(scene=scenes, data=st.data())
@few
def test_the_whole_structure_does_not_know_its_order(scene, data):
    order = data.draw(st.permutations(scene.build_order))
    nodes = [n for brick in scene.bricks for n in brick.nodes if n not in scene.blocked_nodes]
    grips = data.draw(st.lists(st.sampled_from(nodes), min_size=1, max_size=3, unique=True))
    own, other = (ComplianceEngine(build_network(scene, o)) for o in (None, order))
    count = len(scene.bricks)
    expected = worst(own, count, grips)
    assert worst(other, count, grips) == pytest.approx(expected, rel=1e-7, abs=1e-12)


def spread(points):
    """How far points are from lying in one line, over how far they are apart."""
    apart = np.array(points) - points[0]
    return np.linalg.svd(apart, compute_uv=False)[1] / np.abs(apart).max()


@given(scene=scenes, data=st.data())
@few
def test_any_order_builds_what_is_tied_or_held(scene, data):
    """Parts that no joint ties to the ground need grips that are in no line: a brick has none."""
    order = data.draw(st.permutations(scene.build_order))
    engine = ComplianceEngine(build_network(scene, order))
    count = data.draw(st.integers(1, len(order)))
    nodes = {brick.name: brick.nodes for brick in scene.bricks}
    parts = [sorted(n for b in part for n in nodes[b]) for part in islands(engine.network, count)]
    grips = [n for part in parts for n in part if n not in scene.blocked_nodes]
    fixed = [
        spread([scene.node_position(n) for n in part if n in grips]) if len(part) > 2 else 0.0
        for part in parts
    ]
    if min(fixed, default=1.0) > 0.1:
        assert np.isfinite(worst(engine, count, grips)).all()
    elif min(fixed) < 1e-9:
        with pytest.raises(MechanismError):
            worst(engine, count, grips)
    else:  # nearly in a line: whichever an engine says, it says no number that is none
        with suppress(MechanismError):
            assert np.isfinite(worst(engine, count, grips)).all()


# laws of the ground ends: with the grips they carry the weight, whichever comes first


any_scene = st.one_of(arches(), walls(), both_sided())


def left_over(net, bricks, grips, fields):
    """Force and moment about the origin, (6,), of weight, grips and ground ends summed."""
    places = [net.node_name.index(int(node)) for node in grips[0]]
    points = np.vstack(
        [net.centroid[:bricks], net.node_position[places], net.springs.anchor[net.springs.support]]
    )
    reaction = fields.support[0]
    forces = np.vstack([net.weight[:bricks], fields.grip_force[0], reaction[:, :3]])
    moment = np.cross(points, forces).sum(axis=0) + reaction[:, 3:].sum(axis=0)
    return np.concatenate([forces.sum(axis=0), moment])


def size(net, fields):
    return np.abs(net.weight).max() + np.abs(fields.joint_wrench).max()


@pytest.mark.parametrize("engine", [ComplianceEngine, FrameEngine, DiscreteEngine])
@pytest.mark.parametrize("bricks", [2, 5, 7])
def test_the_first_end_alone_does_not(engine, bricks):
    """Negative control, and the fault: of an arch built from both sides one end was read."""
    net = build_network(from_both_sides(7))
    fields = engine(net).solve(bricks, [[3]] if bricks > 2 else HERE, Want.ALL)
    grips = np.array([[3]] if bricks > 2 else HERE)
    assert np.abs(left_over(net, bricks, grips, fields)).max() <= 1e-4 * size(net, fields)
    first = fields.support.copy()
    first[:, 1] = 0.0
    alone = replace(fields, support=first)
    assert np.abs(left_over(net, bricks, grips, alone)[:3]).max() > 0.1 * np.abs(net.weight).max()


@given(state=states(any_scene), data=st.data())
def test_the_order_of_the_ends_changes_the_axis_and_nothing_else(state, data):
    scene, bricks, grips = state
    order = data.draw(st.permutations(range(len(scene.grounds))))
    other = replace(scene, grounds=tuple(scene.grounds[i] for i in order))
    nets = [build_network(s) for s in (scene, other)]
    one, two = (ComplianceEngine(net).solve(bricks, grips, Want.ALL) for net in nets)
    limit = 1e-8 * size(nets[0], one)
    assert np.abs(two.support - one.support[:, order]).max() <= limit
    answers = [responses_of(*pair) for pair in zip(nets, (one, two), strict=True)]
    for name, value in answers[0].items():
        gap = np.abs(answers[1][name] - value).max(initial=0)
        assert gap <= (1e-8 * np.abs(one.displacement).max() if name[0] == "D" else limit), name


@given(state=states(any_scene))
def test_an_end_that_does_not_act_carries_nothing(state):
    """And one that does carries what its spring exerts, about its own fixed point."""
    scene, bricks, grips = state
    net = build_network(scene)
    fields = ComplianceEngine(net).solve(bricks, grips, Want.ALL)
    springs = net.springs
    for end, ground in enumerate(scene.grounds):
        spring, reaction = springs.support[end], fields.support[0, end]
        assert tuple(springs.anchor[spring]) == ground.anchor
        if springs.since[spring] > bricks:
            assert not reaction.any()
        force, moment = np.split(fields.joint_wrench[0, spring], 2)
        arm = skew(np.subtract(ground.position, ground.anchor))
        wanted = np.concatenate([force, moment + arm @ force])
        assert np.abs(reaction - wanted).max() <= 1e-12 * size(net, fields)


# laws that every verdict obeys
@settings(max_examples=6)
@given(
    length=st.floats(-3, 3),
    force=st.floats(-3, 3),
    offset=st.floats(0.05, 0.9),
    blocks=st.integers(2, 5),
)
def test_units_change_no_verdict(length, force, offset, blocks):
    """Lengths, and forces by density, gravity or unit, scaled by up to a thousand either way."""
    offset = offset / blocks
    assume(abs(0.5 * blocks * offset - 0.5) > 1e-3)
    plain = stack([offset] * (blocks - 1)).assembly(2000.0)
    size, pull = 10.0**length, 10.0**force
    scaled = replace(
        plain,
        centroid=plain.centroid * size,
        corner=plain.corner * size,
        weight=plain.weight * pull,
    )
    a, b = assess(plain, DRY), assess(scaled, DRY)
    assert a.verdict is b.verdict is not Verdict.UNDECIDED
    assert b.bond * size**2 / pull == pytest.approx(a.bond, rel=1e-3, abs=1e-2)
    assert b.friction == pytest.approx(a.friction, abs=2e-4)
    np.testing.assert_allclose(b.pull, a.pull, rtol=2e-3, atol=1e-5)
    assert (a.first_block, a.first_contact) == (b.first_block, b.first_contact)


@pytest.mark.slow
@settings(max_examples=15)
@given(st.lists(st.floats(-0.6, 0.6), min_size=1, max_size=4), st.floats(0.1, 1.0))
def test_more_friction_bond_or_payload_never_hurts(offsets, friction):
    leaning = stack([x or 0.1 for x in offsets]).assembly(2000.0)
    low, high = (assess(leaning, Mortar(friction=f)) for f in (friction, friction + 0.3))
    assert high.bond <= low.bond * (1 + 1e-3) + 1e-2
    end = leaning.corner[-1] + [0.0, 0.0, 1.0]
    a, b = (assess(held(leaning, p, end), DRY).bond for p in (1e2, 1e4))
    assert b <= a * (1 + 1e-3) + 1e-2


# laws of screens: more grips, payload, friction or bond never hurt; scale does not count
@st.composite
def questions(draw, grips=2):
    """A small arch, a brick count and a few grip sets, as places from 1."""
    scene = draw(arches(max_bricks=5, min_bricks=2))
    bricks = draw(st.integers(2, len(scene.bricks)))
    place = st.integers(0, 2 * bricks)
    row = st.lists(place, min_size=grips, max_size=grips, unique=True)
    return scene, bricks, np.array(draw(st.lists(row, min_size=4, max_size=4)))


def asked(scene, bricks, held, mortar=DRY, payload=150.0):
    """Verdicts found one by one, without what one set says of another."""
    out = []
    for row in held:
        try:
            out.append(Screen(scene, mortar).stands(bricks, [row], payload)[0])
        except SceneError:  # rolled so far that faces miss each other
            reject()
    return np.array(out)


def never_hurts(before, after):
    assert not ((before == STANDS) & (after == FALLS)).any()


@pytest.mark.slow
@settings(max_examples=15)
@given(questions(), st.integers(1, 10), st.floats(0.1, 1.0), st.floats(10.0, 200.0))
def test_more_never_hurts(question, extra, friction, payload):
    scene, bricks, held = question
    mortar = Mortar(friction=friction)
    before = asked(scene, bricks, held, mortar, payload)
    another = np.full((len(held), 1), min(extra, 2 * bricks))
    another[(held == another).any(axis=1)] = 0
    never_hurts(before, asked(scene, bricks, np.hstack([held, another]), mortar, payload))
    never_hurts(before, asked(scene, bricks, held, mortar, 2 * payload))
    never_hurts(before, asked(scene, bricks, held, Mortar(friction=friction + 0.3), payload))
    never_hurts(before, asked(scene, bricks, held, bond_mortar(2e3, friction), payload))


@settings(max_examples=5)
@given(questions(grips=3))
def test_what_is_learned_changes_no_verdict(question):
    """Together and one by one; and whichever robot holds which node."""
    scene, bricks, held = question
    alone = asked(scene, bricks, held)
    together = Screen(scene, DRY).stands(bricks, held, 150.0)
    swapped = Screen(scene, DRY).stands(bricks, held[:, ::-1], 150.0)
    settled = (alone != OPEN) & (together != OPEN) & (swapped != OPEN)
    assert (alone[settled] == together[settled]).all()
    assert (alone[settled] == swapped[settled]).all()


@settings(max_examples=5)
@given(questions(), st.floats(-1, 1), st.floats(-2, 2), st.floats(0, 3))
def test_units_place_and_scale_change_nothing(question, length, density, angle):
    """Weights and payloads grow alike; the arch is turned, moved, larger and of other matter."""
    scene, bricks, held = question
    size, heavy = 10.0**length, 10.0**density
    turn = about_vertical(angle)
    other = moved(scaled(scene, size, density=heavy), lambda p: turn @ p + [3.0, -2.0, 1.0])
    here = asked(scene, bricks, held)
    there = asked(other, bricks, held, payload=150.0 * heavy * size**3)
    settled = (here != OPEN) & (there != OPEN)
    assert (here[settled] == there[settled]).all()
    assert settled.any()


def test_a_law_that_is_broken_is_seen():
    with pytest.raises(AssertionError):
        never_hurts(np.array([STANDS, FALLS]), np.array([FALLS, FALLS]))
    assert replace(DRY, friction=0.1) != DRY


def test_less_tilt_never_hurts(arch25):
    network, sets = build_network(arch25), np.array([[a, 24] for a in range(2, 24, 3)])
    sets = np.vstack([sets, sets - [0, 1]])
    upright, tilted = (Screen(network, DRY, x).stands(12, sets) for x in (0.0, 0.1))
    assert (tilted == STANDS).any()
    never_hurts(tilted, upright)
