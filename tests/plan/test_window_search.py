"""The search that solves only the models it meets: windows, dead ends, what looks further."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.harness.scenes import half_circle
from seqopt.engines.rigid._extremes import can_compile
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import ProblemError, SolverError
from seqopt.graph._decision_search import Windows, walk_windows
from seqopt.graph.decisions import pose_decisions
from seqopt.graph.formulation import Watch
from seqopt.plan.solve import solve
from seqopt.problem.requirements import Limit
from seqopt.responses import _grip_sets
from seqopt.responses.table import analyze
from seqopt.sequence.methods import three_robot_loop
from seqopt.study.published import EQUATIONS


def test_a_dead_end_that_the_cascade_foresees(engine25):
    schedule, limits = three_robot_loop(engine25.network), [Limit("T_max", 64.0)]
    with pytest.raises(SolverError, match="move 8, step 31: rob2 has no allowed grip after"):
        walk_windows(pose_decisions(engine25, schedule, EQUATIONS, limits), Watch())
    plan = solve(pose_decisions(engine25, schedule, EQUATIONS, limits), "cascade")
    assert len(plan.nodes) == len(schedule.moves)


def test_a_window_depends_on_the_choices_before_it(engine25):
    schedule = three_robot_loop(engine25.network)
    problem = pose_decisions(engine25, schedule, EQUATIONS)
    found = walk_windows(problem, Watch())
    before, costs = found.choice[8], found.costs(9)
    _ = problem.sums  # windows are parts of all responses from now on
    chosen = ([*found.choice[:8], c] for c in (before, 1 if before == 0 else 0))
    own, other = (Windows(problem, choice).costs(9) for choice in chosen)
    able = np.isfinite(costs)
    assert own[able] == pytest.approx(costs[able])
    assert other.tolist() != own.tolist()


@pytest.mark.slow
@pytest.mark.skipif(not can_compile(), reason="no numba")
@pytest.mark.xdist_group("compiled loops")
def test_the_search_answers_steps_on_its_way(monkeypatch):
    """Large structures grow once for a plan and its table."""
    monkeypatch.setattr(_grip_sets, "COMPILED", 0.0)
    network = half_circle(60)
    engine, known = ComplianceEngine(network), three_robot_loop(network)
    plan = solve(pose_decisions(engine, known, EQUATIONS), "cascade", proof=False)
    late = {step.number for step in plan.steps if step.bricks > 40}
    assert late <= plan.search.fields.keys() | {plan.steps[-1].number}
    found, fresh = plan.responses(), analyze(ComplianceEngine(network), plan.steps)
    for column in fresh.select_dtypes("number"):
        a, b = (table[column].to_numpy(float) for table in (found, fresh))
        assert np.allclose(
            a, b, rtol=0, atol=1e-9 * max(np.nanmax(np.abs(b)), 1e-9), equal_nan=True
        )


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("overlap_dp", {}, "overlap_dp looks beyond"),
        ("cascade", {"charge": "earlier"}, "cascade charge=earlier looks beyond"),
        ("rank_search", {"horizon": 2}, "rank_search horizon=2 looks beyond"),
    ],
)
def test_what_looks_further_is_refused(problem25, name, options, said):
    with pytest.raises(ProblemError, match=said):
        solve(problem25, name, proof=False, **options)
