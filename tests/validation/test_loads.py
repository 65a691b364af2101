"""Loads and movements of the ground in closed form, and laws that every engine keeps."""

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.engines.diagnosis import residual
from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.rigid._mixed import solve_mixed
from seqopt.engines.rigid._refinement import Refinement
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.network import build_network
from seqopt.scene import Load
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.library import WallShape, chain, wall
from tests.builders import HERE, apart
from tests.direct_solve import solve_dense

SLIDE, TURN = 3e7, 4e5  # N/m, N m/rad of every joint
LENGTH = 0.2
NAMES = ("edge_force", "displacement", "grip_force", "support", "joint_wrench", "brick_twist")


def bar(count, pitch, *, closed):
    """A straight row of bricks without weight, all of whose joints are alike."""
    shape = ArchShape(
        pitch=[pitch] * count,
        pattern="V",
        gap=0.0,
        dimensions=(LENGTH, 0.1, 0.05),
        closed=closed,
        translational_stiffness=(SLIDE,) * 3,
        rotational_stiffness=(TURN,) * 3,
    )
    return replace(arch_scene(shape), gravity=(0.0, 0.0, 0.0))


def whole(scene, engine="compliance"):
    """All fields of a whole structure that nobody holds."""
    return seqopt.make_engine(engine, scene).solve(len(scene.bricks), HERE, Want.ALL)


ENGINES = pytest.mark.parametrize(("engine", "digits"), [("compliance", 1e-11), ("frame", 1e-5)])


@ENGINES
def test_a_bar_is_stretched(engine, digits):
    """Every joint gives F / k; the edges carry F, that of the loaded brick half of it."""
    scene = replace(
        bar(5, np.pi / 2, closed=False), loads=(Load(brick=5, force=(0.0, 0.0, 700.0)),)
    )
    found = whole(scene, engine)
    lifts = found.brick_twist[0, :, 2]
    assert lifts == pytest.approx(700.0 / SLIDE * np.arange(1, 6), rel=digits)
    network = build_network(scene)
    inner = np.flatnonzero(network.edge_spring < 0)
    assert found.edge_force[0, inner] == pytest.approx([700.0] * 4 + [350.0], rel=digits)
    assert found.support[0, 0, 2] == pytest.approx(-700.0, rel=digits)


@ENGINES
def test_a_cantilever_bends(engine, digits):
    """Of a force P at the tip, every joint a distance a away gives P / k and P a² / k_r."""
    scene = bar(6, 0.0, closed=False)
    tip = np.array(scene.bricks[-1].position)
    scene = replace(scene, loads=(Load(brick=6, force=(0.0, 0.0, -90.0)),))
    arms = tip[0] - build_network(scene).springs.position[:, 0]
    drop = 90.0 * (1 / SLIDE + arms**2 / TURN).sum()
    assert whole(scene, engine).brick_twist[0, -1, 2] == pytest.approx(-drop, rel=digits)
    beyond = Load(brick=6, force=(0.0, 0.0, -90.0), position=(tip[0] + 0.1, tip[1], tip[2] + 0.02))
    far_out = 90.0 * (1 / SLIDE + arms * (arms + 0.1) / TURN).sum()
    moved = whole(replace(scene, loads=(beyond,)), engine).brick_twist[0, -1, 2]
    assert moved == pytest.approx(-far_out, rel=digits)


