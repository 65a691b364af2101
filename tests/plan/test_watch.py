"""What a watch is told and what it tells on; formulations that cannot be watched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.errors import ProblemError
from seqopt.graph.decision_costs import LayeredCosts
from seqopt.graph.formulation import Watch, find_formulation
from seqopt.plan.solve import solve
from tests.layered import Costs


def test_only_what_is_better_is_told():
    told = []
    watch = Watch(progress=told.append)
    for objective, bound in ((np.inf, -np.inf), (9, 1), (9, 1), (10, 0), (8, 0), (9, 2)):
        watch.tell(objective, bound)
    assert [(f.objective, f.bound) for f in told] == [(np.inf, -np.inf), (9, 1), (8, 1), (8, 2)]
    assert tuple(told) == watch.trace


def problem():
    costs = LayeredCosts((np.array([2.0, 1.0]),), (np.zeros((1, 2)),))
    return Costs(costs).compiled().instance


@pytest.mark.parametrize("limit", [-1, "1", np.nan, None])
def test_a_time_limit_is_seconds(limit):
    with pytest.raises(ProblemError, match=r"time_limit is .*; give seconds from 0"):
        solve(problem(), "overlap_dp", time_limit=limit)


def test_what_takes_no_watch_takes_no_time_limit():
    exact = find_formulation("overlap_dp")

    def unwatched(problem):
        return exact.solve(problem)

    bare = replace(exact, name="bare", solve=unwatched)
    assert not bare.watched
    assert solve(problem(), bare).certificate.objective == 1.0
    assert solve(problem(), bare).selection.trace[-1].objective == 1.0
    with pytest.raises(ProblemError, match="bare takes no time limit; leave it out"):
        solve(problem(), bare, time_limit=1.0)
    assert "watch" not in exact.options
