"""What is proven of budgets; proofs are as strong as they promise."""

from dataclasses import replace
from fractions import Fraction
from heapq import heappop, heappush
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import seqopt
from experiments.harness.layers import LayeredCosts
from seqopt.engines.interface import Want
from seqopt.errors import InfeasibleError, ProblemError, SolverError, TimeUpError
from seqopt.graph import Explorer
from seqopt.graph._spaces import OrderSpace, among_orders, explore, floors_of_goals
from seqopt.graph.formulation import End, FormulationKind, formulations
from seqopt.graph.graph import (
    Graph,
    distances,
    keep_best,
    least_peak,
    lexicographic_bounds,
    reached,
)
from seqopt.graph.states import build_states
from seqopt.instances._solve import smallest_conflict
from seqopt.judge import arithmetic as budget_proof
from seqopt.judge._proof import Proof, TooManyPartsError
from seqopt.judge._states import Filter, StateEvaluator
from seqopt.judge.arithmetic import budget_bounds, least_within
from seqopt.plan.solve import solve
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import Limit
from seqopt.responses.quantities import CHOSEN_BY
from seqopt.scene.scene import with_robots
from seqopt.sequence.rules import Ending, FreeRules
from tests.builders import small_arch
from tests.layered import Budget, Costs, answer
from tests.plain_rules import PlainBook
from tests.strategies import budgeted

TAKERS = {name: found for name, found in formulations("costs").items() if found.takes_budgets}


def bounded(problem, value, claimed):
    """What the judge proves of costs, given the value of a choice and claimed multipliers."""
    instance = problem.compiled().instance
    limited = [(cap.column, cap.most) for cap in instance.caps]
    costs = instance.amounts[:, 0]
    prices = [max(0.0, claimed.get(cap.name, 0.0)) for cap in instance.caps]
    own = instance.graph, costs, limited, value
    return least_within(*own, prices=prices, labels=True)


@pytest.mark.parametrize("most", [1, 5_000])
@given(problem=budgeted(), price=st.floats(0, 5))
def test_no_choice_costs_less_than_is_proven(problem, price, most):
    found = problem.within()
    claimed = {budget.name: price for budget in problem.budgets}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(budget_proof, "MOST", most)
        for value in {*found.values()}:
            bound = bounded(problem, value, claimed)
            assert bound <= min(found.values()) + 1e-6
            if most > 1:
                assert bound == pytest.approx(min(found.values()), abs=1e-6)


@given(problem=budgeted())
def test_the_smallest_conflict(problem):
    def within(budgets):
        return replace(problem, budgets=tuple(budgets)).within()

    if not within(()):
        return
    found = [cap.name for cap in smallest_conflict(problem.compiled().instance)]
    sizes = [
        count
        for count in range(1, len(problem.budgets) + 1)
        if any(not within(some) for some in combinations(problem.budgets, count))
    ]
    assert len(found) == (sizes[0] if sizes else 0)
    assert not found or not within(b for b in problem.budgets if b.name in found)


def tied(rng):
    """A problem of one to three moves with equal costs; a choice is exactly at its budgets.

    Or just above them, so that none may be within.
    """
    sizes = rng.integers(1, 4, rng.integers(1, 4))

    def parts(values):
        pairs = zip((1, *sizes[:-1]), sizes, strict=True)
        shared = tuple(rng.choice([0.0, *values], pair) for pair in pairs)
        return tuple(rng.choice(values, size) for size in sizes), shared

    chosen = tuple(int(rng.integers(size)) for size in sizes)
    budgets = []
    for name in ("one", "two")[: rng.integers(1, 3)]:
        budget = Budget(name, *parts([0.1, 0.2, 0.3, 1.0, 2.0]), 0.0)
        bound = budget.spent(chosen) - rng.choice([0.0, 0.0, 0.0, 0.05])
        budgets.append(replace(budget, bound=bound))
    return Costs(LayeredCosts(*parts([1.85, 3.7, 3.7, 1e-3])), tuple(budgets))


