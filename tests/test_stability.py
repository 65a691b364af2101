"""Equilibrium certificates: textbook limits, laws of scale, and solvers that lie."""

from __future__ import annotations

from dataclasses import replace
from math import atan, cos, radians, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import assume, given, reject
from hypothesis import strategies as st

from experiments.stability.parts.blocks import Blocks, Contact, ring, stack, touching
from formulations.limit_analysis import compile_equilibrium
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY, EPOXY, Mortar
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.network.network import GROUND
from seqopt.sequence.steps import Step, StepKind
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import Verdict, assess, bonded, sideways
from seqopt.stability.limit_analysis import CAP, EXACT, Answer, Case, Claim, Sense, bound, violation
from seqopt.stability.prover import Prover, proven_value
from tests.scenes import arches, moved

ROUGH = Mortar(friction=5.0)
STRONG = Mortar(friction=0.5, tensile_strength=1e9, cohesion=1e9)


def inclined(angle):
    """A cube on the ground, gravity turned by an angle about y."""
    cube = stack([]).assembly(2000.0)
    size = np.linalg.norm(cube.weight)
    return replace(cube, weight=size * np.array([[sin(angle), 0.0, -cos(angle)]]))


def ladder(half_span, height):
    """Two weightless bars that lean on each other, each with 1 N in its middle: three hinges."""
    edge = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1e-9, 1.0, 0.0], [1e-9, 0.0, 0.0]])
    upright = edge[:, [2, 1, 0]]
    foot = Contact((GROUND, 0), edge - np.array([half_span, 0, 0]))
    other = Contact((GROUND, 1), edge + np.array([half_span, 0, 0]))
    crown = Contact((0, 1), upright + np.array([0, 0, height]))
    centroid = np.array([[-half_span / 2, 0.5, height / 2], [half_span / 2, 0.5, height / 2]])
    weight = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
    return touching(centroid, weight, [foot, other, crown])


def held(assembly, payload, *points):
    """The assembly with its last block held at points."""
    last = len(assembly.centroid) - 1
    return replace(
        assembly,
        grip_block=np.full(len(points), last),
        grip_position=np.array(points, float).reshape(-1, 3),
        payload=np.full(len(points), payload),
    )


# validation: closed forms


@pytest.mark.parametrize("degrees", [5.0, 20.0, 35.0])
def test_a_block_slides_at_the_friction_angle(degrees):
    result = assess(inclined(radians(degrees)), DRY)
    assert result.verdict is (Verdict.STANDS if degrees < 25 else Verdict.FALLS)
    assert result.friction == pytest.approx(tan(radians(degrees)), abs=2e-4)


def test_a_cube_tips_or_slides_sideways():
    cube = stack([]).assembly(2000.0)
    assert assess(cube, DRY).tilt == pytest.approx(radians(25.0), abs=1e-5)
    assert assess(cube, ROUGH).tilt == pytest.approx(atan(1.0), abs=1e-5)


@pytest.mark.parametrize("blocks", [2, 3, 6])
def test_the_leaning_stack_is_harmonic(blocks):
    """The largest overhang of n equal blocks, half a length over 1, 2, 3 … from the top."""
    limit = [0.5 / i for i in range(blocks - 1, 0, -1)]
    for factor, verdict in ((0.999, Verdict.STANDS), (1.001, Verdict.FALLS)):
        leaning = stack([factor * x for x in limit]).assembly(1800.0)
        assert assess(leaning, DRY).verdict is verdict


def test_the_overhanging_block_needs_a_bond_and_goes_first():
    """Moments about the edge: weight times excess = bond times face times half its length."""
    excess = 0.1
    leaning = stack([0.5 + excess]).assembly(2000.0)
    face = 0.5 - excess
    weight = 2000.0 * 9.81
    result = assess(leaning, DRY)
    assert result.bond == pytest.approx(weight * excess / (face * face / 2), rel=1e-4)
    assert (result.first_block, result.first_contact) == ("2", "1-2")
    assert np.isnan(result.tilt)
    strong = replace(DRY, tensile_strength=1.01 * result.bond, cohesion=2 * result.bond)
    assert assess(leaning, strong).verdict is Verdict.STANDS
    weak = replace(DRY, tensile_strength=0.99 * result.bond, cohesion=2 * result.bond)
    assert assess(leaning, weak).verdict is Verdict.FALLS


def test_least_thickness_of_a_semicircular_arch():
    """t/R = 0.1075 (Milankovitch 1907; Heyman 1969), and sliding needs friction below 0.4."""
    for ratio, verdict in ((0.107, Verdict.FALLS), (0.108, Verdict.STANDS)):
        result = assess(ring(60, 5.0, 5.0 * ratio).assembly(2400.0), Mortar(friction=0.7))
        assert result.verdict is verdict
    assert 0.38 < result.friction < 0.40


