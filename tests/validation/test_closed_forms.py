"""Level chains of bricks and single bricks, solved by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from seqopt.contact.mortar import DRY, BedStiffness, Mortar
from seqopt.engines.discrete import DiscreteEngine, _build_system, _held_nodes, _settle
from seqopt.engines.interface import RIGID, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError
from seqopt.network.network import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.sequence.methods import METHODS
from seqopt.study import STUDY_BED
from tests.builders import HERE, block


def horizontal(count, joint_t=1e8, joint_r=1e6):
    shape = ArchShape(
        pitch=[0.0] * count,
        pattern="V",
        gap=0.0,
        translational_stiffness=(joint_t,) * 3,
        rotational_stiffness=(joint_r,) * 3,
        closed=False,
        stub=0.05,
    )
    return arch_scene(shape)


@pytest.mark.parametrize("count", [1, 5, 40])
def test_cantilever_closed_form(count):
    """A level cantilever of rigid bricks: moments and shears at the joints, summed by hand.

    Joint j (at j L) carries (n-j) W and, about itself, W L (n-j)^2 / 2; the far inner node of the
    last brick at x = (n - 1/4) L sinks by the sum of shear / k and moment (x - j L) / k_r.
    """
    scene = horizontal(count)
    engine = ComplianceEngine(build_network(scene))
    fields = engine.solve(count, np.zeros((1, 0), dtype=int))
    length, weight = scene.bricks[0].dimensions[0], scene.bricks[0].mass * 9.81
    beyond = count - np.arange(count)
    moment = weight * length * beyond**2 / 2
    tip = (count - 0.25) * length
    sink = (weight * beyond / 1e8 + moment * (tip - np.arange(count) * length) / 1e6).sum()
    node = engine.network.node_name.index(2 * count - 1)
    assert fields.displacement[0, node, 2] == pytest.approx(-sink, rel=1e-12)
    assert fields.support[0, 0, 2] == pytest.approx(count * weight, rel=1e-12)
    about_anchor = moment[0] + count * weight * 0.05
    assert np.linalg.norm(fields.support[0, 0, 3:]) == pytest.approx(about_anchor, rel=1e-12)


def test_propped_cantilever_closed_form():
    """A level cantilever propped at one node: reaction = free displacement / flexibility there."""
    count = 6
    scene = horizontal(count)
    engine = ComplianceEngine(build_network(scene))
    length, weight = scene.bricks[0].dimensions[0], scene.bricks[0].mass * 9.81
    joints = np.arange(count) * length
    arm = (count - 0.25) * length - joints
    beyond = count - np.arange(count)
    sink = (weight * beyond / 1e8 + weight * length * beyond**2 / 2 * arm / 1e6).sum()
    give = (1 / 1e8 + arm**2 / 1e6).sum()
    fields = engine.solve(count, [[2 * count - 1]])
    assert fields.grip_force[0, 0, 2] == pytest.approx(sink / give, rel=1e-12)


def test_a_brick_hanging_from_its_upper_half():
    """A.1 step 1: half the weight hangs below the grip, W/2 cos(lean) along the inner edge."""
    lean = np.radians(11.4)
    scene = arch_scene(ArchShape(pitch=[np.pi / 2 - lean], closed=False))
    fields = ComplianceEngine(build_network(scene)).solve(1, [[1]])
    half = scene.bricks[0].mass * 9.81 / 2
    assert half == pytest.approx(17.95, abs=0.01)
    joint = np.abs(fields.support[0, 0, :3]).max()
    assert fields.edge_force.max() == pytest.approx(half * np.cos(lean), abs=0.1 * joint + 1e-9)
    assert round(fields.edge_force.max(), 1) == pytest.approx(17.6)


def test_robots_carry_a_level_beam_by_symmetry():
    """Between a ground end and its mirror image, a lone middle grip takes no moment of either."""
    count = 5
    scene = horizontal(count)
    last = scene.grounds[0]
    far = (count * 0.246, 0.0, 0.0)
    other = replace(last, brick=count, position=far, anchor=(far[0] + 0.05, 0.0, 0.0))
    net = build_network(replace(scene, grounds=(last, other)))
    fields = ComplianceEngine(net).solve(count, np.zeros((1, 0), dtype=int))
    weight = count * scene.bricks[0].mass * 9.81
    assert fields.support[0, :, 2] == pytest.approx(weight / 2, rel=1e-9)
    assert np.ptp(np.abs(fields.support[0]), axis=0) == pytest.approx(0, abs=1e-9 * weight)
    motion = fields.displacement[0, net.inner.ravel(), 2]
    assert motion == pytest.approx(motion[::-1], rel=1e-9)


# the reference arch held softly, as a separate dense computation of springs at the grips gave it
TABLE = {  # stiffness: largest force and displacement, sequential and cantilever
    None: ((406, 306), (409, 15.7)),
    1e7: ((401, 311), (405, 66)),
    1e6: ((363, 488), (371, 379)),
    3e5: ((301, 1069), (311, 1076)),
}


def largest(network, method):
    """The largest force of a grip and displacement of a brick's node over the steps of a method."""
    engine, most = ComplianceEngine(network), np.zeros(2)
    for step in METHODS[method](network):
        held = network.scene.grip_numbers(step.grips, step.bricks)
        found = engine.solve(step.bricks, [held], Want.DISPLACEMENTS)
        moved = found.displacement[0, network.inner[: step.bricks].ravel()]
        force = np.linalg.norm(found.grip_force[0], axis=1).max(initial=0.0)
        most = np.maximum(most, [force, 1e6 * np.linalg.norm(moved, axis=1).max()])
    return most


