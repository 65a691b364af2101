"""States that every plan passes are asked before any plan is sought; formulations of schedules."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from formulations.order_search import FORMULATION as ORDER
from formulations.pareto_zones import FORMULATION as FRONT
from formulations.schedule_search import FORMULATION as PLAN
from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph import Explorer
from seqopt.graph._spaces import StateSpace, among_orders, barred, explore
from seqopt.graph.formulation import Solution
from seqopt.graph.states import build_states
from seqopt.judge._proof import Proof
from seqopt.plan.front import FrontProblem, find_front
from seqopt.plan.solve import solve
from seqopt.problem.amounts import parse_goals
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import Limit
from seqopt.sequence.rules import FreeRules
from tests.builders import small_arch
from tests.strategies import free_builds

ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))
END = r"the finished structure, which nobody holds, "


def windy(wind, stands="dry", limits=(), bricks=5, rules=None):
    """An arch in wind along it, over the weight of every brick, all of whose states must stand."""
    scene = replace(small_arch(bricks), wind=(wind, 0.0, 0.0))
    engine = seqopt.make_engine("compliance", seqopt.build_network(scene))
    return build_states(engine, rules or seqopt.FreeRules(), ONES, "steps", limits, stands)


def test_that_the_whole_falls_is_known_before_a_plan_is_sought():
    """It was found after all states that are reached, and told of the brick where they ended."""
    problem = windy(0.6)
    with pytest.raises(InfeasibleError, match=END + "does not stand dry; .* a bond of") as found:
        seqopt.solve(problem, "schedule_search")
    assert "claimed" not in str(found.value)
    assert problem.stability.looked_at == 1
    proof = Proof(replace(problem))
    assert proof.is_impossible()
    assert proof.states == 1
    calm = windy(0.0)
    assert barred(calm) is None
    assert not Proof(calm).is_impossible()


@pytest.mark.slow
def test_all_orders_and_fronts_end_in_it_too():
    problem = windy(0.6, bricks=4)
    with pytest.raises(InfeasibleError, match=END):
        seqopt.solve(among_orders(problem, "tied"), "order_search")
    with pytest.raises(InfeasibleError, match=END):
        find_front(FrontProblem(problem, None))


@pytest.mark.slow
def test_a_step_without_an_open_grip_is_asked_before_those_with_one():
    """In the loop of three robots two steps have none; a storm is more than robots hold."""
    network = seqopt.build_network(replace(seqopt.load_scene("arch25"), wind=(0.0, 30.0, 0.0)))
    engine, loop = seqopt.make_engine("compliance", network), seqopt.three_robot_loop(network)
    problem = build_states(engine, loop, ONES, "minmax", stands="dry")
    assert [level for level, _ in problem.space.without_choice()] == [2, 1]
    level, state = barred(problem)
    assert (level, problem.space.grips(state).tolist()) == (2, [2])
    assert Proof(replace(problem)).is_impossible()
    said = "step 2 of 90, in which no grip is open, does not stand dry"
    with pytest.raises(InfeasibleError, match=said):
        seqopt.solve(problem, "schedule_search", time_limit=1.0)
    calm = build_states(
        seqopt.make_engine("compliance", seqopt.load_scene("arch25")), loop, ONES, stands="dry"
    )
    assert barred(calm) is None


@given(build=free_builds(most_bricks=3, most_robots=2), limit=st.floats(-12.0, -4.0))
@settings(max_examples=10, deadline=None)
def test_where_it_says_that_no_plan_is_there_is_none(build, limit):
    """By all states, none left out, and by the judge; where it says nothing, they decide."""
    scene, rules = build
    engine = seqopt.make_engine("compliance", scene)
    problem = build_states(engine, rules, ONES, "steps", [seqopt.Limit("D_max", 10.0**limit)])
    every = Explorer(StateSpace(replace(problem)))
    found = every.rise()
    assert explore(problem).whole == found
    assert Proof(problem).is_impossible() == (not found)
    if barred(problem) is not None:
        assert not found
        level, state = barred(problem)
        assert problem.space.ended(state).all()
        assert level == len(scene.bricks)
        assert not np.any(state)


# formulations of schedules, orders and fronts: what they change, return, raise and deny
RULES = FreeRules(least_grips=1)


def free(limits=(), rules=RULES, aim="F_largest,M_sup"):
    engine = seqopt.make_engine("compliance", small_arch(4))
    return build_states(engine, rules, ONES, aim, limits)


def order(**words):
    return among_orders(free(**words), "tied")


def front(**words):
    return FrontProblem(free(**words))


def loop(limits=()):
    engine = free().engine
    schedule = seqopt.three_robot_loop(engine.network)
    return FrontProblem(build_states(engine, schedule, ONES, "F_largest,M_sup", limits))


KINDS = {
    "plan": (free, solve, PLAN),
    "order": (order, solve, ORDER),
    "front": (front, find_front, FRONT),
    "loop's front": (loop, find_front, FRONT),
}
kinds = pytest.mark.parametrize("kind", KINDS)


def asked(kind, fake, **words):
    """Solve a problem of a kind by its formulation with another function."""
    pose, solver, real = KINDS[kind]
    return solver(pose(**words), replace(real, name="fake", solve=fake))


@cache
def answer_of(kind):
    """What the formulation of a kind finds, found once."""
    pose, _, real = KINDS[kind]
    return real.solve(pose())


def goals(problem):
    object.__setattr__(getattr(problem, "_problem", problem), "goals", parse_goals("D_max,T_max"))


def limits(problem):
    object.__setattr__(getattr(problem, "_problem", problem), "limits", (Limit("M_sup", 1e9),))


def leftovers(problem):
    for name in ("space", "caps", "named", "certified"):
        vars(problem)[name] = "forged"


def says_empty(problem):
    problem.is_empty_below = lambda _: True


def infinite(problem):
    amounts = problem._explored[0].graph.amounts
    amounts.flags.writeable = True
    amounts[:] = np.inf


CHANGES = [
    *(("plan", change) for change in (goals, leftovers)),
    pytest.param("order", limits, marks=pytest.mark.slow),
    *(("front", change) for change in (limits, says_empty)),
    ("loop's front", infinite),
]


@pytest.mark.parametrize(("kind", "change"), CHANGES)
def test_what_a_formulation_changes_is_not_judged_by(kind, change):
    def fake(problem, **options):
        found = KINDS[kind][2].solve(problem, **options)
        change(problem)
        return found

    def fake_denial(problem, **options):
        fake(problem, **options)
        raise InfeasibleError("none")

    pose, solver, real = KINDS[kind]
    problem = pose()
    found = solver(problem, replace(real, name="fake", solve=fake))
    assert repr(found).replace("fake", real.name) == solved(kind)
    assert repr(problem) == repr(pose())
    with pytest.raises(SolverError, match="some are"):
        asked(kind, fake_denial)


@cache
def solved(kind):
    """What the true formulation of a kind answers, in words."""
    pose, solver, real = KINDS[kind]
    return repr(solver(pose(), real))


NONSENSE = {
    "plan": {
        "states beyond": {"states": ((1, 10**30, 0, 0),)},
        "too few values": {"objective": (1.0,)},
        "bounds NaN where it was stopped": {"bound": (np.nan, np.nan), "stopped": "time"},
        "bounds above the values": {"bound": (np.inf, 1e9), "stopped": "time"},
        "an order where it is given": {"order": (1, 2, 3, 4)},
    },
    "order": {
        "order None": {"order": None},
        "order text": {"order": "abcd"},
        "order of another scene": {"order": (1, 2, 3, 5)},
        "effort None": {"effort": None},
    },
    "front": {
        "values infinite": {"objective": (np.inf, 1.0)},
        "too few numbers": {"objective": (1.0,), "bound": (1.0,)},
        "states of nothing": {"states": (None,)},
    },
}


@pytest.mark.parametrize(
    ("kind", "what"), [(kind, what) for kind, every in NONSENSE.items() for what in every]
)
def test_nonsense_has_failed(kind, what):
    """What goes beyond any solution's numbers, which `tests.plan.test_no_choice` has."""

    def changed(found):
        return replace(found, **NONSENSE[kind][what])

    found = answer_of(kind)
    answer = tuple(map(changed, found)) if kind == "front" else changed(found)
    with pytest.raises(SolverError) as caught:
        asked(kind, lambda *_, **__: answer)
    assert "\n" not in str(caught.value)


