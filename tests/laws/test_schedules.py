"""Laws of methods and schedules, with any robots on any build: possible, held, never adrift."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.harness.scenes import running_bond
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import GROUND
from seqopt.responses.quantities import CHOSEN_BY, lengths
from seqopt.sequence.methods import METHODS, SCHEDULES
from seqopt.sequence.schedule import islands
from seqopt.sequence.schedule_file import parse_schedule, schedule_text
from seqopt.sequence.steps import StepKind, check_sequence
from tests.builders import anywhere, branch, from_both_ends, small_arch
from tests.strategies import arches, both_sided, builds


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


@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.parametrize(
    "scene", [running_bond(3, 3), from_both_ends(9), branch()], ids=lambda s: s.name
)
@pytest.mark.parametrize("name", [*METHODS, *SCHEDULES])
def test_robots_that_reach_everything_build_everything(name, scene, count):
    network = build_network(replace(scene, robots=anywhere(count)))
    least = 3 if name in {"three-robot", "modified-sequential"} else 2
    if count < least:
        with pytest.raises(StepError, match="needs three"):
            (METHODS | SCHEDULES)[name](network)
        return
    steps = possible((METHODS | SCHEDULES)[name], network, lambda free: free[0])
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