def exactly_within(problem):
    """The choices within all budgets, without rounding, and what they cost."""

    def spent(budget, choice):
        return sum(map(Fraction, LayeredCosts(budget.single, budget.shared).parts(choice)))

    return {
        choice: problem.sums.cost(choice)
        for choice in product(*map(range, problem.sums.sizes))
        if all(spent(budget, choice) <= Fraction(budget.bound) for budget in problem.budgets)
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", TAKERS)
def test_none_is_within_only_where_enumeration_finds_none(name):
    """Prices may rise without end where costs tie; rounding must not decide what is possible."""
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(60):
        problem = tied(rng)
        found = exactly_within(problem)
        try:
            proof = answer(problem, name).certificate
        except InfeasibleError:
            assert not found, problem
            refused += 1
        except SolverError:
            assert TAKERS[name].kind is FormulationKind.BOUND, problem
        else:
            best = min(found.values(), default=np.inf)
            assert proof.bound <= best + 1e-6
            if TAKERS[name].kind is FormulationKind.EXACT:
                assert proof.objective <= best + 1e-6
    assert refused


def test_what_rounding_puts_above_a_bound_is_not_proven_to_exceed_it():
    """0.1 + 1.1 is more than 1.2 in binary fractions; a choice that takes it counts as within."""
    pairs = (np.zeros((1, 2)), np.zeros((2, 1)))
    use = (np.array([0.1, 0.0]), np.array([1.1]))
    costs = LayeredCosts((np.array([1.0, 2.0]), np.zeros(1)), pairs)
    problem = Costs(costs, (Budget("use", use, pairs, 1.2),))
    assert problem.budgets[0].spent((0, 0)) > 1.2
    assert bounded(problem, 2.0, {}) == pytest.approx(1.0)
    assert bounded(problem, 2.0, {"use": 1e17}) <= 1.0 + 1e-6
    only = replace(problem.budgets[0], single=(np.array([0.1, 0.1]), np.array([1.1])))
    assert smallest_conflict(replace(problem, budgets=(only,)).compiled().instance) == ()
    for name in ("labels", "overlap_mip"):
        assert answer(problem, name).choice == (0, 0)


@pytest.mark.parametrize("peak", [True, False])
def test_multipliers_bound_what_is_capped_and_others_are_refused(peak):
    """The cheap way takes two of a cap of one, the dear one nothing; labels see that of sums."""
    rows, amounts = np.array([[0, 0], [1, 1]], dtype=np.int32), np.array([[1.0, 2.0], [4.0, 0.0]])
    graph = Graph(*rows, amounts, (peak, False), np.array([False, True]))
    claimed = (4.0 if peak else 1.0,)
    assert budget_bounds(graph, (4.0,), claimed, ((1.0,), ((2.0,),))) == pytest.approx(
        (4.0 if peak else 2.0,)
    )
    (proven,) = budget_bounds(graph, (4.0,), claimed, ((1.0,), ((0.0,),)))
    assert proven == (-np.inf if peak else 1.0)
    (proven,) = budget_bounds(graph, (4.0,), (4.0,), ((1.0,), ((0.0,),)))
    assert proven == (-np.inf if peak else pytest.approx(4.0))
    for none in ((np.nan,), (np.inf,), (1.0, 1.0), ()):
        with pytest.raises(SolverError, match="where 1 numbers belong"):
            budget_bounds(graph, (4.0,), (4.0,), ((1.0,), (none,)))


@pytest.mark.slow
def test_few_labels_stop_with_a_bound(problem25):
    capped = problem25.but(budgets=["travel=18m", "steps_over:F_largest=250:18"])
    best = solve(capped, "labels")
    assert best.ended is End.DONE
    assert best.certificate.claimed_gap <= 1e-6
    few = solve(capped, "labels", options={"most": 8})
    assert few.selection.bound[0] <= best.certificate.objective <= few.certificate.objective
    assert few.ended is End.STOPPED or few.selection.bound == few.selection.objective
    assert few.certificate.claimed_gap < 0.02
    with pytest.raises(ProblemError, match="F_rob9"):
        solve(problem25.but(budgets="steps_over:F_rob9=100:1"), "labels")
    tight = problem25.but(budgets=["travel=11.4m", "steps_over:F_largest=250:18"])
    with pytest.raises(TimeUpError, match="no path within all caps was found yet"):
        solve(seqopt.compile_instance(tight), "labels", options=["most=1"], time_limit=0)


def test_labels_prove_only_what_all_of_them_close(monkeypatch):
    """Both cheap candidates exceed the cap together; multipliers alone say half of what is left."""
    pairs = (np.zeros((1, 2)), np.zeros((2, 2)))
    costs = LayeredCosts((np.array([0.0, 1.0]), np.array([0.0, 2.0])), pairs)
    use = (np.array([1.0, 0.0]),) * 2
    problem = Costs(costs, (Budget("use", use, pairs, 1.5),))
    assert bounded(problem, 1.0, {}) == pytest.approx(1.0)
    whole = budget_proof._swept

    def spoiled(*asked):
        found = whole(*asked)
        return replace(found, kept=found.kept[:1])

    monkeypatch.setattr(budget_proof, "_swept", spoiled)
    assert bounded(problem, 1.0, {}) == pytest.approx(0.5)


# proofs are as strong as they promise: one that looks at less, or allows more, is noticed
ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))
FREE_RULES = FreeRules()