@pytest.mark.parametrize("stiffness", TABLE)
def test_sequences_of_the_arch_held_softly(arch25, stiffness):
    network = build_network(arch25.with_grips(stiffness))
    for method, (force, moved) in zip(("sequential", "cantilever"), TABLE[stiffness], strict=True):
        found = largest(network, method)
        assert found[0] == pytest.approx(force, abs=0.5)
        assert found[1] == pytest.approx(moved, abs=0.05 if moved < 20 else 0.5)


# one block on its ground: friction, toppling, bonds and beds of springs in closed form
@pytest.mark.parametrize("angle", [20.0, 24.9, 25.1, 30.0])
def test_a_block_slides_beyond_the_angle_of_friction(angle):
    scene = block(lean=math.radians(angle))
    engine = DiscreteEngine(build_network(scene), DRY)  # 25 degrees
    if angle > 25:
        with pytest.raises(
            MechanismError, match="1 bricks: joints open or slip and brick 1 becomes unstable"
        ):
            engine.solve(1, HERE)
    else:
        force = engine.solve(1, HERE).support[0, 0, :3]
        assert force == pytest.approx([0, 0, scene.bricks[0].mass * 9.81], abs=1e-6)


@pytest.mark.parametrize("height", [0.5, 0.65])
def test_a_slender_block_topples(height):
    """It stands while its weight stays over its base: tan(35°) = 0.7, a base of 0.4."""
    scene = block((0.4, 0.3, height), lean=math.radians(35))
    engine = DiscreteEngine(build_network(scene), Mortar(friction=2.0))
    if height > 0.4 / math.tan(math.radians(35)):
        with pytest.raises(MechanismError):
            engine.solve(1, HERE)
    else:
        engine.solve(1, HERE)


def test_an_open_base_tilts_as_statics_says():
    """A resultant at e from the middle presses on c = 3 (b/2 - e) of a base without tension."""
    size, lean, stiffness = (0.4, 0.3, 0.5), math.radians(25), 1e9
    net = build_network(block(size, lean))
    system = _build_system(net, 1, Mortar(friction=1.0), BedStiffness(stiffness, stiffness))
    found = _settle(_held_nodes(net, system, np.zeros(0, int), RIGID, []))
    assert found.rests
    eccentric = size[2] / 2 * math.tan(lean)
    assert eccentric > size[0] / 6  # else all of it would press
    pressed = 3 * (size[0] / 2 - eccentric)
    normal = np.linalg.norm(net.weight[0]) * math.cos(lean)
    tilt = 2 * normal / (pressed**2 * size[1] * stiffness)
    assert (system.unit * found.motion)[4] == pytest.approx(tilt, rel=0.03)  # 96 points
    closed = 12 * normal * eccentric / (size[0] ** 3 * size[1] * stiffness)
    assert tilt > 1.4 * closed  # the control: a base that bears tension


@pytest.mark.parametrize("strength", [0.9, 1.1])
def test_a_bond_breaks_at_its_strength(strength):
    """Gravity upwards: the block hangs on its bond."""
    size = (0.4, 0.3, 0.1)
    stress = 2000 * 9.81 * size[2]
    mortar = Mortar(friction=0.5, tensile_strength=strength * stress, cohesion=1e6)
    engine = DiscreteEngine(build_network(block(size, gravity=-9.81)), mortar)
    if strength < 1:
        with pytest.raises(MechanismError):
            engine.solve(1, HERE)
    else:
        engine.solve(1, HERE)


NORMAL, TANGENTIAL = STUDY_BED.normal, STUDY_BED.tangential


def twist_of(scene):
    """How a block moves and turns on the paper's bed, and its weight."""
    net = build_network(scene)
    fields = DiscreteEngine(net, bed=STUDY_BED).solve(1, HERE, Want.ALL)
    return fields.brick_twist[0, 0], -net.weight[0, 2]


@pytest.mark.parametrize("lean", [0.0, math.pi])
def test_a_block_on_the_ground_or_below_a_ceiling_settles_by_its_weight(lean):
    twist, weight = twist_of(block((0.4, 0.3, 0.5), lean))
    assert twist[2] == pytest.approx(-weight / (NORMAL * 0.4 * 0.3))
    assert twist[[0, 1, 3, 4, 5]] == pytest.approx(0, abs=1e-15)


def test_a_block_on_a_wall_hangs_and_leans_as_springs_say():
    length, width, height = size = 0.4, 0.3, 0.5
    twist, weight = twist_of(block(size, math.pi / 2))
    tilt = weight * height / 2 / (NORMAL * width * length**3 / 12)
    assert twist[4] == pytest.approx(tilt)
    assert twist[2] == pytest.approx(-weight / (TANGENTIAL * length * width) - tilt * height / 2)
    assert twist[[1, 3, 5]] == pytest.approx(0, abs=1e-15)
