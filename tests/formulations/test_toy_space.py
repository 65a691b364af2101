"""A puzzle without bricks, as a graph: every formulation solves it, and the judge proves it."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import seqopt
from seqopt.graph.formulation import formulations
from seqopt.graph.instance import Instance, _Cap, _Target
from seqopt.problem.problem import Aim

JUGS, WANTED = (5, 3), 4  # liters that jugs hold, and liters to be measured
EVERY = formulations("goals", "instance")
SUMS = [name for name, f in EVERY.items() if f.aim is not Aim.PEAK]
PEAKS = [name for name, f in EVERY.items() if f.aim is not Aim.SUM]


def poured(full):
    """The states that follow from one: a jug is filled, emptied, or poured into the other."""
    for a, b in ((0, 1), (1, 0)):
        for amount in (JUGS[a], 0):
            yield tuple(amount if k == a else full[k] for k in (0, 1))
        moved = min(full[a], JUGS[b] - full[b])
        yield tuple(full[k] + moved * (1 if k == b else -1) for k in (0, 1))


def puzzle(kind, cap=np.inf):
    """Measure four liters: least water moved, of which no move counts less than half a liter."""
    states = sorted(product(*(range(size + 1) for size in JUGS)))
    arcs = sorted({(s, t) for s in states for t in poured(s) if s != t and s[0] != WANTED})
    source, target = (np.array([states.index(arc[k]) for arc in arcs], np.int32) for k in (0, 1))
    water = [max(0.5, *np.abs(np.subtract(s, t))) for s, t in arcs]
    ends = np.array([s[0] == WANTED for s in states])
    amounts = np.column_stack([water, np.ones(len(arcs))])
    caps = (_Cap("moves", 1, cap),) if np.isfinite(cap) else ()
    rows = np.column_stack([np.zeros(len(states), int), states])
    names, goal = ("water", "moves"), _Target("water", kind, (0,))
    return Instance("jugs", source, target, ends, names, amounts, (goal,), caps, rows)


def best(kind, cap=10):
    """The least water of any sequence of at most so many moves, by trying all."""
    one, join = puzzle(kind), {"sum": np.add, "peak": np.maximum}[kind]
    found, worth = np.inf, {0: 0.0}
    for _ in range(cap):
        after: dict[int, float] = {}
        for s, t, water in zip(
            one.source.tolist(), one.target.tolist(), one.amounts[:, 0], strict=True
        ):
            if s in worth:
                after[t] = min(after.get(t, np.inf), float(join(worth[s], water)))
        found = min([found, *(v for t, v in after.items() if one.ends[t])])
        worth = after
    return found


@pytest.mark.parametrize(
    ("name", "kind"), [*((n, "sum") for n in SUMS), *((n, "peak") for n in PEAKS)]
)
def test_every_formulation_solves_it_and_the_judge_proves_it(name, kind):
    plan = seqopt.solve(puzzle(kind), name)
    value = plan.objective["water"]
    assert value >= best(kind) - 1e-9
    if EVERY[name].kind.value == "exact":
        assert value == pytest.approx(best(kind))
        assert plan.certificate.gap <= 1e-9
    states = puzzle(kind).states[list(plan.nodes)]
    assert states[-1, 1] == WANTED
    assert plan.summary()["nodes_of_path"] == [*plan.nodes]


def test_moves_may_be_capped():
    free, few = best("sum"), best("sum", 6)
    plan = seqopt.solve(puzzle("sum", 6.0), "labels")
    assert plan.objective["water"] == pytest.approx(few)
    assert few >= free
    assert len(plan.nodes) == 6
    with pytest.raises(seqopt.errors.InfeasibleError, match="moves"):
        seqopt.solve(puzzle("sum", 5.0), "labels")
