"""What a formulation claims is recomputed: false answers, broken promises, bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.errors import SolverError
from seqopt.placement.budgets import travel
from seqopt.placement.certificate import certify
from seqopt.placement.costs import LayeredCosts
from seqopt.placement.formulation import FormulationKind, Selection, formulations
from seqopt.placement.interface import Aim, CostProblem
from seqopt.placement.solving import solve

ALL = formulations()


FAULTS = {
    "zeros": lambda s: replace(s, choice=(0,) * len(s.choice)),
    "too short": lambda s: replace(s, choice=s.choice[:-1]),
    "out of range": lambda s: replace(s, choice=(99, *s.choice[1:])),
    "negative": lambda s: replace(s, choice=(-1, *s.choice[1:])),
    "false objective": lambda s: replace(s, objective=0.9 * s.objective),
    "not a number": lambda s: replace(s, objective=float("nan")),
    "false bound": lambda s: replace(s, bound=1.1 * s.objective),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_false_answer_is_caught(problem25, fault):
    good = ALL["overlap_dp"].solve(problem25)
    certify(problem25, good, Aim.SUM)
    with pytest.raises(SolverError):
        certify(problem25, FAULTS[fault](good), Aim.SUM)


def test_promises_are_held(problem25):
    """A heuristic that calls itself exact is refused, and so is a bound above the optimum."""
    cascade = ALL["cascade"]
    with pytest.raises(SolverError, match="promises the optimum"):
        solve(problem25, replace(cascade, kind=FormulationKind.EXACT))
    poor = cascade.solve(problem25)
    with pytest.raises(SolverError, match="claimed bound"):
        certify(problem25, replace(poor, bound=poor.objective), Aim.SUM)


def test_within_a_budget_the_certificate_proves_the_optimum_itself(problem25):
    capped = replace(problem25, budgets=(travel(problem25, 20.0),))
    for name in ("overlap_mip", "labels"):
        certificate = solve(capped, ALL[name]).certificate
        assert certificate.gap <= 1e-6
        assert certificate.bound > solve(problem25, "overlap_dp").certificate.bound + 1.0


def test_within_a_budget_a_poor_answer_is_seen_and_prices_need_not_be_believed(problem25):
    capped = replace(problem25, budgets=(travel(problem25, 20.0),))
    best = solve(capped, "labels")
    poor = min(
        (
            (*best.selection.choice[:k], other, *best.selection.choice[k + 1 :])
            for k, size in enumerate(problem25.sums.sizes)
            for other in range(size)
            if other != best.selection.choice[k]
        ),
        key=lambda c: (capped.budgets[0].spent(c) > 20.0, problem25.sums.cost(c)),
    )
    value = problem25.sums.cost(poor)
    for prices in ({}, best.selection.prices, {"robot travel [m]": 1e9}, {"robot travel [m]": -1}):
        proof = certify(capped, Selection(poor, value, prices=prices), Aim.SUM)
        assert proof.gap == pytest.approx((value - best.certificate.objective) / value, abs=1e-9)
        assert proof.gap > 1e-5


def test_a_choice_that_is_not_allowed_is_caught():
    problem = CostProblem(LayeredCosts((np.array([0.0, np.inf]),), (np.zeros((1, 2)),)))
    with pytest.raises(SolverError, match="not allowed"):
        certify(problem, Selection((1,), 0.0), Aim.SUM)
