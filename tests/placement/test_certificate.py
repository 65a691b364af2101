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


def test_a_budget_keeps_its_claimed_bound(problem25):
    capped = replace(problem25, budgets=(travel(problem25, 20.0),))
    certificate = solve(capped, ALL["overlap_mip"]).certificate
    assert certificate.gap > 0  # from the least value without the budget
    assert certificate.claimed_gap <= 1e-6


def test_a_choice_that_is_not_allowed_is_caught():
    problem = CostProblem(LayeredCosts((np.array([0.0, np.inf]),), (np.zeros((1, 2)),)))
    with pytest.raises(SolverError, match="not allowed"):
        certify(problem, Selection((1,), 0.0), Aim.SUM)
