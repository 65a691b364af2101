"""The search that solves only the models it meets: windows, dead ends, what looks further."""

from __future__ import annotations

import numpy as np
import pytest

from seqopt.errors import ProblemError, SolverError
from seqopt.graph.layers.layers import candidate_layers, windows
from seqopt.plan.search._window_search import search_windows
from seqopt.plan.solving import solve
from seqopt.problem.requirements import Limit
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.published import EQUATIONS, WEIGHTED


def test_a_dead_end_that_the_cascade_foresees(engine25):
    schedule, limits = three_robot_loop(engine25.network), [Limit("T_max", 64.0)]
    with pytest.raises(SolverError, match="move 8, step 31: rob2 has no allowed grip after"):
        search_windows(candidate_layers(engine25, schedule, EQUATIONS, limits))
    plan = solve(candidate_layers(engine25, schedule, EQUATIONS, limits), "cascade")
    assert len(plan.nodes) == len(schedule.moves)


def test_a_window_depends_on_the_choices_before_it(engine25):
    schedule = three_robot_loop(engine25.network)
    found = search_windows(candidate_layers(engine25, schedule, EQUATIONS))
    before = found.choice[8]
    own, other = (
        candidate_layers(engine25, windows(schedule, [(9, c)]), EQUATIONS).sums.single[0]
        for c in (before, 1 if before == 0 else 0)
    )
    assert own.tolist() == found.shared[9].sums.single[0].tolist()
    assert other.tolist() != own.tolist()


def test_the_table_says_what_the_next_one_costs(engine25):
    problem = candidate_layers(engine25, three_robot_loop(engine25.network), WEIGHTED)
    plan = solve(problem, "rank_search", proof=False)
    found, table = plan.search, plan.table()
    assert len(table) == 22
    assert (table["margin"] >= 0).all()
    last = np.sort(found.costs(21))
    assert table["cost"].iloc[-1] == last[0]
    assert table["margin"].iloc[-1] == last[1] - last[0]


def test_a_dead_end_is_named(engine25):
    schedule = three_robot_loop(engine25.network)
    with pytest.raises(SolverError, match="move 1, step 3: rob3 has no allowed grip"):
        search_windows(candidate_layers(engine25, schedule, EQUATIONS, [Limit("F_largest", 9.0)]))


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("overlap_dp", {}, "overlap_dp looks beyond"),
        ("beam", {}, "beam looks beyond"),
        ("cascade", {"charge": "earlier"}, "cascade charge=earlier looks beyond"),
        ("rank_search", {"horizon": 2}, "rank_search horizon=2 looks beyond"),
    ],
)
def test_what_looks_further_is_refused(problem25, name, options, said):
    with pytest.raises(ProblemError, match=said):
        solve(problem25, name, proof=False, **options)
