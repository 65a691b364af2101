"""Peers: plain loops and general tools answer as we do, and a wrong one would be seen."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from experiments.peers import peers
from experiments.peers.parts.chain import chain_of
from experiments.peers.parts.frames import MODULES, PACKAGES, missing_packages
from experiments.peers.parts.loops import LOOPS, kept, loop
from experiments.peers.parts.workload import PATHS, Case, by_linprog, by_networkx, workload
from experiments.peers.peers import difference
from seqopt.engines.interface import Want, grip_columns
from seqopt.graph.layers.costs import LayeredCosts
from tests.layered import Costs, answer

STATES = [(4, (1, 5, 7)), (17, (1, 20, 33)), (17, (1, 20, 21)), (25, (4, 47)), (25, (12, 13, 46))]


def gap(engine, solve):
    """Largest difference from the engine over a few states, two grips on one brick among them."""
    answers = []
    for bricks, grips in STATES:
        sets = np.array([grips])
        columns = grip_columns(engine.network, bricks, sets)
        case = Case(bricks, sets, columns, Want.RESPONSES)
        answers.append((case, 0, solve(bricks).solve(columns[0], Want.RESPONSES)))
    return difference(engine, answers)


@pytest.mark.parametrize("name", LOOPS)
def test_loops_agree_with_the_engine(engine25, name):
    limit = peers.LIKE_RIGID if "bricks" in name else peers.LIKE_BARS
    assert gap(engine25, lambda bricks: loop(engine25.network, bricks, name)) <= limit


@pytest.mark.parametrize("name", LOOPS)
def test_a_loop_with_a_wrong_stiffness_does_not(engine25, name):
    """The joints a hundredth stiffer; forces hardly notice, displacements must."""
    wrong = gap(engine25, lambda bricks: loop(engine25.network, bricks, name, factor=1.01))
    assert wrong == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize("name", sorted(set(PACKAGES) - {"OpenSeesPy"}))
def test_installed_packages_agree_with_the_engine(engine25, name):
    pytest.importorskip(MODULES[name])
    made = PACKAGES[name]
    assert gap(engine25, lambda b: made(chain_of(engine25.network, b))) <= peers.LIKE_BARS


def test_what_is_not_asked_is_empty(engine25):
    columns = grip_columns(engine25.network, 9, np.array([[1, 17]]))[0]
    answer = loop(engine25.network, 9, "SciPy bricks, banded").solve(columns, Want.SUPPORT)
    assert not answer.edge_force.size
    assert not answer.displacement.size
    assert answer.grip_force.shape == (2, 3)


def test_joints_that_differ_are_refused(engine25):
    parts = kept(engine25.network, 3, rigid=True)
    assert len(parts.matrix) == 18
    springs = engine25.network.springs
    stiffness = springs.translational_stiffness.copy()
    stiffness[1] *= 2
    changed = replace(springs, translational_stiffness=stiffness)
    network = type(engine25.network)(
        **{
            name: getattr(engine25.network, name)
            for name in engine25.network.__dataclass_fields__
            if name != "springs"
        },
        springs=changed,
    )
    with pytest.raises(ValueError, match="differ in stiffness"):
        chain_of(network, 3)


@pytest.mark.parametrize("solve", [by_networkx, by_linprog("highs-ds"), by_linprog("highs-ipm")])
def test_general_tools_find_the_optimum_of_dynamic_programming(solve):
    rng = np.random.default_rng(3)
    sizes = [4, 7, 3, 6, 5]
    pairs = zip([1, *sizes[:-1]], sizes, strict=True)
    single = [rng.standard_normal(size) for size in sizes]
    shared = [rng.standard_normal(pair) for pair in pairs]
    shared[2][rng.random(shared[2].shape) < 0.3] = np.inf
    costs = LayeredCosts(tuple(single), tuple(shared))
    best = answer(Costs(costs)).certificate.objective
    assert solve(costs) == pytest.approx(best, abs=1e-8)


def test_networkx_agrees_on_the_arch(engine25):
    problem, cases = workload(engine25.network)
    assert sum(len(case.grips) for case in cases) == problem.evaluation.models == 8642
    best = PATHS["seqopt, overlap_dp"](problem.sums)
    assert by_networkx(problem.sums) == pytest.approx(best, rel=1e-12)


def test_packages_that_are_not_installed_are_named(monkeypatch):
    for module in ("Pynite", "openseespy.opensees", "openseespy", "openseespylinux", "pyconmech"):
        monkeypatch.setitem(sys.modules, module, None)
    assert missing_packages() == list(PACKAGES)
    assert '"seqopt[peers]"' in peers.EXTRA