@pytest.mark.parametrize("count", [1, 7])
@ENGINES
def test_a_support_settles(engine, digits, count):
    """Shear of a row held at both ends: δ over the sum of 1 / k + a² / k_r about its middle."""
    scene = bar(count, 0.0, closed=True)
    first, last = scene.grounds
    settled = replace(scene, grounds=(first, replace(last, movement=(0.0, 0.0, -0.003))))
    springs = build_network(scene).springs
    at = np.linalg.norm(springs.position - springs.position[0], axis=1)
    shear = 0.003 / (1 / SLIDE + (at - at.mean()) ** 2 / TURN).sum()
    found = whole(settled, engine)
    assert found.support[0, :, 2] == pytest.approx([shear, -shear], rel=digits)
    assert found.brick_twist[0, count // 2, 2] == pytest.approx(-0.0015, rel=digits)
    base = build_network(settled).node_position[:, 0].argmax()
    assert found.displacement[0, base] == pytest.approx([0.0, 0.0, -0.003], rel=digits)


@ENGINES
def test_a_support_turns(engine, digits):
    """Shear and moment of a row held at both ends, by two equations of its joints."""
    scene = bar(4, 0.0, closed=True)
    first, last = scene.grounds
    turned = replace(scene, grounds=(first, replace(last, movement=(0, 0, 0, 0, -0.002, 0))))
    x = build_network(scene).springs.position[:, 0]
    arm = last.anchor[0] - x  # of a unit force up and a unit moment at the anchor
    flexible = np.array(
        [
            [(1 / SLIDE + arm**2 / TURN).sum(), (arm / TURN).sum()],
            [(arm / TURN).sum(), len(arm) / TURN],
        ]
    )
    force, moment = np.linalg.solve(flexible, [0.0, 0.002])
    found = whole(turned, engine)
    assert found.support[0, 1, 2] == pytest.approx(force, rel=digits)
    assert found.support[0, 1, 4] == pytest.approx(-moment, rel=digits)


def loaded(scene, seed=0, way=1e-4, size=300.0):
    """A scene with random loads, wind and movements of the ground."""
    rng = np.random.default_rng(seed)
    names = scene.build_order
    loads = []
    for i in range(4):
        brick = scene.placed[int(rng.integers(len(names))) if i else 0]
        off = 0.4 * rng.uniform(-1, 1, 3) * min(brick.dimensions)
        place = tuple(np.array(brick.position) + off) if i % 2 else None
        force = tuple(size * rng.normal(size=3))
        since = int(rng.choice(names)) if i > 1 else None
        loads.append(Load(brick=brick.name, force=force, position=place, since=since))
    grounds = tuple(
        replace(ground, movement=tuple(way * rng.normal(size=6))) for ground in scene.grounds
    )
    wind = tuple(0.2 * rng.normal(size=3))
    return replace(scene, loads=tuple(loads), wind=wind, grounds=grounds)


SCENES = {
    "arch": lambda: seqopt.load_scene("arch25"),
    "wall": lambda: wall(WallShape(columns=4, courses=3)),
    "vault": lambda: seqopt.load_scene("vault:span=1,rise=0.4,columns=3"),
}


def some_grips(scene, bricks):
    """No grip, one, and two on one brick."""
    a, b = scene.placed[bricks - 1].nodes
    if {a, b} & {*scene.blocked_nodes}:
        return [[b]]
    return [[], [a], [a, b]]


@pytest.mark.parametrize(("kind", "part"), [*zip(SCENES, (0.3, 0.7, 1.0), strict=True)])
def test_engines_agree(kind, part):
    """One flexibility that grows, two systems of equations, a frame and discrete elements."""
    scene = loaded(SCENES[kind]())
    network, bricks = build_network(scene), max(2, int(part * len(scene.bricks)))
    engines = {n: seqopt.make_engine(n, network) for n in ("compliance", "frame")}
    for grips in some_grips(scene, bricks):
        columns = grip_columns(network, bricks, np.array([grips], dtype=int))
        sure = solve_mixed(network, bricks, columns)
        assert apart(solve_dense(network, bricks, columns), sure) < 1e-8
        assert apart(Refinement(network, bricks).solve(columns), sure) < 1e-9
        found = {n: engine.solve(bricks, [grips], Want.ALL) for n, engine in engines.items()}
        assert apart(found["compliance"], sure) < 1e-9
        assert residual(network, bricks, columns[0], found["compliance"]).backward_error < 1e-9
        if len(grips) < 2:
            assert apart(found["frame"], sure) < 1e-4
    bare = build_network(replace(scene, loads=()))
    assert residual(bare, bricks, columns[0], sure).equilibrium > 1e-3
    still = replace(scene, grounds=tuple(replace(g, movement=None) for g in scene.grounds))
    assert residual(build_network(still), bricks, columns[0], sure).joints > 1e-6


def test_discrete_elements_within_their_limits():
    network = build_network(loaded(SCENES["arch"](), way=1e-6, size=20.0))
    for grips in ([20], [21]):
        columns = grip_columns(network, 11, np.array([grips], dtype=int))
        found = seqopt.make_engine("discrete", network).solve(11, [grips], Want.ALL)
        assert apart(found, solve_mixed(network, 11, columns)) < 1e-8


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=[pytest.mark.slow] * (k == "vault")) for k in SCENES]
)
def test_weight_loads_and_movements_add_up(kind):
    scene = loaded(SCENES[kind]())
    nothing = {"loads": (), "wind": (0.0, 0.0, 0.0), "weight_factor": 0.0}
    still = {"grounds": tuple(replace(g, movement=None) for g in scene.grounds)}
    parts = (
        {**nothing, **still, "weight_factor": 1.0},
        {**nothing, **still, "loads": scene.loads},
        {**nothing, **still, "wind": scene.wind},
        nothing,
    )
    bricks = len(scene.bricks)
    for grips in some_grips(scene, bricks):
        answers = [
            ComplianceEngine(replace(scene, **part)).solve(bricks, [grips], Want.ALL)
            for part in parts
        ]
        total = answers[0]
        for other in answers[1:]:
            total = replace(total, **{n: getattr(total, n) + getattr(other, n) for n in NAMES})
        together = ComplianceEngine(scene).solve(bricks, [grips], Want.ALL)
        assert apart(together, total) < 1e-9
        assert all(np.abs(answer.brick_twist).max() > 1e-12 for answer in answers)


