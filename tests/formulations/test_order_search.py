"""The best order against brute force on small builds; what is said where they are large."""

from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings

import seqopt
from formulations.order_search import FORMULATION
from seqopt.contact.mortar import find_mortar
from seqopt.errors import InfeasibleError, ProblemError, SolverError, TimeUpError
from seqopt.graph._spaces import among_orders, order_rules
from seqopt.graph.formulation import FormulationKind, find_formulation
from seqopt.graph.states import build_states, over_scenarios, within
from seqopt.judge._proof import Proof
from seqopt.plan.plan import Status
from seqopt.plan.solve import solve
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.problem import WORST_TOTAL, Orders, cvar
from seqopt.responses import Resources
from seqopt.sequence.rules import FreeRules
from seqopt.stability.standing import Standing, slack
from seqopt.work import Stage
from tests.builders import small_arch
from tests.strategies import free_builds

LONG = (pytest.mark.slow, pytest.mark.long)
PROGRAMS = ("overlap_lp", "overlap_mip")
TWO = FreeRules(robots=("rob1", "rob2"), least_grips=1)
ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0), ("T_max", 30.0), ("D_max", 1e-5)))


def posed(scene, rules=None, aim="minmax", among="tied", limits=()):
    engine = seqopt.make_engine("compliance", scene)
    return among_orders(build_states(engine, rules or FreeRules(), ONES, aim, limits), among)


def better(problem, value):
    """Whether the judge finds a plan of some order whose first goal is below a value."""
    alone = replace(problem, goals=problem.goals[:1], budgets=())
    if alone.goals[0].margins:
        bound = max(0.0, value - slack(alone.goals[0].name, value))
        return bool(bound) and not Proof(alone).is_impossible((bound,))
    return bool(Proof(alone).bounds((value,))[0] < value * (1 - 5e-10))


def brute_force(problem):
    """What the best plan of every order is worth, one order after the other."""
    worths = {}
    search = find_formulation("schedule_search")
    alone = replace(problem, goals=problem.goals[:1], budgets=())
    for order in permutations(problem.network.scene.build_order):
        try:
            worths[order] = search.solve(alone.at(order)).objective[0]
        except InfeasibleError:
            continue
    return worths


@cache
def known(bricks, rules=None, aim="minmax"):
    """The same of a small arch, found once."""
    return brute_force(posed(small_arch(bricks), rules, aim))


# what shares what is found once goes to one worker
once = pytest.mark.xdist_group("orders of small arches")


def check_against_brute_force(scene, rules, aim="minmax"):
    problem = posed(scene, rules, aim)
    worths = brute_force(problem)
    for among in ("tied", "any"):  # what nothing ties cannot be held
        if not worths:
            with pytest.raises(InfeasibleError, match="no order of the bricks has a plan"):
                seqopt.solve(replace(problem, orders=Orders(among)), FORMULATION)
            continue
        found = seqopt.solve(replace(problem, orders=Orders(among)), FORMULATION)
        assert found.status == "optimal"
        assert found.selection.objective[0] == pytest.approx(min(worths.values()), rel=1e-8)
        assert worths[found.order] == pytest.approx(found.selection.objective[0], rel=1e-8)


@given(build=free_builds(most_bricks=3, most_robots=3))
@settings(max_examples=2, deadline=None)
def test_it_equals_brute_force(build):
    check_against_brute_force(*build)


@pytest.mark.parametrize(
    ("aim", "bricks", "robots"),
    [
        ("regrips,minmax", 3, 2),
        *(pytest.param(aim, 3, 2, marks=LONG[:1]) for aim in ("sum", "travel")),
        pytest.param("travel", 4, 3, marks=LONG),
    ],
)
def test_what_adds_up_equals_brute_force(aim, bricks, robots):
    """It is found over all orders at once; the proof knows the least of all, and no less."""
    scene = small_arch(bricks)
    problem = posed(replace(scene, robots=scene.robots[:robots]), FreeRules(least_grips=1), aim)
    worths, found = brute_force(problem), seqopt.solve(problem, FORMULATION)
    assert found.selection.objective[0] == pytest.approx(min(worths.values()), rel=1e-9)
    assert worths[found.order] == pytest.approx(min(worths.values()), rel=1e-9)
    assert (found.status, found.gap) == ("optimal", 0.0)
    least = min(worths.values())
    assert better(problem, least + 1e-6 * max(1.0, least)) is True
    assert better(problem, least) is False


OF_ONE_AIM = {"sum": ("minimax",)}  # what they refuse
TAKE_ORDERS = [
    pytest.param(name, marks=[pytest.mark.slow] * (name not in ("schedule_search", "overlap_dp")))
    for name in seqopt.formulations("order")
    if name != "order_search"
]