def posed(aim, scene=None, limits=(), count=5, rules=FREE_RULES):
    engine = seqopt.make_engine("compliance", scene or small_arch(count))
    return build_states(engine, rules, ONES, aim, limits)


def states_below(problem, bound, join):
    """How many states plans may pass whose values, joined, are within a bound: in plain words."""
    book, engine = PlainBook(problem.network, problem.rules), problem.engine
    work = [(0.0, 0, 0, (None,) * len(problem.network.scene.robots))]
    done, values, pushed = set(), {}, 0
    while work:
        taken, _, bricks, grips = heappop(work)
        if (bricks, grips) in done:
            continue
        done.add((bricks, grips))
        for _, after, held, _ in book.follow(bricks, grips, 0):
            nodes = tuple(sorted(node for node in held if node is not None))
            if (after, nodes) not in values:
                asked = np.array([nodes], dtype=int).reshape(1, -1)
                fields = engine.solve(after, asked, Want.ALL)
                values[after, nodes] = float(CHOSEN_BY["M_sup"].of(engine.network, fields)[0])
            total = join(taken, values[after, nodes])
            if total <= bound:
                pushed += 1
                heappush(work, (total, pushed, after, held))
    return len(done)


@pytest.mark.parametrize(("aim", "join"), [("M_sup", max), ("sum(M_sup)", lambda a, b: a + b)])
def test_the_proof_looks_at_every_state_that_a_better_plan_could_pass(aim, join):
    problem = posed(aim, count=6, rules=FreeRules(ending=Ending.HELD))
    best = solve(problem, "schedule_search", proof=False).selection.objective
    proof = Proof(problem)
    assert proof.bounds(best) == pytest.approx(best, rel=1e-12)
    most = best[0] * (1 - 1e-9) if join is max else np.inf  # any state may be on a way to less
    assert proof.states == states_below(problem, most, join)
    assert proof.states > (150 if join is max else 200)  # one that stops early looks at less


@pytest.mark.parametrize("ending", list(Ending))
@pytest.mark.parametrize(("robots", "regrips"), [(2, None), (4, 0)])
def test_what_all_plans_have_in_common_bounds_every_path(ending, robots, regrips):
    """The search and the judge say the same, and no path through all states stays below."""
    rules = FreeRules(ending=ending, regrips=regrips, least_grips=1)
    problem = posed("minmax,steps", with_robots(small_arch(5), robots), rules=rules)
    floors = floors_of_goals(problem)
    assert StateEvaluator(problem).least() == pytest.approx(floors, rel=1e-12)
    graph = explore(problem).graph().graph
    assert least_peak(graph, 0) >= floors[0] * (1 - 1e-12)
    fewest = keep_best(graph, 1)[1]
    assert fewest == floors[1] or (regrips == 0 and fewest > floors[1])
    assert np.isfinite(floors[0]) == (ending is not Ending.HELD)


