"""The proof from some of the pairs, against all pairs solved."""

from __future__ import annotations

from dataclasses import replace
from unittest.mock import ANY

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph._decision_search import PairBounds, walk_windows
from seqopt.graph.decision_costs import LayeredCosts
from seqopt.graph.decisions import pose_decisions
from seqopt.graph.formulation import End, Solution, Watch, find_formulation
from seqopt.graph.paths import lexicographic
from seqopt.judge.certificate import TOLERANCE
from seqopt.network.build import build_network
from seqopt.plan._answers import judged
from seqopt.plan.solve import solve
from seqopt.problem.criteria import Ranked, StepCost
from seqopt.problem.problem import Aim
from seqopt.problem.requirements import Limit
from seqopt.sequence.methods import three_robot_loop
from seqopt.study.published import EQUATIONS, WEIGHTED, WORST_RATIO
from tests.builders import far_reaching
from tests.layered import Costs, answer
from tests.strategies import arches, problems

CONDITIONAL = replace(EQUATIONS, ranked=Ranked.CONDITIONAL)


def squares(responses, bricks):
    return 0.5 + (responses["F_largest"] / 270) ** 2 + (responses["T_max"] / 87.7) ** 2


OWN = StepCost("squares", ("F_largest", "T_max"), squares, least=0.5)


def posed(engine, criterion, limits=()):
    return pose_decisions(engine, three_robot_loop(engine.network), criterion, limits)


QUICK = {("overlap_dp", OWN)}
SLOW = {("overlap_dp", CONDITIONAL), ("minimax", WORST_RATIO), ("overlap_mip", WEIGHTED)}


def marks(case):
    """Quick, slow or for a release; every formulation and every criterion is quick or slow."""
    if case in QUICK:
        return []
    return [pytest.mark.slow] if case in SLOW else [pytest.mark.slow, pytest.mark.long]


@pytest.mark.parametrize(
    ("name", "criterion"),
    [
        pytest.param(name, criterion, marks=marks((name, criterion)))
        for name in ("overlap_dp", "minimax", "overlap_mip")
        for criterion in (CONDITIONAL, WEIGHTED, WORST_RATIO, OWN)
    ],
    ids=lambda given: getattr(given, "name", given),
)
def test_the_optimum_is_that_of_all_pairs(engine25, name, criterion):
    problem = posed(engine25, criterion)
    lazy, whole = solve(posed(engine25, criterion), name, lazy=True), solve(problem, name)
    assert lazy.certificate.objective == pytest.approx(whole.certificate.objective, rel=1e-9)
    assert lazy.certificate.gap <= 1e-9
    assert lazy.ended is End.DONE
    value = whole.formulation.aim.value_of(whole.formulation.aim.costs(problem), lazy.choice)
    assert value == pytest.approx(lazy.certificate.objective, rel=1e-12)
    assert lazy.models < whole.models
    assert lazy.summary()["status"] == "optimal"
    assert len(lazy.table()) == len(whole.table())


@pytest.mark.parametrize("name", ["overlap_dp", pytest.param("minimax", marks=pytest.mark.slow)])
@settings(max_examples=6)
@given(scene=arches(min_bricks=4, max_bricks=7).map(far_reaching), data=st.data())
def test_on_any_chain(name, scene, data):
    engine = ComplianceEngine(build_network(scene))
    criterion = data.draw(st.sampled_from([CONDITIONAL, WEIGHTED, OWN]))
    lazy = solve(posed(engine, criterion), name, lazy=True)
    whole = solve(posed(engine, criterion), name)
    assert lazy.certificate.objective == pytest.approx(whole.certificate.objective, rel=1e-9)
    assert lazy.certificate.gap <= 1e-9


@pytest.mark.parametrize("name", ["minimax"])
def test_where_choices_move_by_move_end_others_are_found(engine25, name):
    limits = [Limit("T_max", 65.0)]
    with pytest.raises(SolverError, match="no allowed grip after the choices before it"):
        walk_windows(posed(engine25, WEIGHTED, limits), Watch())
    lazy = solve(posed(engine25, WEIGHTED, limits), name, lazy=True)
    whole = solve(posed(engine25, WEIGHTED, limits), name)
    assert lazy.certificate.objective == pytest.approx(whole.certificate.objective, rel=1e-9)
    assert lazy.certificate.gap <= 1e-9
    with pytest.raises(SolverError, match="no choice was found yet"):
        solve(posed(engine25, WEIGHTED, limits), name, lazy=True, time_limit=0)
    with pytest.raises(InfeasibleError):
        solve(posed(engine25, WEIGHTED, [Limit("T_max", 60.0)]), name, lazy=True)


@pytest.mark.parametrize(("name", "criterion"), [("overlap_dp", WEIGHTED)])
def test_stopped_before_it_has_a_choice_and_a_bound(engine25, name, criterion):
    stopped = solve(posed(engine25, criterion), name, lazy=True, time_limit=0)
    best = solve(posed(engine25, criterion), name).certificate.objective
    found = stopped.certificate
    assert stopped.ended is End.STOPPED
    assert found.bound <= best < found.objective
    assert found.gap == pytest.approx((found.objective - found.bound) / found.objective)
    assert stopped.summary()["status"] == "feasible"