@pytest.mark.parametrize(("half_span", "height"), [(1.0, 1.0), (1.0, 2.5), (2.0, 1.5)])
def test_three_hinges(half_span, height):
    """Friction under the feet, and the sideways pull at which a foot or the crown slides.

    By moments about the hinges, with 1 N in the middle of each bar.
    """
    bars = ladder(half_span, height)
    slope = half_span / height
    result = assess(bars, Mortar(friction=2.0))
    assert result.friction == pytest.approx(slope / 2, abs=2e-4)
    windward = (2.0 + slope / 2) / (1 + 1 / slope)
    leeward = (2.0 - slope / 2) / (1 - 1 / slope) if slope > 1 else np.inf
    crown = 2.0 * slope**2
    expected = min(windward, leeward, crown)
    assert result.pull[0] == pytest.approx(expected, rel=1e-4)
    assert result.pull[0] == pytest.approx(result.pull[4], rel=1e-4)


def test_a_robot_carries_what_the_lever_says():
    """A block beside its support, held at a point: the robot takes the moment about the edge."""
    leaning = stack([0.6]).assembly(2000.0)
    weight = 2000.0 * 9.81
    hand = held(leaning, 0.3 * weight, (1.6, 0.5, 1.5))
    lever = 1.6 - 1.0  # from the edge of the block below
    result = assess(hand, ROUGH)
    assert result.verdict is Verdict.STANDS
    least = weight * 0.1 / sqrt(lever**2 + 0.5**2)  # at right angles to the lever
    assert result.grip == pytest.approx(least, rel=1e-3)
    assert assess(held(leaning, 0.99 * least, (1.6, 0.5, 1.5)), ROUGH).verdict is Verdict.FALLS


def test_a_block_that_only_a_robot_holds():
    """No bond and no friction helps; the grip must be above or below the centroid."""
    alone = Assembly(
        block_name=(1,),
        centroid=np.zeros((1, 3)),
        weight=np.array([[0.0, 0.0, -10.0]]),
        contact_name=(),
        bodies=np.empty((0, 2), dtype=np.int64),
        normal=np.empty((0, 3)),
        corner=np.empty((0, 3)),
        contact=np.empty(0, dtype=np.int64),
        grip_block=np.array([0]),
        grip_position=np.array([[0.0, 0.0, 0.5]]),
        payload=np.array([10.1]),
    )
    assert assess(alone, EPOXY).verdict is Verdict.STANDS
    assert assess(alone, EPOXY).grip == pytest.approx(10.0, rel=1e-4)
    beside = assess(held(alone, 100.0, (0.2, 0.0, 0.0)), EPOXY)
    assert beside.verdict is Verdict.FALLS
    assert beside.bond == beside.friction == beside.grip == np.inf
    assert beside.first_block == "1"
    weak = assess(held(alone, 9.9, (0.0, 0.0, 0.5)), EPOXY)
    assert weak.verdict is Verdict.FALLS
    assert weak.grip == pytest.approx(10.0, rel=1e-4)


# laws


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


@pytest.mark.parametrize("density", [1e-3, 1.0, 1e3, 2420.0, 1e6])
@pytest.mark.parametrize(
    ("half_angle", "verdict"), [(90.0, Verdict.STANDS), (120.0, Verdict.FALLS)]
)
def test_density_does_not_flip_an_arch(density, half_angle, verdict):
    """25 blocks, thickness 1 on span 10."""
    radius = 5.0 / sin(radians(min(half_angle, 90.0)))
    arch = ring(25, radius, 1.0, radians(half_angle)).assembly(density)
    assert assess(arch, Mortar(friction=0.7)).verdict is verdict


@given(arches(), st.integers(0, 1))
def test_where_the_scene_stands_changes_nothing(scene, grips):
    angle = 0.7
    turn = np.array([[cos(angle), -sin(angle), 0], [sin(angle), cos(angle), 0], [0, 0, 1.0]])
    last = scene.placed[-1].nodes[1]
    step = Step(1, StepKind.PLACE, len(scene.bricks), (last if grips else None, None, None))
    try:
        here = step_assembly(build_network(scene), step.bricks, step.grips)
    except SceneError:  # rolled so far that faces miss each other
        reject()
    there = step_assembly(
        build_network(moved(scene, lambda p: turn @ p + [3.0, -2.0, 1.0])), step.bricks, step.grips
    )
    a, b = (Prover(x, compile_equilibrium)(bonded(x, DRY)).value for x in (here, there))
    assert a == pytest.approx(b, rel=2e-3, abs=1e-5)


