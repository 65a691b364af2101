"""One block on its ground: friction, toppling, bonds and beds of springs in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from seqopt.contact.mortar import DRY, BedStiffness, Mortar
from seqopt.engines._grip_compliance import RIGID
from seqopt.engines.discrete._system import build_system, settle
from seqopt.engines.discrete.engine import DiscreteEngine, _held_nodes
from seqopt.engines.interface import Want
from seqopt.errors import MechanismError
from seqopt.network.build import build_network
from seqopt.study.published import STUDY_BED
from tests.builders import HERE, block


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
    system = build_system(net, 1, Mortar(friction=1.0), BedStiffness(stiffness, stiffness))
    found = settle(_held_nodes(net, system, np.zeros(0, int), RIGID, []))
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
