"""Large structures by blocks that the build leaves behind, against one factorization per set."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.engines._grip_compliance import read_compliance
from seqopt.engines.interface import grip_columns
from seqopt.engines.rigid._frontal import FrontalFactor, FrontalSystem
from seqopt.engines.rigid._mechanism import LAST_CORRECTION
from seqopt.engines.rigid._mixed import solve_mixed
from seqopt.engines.rigid.compliance import _LARGE, ComplianceEngine
from seqopt.errors import MechanismError, SolverError
from seqopt.network.build import build_network
from seqopt.scene.parts import Load
from tests.builders import apart, hinged


def loaded(scene):
    """Loads that begin late, on bricks passed long before, wind, and ground that sinks."""
    last = scene.build_order[-1]
    late = Load(brick=2, force=(3.0, 0.0, -50.0), since=last)
    loads = (late, Load(brick=3, force=(0.0, 8.0, 0.0)))
    sinks = replace(scene.grounds[0], movement=(1e-4, 0.0, -2e-4))
    return replace(scene, loads=loads, wind=(0.1, 0.2, 0.0), grounds=(sinks, *scene.grounds[1:]))


SCENES = {
    "vault": lambda: seqopt.load_scene("vault:span=1,rise=0.4,columns=2"),
    "chain": lambda: seqopt.load_scene("chain:bricks=16"),
    "loads": lambda: loaded(seqopt.load_scene("wall:courses=4,columns=4")),
    "soft": lambda: seqopt.load_scene("chain:bricks=16").with_grips(1e6, 1e4),
}
AT_ONCE = 3  # bricks of a block, so that small structures have several


def asked(network, bricks, seed, moved=None):
    """A set at the newest bricks, one anywhere, and one that holds a brick at both of its nodes."""
    rng, numbers = np.random.default_rng(seed), network.scene.placed_nodes[: 2 * bricks]
    nodes = np.array([node for node in numbers if node not in network.scene.blocked_nodes])
    sets = np.array([nodes[-3:-1], rng.choice(nodes, 2, replace=False), numbers[2:4]])
    columns = grip_columns(network, bricks, sets)
    return columns, read_compliance(network, columns, sets, moved)


@pytest.mark.parametrize("name", SCENES)
def test_one_factorization_per_set_agrees(name):
    network = build_network(SCENES[name]())
    system, count = FrontalSystem(network, AT_ONCE), len(network.inner)
    for bricks in (2, 3 * AT_ONCE, count // 2, count, count - 2):  # the last one begins anew
        moved = np.random.default_rng(bricks).normal(size=(3, 2, 3)) * 1e-5
        for far in (None, moved):
            columns, compliance = asked(network, bricks, bricks, far)
            found = system.solve(bricks, columns, compliance, LAST_CORRECTION)
            assert apart(found, solve_mixed(network, bricks, columns, compliance)) < 1e-8
    assert len(system._factor.blocks) > 2


def test_what_blocks_get_wrong_is_corrected_or_refused():
    network = build_network(SCENES["vault"]())
    system, count = FrontalSystem(network, AT_ONCE), len(network.inner)
    columns, compliance = asked(network, count, 0)
    right = system.solve(count, columns, compliance, LAST_CORRECTION)
    blocks = system._factor.blocks
    blocks[0] = blocks[0]._replace(answer=2 * blocks[0].answer)
    assert apart(system.solve(count, columns, compliance, LAST_CORRECTION), right) < 1e-8
    blocks[0] = blocks[0]._replace(carried=3 * blocks[0].carried)
    with pytest.raises(SolverError, match="keep too few digits"):
        system.solve(count, columns, compliance, LAST_CORRECTION)


@pytest.mark.parametrize("softer", [1e-3, 1e-8, 0.0])
def test_what_hardly_holds_is_answered_right_or_not_at_all(softer):
    scene, rng = SCENES["chain"](), np.random.default_rng(0)
    for joint in (2, 9):
        own = scene.joints[joint]
        turns = tuple(softer * k for k in own.rotational_stiffness)
        joints = (*scene.joints[:joint], replace(own, rotational_stiffness=turns))
        network = build_network(replace(scene, joints=(*joints, *scene.joints[joint + 1 :])))
        system, count = FrontalSystem(network, AT_ONCE), len(network.inner)
        for held in range(3):
            nodes = rng.choice(np.arange(2, 2 * count - 1), held, replace=False)
            columns = grip_columns(network, count - 1, nodes[None])
            own_grips = read_compliance(network, columns, nodes[None], None)
            try:
                right = solve_mixed(network, count - 1, columns, own_grips)
            except (MechanismError, SolverError):
                right = None
            with suppress(SolverError):
                found = system.solve(count - 1, columns, own_grips, LAST_CORRECTION)
                assert right is not None
                assert apart(found, right) < 1e-7


def test_a_mechanism_is_left_to_operators():
    scene = hinged(seqopt.load_scene(f"chain:bricks={_LARGE}"), 4)
    network, free = build_network(scene), np.zeros((1, 0), dtype=int)
    compliance = read_compliance(network, free, free, None)
    with pytest.raises(SolverError):
        FrontalSystem(network).solve(30, free, compliance, LAST_CORRECTION)
    with pytest.raises(MechanismError):
        ComplianceEngine(network).solve(30, free)


@pytest.mark.parametrize(("spoil", "solutions"), [(0.0, 2), (7e-3, 6)])
def test_corrections_end_before_one_that_would_not_count(monkeypatch, spoil, solutions):
    network, calls, solve = build_network(SCENES["chain"]()), [], FrontalFactor.solve
    count = len(network.inner)
    columns, compliance = asked(network, count, 1)

    def spoiled(*arguments):
        calls.append(arguments)
        return tuple(found * (1 + spoil) for found in solve(*arguments))

    monkeypatch.setattr(FrontalFactor, "solve", spoiled)
    found = FrontalSystem(network, AT_ONCE).solve(count, columns, compliance, LAST_CORRECTION)
    assert len(calls) == solutions * len(columns)
    expected = solve_mixed(network, count, columns, compliance)
    assert apart(found, expected) <= 1e-9
    monkeypatch.setattr("seqopt.engines.rigid._frontal._MARGIN", 0.0)  # the control
    found = FrontalSystem(network, AT_ONCE).solve(count, columns, compliance, LAST_CORRECTION)
    assert (apart(found, expected) > 1e-9) == (spoil > 0)
