"""Conformance: what every registered formulation does, on random problems and on arches."""

from __future__ import annotations

import signal
from dataclasses import replace
from itertools import cycle, pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from seqopt.graph.layers.interface import CostProblem

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.formulation import (
    End,
    FormulationKind,
    On,
    exhibits,
    find_formulation,
    formulations,
)
from seqopt.graph.layers.costs import Budget, LayeredCosts
from seqopt.graph.layers.layers import candidate_layers, steps_over, travel
from seqopt.network.build import build_network
from seqopt.plan.solving import solve
from seqopt.problem.problem import Aim
from seqopt.problem.requirements import Limit
from seqopt.sequence.three_robots import SCHEDULES, three_robot_loop
from seqopt.study.published import CRITERIA, EQUATIONS, WORST_RATIO
from tests.builders import small_arch
from tests.strategies import budgeted, problems

SHOWN = formulations(On.LAYERS)  # what comparisons have
ALL = SHOWN | exhibits()
EXACT_SUMS = [
    n for n, f in SHOWN.items() if f.aim is Aim.SUM and f.kind is not FormulationKind.HEURISTIC
]
HEURISTICS = [n for n, f in ALL.items() if f.kind is FormulationKind.HEURISTIC]
every = pytest.mark.parametrize("name", ALL)
timely = pytest.mark.parametrize("name", [n for n, f in ALL.items() if f.watched])
takers = pytest.mark.parametrize("name", [n for n, f in ALL.items() if f.takes_budgets])


class Clock:
    """A clock that moves on by a second whenever it is looked at."""

    def __init__(self):
        self.now = 0.0

    def perf_counter(self):
        self.now += 1.0
        return self.now


def brute_force(problem, aim):
    """The best value over every combination, infinite if none is allowed."""
    worth = problem.sums.cost if aim is Aim.SUM else problem.peaks.worst
    choices = product(*(range(size) for size in problem.sums.sizes))
    within = (c for c in choices if all(b.spent(c) <= b.bound for b in problem.budgets))
    return min((worth(c) for c in within), default=np.inf)


@every
@given(problem=problems())
@settings(max_examples=15)
def test_answers_are_certified_or_refused_as_infeasible(name, problem):
    best = brute_force(problem, ALL[name].aim)
    if not np.isfinite(best):
        with pytest.raises(InfeasibleError, match="move"):
            ALL[name].solve(problem)
        return
    plan = solve(problem, name)
    selection, certificate = plan.selection, plan.certificate
    assert certificate.objective >= best - 1e-9
    assert certificate.bound == pytest.approx(best, abs=1e-9)
    if ALL[name].kind is not FormulationKind.HEURISTIC:
        assert certificate.objective == pytest.approx(best, abs=1e-6)
        assert certificate.gap <= 1e-6
    assert selection.bound <= best + 1e-6


@given(problem=problems())
def test_wide_searches_are_exact(problem):
    best = brute_force(problem, Aim.SUM)
    if not np.isfinite(best):
        return
    moves = len(problem.sums.sizes)
    for name, options in (("beam", {"width": 4}), ("rank_search", {"horizon": moves})):
        assert solve(problem, ALL[name], **options).certificate.objective == pytest.approx(best)


@given(problem=problems(), width=st.integers(1, 4))
def test_a_beam_never_does_worse_than_the_cascade(problem, width):
    if not np.isfinite(brute_force(problem, Aim.SUM)):
        return
    beam = solve(problem, ALL["beam"], width=width).certificate.objective
    assert beam <= solve(problem, ALL["cascade"]).certificate.objective + 1e-9


@every
@given(problem=problems(), data=st.data())
@settings(max_examples=8)
def test_renumbering_candidates_keeps_the_value_of_exact_ones(name, problem, data):
    formulation = ALL[name]
    heuristic = formulation.kind is FormulationKind.HEURISTIC
    if heuristic or not np.isfinite(brute_force(problem, formulation.aim)):
        return
    order = [data.draw(st.permutations(range(size))) for size in problem.sums.sizes]
    before = [[0], *order[:-1]]
    single = tuple(c[list(o)] for c, o in zip(problem.sums.single, order, strict=True))
    shared = tuple(
        c[np.ix_(list(b), list(o))]
        for c, b, o in zip(problem.sums.shared, before, order, strict=True)
    )
    other = CostProblem(LayeredCosts(single, shared))
    a, b = (solve(p, formulation).certificate.objective for p in (problem, other))
    assert a == pytest.approx(b, abs=1e-6)