@given(problem=problems(), data=st.data(), aim=st.sampled_from(Aim))
def test_what_some_pairs_prove(problem, data, aim):
    """Whatever pairs are known, bound and best enclose the optimum; with all they meet."""
    sums = problem.sums
    finite = [array[np.isfinite(array)].min(initial=0.0) for array in (*sums.single, *sums.shared)]
    lift = -min(finite)
    single = tuple(own + lift for own in sums.single)
    first = np.zeros((1, sums.sizes[0]))
    costs = LayeredCosts(single, (first, *(shared + lift for shared in sums.shared[1:])))
    best = costs.least(aim)
    rows = {
        (k, before): row
        for k, shared in enumerate(costs.shared)
        for before, row in enumerate(shared)
        if k
    }
    some = {}
    for key, row in rows.items():
        if data.draw(st.booleans()):
            drawn = data.draw(st.lists(st.booleans(), min_size=len(row), max_size=len(row)))
            some[key] = np.where(drawn, row, np.nan)
    part, everything = (PairBounds([*single], 0.0, aim, own) for own in (some, rows))
    close = {"rel": 1e-9, "abs": 1e-9}
    (bound, path), known = part.best(0.0), part.best(np.inf)[0]
    assert bound <= best + 1e-9 * abs(best) or np.isinf(best)
    assert known >= best - 1e-9 * abs(best) or np.isinf(known)
    assert [everything.best(other)[0] for other in (0.0, np.inf)] == [
        pytest.approx(best, **close)
    ] * 2
    if np.isinf(best):
        return
    if aim is Aim.PEAK:
        path = part.fewest_open(bound + 1e-9)
    floors = [
        [some.get((k, i), np.full(len(row), np.nan)) for i, row in enumerate(shared)]
        for k, shared in enumerate(costs.shared)
        if k
    ]
    lower = tuple(np.where(np.isnan(own), 0.0, own) for own in map(np.array, floors))
    value = aim.value_of(LayeredCosts(single, (first, *lower)), path)
    assert value == pytest.approx(bound, **close)
    for own, unknown, least in ((part, True, bound), (everything, False, best)):
        instance, _ = own.compiled(unknown=unknown)
        assert lexicographic(instance.graph) == (ANY, (pytest.approx(least, **close),))
    plan = answer(Costs(costs), "overlap_dp" if aim is Aim.SUM else "minimax")
    assert plan.certificate.objective == pytest.approx(best, **close)


@pytest.mark.parametrize(("aim", "best", "bound"), [(Aim.SUM, 6.0, 4.0), (Aim.PEAK, 3.0, 2.0)])
def test_the_judge_holds_a_plan_against_the_graph_with_floors(aim, best, bound):
    """The first move costs 2, the second 1 or 1.5, a pair that is known 3, others at least 1."""
    single = np.full(2, 2.0), np.array([1.0, 1.5])
    part = PairBounds([*single], 1.0, aim, {(1, 0): np.array([3.0, np.nan])})
    assert (part.best(np.inf)[0], part.best(1.0)[0]) == (best, bound)
    instance, nodes = part.compiled(unknown=True)
    path = tuple((node,) for node in np.searchsorted(nodes, [1, 3]).tolist())
    good = Solution(path, (best,), (bound,), stopped="time")
    exact = find_formulation("overlap_dp" if aim is Aim.SUM else "minimax")
    proof = judged(instance, exact, good)
    assert (proof.bound, proof.gap) == (bound, (best - bound) / best)
    judged(instance, exact, replace(good, bound=(bound + 0.9 * TOLERANCE * best,)))
    for wrong in (
        *(replace(good, bound=(bound + more,)) for more in (1.1 * TOLERANCE * best, 0.1, np.inf)),
        replace(good, objective=(best - 1,)),
        replace(good, objective=(np.nan,)),
        replace(good, stopped=""),
    ):
        with pytest.raises(SolverError):
            judged(instance, exact, wrong)


def test_a_criterion_that_lies_about_its_least_cost_is_refused(engine25):
    with pytest.raises(ProblemError, match=r"below its least, 50; state a lower one"):
        solve(posed(engine25, replace(OWN, least=50.0)), "overlap_dp", lazy=True)
    with pytest.raises(ProblemError, match=r"least is -1; give a number from 0"):
        replace(OWN, least=-1)


@pytest.mark.parametrize(
    ("criterion", "name", "options", "said"),
    [
        (EQUATIONS, "overlap_dp", {}, "nothing is known of a pair before all are solved"),
        (replace(OWN, least=None), "overlap_dp", {}, "state the least cost"),
        (WEIGHTED, "cascade", {}, "give an exact formulation"),
        (WEIGHTED, "overlap_dp", {"proof": False}, "a lazy search proves"),
    ],
)
def test_what_cannot_be_searched_lazily_is_refused(engine25, criterion, name, options, said):
    with pytest.raises(ProblemError, match=said):
        solve(posed(engine25, criterion), name, lazy=True, **options)


def test_costs_that_are_given_and_free_schedules_have_nothing_to_save():
    costs = Costs(LayeredCosts((np.ones(2),), (np.zeros((1, 2)),)))
    with pytest.raises(ProblemError, match="leave out lazy"):
        solve(costs.compiled().instance, "overlap_dp", lazy=True)
