"""One way from a problem, a graph of choices or an instance to a plan."""

from __future__ import annotations

import pytest

import seqopt
from seqopt.errors import ProblemError
from seqopt.plan.pose import graph_of
from seqopt.sequence.methods import three_robot_loop
from tests.builders import small_arch

WORST = seqopt.CRITERIA["worst-ratio"]


def posed(goals):
    engine = seqopt.make_engine("compliance", small_arch(4))
    return seqopt.pose(engine, three_robot_loop(engine.network), WORST, goals)


def test_a_problem_its_graphs_and_its_instance_have_one_optimum():
    problem = posed("sum")
    moves, states = (graph_of(problem, moves=each) for each in (True, False))
    arcs = seqopt.compile_instance(problem)
    plans = [seqopt.solve(each) for each in (problem, moves, states, arcs)]
    best = plans[0].certificate.values
    for plan in plans:
        assert plan.certificate.values == pytest.approx(best, rel=1e-9)
        assert plan.gap == pytest.approx(0, abs=1e-9)
    assert [bool(plan.steps) for plan in plans] == [True, True, True, False]
    assert [plan.graph for plan in plans[1:]] == [moves, states, arcs]


def test_a_formulation_takes_the_aim_that_is_asked():
    """Its own aim holds where none is asked; what it cannot make small it refuses itself."""
    for goals in ("sum", "minmax", "steps", "minmax,steps"):
        best = seqopt.solve(posed(goals)).certificate.values
        for name in ("overlap_dp", "overlap_lp"):
            plan = seqopt.solve(posed(goals), name)
            assert plan.certificate.values == pytest.approx(best), (goals, name)
    with pytest.raises(ProblemError, match="minimax: a sum comes first"):
        seqopt.solve(posed("sum"), "minimax")
    with pytest.raises(ProblemError, match="minimax_arc: it writes one largest cost down alone"):
        seqopt.solve(posed("sum"), "minimax_arc")
