"""What judges free schedules and Pareto sets sees what is wrong; the judge is attacked."""

from dataclasses import replace
from functools import cache, partial, wraps

import numpy as np
import pytest

import seqopt
from seqopt.errors import InfeasibleError, SolverError, StepError
from seqopt.graph.formulation import find_formulation
from seqopt.graph.graph import Graph, lexicographic
from seqopt.graph.states import build_states
from seqopt.judge._schedules import judge_schedule
from seqopt.plan.front import FrontProblem, find_front
from seqopt.problem.criteria import WorstRatio
from seqopt.scene.scene import with_robots
from seqopt.sequence.rules import FreeRules
from tests.brute_force import ONES
from tests.builders import small_arch

PAIR = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))


@pytest.mark.slow
def test_weights_of_scenarios_that_prove_little_leave_a_gap():
    """Wrong weights are no error, but prove less; a wrong total, or none for a scenario, is one."""
    scene = small_arch(5)
    problem = seqopt.pose(
        *(seqopt.make_engine("compliance", scene), seqopt.FreeRules(), PAIR),
        scenarios=seqopt.scenarios(scene, count=3, seed=1),
        over="worst-total",
    )
    plan = seqopt.solve(problem, "schedule_search")
    states, found = plan.states, plan.selection
    assert 0 < plan.certificate.gap < 0.02  # what labels alone close is claimed
    assert plan.status == "claimed optimal"
    worst = int(np.argmax(found.prices[0]))
    alone = tuple(float(k == (worst + 1) % 3) for k in range(3))
    less = judge_schedule(states, replace(found, prices=(alone,)), plan.steps)
    assert (less.gap > plan.certificate.gap, less.claimed_gap) == (True, 0.0)
    none = judge_schedule(states, replace(found, prices=(alone,), bound=(-np.inf,)), plan.steps)
    assert none.claimed_gap == none.gap == less.gap
    double = judge_schedule(states, replace(found, prices=((2.0, 2.0, 2.0),)), plan.steps)
    assert double.bounds[0] <= plan.objective["worst-total"] * (1 + 1e-12)
    with pytest.raises(SolverError, match="no weight for every scenario"):
        judge_schedule(states, replace(found, prices=()), plan.steps)
    with pytest.raises(SolverError, match=r"worst-total is .* as claimed"):
        judge_schedule(states, replace(found, objective=(0.9 * found.objective[0],)), plan.steps)


def basis(plan):
    named = {n: str(b) for n, b in zip(plan.goals, plan.certificate.rests_on, strict=False)}
    assert plan.summary()["bound_rests_on"] == named
    return [*named.values()]


def test_states_are_rebuilt_and_costs_of_instances_are_given():
    scene = seqopt.load_scene("chain:bricks=7")
    assert basis(seqopt.optimize(scene, "free", aim="minmax,steps")) == ["rebuilt", "rebuilt"]
    loop = seqopt.optimize(scene)
    assert basis(loop) == ["rebuilt"]
    assert basis(seqopt.solve(seqopt.compile_instance(loop.problem))) == ["given"]


def test_without_a_proof_nothing_is_said():
    plan = seqopt.optimize("chain:bricks=7", "free", search=seqopt.Search(proof=False))
    assert plan.summary()["bound_rests_on"] == {}


# the judge is attacked: lies of every kind are refused or not believed, on every kind of problem
HELD = FreeRules(ending="held")
TIMES = "fetch=30,place=10,approach=10,grip=5,release=5"


def loop(*goals, criterion="weighted", **more):
    engine = seqopt.make_engine("compliance", seqopt.load_scene("chain:bricks=8"))
    moves = seqopt.three_robot_loop(engine.network)
    return seqopt.pose(engine, moves, seqopt.CRITERIA[criterion], *goals, **more)


def free(*goals, scene=None, rules=HELD, **more):
    engine = seqopt.make_engine("compliance", scene or small_arch(4))
    return seqopt.pose(engine, rules, ONES, *goals, **more)


def over_scenarios(make, scene, over):
    return make(scenarios=seqopt.scenarios(scene, count=3, seed=1), over=over)


