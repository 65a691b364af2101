"""What formulations of paths say of the graph that they get is checked before it counts."""

import numpy as np
import pytest

import seqopt
from formulations.on_graph import Choice, on_graph
from seqopt.errors import SolverError
from seqopt.graph.formulation import FormulationKind
from seqopt.graph.graph import lexicographic
from seqopt.responses.quantities import RESPONSES
from tests.brute_force import ONES
from tests.builders import small_arch

LIES = {
    "no path, though time was left": lambda best: Choice(()),
    "an infinite bound": lambda best: Choice(best.path, (np.inf,)),
    "a bound that is no number": lambda best: Choice(best.path, (np.nan,)),
    "a bound above the value": lambda best: Choice(best.path, (1.1 * best.values[0],)),
    "a negative state": lambda best: Choice((-1, *best.path[1:])),
    "a state too many": lambda best: Choice((*best.path, 10**9)),
    "the start": lambda best: Choice((0, *best.path)),
    "a path that ends too soon": lambda best: Choice(best.path[:-1]),
}


@pytest.mark.parametrize("kind", [FormulationKind.EXACT, FormulationKind.HEURISTIC])
@pytest.mark.parametrize("moves", ["loop", "free"])
def test_a_lie_is_the_formulations_failure(moves, kind):
    engine = seqopt.make_engine("compliance", small_arch(5))
    rules = seqopt.FreeRules() if moves == "free" else seqopt.three_robot_loop(engine.network)
    problem = seqopt.pose(engine, rules, ONES, "minmax")
    for lie, say in LIES.items():
        told = on_graph(lie, lie, lambda graph, _, say=say: say(lexicographic(graph)), kind)
        with pytest.raises(SolverError, match=f"formulation {lie}"):
            seqopt.solve(problem, told)
    honest = on_graph("honest", "", lambda graph, _: Choice(*lexicographic(graph)), kind)
    assert seqopt.solve(problem, honest).status == "optimal"


def test_a_budget_has_no_lower_bound():
    plan = seqopt.optimize("chain:bricks=7", "free", aim="minmax", budgets="travel=2.5m")
    proof = plan.certificate
    assert len(proof.values) == 2
    assert len(proof.bounds) == len(proof.rests_on) == len(plan.bound) == 1


def test_a_sum_counts_no_tension_below_zero():
    """Where all edges are compressed the largest tension is below zero."""
    plan = seqopt.optimize("arch:span=2,rise=0.8", "free", aim="sum(T_max)")
    tensions = plan.responses()[RESPONSES["T_max"].column]
    assert (tensions < 0).any()
    assert plan.objective["sum(T_max)"] == pytest.approx(tensions.clip(lower=0).sum())
    assert plan.status == "optimal"
