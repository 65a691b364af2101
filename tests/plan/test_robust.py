"""Plans for many scenarios: right against brute force and programs, and refused where they lie."""

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import Bounds, LinearConstraint, milp

import seqopt
from experiments.harness.layers import LayeredCosts
from formulations._instance_program import program
from formulations.on_graph import by_weights, cheapest_by, least_total
from formulations.overlap_dp import OVERLAP_DP
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.formulation import Run, Watch, as_formulation
from seqopt.instances._solve import find_path
from seqopt.problem.problem import WORST_PEAK, WORST_TOTAL, Aim, RobustAim, cvar, parse_robust
from seqopt.responses import Resources
from seqopt.scene.scenarios import scenarios
from tests.builders import six_bricks, small_arch
from tests.layered import compile_costs, compile_totals, largest_of

AIMS = (WORST_PEAK, WORST_TOTAL, cvar(0.5), cvar(0.99))
every = pytest.mark.parametrize("aim", AIMS, ids=str)


@st.composite
def many(draw, most_moves=4, most_candidates=4):
    """Costs of the same few moves in several scenarios, with ties and what is not allowed."""
    sizes = draw(st.lists(st.integers(1, most_candidates), min_size=1, max_size=most_moves))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    whole = draw(st.booleans())

    def array(*shape):
        drawn = rng.integers(0, 6, shape) if whole else np.abs(rng.normal(3.0, 2.0, shape))
        return np.where(rng.uniform(size=shape) < 0.04, np.inf, drawn)

    def layers():
        single = tuple(array(size) for size in sizes)
        return LayeredCosts(
            single, tuple(array(a, b) for a, b in zip([1, *sizes[:-1]], sizes, strict=True))
        )

    return tuple(layers() for _ in range(draw(st.integers(1, 6))))


class Found(NamedTuple):
    """A choice, what is claimed of it, and what is proven."""

    choice: tuple[int, ...]
    selection: object
    certificate: object


def solved(layers, aim, formulation=None, time_limit=np.inf):
    """The judged answer for layers over scenarios that are given by their costs alone."""
    made, name = compile_totals("drawn", layers, aim), "overlap_dp"
    if aim == WORST_PEAK:
        made, name = compile_costs("drawn", largest_of(layers), Aim.PEAK), "minimax"
    run = Run(time_limit)
    found = find_path(made.instance, as_formulation(formulation or name), run)
    choice = made.choice([node for (node,) in found.selection.states])
    return Found(choice, found.selection, found.certificate)


def robust(problem, scenes, aim):
    """A problem over scenarios."""
    some = {"limits": problem.limits, "resources": problem.resources}
    asked = (problem.engine, problem.moves, problem.criterion)
    return seqopt.pose(*asked, scenarios=scenes, over=aim, **some)


def values(layers, aim):
    """What every choice that is allowed in all scenarios is worth."""
    found = {}
    for choice in product(*(range(size) for size in layers[0].sizes)):
        each = [(costs.cost if aim.aim is Aim.SUM else costs.worst)(choice) for costs in layers]
        if np.isfinite(each).all():
            found[choice] = tail(each, aim)
    return found


def tail(each, aim):
    """The mean of the worst, written down anew: by the least over thresholds."""
    if str(aim).startswith("worst"):
        return max(each)
    rest = (1 - aim.level) * len(each)
    return min(t + sum(max(x - t, 0.0) for x in each) / rest for t in each)


@every
@given(layers=many())
@settings(max_examples=10)
def test_plans_agree_with_brute_force(aim, layers):
    found = values(layers, aim)
    if not found:
        with pytest.raises(InfeasibleError, match="move"):
            solved(layers, aim)
        return
    plan = solved(layers, aim)
    best = min(found.values())
    proof = plan.certificate
    assert proof.objective == pytest.approx(best, abs=1e-6)
    assert found[plan.choice] == pytest.approx(proof.objective, abs=1e-9)
    assert proof.bound <= plan.selection.bound[0] + 1e-9 <= best + 2e-9
    assert proof.claimed_gap <= 1e-6
    assert not plan.selection.stopped


@pytest.mark.parametrize("aim", AIMS[1:], ids=str)
@given(layers=many())
@settings(max_examples=6)
def test_plans_agree_with_the_program(aim, layers):
    if not values(layers, aim):
        return
    plan = solved(layers, aim)
    asked = program(compile_totals("drawn", layers, aim).instance)
    rules = LinearConstraint(asked.matrix, asked.low, asked.high)
    value, relaxed = (
        milp(asked.cost, integrality=whole, bounds=Bounds(0, asked.upper), constraints=rules).fun
        for whole in (asked.whole, 0 * asked.whole)
    )
    assert value == pytest.approx(plan.certificate.objective, abs=1e-5)
    assert relaxed == pytest.approx(plan.certificate.bound, abs=1e-4 * max(1.0, abs(relaxed)))


# negative controls: a wrong claim is seen
LAYERS = tuple(
    LayeredCosts((np.array(single),), (np.zeros((1, 2)),)) for single in ([3.0, 1.0], [0.0, 4.0])
)


@pytest.mark.parametrize(
    ("claim", "match"),
    [
        ({"objective": (2.5,), "bound": (2.0,)}, "is 3, not 2.5 as claimed"),
        ({"states": ((2,),), "objective": (4.0,), "bound": (4.5,)}, "a bound is above its value"),
    ],
)
def test_a_false_claim_is_refused(claim, match):
    assert solved(LAYERS, WORST_TOTAL).certificate.objective == 3.0
    with pytest.raises(SolverError, match=match):
        solved(LAYERS, WORST_TOTAL, claiming(**claim))


