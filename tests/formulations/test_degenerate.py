"""Degenerate placement problems against enumeration, and answers that are not what they claim."""

from dataclasses import replace
from itertools import pairwise

import cvxpy as cp
import numpy as np
import pytest

from experiments.failing.parts.choice_cells import (
    CASES,
    MALFORMED,
    Cell,
    Size,
    capped,
    judge,
    rows,
    whole,
)
from formulations import solvers
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.formulation import Formulation, FormulationKind, Solution, formulations
from seqopt.problem.problem import Aim
from tests.layered import answer

ALL = formulations("costs")
SMALL = Size(3, 3, 6)
TAKERS = [name for name, formulation in formulations("costs").items() if formulation.takes_budgets]
FLOWS = ("overlap_lp", "overlap_mip")
EXACT = ("labels", "lagrangian", "minimax", "overlap_dp", *FLOWS)
BOUNDS = ("lagrangian", "overlap_lp")  # where a budget binds
MIXTURES = {"overlap_mip": "infeasible", "labels": "infeasible", "lagrangian": "infeasible"}
flows = pytest.mark.parametrize("name", FLOWS)
NONE_ALLOWED = {
    "limit nobody meets",
    "no pair allowed",
    "all costs infinite",
    "budget cannot be met",
    "budgets not met by mixtures",
}
LOOSE = {"costs 1e-9 and 1e9"}  # further apart than the accuracy of a solver


def small(seed=0, scale=1.0):
    return whole(SMALL.sizes, np.random.default_rng(seed), scale)


@pytest.mark.parametrize("case", CASES)
def test_no_answer_is_wrong(case):
    for row in rows(Cell("costs", case, CASES[case], SMALL), range(1)):
        status, name = row["status"], row["method"]
        assert status != "wrong", row
        if case in MALFORMED:
            assert status == "refused", row
        elif case.startswith("budget") and name not in TAKERS:
            assert "takes no caps" in row["message"]
        elif case in NONE_ALLOWED:
            assert status == "infeasible", row
        elif case == "budgets met by mixtures only":
            assert status == MIXTURES.get(name, "failed"), row
        elif case not in LOOSE and name in EXACT:
            binds = case.startswith("budget") and name in BOUNDS
            assert status in ({"answered", "failed"} if binds else {"answered"}), row
            assert binds or row["error"] == pytest.approx(0, abs=1e-9), row


def answers(reply, **promised) -> Formulation:
    """A formulation that gives a fixed reply to an instance, or raises it."""

    def solve(instance):
        if isinstance(reply, Exception):
            raise reply
        return reply(instance)

    promised = {"kind": FormulationKind.EXACT, "aim": Aim.SUM} | promised
    return Formulation("fake", "", solve=solve, **promised)


def best(instance):
    return ALL["overlap_dp"].solve(instance)


def another(instance):
    """A path of no small sum, with its own."""
    largest = replace(instance, amounts=instance.amounts.max() - instance.amounts)
    states = best(largest).states
    nodes = [0, *(node for (node,) in states)]
    codes = [a * instance.nodes + b for a, b in pairwise(nodes)]
    every = (instance.source.astype(int) * instance.nodes + instance.target).tolist()
    value = sum(instance.amounts[every.index(code), 0] for code in codes)
    return Solution(states, (float(value),), (-np.inf,))


@pytest.mark.parametrize(
    ("reply", "status"),
    [
        (another, "failed"),
        (lambda i: replace(best(i), objective=(0.0,), bound=(0.0,)), "failed"),
        (lambda i: replace(best(i), objective=(np.nan,)), "failed"),
        (lambda i: replace(best(i), bound=(np.nan,)), "failed"),
        (lambda i: None, "failed"),
        (SolverError("stalled"), "failed"),
        (InfeasibleError("none"), "failed"),
        (ProblemError("odd"), "wrong"),
        (ZeroDivisionError("traceback"), "failed"),
        (best, "answered"),
    ],
)
@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_the_judge_tells_them_apart(reply, status, scale):
    """Negative control: what is wrong with an answer shows in its status, in any unit."""
    assert judge(small(scale=scale), answers(reply))["status"] == status


@flows
@pytest.mark.parametrize(
    ("status", "named"),
    [
        (cp.INFEASIBLE, "infeasible that is not|within all budgets, and some are"),
        (cp.OPTIMAL_INACCURATE, "ended with status"),
        (cp.INFEASIBLE_INACCURATE, "ended with status"),
        (cp.USER_LIMIT, "ended with status"),
        (None, "ended with status"),
        (cp.SolverError("out of memory"), "failed: out of memory"),
    ],
)
def test_a_solver_that_fails_never_calls_the_problem_infeasible(monkeypatch, name, status, named):
    def solve(program, **options):
        if isinstance(status, Exception):
            raise status

    def end(*_):
        if isinstance(status, Exception):
            raise status
        return "kInfeasible" if status == cp.INFEASIBLE else str(status)

    monkeypatch.setattr(cp.Problem, "solve", solve)
    monkeypatch.setattr(cp.Problem, "status", status, raising=False)
    monkeypatch.setattr(solvers, "_end", end)
    for problem in (small(), capped(SMALL, np.random.default_rng(0), 1.0, 0.6)):
        with pytest.raises(SolverError, match=named):
            answer(problem, name)