@pytest.mark.parametrize("name", SHOWN)
def test_it_is_repeatable(name, problem25):
    assert ALL[name].solve(problem25).choice == ALL[name].solve(problem25).choice


@every
def test_malformed_problems_are_refused_before_any_formulation(name):
    one, none = np.zeros(1), np.zeros((1, 0))
    with pytest.raises(ProblemError, match="no moves"):
        ALL[name].solve(CostProblem(LayeredCosts((), ())))
    with pytest.raises(ProblemError, match="move 1 has no candidates"):
        ALL[name].solve(CostProblem(LayeredCosts((np.zeros(0),), (none,))))
    with pytest.raises(ProblemError, match="move 1: a single cost is NaN"):
        ALL[name].solve(CostProblem(LayeredCosts((np.array([np.nan]),), (np.zeros((1, 1)),))))
    with pytest.raises(ProblemError, match=r"move 2: shared costs \(1, 2\)"):
        ALL[name].solve(CostProblem(LayeredCosts((one, one), (np.zeros((1, 1)), np.zeros((1, 2))))))


@every
def test_budgets_are_kept_or_refused(name):
    """Taking the cheap candidate of every move costs too much of the budget."""
    single = tuple(np.array([0.0, 1.0]) for _ in range(3))
    shared = (np.zeros((1, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
    amounts = tuple(np.array([1.0, 0.0]) for _ in range(3))
    capped = CostProblem(LayeredCosts(single, shared), (Budget("use", amounts, shared, 1.0),))
    if ALL[name].takes_budgets:
        plan = solve(capped, ALL[name])
        selection, certificate = plan.selection, plan.certificate
        assert certificate.spent["use"] <= 1
        assert selection.bound == pytest.approx(2.0, abs=1e-6)
        if name == "overlap_lp":  # three choices tie: the mixture need not be followed to one
            assert certificate.objective >= 2.0 - 1e-6
            assert selection.prices["use"] == pytest.approx(1.0, abs=1e-3)
        else:
            assert certificate.objective == pytest.approx(2.0)
        impossible = replace(capped, budgets=(replace(capped.budgets[0], bound=-1.0),))
        with pytest.raises(InfeasibleError, match="budgets"):
            ALL[name].solve(impossible)
    else:
        with pytest.raises(ProblemError, match="budget 'use' couples all moves"):
            solve(capped, name)


@timely
@given(problem=st.one_of(problems(), budgeted()), limit=st.integers(0, 60))
@settings(max_examples=15)
def test_an_answer_stopped_early_is_allowed_and_its_bound_holds(name, problem, limit):
    """On a clock that moves on whenever it is looked at."""
    formulation = ALL[name]
    if problem.budgets and not formulation.takes_budgets:
        problem = replace(problem, budgets=())
    best = brute_force(problem, formulation.aim)
    told = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("seqopt.graph.formulation.time", Clock())
        plan, wrongly_refused = None, False
        try:
            plan = solve(problem, formulation, time_limit=float(limit), progress=told.append)
        except InfeasibleError:
            wrongly_refused = np.isfinite(best)
        except SolverError:  # no choice within the budgets was at hand
            wrongly_refused = not problem.budgets
    assert not wrongly_refused
    if plan is None:
        return
    aim = formulation.aim
    worth = aim.value_of(aim.costs(problem), plan.selection.choice)
    assert plan.certificate.objective == pytest.approx(worth)
    assert all(b.spent(plan.selection.choice) <= b.bound + 1e-6 for b in problem.budgets)
    assert plan.selection.bound <= best + 1e-6 <= worth + 2e-6
    trace = plan.selection.trace
    assert tuple(told) == trace
    assert trace[-1].objective == pytest.approx(worth, rel=1e-6, abs=1e-6)
    for before, after in pairwise(trace):
        assert before.seconds <= after.seconds
        assert before.objective >= after.objective
        assert before.bound <= after.bound <= best + 1e-6
    if plan.selection.end is End.DONE and formulation.kind is FormulationKind.EXACT:
        assert worth == pytest.approx(best, abs=1e-6)


@timely
def test_no_time_is_enough_for_an_allowed_choice(name, problem25):
    plan = solve(problem25, ALL[name], time_limit=0)
    assert plan.selection.end is End.STOPPED
    assert plan.certificate.gap < 0.3
    assert plan.selection.bound <= plan.certificate.bound + 1e-6


@timely
def test_an_interrupt_leaves_an_allowed_choice_and_a_bound_that_holds(name, problem25):
    """It comes with the first finding; a second one would end the program."""
    formulation, best, came = ALL[name], ALL["overlap_dp"].solve(problem25).objective, []
    if formulation.takes_budgets:
        problem25 = replace(problem25, budgets=(travel(problem25, 20.516),))

    def interrupt(finding):
        if not came:
            signal.raise_signal(signal.SIGINT)
        came.append(finding)

    plan = solve(problem25, formulation, progress=interrupt)
    assert plan.selection.end is End.INTERRUPTED
    assert plan.selection.trace == tuple(came)
    assert plan.selection.bound <= plan.certificate.objective + 1e-6
    if formulation.aim is Aim.SUM:
        assert plan.certificate.objective >= best - 1e-6
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_before_any_choice_within_the_budgets_says_the_bound(problem25):
    budgets = (travel(problem25, 13.0), steps_over(problem25, "F_largest", 300.0, 1.0))

    came = []

    def interrupt(finding):
        if not came:
            signal.raise_signal(signal.SIGINT)
        came.append(finding)

    with pytest.raises(KeyboardInterrupt, match=r"no choice is below [0-9.]+\) before any"):
        solve(replace(problem25, budgets=budgets), "labels", progress=interrupt)


@pytest.mark.slow
@takers
@given(problem=budgeted())
@settings(max_examples=40)
def test_budgets_against_brute_force(name, problem):
    """Exact ones find the optimum or that there is none; bounds lie below, choices not."""
    free = brute_force(replace(problem, budgets=()), Aim.SUM)
    best = brute_force(problem, Aim.SUM)
    exact = ALL[name].kind is FormulationKind.EXACT
    if not np.isfinite(best) and (exact or not np.isfinite(free)):
        with pytest.raises(InfeasibleError, match="budget" if np.isfinite(free) else "relax"):
            solve(problem, name)
        return
    try:
        plan = solve(problem, name)
    except InfeasibleError:
        assert not np.isfinite(best)
        return
    except SolverError:  # one that was not kept, or no choice was met that keeps all
        assert not exact
        return
    certificate = plan.certificate
    assert all(b.spent(plan.selection.choice) <= b.bound + 1e-6 for b in problem.budgets)
    assert certificate.bound <= best + 1e-6
    assert plan.selection.bound <= best + 1e-6
    if exact:
        assert certificate.objective == pytest.approx(best, abs=1e-6)
        assert certificate.gap <= 1e-6  # proven by the certificate alone
    else:
        assert certificate.objective >= best - 1e-6


@takers
@given(problem=budgeted(most_budgets=2))
@settings(max_examples=15)
def test_prices_are_slopes_of_the_bound(name, problem):
    """With prices p the bound falls by at most p for every unit that there is more."""
    try:
        selection = solve(problem, name).selection
    except (InfeasibleError, SolverError):
        return
    for budget in problem.budgets:
        if budget.name not in selection.prices:
            continue
        price = selection.prices[budget.name]
        assert price >= -1e-6
        wider = [replace(b, bound=b.bound + 1.0 * (b is budget)) for b in problem.budgets]
        best = brute_force(replace(problem, budgets=tuple(wider)), Aim.SUM)
        relaxed = ALL["lagrangian"] if name != "overlap_lp" else ALL[name]
        assert best >= relaxed.solve(problem).bound - price - 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("criterion", "method"),
    [*zip(CRITERIA.values(), cycle(SCHEDULES)), *((EQUATIONS, name) for name in [*SCHEDULES][1:])],
    ids=lambda given: getattr(given, "name", given),
)
def test_exact_ones_agree_on_the_reference_arch(engine25, criterion, method):
    problem = candidate_layers(engine25, SCHEDULES[method](engine25.network), criterion)
    values = [solve(problem, ALL[name]).certificate.objective for name in EXACT_SUMS]
    assert len(values) == 5
    assert np.ptp(values) <= 1e-6 * max(values)
    for name in HEURISTICS:
        assert solve(problem, ALL[name]).certificate.objective >= min(values) * (1 - 1e-9)
    assert solve(problem, ALL["minimax"]).certificate.gap <= 1e-9


@pytest.mark.parametrize("count", [5, 8])
@pytest.mark.parametrize("criterion", CRITERIA.values(), ids=CRITERIA)
def test_all_exact_ones_equal_brute_force_on_small_arches(count, criterion):
    engine = ComplianceEngine(build_network(small_arch(count)))
    problem = candidate_layers(engine, three_robot_loop(engine.network), criterion)
    best = solve(problem, ALL["rank_search"], horizon=count).certificate.objective
    assert best == pytest.approx(brute_force(problem, Aim.SUM))
    for name in EXACT_SUMS:
        assert solve(problem, ALL[name]).certificate.objective == pytest.approx(best, rel=1e-6)
    peak = solve(problem, ALL["minimax"]).certificate.objective
    assert peak == pytest.approx(brute_force(problem, Aim.PEAK))


def test_options_are_checked(problem25):
    for name, options, named in (
        ("cascade", {"charge": "both"}, "charge is 'both'; give one of later, earlier"),
        ("beam", {"width": 0}, "width is 0"),
        ("rank_search", {"horizon": 0}, "horizon is 0"),
        ("rank_search", {"horizon": 22}, "lower the horizon"),
        ("labels", {"most": 0}, "most is 0"),
    ):
        with pytest.raises(ProblemError, match=named):
            ALL[name].solve(problem25, **options)
    with pytest.raises(ProblemError, match="does not exist; give one of beam, best_first"):
        find_formulation("simplex")


def test_a_longer_horizon_and_a_wider_beam_serve(problem25):
    one = solve(problem25, ALL["rank_search"], horizon=1).certificate.objective
    assert one == solve(problem25, ALL["cascade"]).certificate.objective
    two = solve(problem25, ALL["rank_search"]).certificate.objective
    assert one - two > 3  # by default it is a search of its own
    three = solve(problem25, ALL["rank_search"], horizon=3).certificate.objective
    best = solve(problem25, ALL["overlap_dp"]).certificate.objective
    assert best <= three <= two
    assert solve(problem25, ALL["beam"], width=46).certificate.objective == pytest.approx(best)
    earlier = solve(problem25, ALL["cascade"], charge="earlier").certificate.objective
    assert earlier >= best


def test_limits_hold_or_are_infeasible(engine25):
    schedule = three_robot_loop(engine25.network)
    best = solve(
        candidate_layers(engine25, schedule, WORST_RATIO), ALL["minimax"]
    ).certificate.objective
    for factor in (1.001, 0.999):
        limits = [Limit(name, factor * best * bound) for name, bound in WORST_RATIO.limits]
        problem = candidate_layers(engine25, schedule, EQUATIONS, limits)
        if factor > 1:
            choice = solve(problem, ALL["overlap_dp"]).selection.choice
            for choices in problem.evaluation.steps:
                chosen = tuple(choice[m] for m in choices.moves)
                for limit in limits:
                    assert choices.responses[limit.response][chosen] <= limit.bound
        else:
            with pytest.raises(InfeasibleError, match="relax a limit"):
                ALL["overlap_dp"].solve(problem)


def test_budgets_of_the_reference_arch(problem25):
    free = ALL["overlap_dp"].solve(problem25)
    for budget in (travel(problem25, 20.0), steps_over(problem25, "F_largest", 300.0, 5.0)):
        assert budget.spent(free.choice) > budget.bound
        capped = replace(problem25, budgets=(budget,))
        plan = solve(capped, ALL["labels"])
        selection, certificate = plan.selection, plan.certificate
        assert certificate.gap <= 1e-6
        claimed = ALL["overlap_mip"].solve(capped).objective
        assert certificate.objective == pytest.approx(claimed, rel=1e-6)
        assert certificate.spent[budget.name] <= budget.bound + 1e-6
        assert certificate.objective > free.objective
        for name in ("overlap_lp", "lagrangian"):
            relaxed = ALL[name].solve(capped)
            assert relaxed.bound <= selection.objective + 1e-6
            assert relaxed.prices[budget.name] > 0
        flow = ALL["overlap_lp"].solve(capped).bound
        assert relaxed.bound == pytest.approx(flow, rel=1e-5)
    with pytest.raises(ProblemError, match="name it in `also`"):
        steps_over(problem25, "F_rob9", 100.0, 1.0)