def claiming(**claim):
    """The search over scenarios, of whose answer something is changed."""

    def solve(instance):
        return replace(OVERLAP_DP.solve(instance), **claim)

    return replace(OVERLAP_DP, solve=solve)


@pytest.mark.parametrize("weights", [(1.0, 0.0), (0.7, 0.7), (-0.5, 0.5)])
def test_weights_that_do_not_fit_the_aim_prove_nothing(weights):
    aim = cvar(0.0)
    assert solved(LAYERS, aim).certificate.gap == 0.0
    with pytest.raises(SolverError, match="weights: "):
        solved(LAYERS, aim, claiming(prices=(weights,)))


def test_the_gap_that_weights_leave_is_real_here():
    """Half of either scenario proves 2; no choice is better than 3."""
    graph = compile_totals("two", LAYERS, WORST_TOTAL).instance.asked
    cheapest = cheapest_by(OVERLAP_DP.solve.choose, Watch())
    weighed = by_weights(graph, WORST_TOTAL, cheapest, Watch())
    assert weighed.bound == pytest.approx(2.0)
    assert least_total(graph, WORST_TOTAL, cheapest, Watch()).bound == pytest.approx(3.0)


# scenes
def posed(limits=(), workers=1):
    network = seqopt.build_network(six_bricks())
    engine = seqopt.make_engine("compliance", network)
    return seqopt.pose(
        engine,
        seqopt.three_robot_loop(network),
        seqopt.CRITERIA["weighted-published"],
        limits=limits,
        resources=Resources(workers),
    )


@pytest.mark.slow
@pytest.mark.parametrize("aim", AIMS[:3], ids=str)
def test_a_plan_over_scenarios_shows_its_choice(aim):
    problem = posed()
    drawn = scenarios(problem.schedule.scene, count=6, seed=1)
    plan = seqopt.solve(robust(problem, drawn, aim))
    assert len(plan.table()) > len(plan.choice) == len(plan.nodes)
    assert plan.goals == ("minmax" if aim == WORST_PEAK else str(aim),)


@pytest.mark.slow
def test_limits_hold_in_every_scenario():
    problem = posed()
    drawn = scenarios(problem.schedule.scene, count=5, seed=1)
    free = seqopt.solve(robust(problem, drawn, WORST_TOTAL))
    largest = max(largest_force(scene, free) for scene in drawn.scenes)
    limited = posed([seqopt.Limit("F_largest", 0.9 * largest)])
    kept = seqopt.solve(robust(limited, drawn, WORST_TOTAL))
    assert kept.certificate.objective >= free.certificate.objective
    assert all(largest_force(scene, kept) <= 0.9 * largest + 1e-6 for scene in drawn.scenes)
    nothing = posed([seqopt.Limit("F_largest", 1.0)])
    with pytest.raises(InfeasibleError, match="in which no grip is open, has F_largest=37"):
        seqopt.solve(robust(nothing, drawn, WORST_TOTAL))
    little = posed([seqopt.Limit("F_largest", 45.0)])
    for aim in (WORST_TOTAL, WORST_PEAK):
        with pytest.raises(InfeasibleError, match="has no state that is allowed"):
            seqopt.solve(robust(little, drawn, aim))


def largest_force(scene, plan):
    """The largest force of a grip in the steps whose grips were chosen."""
    table = seqopt.analyze(ComplianceEngine(seqopt.build_network(scene)), plan.steps)
    chosen = {step.number for step in plan.problem.schedule.steps if step.moves}
    rows = table[table["step"].isin(chosen)]
    return rows[["F_rob1_N", "F_rob2_N", "F_rob3_N"]].abs().max().max()


# bad input
def test_aims_in_words():
    assert [parse_robust(str(aim)) for aim in AIMS] == [*AIMS]


@pytest.mark.parametrize("text", ["worst", "cvar=", "cvar=x", "cvar=1", "cvar=-0.1"])
def test_words_that_are_no_aim(text):
    with pytest.raises(ProblemError, match="give"):
        parse_robust(text)


def test_what_is_no_problem_is_refused():
    problem = posed()
    scene = problem.schedule.scene
    drawn = scenarios(scene, count=1)
    with pytest.raises(ProblemError, match="give worst-peak"):
        robust(problem, drawn, None)
    assert robust(problem, drawn, "worst-peak") == robust(problem, drawn, WORST_PEAK)
    with pytest.raises(ProblemError, match="robust aim worst does not exist"):
        robust(problem, drawn, "worst")
    with pytest.raises(ProblemError, match="is not a scene"):
        robust(problem, [scene, None], WORST_PEAK)
    with pytest.raises(ProblemError, match="scenario 1: it has other bricks"):
        robust(problem, [small_arch(4)], WORST_PEAK)
    engine = ComplianceEngine(problem.engine.network)
    own = seqopt.pose(engine, problem.schedule, problem.criterion)
    with pytest.raises(ProblemError, match="scenarios need engines of their own"):
        robust(own, drawn, WORST_PEAK)
    capped = robust(problem, drawn, WORST_PEAK).but(budgets=("travel=3m",))
    with pytest.raises(ProblemError, match="minimax: the budget 'travel' couples all moves"):
        seqopt.solve(capped, "minimax")
    with pytest.raises(ProblemError, match="is not a kind"):
        RobustAim("worst-peak")