@once
@pytest.mark.parametrize(("aim", "bricks"), [pytest.param("minmax", 4, marks=LONG[:1]), ("sum", 3)])
@pytest.mark.parametrize("name", TAKE_ORDERS)
def test_formulations_of_states_find_the_best_order_too(name, aim, bricks):
    worths, problem = known(bricks, TWO, aim).values(), posed(small_arch(bricks), TWO, aim)
    if name in OF_ONE_AIM.get(aim, ()):
        with pytest.raises(ProblemError, match=f"{name}: .* largest cost"):
            seqopt.solve(problem, name)
        return
    found = seqopt.solve(problem, name)
    least = min(worths)
    assert max(worths) > 1.1 * least
    exact = find_formulation(name).kind is not FormulationKind.HEURISTIC
    assert found.selection.objective[0] >= least * (1 - 1e-9)
    if exact:
        assert found.selection.objective[0] == pytest.approx(least, rel=1e-8)
    best = found.selection.objective[0] <= least * (1 + 1e-6)
    assert found.status == ("optimal" if best else "feasible")


@once
@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_the_worst_of_scenarios_equals_brute_force(workers):
    """Another order is the best where the worst of some scenarios counts, and it is found."""
    scene = small_arch(3)
    some = seqopt.scenarios(scene, count=3, density=0.9, seed=5)
    nominal = posed(scene)
    problem = over_scenarios(nominal, some.scenes)
    worths = brute_force(problem)
    found = seqopt.solve(replace(problem, resources=Resources(workers=workers)), FORMULATION)
    assert found.status == "optimal"
    assert found.selection.objective[0] == pytest.approx(min(worths.values()), rel=1e-8)
    assert found.selection.objective[0] > 1.01 * min(known(3).values())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("aim", "bricks", "programs"),
    [
        (WORST_TOTAL, 3, ()),
        (WORST_TOTAL, 2, PROGRAMS[:1]),  # which takes long, the other longer
        pytest.param(cvar(0.5), 3, PROGRAMS, marks=pytest.mark.long),
    ],
)
def test_totals_over_scenarios_equal_brute_force(aim, bricks, programs):
    """By every formulation; a bound is proven where weights leave nothing open, else claimed."""
    scene = small_arch(bricks)
    some = seqopt.scenarios(scene, count=2, density=0.9, seed=5)
    nominal = posed(scene, TWO, "sum")
    problem = over_scenarios(nominal, some.scenes, aim)
    worths = brute_force(problem)
    for name, able in seqopt.formulations("order").items():
        if able.aim is not None or (name in PROGRAMS and name not in programs):
            continue
        plan = seqopt.solve(problem, name)
        (value,), (bound,) = plan.selection.objective, plan.selection.bound
        assert value == pytest.approx(plan.objective[str(aim)])
        assert worths[plan.order] == pytest.approx(value, rel=1e-8)
        assert bound <= min(worths.values()) * (1 + 1e-9)
        if able.kind is FormulationKind.EXACT:
            assert value == pytest.approx(min(worths.values()), rel=1e-8)
            assert plan.gap <= 1e-6 or plan.status is not Status.OPTIMAL
    alone = replace(plan.selection, prices=((1.0,),))
    liar = replace(FORMULATION, solve=lambda *_, **more: alone)
    with pytest.raises(SolverError, match="no weight for every scenario"):
        seqopt.solve(problem, liar)


@pytest.mark.slow
def test_the_order_of_the_best_margin_equals_brute_force():
    """To its width; the judge knows that no order has a better one, and that some has a worse."""
    problem = posed(small_arch(3), aim="friction")
    search, worths = find_formulation("schedule_search"), {}
    for order in filter(order_rules(problem).allows, permutations((1, 2, 3))):
        with suppress(InfeasibleError):
            worths[order] = search.solve(problem.at(order)).objective[0]
    least, width = min(worths.values()), slack("friction", min(worths.values()))
    plan = seqopt.solve(problem, FORMULATION)
    (value,) = plan.selection.objective
    assert least - width <= value <= least + width
    assert worths[plan.order] == pytest.approx(value, abs=width)
    assert plan.selection.bound[0] <= least
    assert "claimed" not in plan.order_bound_said
    assert better(problem, least) is False
    assert better(problem, 2 * least)


@once
@pytest.mark.slow
@pytest.mark.parametrize("aim", ["minmax", "sum"])
def test_orders_within_budgets_equal_brute_force(aim):
    """Another order is the best where robots may not go far; one budget on a peak is decided."""
    nominal = posed(small_arch(4), aim=aim)
    least = min(known(4, aim="travel").values())
    problem = within(nominal, {"travel": 1.0001 * least})
    plans, worths = [], known(4, aim=aim)
    for order in worths:
        with suppress(InfeasibleError):
            plans.append(seqopt.solve(problem.at(order), "schedule_search"))
    plan = seqopt.solve(problem, FORMULATION)
    found, best = plan.selection, min(p.selection.objective[0] for p in plans)
    assert plan.objective["travel"] <= 1.0001 * least * (1 + 1e-6)
    assert min(p.certificate.bounds[0] for p in plans) <= found.objective[0] * (1 + 1e-9)
    assert found.bound[0] <= best * (1 + 1e-9)
    assert best > 1.001 * min(worths.values())
    if aim == "minmax":
        assert found.objective[0] == pytest.approx(best)
    little = within(nominal, {"travel": 0.5 * least})
    with pytest.raises(InfeasibleError, match="no plan is within all budgets; travel is at least"):
        seqopt.solve(little, FORMULATION)