CHAIN, ARCH, HOLD_NO = seqopt.load_scene("chain:bricks=8"), small_arch(5), FreeRules()
TIMED = with_robots(small_arch(4), 3).with_durations(
    TIMES, "rob3:fetch=75,place=25,approach=25,grip=12.5,release=12.5"
)
WITHIN = {"scene": ARCH, "rules": HOLD_NO, "budgets": "travel=0.7m"}
POSED = {
    "loop": (loop, "overlap_dp"),
    "loop, worst": (partial(loop, "minmax", criterion="worst-ratio"), "minimax"),
    "loop, budget": (partial(loop, budgets="travel=0.9"), "labels"),
    "loop, two budgets": (partial(loop, budgets=["travel=0.9", "robot_use:rob1=20:15"]), "labels"),
    "loop, scenarios": (
        partial(over_scenarios, partial(loop, criterion="worst-ratio"), CHAIN, "worst-total"),
        "overlap_dp",
    ),
    "free": (partial(free, "minmax,steps"), "schedule_search"),
    "free, sum": (partial(free, "sum,regrips"), "schedule_search"),
    "free, budget": (partial(free, "minmax,steps", **WITHIN), "schedule_search"),
    "free, sum within": (partial(free, "sum", **WITHIN), "schedule_search"),
    "free, scenarios": (
        partial(over_scenarios, partial(free, scene=ARCH, rules=HOLD_NO), ARCH, "worst-total"),
        "schedule_search",
    ),
    "time": (partial(free, "makespan", scene=TIMED), "makespan_labels"),
    "orders": (partial(free, "minmax", orders="tied"), "order_search"),
}
COMPILED = {
    "loop": "overlap_dp",
    "loop, worst": "minimax",
    "loop, budget": "labels",
    "loop, scenarios": "overlap_dp",
    "free": "overlap_dp",
    "free, sum within": "schedule_search",
    "time": "makespan_labels",
}
SPACES = [*POSED, *(f"instance: {name}" for name in COMPILED)]
GAPS = {"free, sum within": 0.09, "free, scenarios": 0.01}  # that multipliers and weights leave


@cache
def honest(space):
    """A problem, the formulation that solves it truthfully, and its answer."""
    make, name = POSED[space.removeprefix("instance: ")]
    problem = make()
    if space.startswith("instance: "):
        problem, name = seqopt.compile_instance(problem), COMPILED[space.removeprefix("instance: ")]
    return problem, find_formulation(name), seqopt.solve(problem, name)


TRUE = {}  # what every space's formulation answers, found once


def told(space, change):
    """The certificate of an answer that is changed, if the judge lets it pass."""
    problem, formulation, _ = honest(space)

    @wraps(formulation.solve)
    def solve(*args, **options):
        if space not in TRUE:
            TRUE[space] = formulation.solve(*args, **options)
        return change(TRUE[space])

    return seqopt.solve(problem, replace(formulation, solve=solve)).certificate


def steps(change):
    return lambda s: replace(s, states=tuple(change(s.states)))


def values(value=1.0, bound=1.0):
    """The values and bounds of all goals, times factors."""

    def change(s):
        scaled = [tuple(f * v for v in s.objective) for f in (value, bound)]
        return replace(s, objective=scaled[0], bound=scaled[1])

    return change


def infeasible(_):
    raise InfeasibleError("no plan is allowed")


PATHS = {
    "path cut short": steps(lambda own: own[:-1]),
    "path without a step": steps(lambda own: own[:1] + own[2:]),
    "path turned round": steps(lambda own: own[::-1]),
    "path too long": steps(lambda own: (*own, own[-1])),
    "no path": steps(lambda own: ()),
    "unknown state": steps(lambda own: (*own[:-1], tuple(10**6 for _ in own[-1]))),
}
CLAIMS = {
    "better value": values(0.9, 0.9),
    "worse value": values(1.1, 1.0),
    "bound above the value": values(1.0, 1.1),
    "no number": values(float("nan"), 1.0),
    "bound that is no number": values(1.0, float("nan")),
    "infinite bound": values(1.0, np.inf),
    "infeasible": infeasible,
}
ORDERS = {
    "no order": lambda s: replace(s, order=()),
    "order turned round": lambda s: replace(s, order=s.order[::-1]),
    "a brick twice": lambda s: replace(s, order=(s.order[0], *s.order[:-1])),
    "a brick that nothing ties": lambda s: replace(s, order=(2, 1, 3, 4)),
}
REFUSED = [
    *((space, lie) for space in SPACES for lie in CLAIMS),
    *((space, lie) for space in SPACES for lie in PATHS),
    *(("orders", lie) for lie in ORDERS),
]