def test_a_factor_on_weight_is_a_factor_on_answers():
    scene = SCENES["arch"]()
    heavy = replace(scene, weight_factor=1.35)
    once, more = (ComplianceEngine(s).solve(9, [[17]], Want.ALL) for s in (scene, heavy))
    assert apart(more, replace(once, **{n: 1.35 * getattr(once, n) for n in NAMES})) < 1e-10
    assert heavy.up == scene.up


@pytest.mark.parametrize("kind", SCENES)
def test_ground_that_moves_as_one_takes_everything_along(kind):
    """No force changes: the structure moves as a whole."""
    scene, turn, shift = SCENES[kind](), np.array([1e-4, -2e-4, 3e-4]), np.array([1e-3, 0, 2e-3])
    grounds = tuple(
        replace(g, movement=(*(shift + np.cross(turn, g.anchor)), *turn)) for g in scene.grounds
    )
    weightless = replace(scene, grounds=grounds, weight_factor=0.0)
    found = ComplianceEngine(weightless).solve(len(scene.bricks), HERE, Want.ALL)
    network = build_network(scene)
    expected = shift + np.cross(turn, network.node_position)
    assert found.displacement[0] == pytest.approx(expected, abs=1e-11)
    assert np.abs(found.joint_wrench).max() < 1e-9 * 1e-3 * network.springs.stiffness.max()


def test_a_chain_with_a_loose_part():
    """What only robots hold takes loads and movements too."""
    scene = loaded(SCENES["arch"](), seed=3)
    loose = build_network(replace(scene, joints=scene.joints[:11] + scene.joints[12:]))
    for grips in ([[40, 45, 49]], [[40, 44, 48]]):
        found = ComplianceEngine(loose).solve(25, grips, Want.ALL)
        columns = grip_columns(loose, 25, np.array(grips))
        assert apart(found, solve_mixed(loose, 25, columns)) < 1e-9


def test_a_long_chain_that_meets_the_far_ground():
    """All is summed again then, from the ground that has moved."""
    network = build_network(loaded(chain(160), way=1e-5))
    engine = ComplianceEngine(network)
    for bricks, grips in ((160, []), (159, []), (160, [290])):
        columns = grip_columns(network, bricks, np.array([grips], dtype=int))
        found = engine.solve(bricks, [grips], Want.ALL)
        assert apart(found, solve_mixed(network, bricks, columns)) < 1e-10
