"""The levels of fidelity: each equals the next where its condition is met, and says where not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.cli.main import main
from seqopt.contact.elastic_limits import find_elastic_limits
from seqopt.contact.mortar import DRY, EPOXY, Mortar
from seqopt.engines.auto import BEYOND, IN_PLANE, AutoEngine, Level
from seqopt.engines.discrete.engine import DiscreteEngine, held_nodes
from seqopt.engines.discrete.equilibrium_path import settle
from seqopt.engines.discrete.pads import Across, Pinch
from seqopt.engines.discrete.system import BedStiffness, build_system
from seqopt.engines.interface import Want
from seqopt.engines.planar import PlanarEngine
from seqopt.engines.plane import find_plane
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import GripError, MechanismError, SceneError, SolverError
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import Brick, Ground, Robot
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import Verdict
from seqopt.stability.steps import assess_steps
from seqopt.study.presets import STUDY_BED, STUDY_PADS
from tests.scenes import arches, moved, states, walls

HERE = np.zeros((1, 0), dtype=int)  # one set of no grips


def largest_difference(first, second, net):
    """Over all fields, relative to the largest entry or to what a hundredth of a brick makes."""
    weight = 0.01 * np.linalg.norm(net.weight, axis=1).mean()
    soft = weight / net.springs.translational_stiffness.max()
    floors = {"displacement": soft, "brick_twist": soft}
    worst = 0.0
    for name in first.__dataclass_fields__:
        a, b = getattr(first, name), getattr(second, name)
        scale = max(np.abs(b).max(initial=0.0), floors.get(name, weight))
        worst = max(worst, np.abs(a - b).max(initial=0.0) / scale)
    return worst


@st.composite
def flat_arches(draw):
    """An arch whose bricks all lie along it, in one plane that is turned about the vertical."""
    count = draw(st.integers(2, 7))
    bend = draw(st.floats(-0.5, 0.2))
    shape = ArchShape(
        pitch=[1.2 + bend * i for i in range(count)],
        pattern="V",
        offset=draw(st.lists(st.floats(-0.01, 0.01), min_size=count, max_size=count)),
        translational_stiffness=draw(st.tuples(*[st.floats(1e7, 1e9)] * 3)),
        rotational_stiffness=draw(st.tuples(*[st.floats(1e5, 1e7)] * 3)),
        closed=draw(st.booleans()),
    )
    angle = draw(st.floats(0, 3))
    turn = np.array(
        [[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]]
    )
    return moved(arch_scene(shape), lambda x: turn @ x)


@settings(max_examples=25)
@given(states(scenes=st.one_of(flat_arches(), walls())))
def test_in_a_plane_three_unknowns_say_what_six_do(state):
    scene, bricks, grips = state
    net = build_network(scene)
    flat = PlanarEngine(net).solve(bricks, grips, Want.ALL)
    whole = ComplianceEngine(net).solve(bricks, grips, Want.ALL)
    assert largest_difference(flat, whole, net) <= 1e-9


def test_the_plane_is_looked_for():
    shape = ArchShape(pitch=[1.2, 0.8, 0.4], pattern="V")
    scene = arch_scene(shape)
    assert np.abs(find_plane(build_network(scene)).normal @ [0, 1, 0]) == pytest.approx(1)
    column = arch_scene(ArchShape(pitch=[math.pi / 2] * 3, pattern="V", closed=False))
    assert np.abs(find_plane(build_network(column)).normal[2]) < 1e-12
    x, y, z = scene.bricks[1].position
    off = replace(scene.bricks[1], position=(x, y + 0.01, z))
    with pytest.raises(SceneError, match=r"brick 2: its centroid lies 9\.\d+ mm outside"):
        PlanarEngine(build_network(replace(scene, bricks=(scene.bricks[0], off, scene.bricks[2]))))
    a, _, c = scene.joints[0].along
    turned = replace(
        scene.joints[0],
        across=(-0.8 * c, 0.6, 0.8 * a),
        translational_stiffness=(3e8, 2e8, 1e8),
    )
    with pytest.raises(SceneError, match="joint 1-2: its axes are turned"):
        PlanarEngine(build_network(replace(scene, joints=(turned, scene.joints[1]))))


def test_a_grip_outside_the_plane_is_refused_and_would_matter():
    """Bricks laid across and centered: their nodes lie on either side of the plane."""
    net = build_network(arch_scene(ArchShape(pitch=[1.2, 0.8, 0.4], pattern="L", overhang=0.0)))
    engine = PlanarEngine(net)
    engine.solve(3, HERE)
    with pytest.raises(GripError, match=r"grip on node 3: it lies 61\.5 mm outside"):
        engine.solve(3, [[3]])
    force = ComplianceEngine(net).solve(3, [[3]], Want.JOINTS).joint_wrench[0]
    assert np.abs(force[:, [3, 5]]).max() > 0.1  # moments that leave the plane, N m


@settings(max_examples=15)
@given(states(scenes=st.one_of(arches(max_bricks=5), walls())))
def test_within_the_elastic_limits_discrete_elements_are_rigid_bricks(state):
    scene, bricks, grips = state
    net = build_network(scene)
    strong = Mortar(friction=1.0, tensile_strength=1e12, cohesion=1e12)
    found = DiscreteEngine(net, strong).solve(bricks, grips, Want.ALL)
    exact = ComplianceEngine(net).solve(bricks, grips, Want.ALL)
    assert largest_difference(found, exact, net) <= 1e-7


def block(size=(0.4, 0.3, 0.1), lean=0.0, gravity=9.81, **stiffness):
    """A brick on ground that leans by an angle about y; nobody holds it."""
    height = size[2]
    along, normal = (math.cos(lean), 0.0, -math.sin(lean)), (math.sin(lean), 0.0, math.cos(lean))
    spring = {
        "translational_stiffness": (1e9, 1e9, 1e9),
        "rotational_stiffness": (1e7, 1e7, 1e7),
    } | stiffness
    return Scene(
        name="block",
        bricks=(
            Brick(
                name=1,
                position=tuple(0.5 * height * x for x in normal),
                length_axis=along,
                width_axis=(0.0, 1.0, 0.0),
                dimensions=size,
                density=2000.0,
                nodes=(1, 2),
                placing_node=1,
            ),
        ),
        joints=(),
        grounds=(
            Ground(
                brick=1,
                position=(0.0, 0.0, 0.0),
                anchor=tuple(-0.05 * x for x in normal),
                along=normal,
                across=along,
                **spring,
            ),
        ),
        build_order=(1,),
        robots=(Robot(name="rob1", payload=100.0),),
        gravity=(0.0, 0.0, -gravity),
    )


@pytest.mark.parametrize("angle", [20.0, 24.9, 25.1, 30.0])
def test_a_block_slides_beyond_the_angle_of_friction(angle):
    scene = block(lean=math.radians(angle))
    engine = DiscreteEngine(build_network(scene), DRY)  # 25 degrees
    if angle > 25:
        with pytest.raises(MechanismError, match="1 bricks: joints part or slip and brick 1 goes"):
            engine.solve(1, HERE)
    else:
        force = engine.solve(1, HERE).support[0, :3]
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
    system = build_system(net, 1, Mortar(friction=1.0), BedStiffness(stiffness, stiffness))
    found = settle(held_nodes(net, system, np.zeros(0, int), np.zeros((0, 3))))
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


def test_stress_at_the_corners_is_that_of_a_beam():
    """Force over area, moment over section modulus, twist over the polar second moment."""
    size = length, width, _ = (0.4, 0.3, 0.5)
    limits = find_elastic_limits(build_network(block(size)), DRY)
    axes = {"N": (0, 0, 100.0, 0, 0, 0), "M": (0, 0, 0, 7.0, 0, 0), "T": (0, 0, 0, 0, 0, 5.0)}
    stress = {k: np.einsum("kij,j->ki", limits.stress, v) for k, v in axes.items()}
    assert stress["N"][:, 0] == pytest.approx(100 / (length * width))
    assert np.abs(stress["M"][:, 0]) == pytest.approx(7 * 6 / (length * width**2))
    polar = length * width * (length**2 + width**2) / 12
    shear = np.linalg.norm(stress["T"][:, 1:], axis=1)
    assert shear == pytest.approx(5 * math.hypot(length, width) / 2 / polar)
    wrench = np.array([[(0, 0, 100.0, 7.0, 0, 0)], [(0, 0, 100.0, 1.0, 0, 0)]])
    assert limits.exceeded(wrench).tolist() == [True, False]  # e = 70 mm and 10 mm, a sixth: 50


@pytest.mark.parametrize("number", [3, 7, 9, 20, 24])
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
        total = fields.grip_force[0].sum(axis=0) + fields.support[0, :3]
        weight = -net.weight[: step.bricks].sum(axis=0)
        assert total == pytest.approx(weight, abs=1e-6 * np.abs(weight).max())


def test_beds_alone_are_other_joints_and_pads_let_a_brick_turn():
    net = build_network(load_scene("arch25"))
    own, study = DiscreteEngine(net), DiscreteEngine(net, bed=STUDY_BED)
    first, second = (e.solve(10, [[19]], Want.ALL) for e in (own, study))
    assert largest_difference(first, second, net) > 0.5
    pinch = Pinch(Across.WIDTH, STUDY_PADS, side=0.03)
    third = DiscreteEngine(net, bed=STUDY_BED, pinch=pinch).solve(10, [[19]], Want.ALL)
    assert np.abs(third.brick_twist[0, 9]).max() > 0
    total = third.grip_force[0].sum(axis=0) + third.support[0, :3]
    weight = -net.weight[:10].sum(axis=0)
    assert total == pytest.approx(weight, abs=1e-6 * np.abs(weight).max())
    with pytest.raises(SceneError, match="bed: normal is 0"):
        BedStiffness(0.0, 1.0)


def test_the_cheapest_level_is_taken_and_counted():
    net = build_network(
        arch_scene(ArchShape(pitch=[1.2, 0.8, 0.4, 0.0], pattern="VVLV", overhang=0.0))
    )
    engine = AutoEngine(net)
    sets = np.array([[7], [4], [1]])  # node 4 sticks out
    found = engine.solve(4, sets, Want.EDGES)
    assert found.joint_wrench.shape == (3, 0, 6)
    exact = ComplianceEngine(net).solve(4, sets, Want.EDGES)
    assert largest_difference(found, exact, net) <= 1e-9
    (flat, two), (space, one) = engine.tally.items()
    assert (flat, two, space.level, one) == (IN_PLANE, 2, Level.RIGID, 1)


@pytest.mark.parametrize("share", [0.999, 1.001])
def test_contact_is_modeled_where_a_joint_would_leave_its_limits(share):
    net = build_network(load_scene("arch25"))
    weak = Mortar(friction=EPOXY.friction, tensile_strength=0.0, cohesion=1e9)
    wrench = ComplianceEngine(net).solve(6, [[11]], Want.JOINTS).joint_wrench
    tension = float(find_elastic_limits(net, weak).excess(wrench).max())
    assert tension > 0
    engine = AutoEngine(net, replace(weak, tensile_strength=share * tension))
    engine.solve(6, [[11]])
    (choice,) = engine.tally
    assert choice.level is (Level.DISCRETE if share < 1 else Level.RIGID)
    assert (choice == BEYOND) == (share < 1)


def test_the_command_line_says_why(capsys):
    assert main(["analyze", "--method", "sequential", "--engine", "auto"]) == 0
    said = capsys.readouterr().err
    assert "engine: compliance for 49 grip sets: brick 11: its centroid lies 65.2 mm" in said
    dry = ["analyze", "--method", "sequential", "--engine", "auto", "--mortar", "dry"]
    assert main(dry) == 2
    assert "step 9: 5 bricks: joints part or slip and brick" in capsys.readouterr().err
    assert main(["analyze", "--method", "sequential", "--engine", "planar"]) == 2
    assert "use the compliance engine" in capsys.readouterr().err
    assert main(["analyze", "--method", "sequential", "--mortar", "dry"]) == 2
    assert "engine compliance: its joints hold anything" in capsys.readouterr().err