@pytest.mark.parametrize("space", SPACES)
def test_the_honest_answer_is_accepted(space):
    proof, own = told(space, lambda answer: answer), honest(space)[2].certificate
    assert (proof.values, proof.bounds) == (own.values, own.bounds)
    assert proof.gap <= GAPS.get(space.removeprefix("instance: "), 1e-9)


@pytest.mark.parametrize(("space", "lie"), REFUSED)
def test_a_lie_is_refused(space, lie):
    with pytest.raises((SolverError, StepError)):
        told(space, (PATHS | CLAIMS | ORDERS)[lie])


def other_path(instance, best):
    """Another path through an instance within its caps, and its value: no better than the best."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        costs = rng.uniform(size=(instance.arcs, 1))
        graph = Graph(instance.source, instance.target, costs, (False,), instance.ends)
        path = lexicographic(graph).path
        try:
            value = seqopt.judge_instance(instance, path).objective
        except SolverError:  # it exceeds a cap
            continue
        if value > best * (1 + 1e-6):
            return tuple((node,) for node in path), value
    raise AssertionError("no other path was met")


WITH_OTHERS = [
    *("loop", "loop, worst", "loop, budget", "loop, scenarios"),
    *(f"instance: {name}" for name in COMPILED if name != "time"),
]


@pytest.mark.parametrize("share", [0.0, 1e3])
@pytest.mark.parametrize("space", WITH_OTHERS)
def test_another_path_is_not_believed_to_be_the_best(space, share):
    """Whatever multipliers or weights it comes with."""
    problem, _, plan = honest(space)
    best = plan.certificate.objective
    one = problem if space.startswith("instance") else seqopt.compile_instance(problem)
    nodes, value = other_path(one, best)

    def lie(found):
        prices = tuple(tuple(share * price for price in own) for own in found.prices)
        claimed = (value, *found.objective[1:])
        return replace(found, states=nodes, objective=claimed, bound=claimed, prices=prices)

    try:
        proof = told(space, lie)
    except SolverError:
        return
    assert proof.bounds[0] <= best * (1 + 1e-9)
    assert proof.gap > 1e-7  # it is claimed, and not proven


@pytest.mark.parametrize("share", [0.5, 1e3])
@pytest.mark.parametrize("space", [name for name in SPACES if "scen" in name or "with" in name])
def test_multipliers_and_weights_are_not_believed(space, share):
    """Others prove what they prove, and no more than is true."""
    own = honest(space)[2].certificate

    def lie(found):
        return replace(found, prices=tuple(tuple(share * p for p in each) for each in found.prices))

    try:
        proof = told(space, lie)
    except SolverError:
        return
    assert proof.values == own.values
    assert proof.bounds[0] <= own.values[0] * (1 + 1e-9)


@cache
def front():
    """The plans of a small build that no other one dominates."""
    engine = seqopt.make_engine("compliance", small_arch(7))
    posed = FrontProblem(build_states(engine, HOLD_NO, ONES, "F_largest,M_sup"))
    return posed, find_formulation("pareto_zones").solve(posed)


def told_front(change):
    posed, found = front()
    formulation = find_formulation("pareto_zones")
    return find_front(posed, replace(formulation, solve=lambda _, **more: change(found)))


def test_a_front_with_a_point_missing_or_moved_is_refused():
    found = front()[1]
    assert told_front(lambda plans: plans).complete
    assert len(found) > 1
    early = told_front(lambda plans: (replace(plans[0], stopped="time"),))
    assert (early.complete, len(early.table)) == (False, 1)
    for lost in found:
        fewer = tuple(plan for plan in found if plan is not lost)
        with pytest.raises(SolverError, match="the set lacks a point below"):
            told_front(lambda _, fewer=fewer: fewer)

    def better(plan):
        claimed = tuple(0.9 * value for value in plan.objective)
        return replace(plan, objective=claimed, bound=claimed)

    with pytest.raises(SolverError, match="as claimed"):
        told_front(lambda plans: tuple(map(better, plans)))
    with pytest.raises(SolverError, match="dominated by another"):
        told_front(lambda plans: (*plans, plans[0]))
