"""What is promised of every step: payloads, limits, and judges that keep their own data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph.decision_costs import LayeredCosts
from seqopt.problem.requirements import payload_limits
from tests.layered import Costs


def weak(scene, payload):
    return replace(scene, robots=tuple(replace(r, payload=payload) for r in scene.robots))


def test_a_limit_that_a_fixed_step_exceeds_is_infeasible(arch25):
    """The first two steps of the loop have no open grip: nothing can be chosen there."""
    with pytest.raises(InfeasibleError, match=r"F_largest is up to .* of 20 \(steps? 1"):
        seqopt.optimize(arch25, limits=[seqopt.Limit("F_largest", 20.0)])
    with pytest.raises(InfeasibleError, match="no grip is left to choose"):
        seqopt.optimize(
            arch25, "modified-sequential", formulation="cascade",
            search=seqopt.Search(proof=False),
            limits=payload_limits(weak(arch25, 150.0)),
        )  # fmt: skip


def test_payloads_hold_on_every_step_or_are_named(arch25):
    kept = seqopt.optimize(arch25, limits=payload_limits(arch25))
    assert kept.overloads == ()
    assert kept.summary()["payload_exceeded"] == []
    over = seqopt.optimize(weak(arch25, 350.0))
    assert [excess.limit.response for excess in over.overloads] == ["F_rob1"]
    table = over.responses()
    assert over.overloads[0].largest == table["F_rob1_N"].abs().max()
    assert over.summary()["payload_exceeded"] == [str(over.overloads[0])]
    assert "rob1 holds up to 375.4 N, more than its payload of 350 N (step" in str(
        over.overloads[0]
    )


@pytest.mark.parametrize(("share", "exceeds"), [(1 - 1e-12, False), (1 - 1e-6, True)])
def test_the_last_bit_decides_nothing(share, exceeds):
    limit = seqopt.Limit("T_max", share * 0.3)
    assert limit.exceeded(np.array([0.1 + 0.2, np.nan])).tolist() == [exceeds, False]


def small():
    costs = LayeredCosts(
        (np.array([2.0, 1.0]), np.array([1.0, 4.0])), (np.zeros((1, 2)), np.ones((2, 2)))
    )
    return Costs(costs).compiled().instance


def test_costs_that_change_while_they_are_judged_are_seen(monkeypatch):
    monkeypatch.setattr("seqopt.judge.arithmetic.proven", lambda *_: 99.0)
    with pytest.raises(SolverError, match="the bound 99 is above the path's 3"):
        seqopt.solve(small(), "overlap_dp")