@given(st.lists(st.floats(-0.6, 0.6), min_size=1, max_size=4), st.floats(0.1, 1.0))
def test_more_friction_bond_or_payload_never_hurts(offsets, friction):
    leaning = stack([x or 0.1 for x in offsets]).assembly(2000.0)
    low, high = (assess(leaning, Mortar(friction=f)) for f in (friction, friction + 0.3))
    assert high.bond <= low.bond * (1 + 1e-3) + 1e-2
    end = leaning.corner[-1] + [0.0, 0.0, 1.0]
    a, b = (assess(held(leaning, p, end), DRY).bond for p in (1e2, 1e4))
    assert b <= a * (1 + 1e-3) + 1e-2


# agreement: the linear program of plane statics, by another solver


def plane_bond(assembly, friction):
    """Least bond of blocks in a plane by scipy's simplex: Coulomb is linear there."""
    from scipy.optimize import linprog  # noqa: PLC0415

    k = len(assembly.corner)
    along = np.abs(assembly.axes[assembly.contact] @ [0.0, 1.0, 0.0]) < 1e-9
    share = assembly.corner_area * assembly.stress_scale / assembly.scales[0]
    matrix = assembly.contact_map.toarray()
    equal = np.hstack([matrix, np.zeros((len(matrix), 1))])
    rows, right = [], []
    for i in range(k):
        row = np.zeros(3 * k + 1)
        row[3 * i], row[-1] = -1.0, -share[i]
        rows.append(row)
        for j in (1, 2):
            if along[i, j]:
                for sign in (1.0, -1.0):
                    row = np.zeros(3 * k + 1)
                    row[3 * i + j], row[3 * i], row[-1] = (
                        sign,
                        -friction,
                        -share[i] * (1 + friction),
                    )
                    rows.append(row)
            else:
                for sign in (1.0, -1.0):
                    row = np.zeros(3 * k + 1)
                    row[3 * i + j] = sign
                    rows.append(row)
        right = np.zeros(len(rows))
    cost = np.eye(3 * k + 1)[-1]
    bounds = [(None, None)] * (3 * k) + [(0, None)]
    answer = linprog(
        cost, np.array(rows), right, equal, -assembly.load(), bounds=bounds, method="highs"
    )
    assert answer.status == 0
    return answer.fun


@pytest.mark.parametrize("friction", [0.2, 0.6])
@pytest.mark.parametrize(
    "blocks", [stack([0.7]), stack([0.3, 0.4, -0.1]), ring(9, 5.0, 0.4), ring(6, 5.0, 1.5)]
)
def test_a_simplex_finds_the_same_bond(blocks, friction):
    assembly = blocks.assembly(2000.0)
    own = Prover(assembly, compile_equilibrium)(bonded(assembly, Mortar(friction=friction)))
    assert own.value == pytest.approx(plane_bond(assembly, friction), rel=1e-4, abs=1e-6)


# solvers that lie


def liar(change):
    """A compiler whose programs change what the true one answers."""

    def compiled(assembly):
        program = compile_equilibrium(assembly)
        return lambda case, attempt: change(program(case, attempt), assembly)

    return compiled


LIES = {
    "zeros": lambda a, _: replace(
        a,
        value=0.0,
        contact_force=0 * a.contact_force,
        grip_force=0 * a.grip_force,
        motion=0 * a.motion,
    ),
    "NaN": lambda a, _: replace(
        a, value=np.nan, contact_force=np.nan * a.contact_force, motion=np.nan * a.motion
    ),
    "no forces, true motion": lambda a, _: replace(a, contact_force=0 * a.contact_force),
    "NaN forces": lambda a, _: replace(a, contact_force=np.nan * a.contact_force),
    "infinite motion": lambda a, _: replace(a, motion=np.inf * np.ones_like(a.motion)),
    "a motion from elsewhere": lambda a, _: replace(a, motion=a.motion[::-1] + 1.0),
    "a smaller value": lambda a, _: replace(a, value=0.5 * a.value),
    "says infeasible": lambda a, _: replace(a, claim=Claim.INFEASIBLE, value=np.nan),
    "stalls": lambda a, _: replace(a, claim=Claim.STALLED, value=np.nan),
}


@pytest.mark.parametrize("lie", LIES)
@pytest.mark.parametrize("falls", [True, False])
def test_a_lie_is_not_believed(lie, falls):
    """It may leave the verdict open; it never turns it."""
    leaning = stack([0.7 if falls else 0.2]).assembly(2000.0)
    result = assess(leaning, DRY, compiled=liar(LIES[lie]))
    truth = Verdict.FALLS if falls else Verdict.STANDS
    assert result.verdict in (Verdict.UNDECIDED, truth)
    if falls:
        assert result.verdict is Verdict.UNDECIDED
        assert result.unproven
        assert not result.motion.any()


def test_the_truth_is_believed():
    leaning = stack([0.7]).assembly(2000.0)
    assert assess(leaning, DRY, compiled=liar(lambda a, _: a)).verdict is Verdict.FALLS


