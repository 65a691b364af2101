"""Units and scale change no rank, no choice and no verdict."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.graph.decisions import pose_decisions
from seqopt.graph.formulation import find_formulation
from seqopt.network.build import build_network
from seqopt.plan.solve import solve
from seqopt.sequence.methods import three_robot_loop
from seqopt.study.published import CLOSEST, EQUATIONS, RESOLUTION
from tests.builders import rescaled

SCALES = [(1e3, 1e-3, 1e3), (1e3, 1, 1), (1e-3, 1e3, 1e-3), (1e-3, 1, 1)]
CASES = [(criterion, scales) for criterion in (EQUATIONS, CLOSEST) for scales in SCALES]
CASES = [CASES[0], *(pytest.param(*case, marks=pytest.mark.slow) for case in CASES[1:])]


def solved(scene, criterion):
    problem = pose_decisions(
        ComplianceEngine(build_network(scene)), three_robot_loop(build_network(scene)), criterion
    )
    plan = solve(problem, find_formulation("overlap_dp"))
    return problem, plan.nodes, plan.certificate


@pytest.fixture(scope="module")
def plain(arch25):
    return cache(lambda criterion: solved(arch25, criterion))


@pytest.mark.parametrize(("criterion", "scales"), CASES)
def test_ranks_and_choices_do_not_know_units(arch25, plain, criterion, scales):
    """Responses are rounded for ranks in the scene's own units."""
    own, nodes, certificate = plain(criterion)
    other, others, certified = solved(rescaled(arch25, *scales), criterion)
    assert others == nodes
    assert certified.objective == pytest.approx(certificate.objective, rel=1e-9)
    for a, b in zip(own.sums.shared, other.sums.shared, strict=True):
        np.testing.assert_allclose(b, a, rtol=1e-9)


def test_a_resolution_in_other_units_is_another_criterion(arch25, plain):
    """The control: forces in kN rounded to 1 kN decide nothing."""
    _, nodes, _ = plain(EQUATIONS)
    absolute = replace(EQUATIONS, resolution=RESOLUTION)
    assert solved(arch25, absolute)[1] == nodes
    _, others, _ = solved(rescaled(arch25, 1, 1e-3, 1), absolute)
    assert others != nodes
