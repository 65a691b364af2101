"""The judge of free schedules that takes many states at once, against rules in plain words."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError
from seqopt.network.build import build_network
from seqopt.placement.criteria import WorstRatio
from seqopt.placement.free_goals import parse_goals
from seqopt.placement.free_problem import pose_free
from seqopt.placement.free_proof import Proof
from seqopt.placement.free_reach import counts_alone
from seqopt.placement.free_tables import RuleTables
from seqopt.placement.solving import solve
from seqopt.sequence.free_check import RuleBook
from tests.strategies import free_builds

ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0), ("T_max", 30.0), ("D_max", 1e-5)))
few = settings(max_examples=8, deadline=None)


def told(book, tables, bricks, state):
    """What follows from a row by the book, as plain values."""
    robots = len(book.network.scene.robots)
    grips = [None] * robots
    for column, robot in enumerate(book.team):
        grips[robot] = int(tables.nodes[state[column]]) if state[column] else None
    counts = book.rules.regrips is not None
    taken = int(state[-1]) if counts else 0
    place = {node: i for i, node in enumerate(tables.nodes.tolist())}
    for _, after, held, regrips in book.follow(bricks, tuple(grips), taken):
        row = [place[held[r]] if held[r] is not None else 0 for r in book.team]
        yield after, (*row, *([regrips] if counts else []))


@given(build=free_builds(most_bricks=3, most_robots=3), data=st.data())
@few
def test_tables_say_what_the_book_says(build, data):
    """All states that rules lead to, robots that could change places told apart."""
    scene, rules = build
    book = RuleBook(build_network(scene), rules)
    tables = RuleTables(book, [])
    reached = {(0, tuple(tables.start()[0].tolist()))}
    work = [*reached]
    while work:
        bricks, row = work.pop()
        expected = {*told(book, tables, bricks, row)}
        states = np.array([row], dtype=np.int32)
        found = {(b, tuple(r)) for b, rows in tables.follow(bricks, states) for r in rows.tolist()}
        assert found == expected
        assert tables.ends(bricks, states)[0] == book.ends(
            bricks, tuple(int(tables.nodes[n]) if n else None for n in row[: tables.robots])
        )
        work += found - reached
        reached |= found
    assert len(reached) > 1


@pytest.mark.parametrize("aim", ["minmax,steps", "steps,minmax", "T_max,M_sup,steps"])
@given(build=free_builds(most_bricks=4, most_robots=3), more=st.sampled_from([0.0, 1e-6, 0.1]))
@few
def test_both_routes_of_the_proof_agree(aim, build, more):
    """At the optimum none finds a better plan; above it both do."""
    scene, rules = build
    problem = pose_free(ComplianceEngine(build_network(scene)), rules, ONES, aim)
    try:
        best = solve(problem, "schedule_search").selection.objective
    except InfeasibleError:
        return
    for k, goal in enumerate(problem.goals):
        value = best[k] + (more > 0 if str(goal) == "steps" else more * best[k])
        values = (*best[:k], value)
        most = [v * (1 + 1e-12) for v in best[:k]]
        many, one = Proof(problem), Proof(problem)
        most.append(many.bound(values, k))
        assert many.finds_better(values, k) == one._finds_end(most) == (more > 0 and value > 0)


def test_goals_that_add_up_go_the_other_way():
    assert counts_alone(parse_goals("minmax,steps,T_max,bond"))
    assert not counts_alone(parse_goals("minmax,regrips"))
    assert not counts_alone(parse_goals("sum(T_max)"))