@pytest.mark.parametrize("direction", ["build", "take-down"])
@pytest.mark.parametrize("ending", list(Ending))
def test_no_step_lowers_the_steps_to_go_by_more_than_one(direction, ending):
    """So a path through a state has at least as many steps as are counted to it and from there."""
    if direction == "take-down" and ending is not Ending.HELD:
        ending = Ending.RELEASED  # nobody holds in the end, however builds end
    rules = FreeRules(ending=ending, least_grips=1, direction=direction)
    problem = posed("minmax,steps", count=4, rules=rules)
    space, tables = problem.space, StateEvaluator(problem).tables
    graph, states = explore(problem).graph()
    left = [space.steps_to_go(level, rows) for level, _, rows in states]
    again = [tables.steps_to_go(level, rows) for level, _, rows in states]
    bound = np.concatenate(left)
    assert bound.tolist() == np.concatenate(again).tolist()
    fewest = distances(graph, graph.amounts[:, 1], back=True)
    assert (bound <= fewest).all()  # infinite where no end is reached
    assert (bound[graph.source] <= 1 + bound[graph.target]).all()
    assert bound[0] == fewest[0]
    assert (bound == fewest).mean() > 0.05


@pytest.mark.slow
def test_fewer_steps_are_proven_by_states_on_paths_of_fewer_steps():
    """A plan of more steps, or a bound that is too high, is refused by them as by all states."""
    problem = posed("minmax,steps", count=6)
    peak, steps = solve(problem, "schedule_search", proof=False).selection.objective
    proof, every = Proof(problem), Proof(problem)
    assert proof.bounds((peak, steps)) == (peak, steps)
    graph = every.rebuilt(Filter((peak, steps))).graph()
    assert lexicographic_bounds(graph, (peak, steps)) == (peak, steps)
    few = every.rebuilt(Filter((peak, steps), steps=steps - 1)).graph()
    assert len(few.source) < len(graph.source)
    assert not few.ends[reached(few)].any()
    as_many = every.rebuilt(Filter((peak, steps), steps=steps)).graph()
    assert lexicographic_bounds(as_many, (peak, steps))[1] == steps
    for more in (1, 2, 3):
        assert Proof(problem).bounds((peak, steps + more))[1] <= steps


@pytest.mark.parametrize(("aim", "by"), [("F_largest", "limits"), ("sum(M_sup)", "payloads")])
def test_the_proof_lets_robots_carry_all_they_may(aim, by):
    """They may just carry what any plan needs: plans above the best one are found."""
    scene = small_arch(5)
    (least,) = solve(posed("F_largest"), "schedule_search", proof=False).selection.objective
    limits = [Limit(f"F_{robot.name}", least) for robot in scene.robots] if by == "limits" else ()
    if by == "payloads":
        robots = tuple(replace(robot, payload=least) for robot in scene.robots)
        scene = replace(scene, robots=robots)
    problem = posed(aim, scene, limits)
    (best,) = solve(problem, "schedule_search").selection.objective
    assert Proof(problem).bounds((best * (1 + 1e-6),)) == pytest.approx((best,), rel=1e-9)


@pytest.mark.slow
def test_what_was_left_out_for_a_threshold_bounds_all_orders(monkeypatch):
    """Whatever the threshold; and with few sets looked at nothing is proven."""
    problem = among_orders(posed("F_largest", count=4), "tied")
    best = seqopt.solve(problem).certificate.objective
    for share in (0.0, 0.5, 0.99):
        found = Explorer(OrderSpace(problem))
        assert not found.rise(share * best)
        assert share * best < found.excluded <= best * (1 + 1e-6)
    assert Proof(problem).bounds_first(best)
    assert not Proof(problem).bounds_first(best * 1.01)
    monkeypatch.setattr("seqopt.judge._proof.MOST", 3)
    with pytest.raises(TooManyPartsError):
        Proof(problem).bounds_first(best * 1.01)  # the whole arch is below that
