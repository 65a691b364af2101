"""Criteria people bring; what criteria take from a scene."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.errors import InfeasibleError, ProblemError, StepError
from seqopt.graph.states import build_states
from seqopt.judge._proof import Proof
from seqopt.problem.criteria import OVER_METHODS, RankSum, StepCost, WeightedSum, equal
from seqopt.responses.scales import NEVER, SceneFacts, crown
from seqopt.sequence.methods import METHODS
from seqopt.sequence.rules import FreeRules
from seqopt.study import CLOSEST, EQUATIONS, RESOLUTION
from tests.builders import anywhere, far_reaching, rescaled, running_bond, six_bricks, small_arch
from tests.strategies import arches

NAMES = ("F_largest", "M_sup")


def weighed(responses, bricks):
    return responses["F_largest"] / 100.0 + 2.0 * responses["M_sup"] / 10.0


def posed(criterion, scene=None):
    network = seqopt.build_network(six_bricks() if scene is None else scene)
    engine = seqopt.make_engine("compliance", network)
    return seqopt.pose(engine, seqopt.three_robot_loop(network), criterion)


def test_a_function_costs_what_the_same_ready_made_criterion_does():
    same = WeightedSum("same", (("F_largest", 1.0, 100.0), ("M_sup", 2.0, 10.0)))
    ours, theirs = posed(StepCost("own", NAMES, weighed)), posed(same)
    own, ready = (seqopt.compile_instance(problem).amounts for problem in (ours, theirs))
    assert own == pytest.approx(ready)
    assert seqopt.solve(ours, "overlap_dp").certificate.objective == pytest.approx(
        seqopt.solve(theirs, "overlap_mip").certificate.objective
    )


def test_forces_of_all_robots_are_spelled_out_and_zero_without_a_grip():
    seen = {}

    def spread(responses, bricks):
        forces = np.stack([responses[name] for name in sorted(responses)])
        seen.setdefault(tuple(sorted(responses)), []).append(forces)
        return forces.max(axis=0) - forces.min(axis=0)

    problem = posed(StepCost("spread", ("F_each",), spread))
    plan = seqopt.solve(problem, "overlap_dp")
    assert [*seen] == [("F_rob1", "F_rob2", "F_rob3")]
    assert any(
        (forces == 0).all(axis=tuple(range(1, forces.ndim))).any() for forces in seen.popitem()[1]
    )
    assert plan.summary()["responses"] == ["F_rob1", "F_rob2", "F_rob3"]
    assert plan.summary()["function"].endswith("spread")


def test_what_it_does_not_allow_is_not_chosen():
    def strict(responses, bricks):
        return np.where(responses["F_largest"] > 150.0, np.inf, responses["M_sup"])

    with pytest.raises(InfeasibleError):
        seqopt.solve(
            posed(StepCost("none", ("F_largest",), lambda r, b: np.inf * r["F_largest"])),
            "overlap_dp",
        )
    free = seqopt.solve(posed(StepCost("free", NAMES, lambda r, b: r["M_sup"])), "overlap_dp")
    bound = seqopt.solve(posed(StepCost("strict", NAMES, strict)), "overlap_dp")
    assert bound.certificate.objective >= free.certificate.objective


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda r, b: r["T_max"], "its function failed: KeyError"),
        (lambda r, b: 1.0, r"returned shape \(\)"),
        (lambda r, b: np.full_like(r["M_sup"], np.nan), "returned nan for a possible choice"),
    ],
)
def test_a_function_that_is_wrong_gets_one_line(function, said):
    with pytest.raises(ProblemError, match=said) as caught:
        seqopt.solve(posed(StepCost("wrong", NAMES, function)), "overlap_dp")
    assert "\n" not in str(caught.value)


def test_a_cost_below_zero_is_refused_where_steps_can_be_added():
    """A sum would fall without end; where steps are given it is refused alike."""
    criterion = StepCost("gain", ("F_largest",), lambda r, bricks: r["F_largest"] - 60.0)
    engine = seqopt.make_engine("compliance", small_arch(4))
    free = build_states(engine, FreeRules(), criterion, "sum")
    with pytest.raises(ProblemError, match=r"gain: a step costs -\d.* at \d bricks; .* constant"):
        seqopt.solve(free, "schedule_search")
    with pytest.raises(ProblemError, match="gain: a step costs -"):
        Proof(free).bounds((0.0,) * len(free.goals))
    with pytest.raises(ProblemError, match=r"gain: a step costs -\d.* at \d bricks; .* constant"):
        seqopt.solve(posed(criterion), "overlap_dp")


def test_what_is_no_function_is_refused():
    with pytest.raises(ProblemError, match="give names of responses"):
        StepCost("wrong", NAMES, 3.0)
    with pytest.raises(ProblemError, match="give names of responses"):
        StepCost("wrong", "T_max", weighed)
    with pytest.raises(ProblemError, match=r"criterion wrong: a state .* has no X_max; give C_max"):
        posed(StepCost("wrong", ("X_max",), weighed))


# what criteria take from a scene: crown, units, scales; and that none of it is one arch's
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


@pytest.mark.parametrize(
    "name", [pytest.param("equations-2-3", marks=pytest.mark.slow), "worst-ratio"]
)
@given(
    scene=arches(min_bricks=4, max_bricks=7).map(far_reaching),
    power=st.tuples(*[st.integers(-8, 8)] * 3),
)
@settings(max_examples=4)
def test_units_change_no_choice(name, scene, power):
    """Powers of two: the same digits. Softer joints may leave the linear range: it is lifted."""
    other = rescaled(scene, *(2.0**p for p in power))
    how = {"criterion": name, "engine": "compliance", "limits": ["linear_range=any"]}
    a, b = (seqopt.optimize(s, **how) for s in (scene, other))
    assert a.nodes == b.nodes
    assert b.certificate.objective == pytest.approx(a.certificate.objective, rel=1e-9)
