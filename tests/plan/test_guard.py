"""Formulations of schedules, orders and fronts: what they change, return, raise and deny."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import seqopt
from formulations.states.order_search import FORMULATION as ORDER
from formulations.states.pareto_zones import FORMULATION as FRONT
from formulations.states.schedule_search import FORMULATION as PLAN
from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph._orders import among_orders
from seqopt.graph.formulation import Solution
from seqopt.graph.states.states import build_states
from seqopt.plan.front import FrontProblem, find_front
from seqopt.plan.solve import solve
from seqopt.problem.amounts import parse_goals
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import Limit
from seqopt.sequence.rules import FreeRules
from tests.builders import small_arch

ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))
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
    """Of plans `tests/judge/test_lies.py` has the same."""
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
