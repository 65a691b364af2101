"""Laws of the free schedule: what never makes it worse, and what changes nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError
from seqopt.graph.decisions import pose_decisions
from seqopt.graph.formulation import find_formulation
from seqopt.graph.states.states import build_states
from seqopt.network.build import build_network
from seqopt.plan.solve import solve
from seqopt.problem.criteria import WorstRatio
from seqopt.scene.parts import Anywhere, Robot, Sphere
from seqopt.sequence.methods import three_robot_loop
from seqopt.sequence.rules import FreeRules
from seqopt.study.published import CLOSEST, EQUATIONS, RESOLUTION
from tests.builders import rescaled
from tests.strategies import free_builds

SCALES = (("F_largest", 100.0), ("M_sup", 10.0), ("T_max", 30.0), ("D_max", 1e-5))


def best(scene, rules, aim="minmax", scales=SCALES):
    """The optimum, infinite where there is none."""
    engine = ComplianceEngine(build_network(scene))
    problem = build_states(engine, rules, WorstRatio("ones", scales), aim)
    try:
        return np.array(solve(problem, "schedule_search").certificate.values)
    except InfeasibleError:
        return np.full(aim.count(",") + 1, np.inf)


few = settings(max_examples=3, deadline=None)
builds = free_builds(most_bricks=4, most_robots=3)


def not_worse(new, old):
    return bool((new <= old * (1 + 1e-9)).all())


@given(build=builds)
@few
def test_one_more_robot_never_worsens_the_optimum(build):
    scene, rules = build
    more = (*scene.robots, Robot(name="extra", payload=500.0, reach=Anywhere()))
    assert not_worse(best(replace(scene, robots=more), rules), best(scene, rules))


@given(build=builds, data=st.data())
@few
def test_more_reach_never_worsens_the_optimum(build, data):
    scene, rules = build
    which = data.draw(st.integers(0, len(scene.robots) - 1))
    rules = replace(rules, newest="either")  # where a robot places depends on its reach otherwise
    robots = [replace(r, reach=Anywhere()) if i == which else r for i, r in enumerate(scene.robots)]
    assert not_worse(best(replace(scene, robots=tuple(robots)), rules), best(scene, rules))


@pytest.mark.slow
@given(build=builds)
@few
def test_a_looser_rule_never_worsens_the_optimum(build):
    scene, rules = build
    value = best(scene, rules)
    for _, loose in rules.loosened(scene):
        assert not_worse(best(scene, loose), value)


@given(build=builds, data=st.data())
@few
def test_the_order_of_robots_changes_nothing(build, data):
    scene, rules = build
    order = data.draw(st.permutations(scene.robots))
    other = replace(scene, robots=tuple(order))
    a, b = best(scene, rules, "minmax,steps"), best(other, rules, "minmax,steps")
    assert a == pytest.approx(b, rel=1e-9)


@given(
    build=builds,
    length=st.floats(0.2, 5.0),
    force=st.floats(0.1, 10.0),
    softness=st.floats(0.1, 10.0),
)
@few
def test_scaling_changes_nothing(build, length, force, softness):
    scene, rules = build
    robots = (
        replace(r, reach=Anywhere()) if isinstance(r.reach, Sphere) else r for r in scene.robots
    )
    scene = replace(scene, robots=tuple(robots))  # spheres are not scaled with the scene
    factor = {"F": force, "M": force * length, "T": force, "D": force * softness}
    scales = tuple((name, scale * factor[name[0]]) for name, scale in SCALES)
    a = best(scene, rules, "minmax")
    b = best(rescaled(scene, length, force, softness), rules, "minmax", scales)
    assert a == pytest.approx(b, rel=1e-5)


def test_a_worse_optimum_is_seen():
    """The negative control of all laws above."""
    assert not not_worse(np.array([1.1]), np.array([1.0]))
    assert not_worse(np.array([1.0]), np.array([np.inf]))
    with pytest.raises(TypeError):
        FreeRules(2)


# units and scale change no rank, no choice and no verdict


UNITS = [(1e3, 1e-3, 1e3), (1e3, 1, 1), (1e-3, 1e3, 1e-3), (1e-3, 1, 1)]
CASES = [(criterion, scales) for criterion in (EQUATIONS, CLOSEST) for scales in UNITS]
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
