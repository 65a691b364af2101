"""The linear program of plane statics, by another solver."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from experiments.stability.parts.blocks import ring, stack
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import DRY, Mortar, bond_mortar
from seqopt.errors import SceneError
from seqopt.network.network import build_network
from seqopt.scene.parts import Robot
from seqopt.stability._screens import Margins, Screen
from seqopt.stability.assessment import _verdict_of, assess, bonded
from seqopt.stability.limit_analysis import Prover
from seqopt.stability.verdict import Verdict
from tests.strategies import arches


def plane_bond(assembly, friction):
    """Least bond of blocks in a plane by scipy's simplex: Coulomb is linear there."""
    from scipy.optimize import linprog  # noqa: PLC0415

    k = len(assembly.corner)
    along = np.abs(assembly.axes[assembly.contact] @ [0.0, 1.0, 0.0]) < 1e-9
    share = assembly.corner_area * assembly.stress_scale / assembly.scales[0]
    matrix = assembly.contact_map.toarray()
    equal = np.hstack([matrix, np.zeros((len(matrix), 1))])
    rows = []
    for i in range(k):
        row = np.zeros(3 * k + 1)
        row[3 * i], row[-1] = -1.0, -share[i]
        rows.append(row)
        for j in (1, 2):
            for sign in (1.0, -1.0):
                row = np.zeros(3 * k + 1)
                row[3 * i + j] = sign
                if along[i, j]:
                    row[3 * i], row[-1] = -friction, -share[i] * (1 + friction)
                rows.append(row)
    cost = np.eye(3 * k + 1)[-1]
    limits, right = np.array(rows), np.zeros(len(rows))
    load, bounds = -assembly.load(), [(None, None)] * (3 * k) + [(0, None)]
    answer = linprog(cost, limits, right, equal, load, bounds=bounds, method="highs")
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


# screens by linear programs against the certificate by cone programs, on random structures
VERDICTS = {1: Verdict.STANDS, -1: Verdict.FALLS, 0: Verdict.UNDECIDED}
MORTARS = [DRY, Mortar(friction=0.9), bond_mortar(2e3), Mortar(friction=0.3, cohesion=1e3)]
MORTARS += [Mortar(friction=0.5, tensile_strength=2e3), Mortar(friction=0.0)]


def some_sets(scene, bricks, count=16):
    """Grip sets of up to three nodes of a partial structure, as places from 1."""
    every = [
        c + (0,) * (3 - k) for k in range(4) for c in combinations(range(1, 2 * bricks + 1), k)
    ]
    rng = np.random.default_rng(len(every))
    return np.array(every)[rng.choice(len(every), min(count, len(every)), replace=False)]


def with_payload(scene, multiple):
    """The scene with robots that carry a multiple of its mean brick."""
    weight = float(np.linalg.norm(build_network(scene).weight, axis=1).mean())
    robots = (Robot(name=f"rob{i}", payload=multiple * weight) for i in range(3))
    return replace(scene, robots=tuple(robots))


def certified(network, bricks, row, mortar):
    """The verdict of the cone program, with its proofs."""
    nodes = [n for brick in network.scene.placed for n in brick.nodes]
    grips = [nodes[place - 1] if place else None for place in row.tolist()]
    assembly = step_assembly(network, bricks, grips)
    return _verdict_of(Prover(assembly, compile_equilibrium)(bonded(assembly, mortar)))


def compare(scene, bricks, mortar):
    """Return the screen's verdicts and the certificate's; none may contradict another."""
    network = build_network(scene)
    held = some_sets(scene, bricks)
    try:
        found = Screen(network, mortar).stands(bricks, held)
    except SceneError:  # rolled so far that faces miss each other
        reject()
    for row, own in zip(held, found.tolist(), strict=True):
        other = certified(network, bricks, row, mortar)
        if Verdict.UNDECIDED not in (other, VERDICTS[own]):
            assert VERDICTS[own] is other, row
    return found


@settings(max_examples=5)
@given(arches(max_bricks=5), st.sampled_from(MORTARS), st.floats(0.5, 6.0), st.integers(1, 5))
def test_small_arches(scene, mortar, multiple, bricks):
    compare(with_payload(scene, multiple), min(bricks, len(scene.bricks)), mortar)


def test_verdicts_of_either_kind_are_compared(arch25):
    """The check above is not about structures that all stand."""
    found = compare(with_payload(arch25, 2.0), 6, DRY)
    assert {1, -1} <= set(found.tolist())


LONG = (pytest.mark.slow, pytest.mark.long)


@pytest.mark.parametrize(("bricks", "sets"), [(5, 5), pytest.param(24, 2, marks=LONG)])
def test_margins_are_the_certificates(arch25, bricks, sets):
    network = build_network(arch25)
    held = some_sets(arch25, bricks, sets)
    margins = Margins(network, DRY)
    bond, grip = margins.bond(bricks, held), margins.grip(bricks, held)
    friction = margins.friction(bricks, held)
    nodes = [n for brick in arch25.placed for n in brick.nodes]
    for i, row in enumerate(held.tolist()):
        grips = [nodes[place - 1] if place else None for place in row]
        own = assess(step_assembly(network, bricks, grips), DRY)
        np.testing.assert_allclose(bond[i], own.bond, rtol=2e-3, atol=10)
        np.testing.assert_allclose(grip[i], own.grip, rtol=3e-3, atol=0.1)
        assert friction[i, 0] - 2e-4 <= own.friction <= friction[i, 1] + 2e-4
