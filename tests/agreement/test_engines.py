"""Independent routes, one answer: compliance operator, stiff-bar frame, direct rigid solve."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, SolverError
from seqopt.network.build import build_network
from seqopt.responses.table import step_fields
from seqopt.sequence.methods import METHODS
from seqopt.study.published import published_plan
from tests.builders import block, hinged, scaled
from tests.direct_solve import solve_dense
from tests.strategies import arches, both_sided, loosened, states, walls

FIELDS = ("edge_force", "displacement", "grip_force", "support", "joint_wrench", "brick_twist")


def gap(a, b, name):
    """Largest difference of a field relative to its largest entry."""
    x, y = getattr(a, name), getattr(b, name)
    assert x.shape == y.shape
    return np.abs(x - y).max(initial=0) / max(np.abs(y).max(initial=0), 1e-300)


@pytest.fixture(scope="module")
def published(arch25, engine25):
    """Every state of the two tables and the published plan, once."""
    steps = [s for m in METHODS.values() for s in m(engine25.network)] + list(
        published_plan(arch25)
    )
    return list({(s.bricks, frozenset(s.held)): s for s in steps}.values())


def test_published_states_agree_with_the_frame(engine25, published):
    """At its best contrast the frame and the exactly rigid bricks differ by less than 5e-6."""
    frame = FrameEngine(engine25.network)
    worst = dict.fromkeys(FIELDS[:4], 0.0)
    for step in published[::3]:
        a, b = step_fields(engine25, step), step_fields(frame, step)
        for name in worst:
            worst[name] = max(worst[name], gap(b, a, name))
    assert len(published) > 150
    assert max(worst.values()) <= 5e-6, worst


def test_soft_bars_are_seen(engine25, published):
    """Negative control: a contrast of 1e3 is far outside the agreement."""
    soft = FrameEngine(engine25.network, contrast=1e3)
    step = published[40]
    assert gap(step_fields(soft, step), step_fields(engine25, step), "displacement") > 1e-4


@settings(max_examples=8)
@given(state=states(st.one_of(arches(), walls(), both_sided())))
def test_three_routes_agree(state):
    scene, bricks, grips = state
    net = build_network(scene)
    fast = ComplianceEngine(net).solve(bricks, grips, Want.ALL)
    direct = solve_dense(net, bricks, grip_columns(net, bricks, grips))
    frame = FrameEngine(net, contrast=1e6).solve(bricks, grips)  # joints here differ 100-fold
    free = np.abs(ComplianceEngine(net).solve(bricks, np.zeros((1, 0), int)).displacement).max()
    force = np.abs(net.weight).max() + np.abs(fast.joint_wrench).max()
    for other, tolerance in ((direct, 1e-9), (frame, 1e-4)):
        for name in FIELDS:
            difference = np.abs(getattr(other, name) - getattr(fast, name))
            if name == "brick_twist":
                difference = difference[..., :3]  # rotations have a unit of their own
            scale = free if name in ("displacement", "brick_twist") else force
            assert difference.max(initial=0) <= tolerance * scale, name


def answered(solve, *asked):
    """Return an answer, or the kind of error that a route raises."""
    try:
        return solve(*asked)
    except (MechanismError, SolverError) as error:
        return type(error)


@settings(max_examples=15)
@given(state=states(loosened(st.one_of(arches(), walls())), max_grips=6))
def test_three_routes_agree_where_joints_are_loose(state):
    """Islands, hinges and loops of them; what one route calls a mechanism, the others do."""
    scene, bricks, grips = state
    net = build_network(scene)
    fast = answered(ComplianceEngine(net).solve, bricks, grips, Want.ALL)
    direct = answered(solve_dense, net, bricks, grip_columns(net, bricks, grips))
    frame = answered(FrameEngine(net, contrast=1e6).solve, bricks, grips)
    for other, tolerance in ((direct, 1e-9), (frame, 5e-4)):
        if isinstance(fast, type) or isinstance(other, type):
            assert fast is other or SolverError in (fast, other)
            continue
        force = np.abs(net.weight).max() + np.abs(fast.joint_wrench).max()
        moved = np.abs(fast.displacement).max()
        soft = np.abs(net.weight).max() / net.springs.translational_stiffness.max()
        for name in FIELDS[:5]:
            difference = np.abs(getattr(other, name) - getattr(fast, name)).max(initial=0)
            scale = max(moved, soft) if name == "displacement" else force
            assert difference <= tolerance * scale, name


@settings(max_examples=6)
@given(state=states(max_grips=3), data=st.data())
def test_a_batch_equals_its_sets_one_by_one(state, data):
    scene, bricks, grips = state
    engine = ComplianceEngine(build_network(scene))
    nodes = [n for b in scene.placed[:bricks] for n in b.nodes if n not in scene.blocked_nodes]
    count = grips.shape[1]
    one = st.lists(st.sampled_from(nodes), min_size=count, max_size=count, unique=True)
    rows = data.draw(st.lists(one, min_size=1, max_size=5))
    batch = np.array(rows, int).reshape(len(rows), count)
    whole = engine.solve(bricks, batch, Want.ALL)
    for i, row in enumerate(batch):
        single = engine.solve(bricks, row[None], Want.ALL)
        for name in FIELDS:
            a, b = getattr(whole, name)[i], getattr(single, name)[0]
            assert np.abs(a - b).max(initial=0) <= 1e-9 * np.abs(b).max(initial=1e-300)


@pytest.mark.parametrize("engine_type", [ComplianceEngine, FrameEngine])
@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_mechanisms_are_told_from_sound_structures(arch25, engine_type, factor):
    """A hinge below one grip is a mechanism, below two it is not; in any unit of length."""
    engine = engine_type(build_network(scaled(hinged(arch25, 3), length=factor)))
    for grips in ([[]], [[47]]):
        with pytest.raises(MechanismError) as caught:
            engine.solve(24, np.array(grips, dtype=int).reshape(1, -1))
        names = [name for name, _ in caught.value.mode]
        shape = np.array([row for _, row in caught.value.mode])
        assert names == list(range(1, 25))
        assert np.abs(shape).max() == pytest.approx(1)
        assert np.abs(shape[:4]).max() < 1e-6  # what stands below the hinge does not move
    fields = engine.solve(24, [[47, 43]])
    assert np.isfinite(fields.displacement).all()


def test_the_frame_says_when_it_fails(engine25):
    """Beyond any use of double precision the answer is a solver's failure, not a verdict."""
    with pytest.raises(SolverError, match="contrast"):
        FrameEngine(engine25.network, contrast=1e14).solve(25, [[1, 25, 49]])


@pytest.mark.parametrize("engine_type", [ComplianceEngine, FrameEngine])
@pytest.mark.parametrize("grips", [[], [1], [1, 2]])
def test_a_brick_on_springs_without_stiffness_is_loose(engine_type, grips):
    """Where nothing holds it either, no row at all says what resists."""
    none = {f"{way}_stiffness": (0.0, 0.0, 0.0) for way in ("translational", "rotational")}
    with pytest.raises(MechanismError, match="nothing resists a motion of brick 1"):
        engine_type(build_network(block(**none))).solve(1, [grips])