@given(build=free_builds(most_bricks=3, most_robots=3))
@settings(max_examples=2, deadline=None)
def test_the_proof_knows_the_best_of_all_orders(build):
    """It finds a plan below any value above the least one, and none below that, in any order."""
    problem = posed(*build)
    least = min(brute_force(problem).values(), default=np.inf)
    for among in ("tied", "any"):
        asked = replace(problem, orders=Orders(among))
        assert better(asked, least * (1 - 1e-9)) is False
        if np.isfinite(least):
            assert better(asked, least * (1 + 1e-6))


@pytest.mark.slow
def test_the_proof_of_orders_knows_what_must_stand():
    """What is demanded of stability holds in every order, where bricks have other places."""
    problem = posed(small_arch(4))
    standing = replace(problem, standing=Standing(find_mortar("dry")))
    worths = brute_force(standing)
    least = min(worths.values())
    assert better(standing, least * (1 - 1e-9)) is False
    assert better(standing, least * (1 + 1e-6))


@pytest.mark.slow
def test_beyond_the_most_sets_the_own_order_has_a_bound():
    problem = posed(small_arch(4), aim="F_largest")
    best = seqopt.solve(problem, FORMULATION).selection.objective[0]
    plan = seqopt.solve(problem, FORMULATION, options={"most": 4})
    own = solve(replace(problem, orders=None), "schedule_search").selection.objective[0]
    assert (plan.selection.stopped, plan.status) == ("size", "feasible")
    assert plan.selection.objective[0] == own > best * 1.001
    assert plan.selection.bound[0] <= best * (1 + 1e-9)
    assert plan.summary()["status"] == plan.status
    with pytest.raises(ProblemError, match="option most=-1"):
        seqopt.solve(problem, FORMULATION, options={"most": -1})


def test_time_leaves_an_order_and_a_bound():
    problem = posed(small_arch(8))

    def interrupt(told):
        if isinstance(told, Stage) and told.share >= 3 / 8:
            raise KeyboardInterrupt

    found = seqopt.solve(problem, FORMULATION, progress=interrupt)
    assert found.selection.stopped == "interrupt"
    assert found.status == "feasible"
    assert found.selection.bound[0] <= found.selection.objective[0]
    with pytest.raises(TimeUpError, match="no plan was found yet; give more"):
        seqopt.solve(problem, FORMULATION, options={"seconds": 0.0})


@once
@pytest.mark.parametrize(("least", "order", "said"), [
    (True, "worst", "is promised as the least; a plan has less"),
    pytest.param(False, "worst", "", marks=pytest.mark.slow),
    pytest.param(True, "best", "", marks=pytest.mark.slow),
    (np.nan, "best", "a value or bound is NaN"),
])  # fmt: skip
def test_a_formulation_that_names_a_bad_order_is_not_believed(least, order, said):
    """Only a bound that the judge proves makes an order optimal."""
    problem, worths = posed(small_arch(4), aim="F_largest"), known(4, aim="F_largest")
    named = (min if order == "best" else max)(worths, key=worths.__getitem__)
    value = worths[named]
    assert min(worths.values()) < 0.99 * max(worths.values())
    bound = {True: value, False: -np.inf}.get(least, least)
    own = find_formulation("schedule_search").solve(problem.at(named))
    early = "" if bound == value else "size"
    claimed = replace(own, bound=(bound,), order=named, visited=(), stopped=early)
    fake = replace(FORMULATION, solve=lambda *_, **more: claimed)
    if said:
        with pytest.raises(SolverError, match=said):
            seqopt.solve(problem, fake)
        return
    found = seqopt.solve(problem, fake)
    assert found.status == ("optimal" if order == "best" else "feasible")


@pytest.mark.slow
def test_a_bound_that_is_not_proven_is_claimed(monkeypatch):
    problem = posed(small_arch(4), aim="F_largest")
    found = seqopt.solve(problem, FORMULATION, proof=False)
    assert (found.status, found.summary()["bound_rests_on"]) == ("unproven", {})
    assert "claimed, not proven" in found.order_bound_said
    monkeypatch.setattr("seqopt.judge._proof.MOST", 3)
    few = seqopt.solve(problem, FORMULATION)
    assert (few.status, {*few.summary()["bound_rests_on"].values()}) == (
        "claimed optimal",
        {"claimed"},
    )
    assert few.gap is None
    assert "claimed optimal" in repr(few)
    assert "claimed, not proven" in few.order_bound_said
    monkeypatch.undo()
    proven = seqopt.solve(problem, FORMULATION)
    assert (proven.status, {*proven.summary()["bound_rests_on"].values()}) == (
        "optimal",
        {"rebuilt"},
    )
    assert "claimed" not in proven.order_bound_said