@kinds
@pytest.mark.parametrize("reply", [None, (), np.zeros(3), Solution])
def test_what_is_no_selection_has_failed(kind, reply):
    if "front" in kind and isinstance(reply, tuple):
        return  # that there is no plan: below
    with pytest.raises(
        SolverError, match=r"formulation fake returned a .*, not a (Solution|tuple)"
    ):
        asked(kind, lambda *_, **__: reply)


@pytest.mark.parametrize("kind", ["order", "front"])
@pytest.mark.parametrize("error", [ZeroDivisionError("by\nzero"), SystemExit(3)])
def test_what_raises_has_failed(kind, error):
    def fake(*_, **__):
        raise error

    with pytest.raises(SolverError, match=f"formulation fake failed: {type(error).__name__}"):
        asked(kind, fake)


def denies(*_, **__):
    raise InfeasibleError("none")


def test_that_a_front_is_empty_is_not_believed():
    """Of plans `tests/judge/test_free_judge.py` has the same."""
    for fake in (denies, lambda *_, **__: ()):
        with pytest.raises(SolverError, match="found no plan, and some are"):
            asked("front", fake)


@kinds
def test_where_there_is_no_plan_it_is_proven(kind):
    """Nothing that a formulation says counts; of time and size the judge may have too little."""
    words = {"limits": [Limit("F_largest", 1.0)]}
    with pytest.raises(InfeasibleError) as caught:
        asked(kind, denies, **words)
    assert "claimed" not in str(caught.value)
