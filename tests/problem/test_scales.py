"""What criteria take from a scene: crown, units, scales; and that none of it is one arch's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from experiments.harness.scenes import running_bond
from seqopt.errors import ProblemError, StepError
from seqopt.problem.criteria import OVER_METHODS, RankSum, equal
from seqopt.problem.requirements import NEVER, SceneFacts, crown
from seqopt.sequence.methods import METHODS
from seqopt.study.published import CLOSEST, EQUATIONS, RESOLUTION
from tests.builders import anywhere, far_reaching, rescaled, small_arch
from tests.strategies import arches


def facts_of(scene):
    return SceneFacts(seqopt.make_engine("compliance", scene))


def test_the_crown_of_the_reference_arch_and_of_others(arch25):
    assert crown(arch25) == 13
    assert crown(small_arch(15)) == 8
    assert crown(small_arch(50)) == 26  # of two that are nearly as high
    line = seqopt.ArchShape(pitch=np.linspace(1.3, -1.3, 50).tolist(), pattern="V")
    assert crown(seqopt.arch_scene(line)) == 25  # two bricks are equally high: the first
    assert crown(running_bond(6, 4)) == NEVER
    upward = replace(small_arch(15), build_order=tuple(range(1, 9)) + tuple(range(15, 8, -1)))
    assert crown(upward) == 8


def test_a_build_from_both_ends_has_no_crown():
    order = [b for pair in zip(range(1, 8), range(15, 8, -1), strict=True) for b in pair] + [8]
    assert crown(replace(small_arch(15), build_order=tuple(order))) == NEVER


def test_rounding_is_the_papers_on_its_arch(arch25):
    criterion = EQUATIONS.for_scene(facts_of(arch25))
    assert criterion.crown == 13
    assert [name for name, _ in criterion.resolution] == [name for name, _ in RESOLUTION]
    for (_, own), (_, paper) in zip(criterion.resolution, RESOLUTION, strict=True):
        assert own == pytest.approx(paper, rel=1e-12)
    assert CLOSEST.for_scene(facts_of(arch25)).crown == 14


def test_scales_are_those_of_the_scenes_own_methods(arch25):
    facts = facts_of(arch25)
    tables = [seqopt.analyze(facts.engine, m(facts.engine.network)) for m in (
        seqopt.sequential, seqopt.cantilever)]  # fmt: skip
    for name, column, size in (("M_sup", "M_sup_Nm", 1.0), ("D_max", "D_max_1e-3mm", 1e6)):
        assert facts.reference[name] == min(t[column].max() for t in tables) / size
    heavy = facts_of(
        replace(arch25, bricks=tuple(replace(b, density=4840.0) for b in arch25.bricks))
    )
    for name, value in facts.reference.items():
        assert heavy.reference[name] == pytest.approx(2 * value)


def one_places(count):
    """An arch that no fixed method builds: only one robot reaches its other end."""
    scene = small_arch(count)
    near = seqopt.Sphere(center=scene.placed[0].position, radius=0.15)
    first, second = anywhere(2)
    return replace(scene, robots=(first, replace(second, reach=near)))


ALONE = seqopt.FreeRules(newest="free", least_grips=1)


@pytest.mark.parametrize("criterion", ["worst-ratio", "weighted"])
def test_a_scene_that_no_fixed_method_builds_has_scales_of_its_own(criterion):
    scene = one_places(6)
    for method in METHODS.values():
        with pytest.raises(StepError):
            method(seqopt.build_network(scene))
    plan = seqopt.optimize(scene, "free", criterion, rules=ALONE)
    assert plan.status == "optimal"
    summary = plan.summary()
    assert summary["criterion"] == f"{criterion} over payload, weight and size"
    weight = float(np.linalg.norm(seqopt.build_network(scene).weight.sum(axis=0)))
    assert summary["scales"]["F_largest"] == min(robot.payload for robot in scene.robots)
    assert summary["scales"]["T_max"] == pytest.approx(weight)
    given = seqopt.optimize(scene, "free", "worst-ratio-published", rules=ALONE)
    assert given.summary()["criterion"] == "worst-ratio-published"


def test_scales_of_a_scene_go_with_its_units():
    """Powers of two: the same digits in other units of length, force and stiffness."""
    scene = one_places(5)
    length, force, softness = 2.0, 8.0, 4.0
    own, other = (facts_of(s).own_scales for s in (scene, rescaled(scene, length, force, softness)))
    ratio = {name: other[name] / own[name] for name in ("F_largest", "T_max", "M_sup")}
    assert ratio == {"F_largest": force, "T_max": force, "M_sup": force * length}
    assert all(value > 0 for value in own.values())


def test_a_criterion_that_is_not_posed_says_so():
    for criterion in (EQUATIONS, OVER_METHODS, RankSum("own", equal("T_max"), equal("M_sup"))):
        with pytest.raises(ProblemError, match=r"not posed for a scene; use seqopt\.pose"):
            criterion.costs({name: np.ones(3) for name in ("T_max", "F_largest")}, 3, 3)


@pytest.mark.parametrize("name", ["equations-2-3", "worst-ratio"])
@given(
    scene=arches(min_bricks=4, max_bricks=7).map(far_reaching),
    power=st.tuples(*[st.integers(-8, 8)] * 3),
)
@settings(max_examples=4)
def test_units_change_no_choice(name, scene, power):
    """Powers of two: the same digits in other units of length, force and stiffness."""
    other = rescaled(scene, *(2.0**p for p in power))
    a, b = (seqopt.optimize(s, criterion=name, engine="compliance") for s in (scene, other))
    assert a.nodes == b.nodes
    assert b.certificate.objective == pytest.approx(a.certificate.objective, rel=1e-9)
