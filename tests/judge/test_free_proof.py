"""The proof of free schedules; what a formulation claims is recomputed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from experiments.harness.layers import LayeredCosts
from seqopt import judge_instance
from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph.formulation import FormulationKind, find_formulation
from seqopt.graph.states import build_states
from seqopt.judge._proof import Proof
from seqopt.judge._rule_moves import RuleTables
from seqopt.judge.certificate import TOLERANCE
from seqopt.plan.solve import solve
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.problem import Aim
from seqopt.sequence.steps import StepKind
from seqopt.study import EQUATIONS
from tests.builders import first, small_arch
from tests.layered import Budget, Costs, answer, changed, path_of, told
from tests.plain_rules import PlainBook
from tests.strategies import free_builds, problems

ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0), ("T_max", 30.0), ("D_max", 1e-5)))
few = settings(max_examples=3, deadline=None)


def follows(book, tables, bricks, state):
    """What follows from a row by the book, as plain values."""
    robots = len(book.network.scene.robots)
    grips = [None] * robots
    for column, robot in enumerate(book.team):
        grips[robot] = int(tables.nodes[state[column]]) if state[column] else None
    counts = book.rules.regrips is not None
    taken = int(state[-1]) if counts else 0
    place = {node: i for i, node in enumerate(tables.nodes.tolist())}
    for kind, after, held, regrips in book.follow(bricks, tuple(grips), taken):
        row = [place[held[r]] if held[r] is not None else 0 for r in book.team]
        yield after, (*row, *([regrips] if counts else [])), kind is StepKind.REPOSITION


@given(build=free_builds(most_bricks=3, most_robots=3), data=st.data())
@few
def test_tables_say_what_the_book_says(build, data):
    """All states that rules lead to, robots that could change places told apart."""
    scene, rules = build
    book = PlainBook(seqopt.build_network(scene), rules)
    tables = RuleTables(book, [])
    reached = {(0, tuple(tables.start()[0].tolist()))}
    work = [*reached]
    while work:
        bricks, row = work.pop()
        expected = {*follows(book, tables, bricks, row)}
        states = np.array([row], dtype=np.int32)
        found = {
            (follows.level, tuple(after), follows.regrip)
            for follows in tables.successors(bricks, states)
            for after in follows.states.tolist()
        }
        assert found == expected
        found = {move[:2] for move in found}
        assert tables.ends(bricks, states)[0] == book.ends(
            bricks, tuple(int(tables.nodes[n]) if n else None for n in row[: tables.robots])
        )
        work += found - reached
        reached |= found
    assert len(reached) > 1 or not {*follows(book, tables, *reached.pop())}


@pytest.mark.parametrize("aim", ["minmax,steps", "sum(D_max),regrips", "travel"])
@given(build=free_builds(most_bricks=4, most_robots=3), told=st.booleans())
@few
def test_bounds_are_the_values_of_the_best_plan(aim, build, told):
    """Whatever states it is told of; and of a worse plan they are less than its values."""
    scene, rules = build
    problem = build_states(seqopt.make_engine("compliance", scene), rules, ONES, aim)
    try:
        best = seqopt.solve(problem, "schedule_search").selection
    except InfeasibleError:
        assert Proof(problem).is_impossible()
        return
    hint = dict(enumerate(best.visited)) if told else None
    assert Proof(problem, hint).bounds(best.objective) == pytest.approx(best.objective, rel=1e-9)
    assert not Proof(problem, hint).is_impossible()
    worse = (1.1 * best.objective[0] + 1, *best.objective[1:])
    assert Proof(problem, hint).bounds(worse)[0] == pytest.approx(best.objective[0], rel=1e-9)


@pytest.mark.parametrize("count", [1, 2])
def test_the_models_of_a_proof_are_those_that_engines_solved(count):
    network = seqopt.build_network(first(seqopt.load_scene("arch25"), 9))
    engines = [seqopt.make_engine("auto", network) for _ in range(count)]
    problem = build_states(engines[0], seqopt.FreeRules(), ONES, "minmax")
    problem = replace(problem, scenarios=tuple(engines) if count > 1 else ())
    value = seqopt.solve(problem).objective["minmax"]
    before = sum(engine.tally.total() for engine in engines)
    proof = Proof(problem)
    proof.bounds((value,))
    assert proof.models == sum(engine.tally.total() for engine in engines) - before > 0


# what a formulation claims is recomputed: false answers, broken promises, bounds
HEURISTIC, EXACT = FormulationKind.HEURISTIC, FormulationKind.EXACT


def bounded(bound):
    return lambda s: replace(s, bound=(bound(s.objective[0]),))


@pytest.mark.slow
def test_promises_are_held(problem25):
    """A heuristic that calls itself exact is refused, and so is a bound above the optimum."""
    cascade = find_formulation("cascade")
    with pytest.raises(SolverError, match=r"663\.811505 is promised as the least; a plan has less"):
        solve(problem25, replace(cascade, kind=EXACT))
    poor = bounded(lambda value: value)
    with pytest.raises(SolverError, match=r"663\.811505 is promised as the least; a plan has less"):
        solve(problem25, changed(cascade, poor))
    with pytest.raises(SolverError, match=r"660\.\d+ is promised as the least; a plan has less"):
        solve(problem25, changed(cascade, bounded(lambda value: 0.995 * value)))


def test_a_formulation_of_bounds_is_not_optimal_by_its_kind(problem25):
    """Of its bound and of its path only what the judge proves counts."""
    cascade = find_formulation("cascade")
    plan = solve(problem25, replace(cascade, kind=FormulationKind.BOUND))
    assert (plan.status, plan.gap) == ("feasible", pytest.approx(0.0096, abs=2e-4))


def test_a_formulation_is_not_given_what_the_judge_computed():
    seen, scene = [], small_arch(5)
    cascade = find_formulation("cascade")

    def looks(problem, **means):
        seen.extend([problem, *problem.each])
        return cascade.solve(problem, **means)

    worlds = seqopt.scenarios(scene, count=2, seed=1)
    engine = seqopt.make_engine("compliance", scene)
    problem = seqopt.pose(engine, seqopt.three_robot_loop(engine.network), EQUATIONS)
    problem = problem.but(scenarios=worlds, goals="minmax", limits="F_largest=1e6")
    solve(problem, "minimax")
    (graph,) = problem.graphs.values()
    solve(problem, replace(cascade, solve=looks))
    assert graph.judged
    assert len(seen) == 3
    assert not any(each.judged for each in seen)


def proven(costs, aim):
    """What the judge proves of any choice, given one."""
    choice = next(iter(costs.within(aim)))
    compiled = costs.compiled(aim)
    return judge_instance(compiled.instance, path_of(compiled, choice)).bound


@given(problem=problems())
def test_the_least_of_any_choice_is_that_of_enumeration(problem):
    for aim in Aim:
        if problem.within(aim):
            assert proven(problem, aim) == problem.best(aim)


def signed(*bounds):
    """Four choices: (0, 0) is worth 5, (0, 1) 1, (1, 0) 10 and (1, 1) 6. All take 1."""
    single, none = (np.array([0.0, 5.0]), np.array([5.0, 1.0])), (np.zeros((1, 2)), np.eye(2) * 0)
    amounts = (np.ones(2), np.zeros(2))
    budgets = tuple(Budget(f"use {bound:g}", amounts, none, bound) for bound in bounds)
    return Costs(LayeredCosts(single, none), budgets)


BEST = (0, 1)  # of the sum and of the peak
VALUES = {Aim.SUM: 1.0, Aim.PEAK: 1.0}
POOR = {Aim.SUM: ((1, 1), 6.0), Aim.PEAK: ((1, 1), 5.0)}
within = pytest.mark.parametrize("aim", Aim)


@within
@pytest.mark.parametrize("sign", [-1, 1])
def test_how_far_a_claim_may_be_off(aim, sign):
    """By the tolerance, over the value."""
    choice, value = POOR[aim]
    for share, good in ((0.99, True), (1.01, False)):
        claimed = told(signed(), choice, value + sign * share * TOLERANCE * value, aim=aim)
        if good:
            assert answer(signed(), claimed).certificate.objective == pytest.approx(value)
        else:
            with pytest.raises(SolverError, match="as claimed"):
                answer(signed(), claimed)


@within
def test_how_high_a_claimed_bound_may_be(aim):
    choice, value = POOR[aim]
    least = VALUES[aim]
    near = least + 0.99 * TOLERANCE * value
    proof = answer(signed(), told(signed(), choice, value, near, aim=aim)).certificate
    assert proof.bound == pytest.approx(least)
    assert proof.claimed_gap == pytest.approx(proof.gap, rel=1e-5)
    for bound in (least + 1.01 * TOLERANCE * value, value, np.inf, np.nan):
        with pytest.raises(SolverError, match=r"claimed bound .* exceeds|a bound is above"):
            answer(signed(), told(signed(), choice, value, bound, aim=aim))


def test_with_budgets_a_bound_may_lie_above_the_least_but_not_above_the_value():
    claimed = (1, 1), 6.0, 5.5
    with pytest.raises(SolverError, match="claimed bound"):
        answer(signed(), told(signed(), *claimed))
    costs = signed(1.0, 2.0)
    proof = answer(costs, told(costs, *claimed)).certificate
    assert (proof.gap, proof.claimed_gap) == pytest.approx((5 / 6, 0.5 / 6))
    assert proof.spent == {"use 1": 1.0, "use 2": 1.0}
    with pytest.raises(SolverError, match="a bound is above its value"):
        answer(costs, told(costs, (1, 1), 6.0, 6.1))


def test_how_far_a_budget_may_be_exceeded():
    costs = signed(9.0, 1 - 0.99 * TOLERANCE)
    answer(costs, told(costs, BEST, 1.0))
    costs = signed(9.0, 1 - 2 * TOLERANCE)
    with pytest.raises(SolverError, match=r"use 0\.9\S* is 1, more than the 0\.9\S* allowed; use"):
        answer(costs, told(costs, BEST, 1.0))


@pytest.mark.parametrize("kind", FormulationKind)
@pytest.mark.parametrize("bounds", [(), (1.0,)])
@pytest.mark.parametrize(("excess", "kept"), [(0.99 * TOLERANCE, True), (1.01 * TOLERANCE, False)])
def test_who_promises_the_optimum_reaches_it(kind, bounds, excess, kept):
    """Budgets aside, whoever is no heuristic does, unless its search was stopped."""
    none = (np.array([[1.0, 1.0]]),)
    costs = LayeredCosts((np.array([0.0, excess / (1 - excess)]),), none)
    budgets = tuple(Budget("use", (np.zeros(2),), (np.zeros((1, 2)),), b) for b in bounds)
    costs = Costs(costs, budgets)
    given_up = (1,), costs.sums.cost((1,))
    early = answer(costs, told(costs, *given_up, kind=kind, stopped="time")).certificate
    assert early.gap == pytest.approx(excess, rel=1e-6)
    claimed = told(costs, *given_up, kind=kind)
    if kept or bounds or kind is HEURISTIC:
        assert answer(costs, claimed).certificate.gap == pytest.approx(excess, rel=1e-6)
    else:
        with pytest.raises(SolverError, match="told promises the least, and no more than 1 is pro"):
            answer(costs, claimed)
