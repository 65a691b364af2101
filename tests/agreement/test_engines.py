"""Independent routes, one answer: compliance operator, stiff-bar frame, direct rigid solve."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from seqopt.contact.mortar import DRY, Mortar
from seqopt.engines.discrete import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.registry import make_engine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, SceneError, SolverError
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene
from seqopt.network.network import build_network
from seqopt.responses.table import analyze, step_fields
from seqopt.scene.scene_file import ABOUT, load_scene
from seqopt.sequence.methods import METHODS
from seqopt.stability._steps import assess_steps
from seqopt.stability.verdict import Verdict
from seqopt.study import published_plan
from tests.blocks import with_shapes
from tests.builders import apart, block, hinged, largest_difference, scaled, six_bricks
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


# the levels of fidelity: each equals the next where its condition is met, and says where not
@settings(max_examples=8)
@given(states(scenes=st.one_of(arches(max_bricks=5), walls(), both_sided())))
def test_within_the_elastic_limits_discrete_elements_are_rigid_bricks(state):
    scene, bricks, grips = state
    net = build_network(scene)
    strong = Mortar(friction=1.0, tensile_strength=1e12, cohesion=1e12)
    try:
        found = DiscreteEngine(net, strong).solve(bricks, grips, Want.ALL)
    except SceneError:  # bent so far that bricks interpenetrate
        reject()
    exact = ComplianceEngine(net).solve(bricks, grips, Want.ALL)
    assert largest_difference(found, exact, net) <= 1e-7


@pytest.mark.parametrize(
    "number", [3, 9, *(pytest.param(n, marks=pytest.mark.slow) for n in (7, 20, 24))]
)
def test_what_comes_to_rest_is_proven_to_stand(number):
    """Forces within the limits are there: the certificate must find some too, without bonds."""
    net = build_network(load_scene("arch25"))
    step = METHODS["sequential"](net)[number - 1]
    (result,) = assess_steps(net, [step], DRY)
    engine = DiscreteEngine(net, DRY)
    if result.verdict is Verdict.FALLS:
        assert number in (9, 20)
        with pytest.raises((MechanismError, SolverError)):
            engine.solve(step.bricks, [list(step.held)])
    else:
        fields = engine.solve(step.bricks, [list(step.held)])
        total = fields.grip_force[0].sum(axis=0) + fields.support[0, :, :3].sum(axis=0)
        weight = -net.weight[: step.bricks].sum(axis=0)
        assert total == pytest.approx(weight, abs=1e-6 * np.abs(weight).max())


# boxes written as polyhedra with faces of their own: the same answers by every engine
PLAIN = build_network(six_bricks())
SHAPED = build_network(with_shapes(six_bricks()))


def numbers(engine, network):
    table = analyze(make_engine(engine, network), METHODS["cantilever"](network, ()))
    return table.select_dtypes("number").to_numpy()


@pytest.mark.parametrize("engine", ["compliance", "frame", "discrete", "auto"])
def test_every_engine(engine):
    one, other = (numbers(engine, network) for network in (PLAIN, SHAPED))
    assert other == pytest.approx(one, rel=1e-7, abs=1e-7 * np.nanmax(np.abs(one)), nan_ok=True)


def test_stability():
    one, other = (
        assess_steps(network, METHODS["cantilever"](network, ())[::4], DRY, ["bond", "friction"])
        for network in (PLAIN, SHAPED)
    )
    assert [s.verdict for s in one] == [s.verdict for s in other]
    assert [s.bond for s in one] == pytest.approx([s.bond for s in other], rel=1e-6)
    assert [s.friction for s in one] == pytest.approx([s.friction for s in other], rel=1e-6)


def moved_nodes(scene, *offsets):
    """A scene whose second brick is held where offsets from its centroid say."""
    bricks = [replace(b, node_offsets=offsets) if b.name == 2 else b for b in scene.bricks]
    return build_network(replace(scene, bricks=tuple(bricks)))


@pytest.mark.parametrize("shares", [(-0.1, 0.4), (0.05, 0.3)])
def test_weights_act_at_centroids_wherever_nodes_are(shares):
    """Nodes on the long axis but not on either side: exact bricks and frame find the same."""
    scene = six_bricks("V")
    brick = scene.bricks[1]
    along = np.multiply(brick.dimensions[0], brick.length_axis)
    network = moved_nodes(scene, *(tuple(share * along) for share in shares))
    one, other = (numbers(engine, network) for engine in ("compliance", "frame"))
    assert one == pytest.approx(other, rel=1e-6, abs=1e-6 * np.nanmax(np.abs(one)), nan_ok=True)
    free = make_engine("compliance", network).solve(4, np.zeros((1, 0), int))
    plain = make_engine("compliance", build_network(scene)).solve(4, np.zeros((1, 0), int))
    assert free.support == pytest.approx(plain.support, rel=1e-9, abs=1e-9)
    assert free.brick_twist == pytest.approx(plain.brick_twist, rel=1e-9, abs=1e-18)


def test_nodes_above_the_centroid_will_do_and_nodes_beside_it_not():
    scene = six_bricks("V")
    moved_nodes(scene, (-0.05, 0.0, 0.05), (0.05, 0.0, 0.05)).inner_weight.sum()
    network = moved_nodes(scene, (-0.05, 0.05, 0.0), (0.05, 0.05, 0.0))
    with pytest.raises(SceneError, match="weight turns it about the line through its nodes"):
        network.inner_weight.sum()


# partial structures of all kinds: the engine agrees with an independent dense solver to 1e-9
LARGEST = 1e-9  # difference over the largest entry of its kind
EVERY = {"sequential": 1, "cantilever": 10}
ARMADILLO = "armadillo_cra"
LARGE = ("vault338", "dome163", ARMADILLO)
WORDS = (
    "arch:span=2,rise=0.8",
    "arch:span=3,rise=1.2,curve=catenary",
    "vault:span=2,rise=0.8,columns=3",
    "wall:columns=6,courses=5",
    "wall:columns=5,courses=4,corbel=0.02",
)


def scene_of(name):
    """A scene by name or words; the armadillo is imported."""
    if name != ARMADILLO:
        return load_scene(name)
    pytest.importorskip("compas_cra")
    folder = Path(import_module("compas_cra").SAMPLE)
    given = Given(unit="m", density=2400.0, accept_overlaps=True)
    return import_scene(folder / f"{name}.json", given=given)


def marks(name):
    """Quick, slow or for a release."""
    slow = [] if name == WORDS[0] else [pytest.mark.slow]
    return [*slow, *[pytest.mark.long] * (name in LARGE)]


@pytest.mark.filterwarnings("ignore::seqopt.errors.SceneWarning")  # of the armadillo
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=marks(n)) for n in (*ABOUT, *WORDS, ARMADILLO)]
)
def test_the_engine_agrees_with_a_dense_solver(name):
    network = build_network(scene_of(name))
    engine = ComplianceEngine(network)
    for method, every in EVERY.items():
        steps = METHODS[method](network)
        first = {step.bricks: step for step in reversed(steps)}
        few = 60 if name in LARGE else every
        for step in [first[bricks] for bricks in sorted(first)[::few]] + [steps[-1]]:
            held = np.array([step.held], dtype=np.int64).reshape(1, -1)
            wanted = solve_dense(network, step.bricks, grip_columns(network, step.bricks, held))
            gap = apart(engine.solve(step.bricks, held, Want.ALL), wanted)
            assert gap <= LARGEST, (method, step.number)


def test_a_field_that_is_off_is_seen(engine25):
    fields = solve_dense(engine25.network, 5, np.array([[8]]))
    wrong = replace(fields, displacement=fields.displacement * (1 + 2 * LARGEST))
    assert apart(fields, fields) == 0
    assert apart(wrong, fields) > LARGEST