def test_almost_solved_is_counted_and_put_to_the_proof():
    leaning = stack([0.7]).assembly(2000.0)
    almost = liar(lambda a, _: replace(a, claim=Claim.ALMOST))
    result = assess(leaning, DRY, compiled=almost)
    assert result.verdict is Verdict.FALLS
    assert set(result.claims) == {Claim.ALMOST}


def test_a_time_limit_is_a_stall(monkeypatch):
    """The solver itself reaches its limit; that is counted, and no verdict."""
    monkeypatch.setattr("formulations.solvers.SECONDS", 1e-9)
    result = assess(ring(20, 5.0, 0.6).assembly(2000.0), DRY)
    assert result.verdict is Verdict.UNDECIDED
    assert (
        result.claims[Claim.STALLED] == sum(result.claims.values()) == 2 * result.unproven
    )  # two attempts each


def test_proofs_are_the_assemblys_own():
    """Forces of another load, and a motion that closes a contact, prove nothing."""
    light, heavy = stack([0.7]).assembly(1000.0), stack([0.6]).assembly(1000.0)
    case = bonded(light, DRY)
    answer = compile_equilibrium(light)(case)
    assert violation(light, case, answer) < EXACT < 1e-2 < violation(heavy, case, answer)
    assert bound(light, case, answer) == pytest.approx(answer.value, rel=1e-4)
    closing = replace(answer, motion=-answer.motion)
    assert bound(light, case, closing) == 0.0
    assert np.isnan(proven_value(light, case, closing))


# scenes


def test_bricks_touch_where_their_faces_overlap(arch25):
    """The study's joints are 116 × 53 mm; tilted bricks meet a little off."""
    net = build_network(arch25)
    last = METHODS["sequential"](net)[-1]
    whole = step_assembly(net, last.bricks, last.grips)
    assert len(whole.area) == 26
    assert np.median(whole.area) == pytest.approx(0.116 * 0.053, rel=0.02)
    assert whole.area.min() > 0.75 * 0.116 * 0.053  # at the crown, where brick 13 turns out of line
    plane = np.einsum(
        "ki,ki->k", whole.corner - net.springs.position[whole.contact], whole.normal[whole.contact]
    )
    assert np.abs(plane).max() < 1e-12


def test_a_joint_beside_its_bricks_is_named(arch25):
    joints = (
        *arch25.joints[:3],
        replace(arch25.joints[3], along=(0.0, 1.0, 0.0), across=(1.0, 0.0, 0.0)),
    )
    wrong = replace(arch25, joints=(*joints, *arch25.joints[4:]))
    with pytest.raises(SceneError, match="joint 4-5: the faces of its bricks do not overlap"):
        step_assembly(build_network(wrong), 6, (None, None, None))


@pytest.mark.parametrize("method", METHODS)
def test_every_published_step_is_decided(arch25, method):
    """Every seventh here; all of them in the experiment."""
    net = build_network(arch25)
    for step in METHODS[method](net)[::7]:
        assembly = step_assembly(net, step.bricks, step.grips)
        assert assess(assembly, EPOXY).verdict is Verdict.STANDS
        assert assess(assembly, DRY).verdict is not Verdict.UNDECIDED


def test_sideways_pulls_are_at_right_angles_to_gravity():
    up = (0.6, 0.0, 0.8)
    fixed = Case(sense=Sense.SMALLEST, friction=0.5, tension=(0.0, 0.0), cohesion=(0.0, 0.0))
    pulls = np.array([case.pull for case in sideways(fixed, up)])
    np.testing.assert_allclose(pulls @ up, 0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(pulls, axis=1), 1, atol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"corner": np.zeros((8, 3))}, "contact ground-1: its face has no area"),
        ({"weight": np.full((2, 3), np.nan)}, "weight holds a number that is not finite"),
        ({"bodies": np.array([[GROUND, 0], [0, 2]])}, "beyond 0 to 1"),
        ({"bodies": np.array([[0, GROUND], [0, 1]])}, "name it first"),
    ],
)
def test_a_wrong_assembly_is_named(change, message):
    with pytest.raises(SceneError, match=message):
        replace(stack([0.1]).assembly(2000.0), **change)


def test_a_wrong_mortar_is_named():
    with pytest.raises(SceneError, match=r"mortar: friction is -1.0; give a number"):
        Mortar(friction=-1.0)


def test_a_ring_of_blocks_has_its_volume():
    """The builder itself: a half ring of many blocks."""
    weight = -ring(400, 5.0, 1.0).assembly(1.0, gravity=1.0).weight[:, 2].sum()
    assert weight == pytest.approx(np.pi * 5.0, rel=1e-4)
    assert isinstance(ring(3, 1.0, 0.1), Blocks)
    assert CAP > 1
    assert Answer  # the protocol's value is public
