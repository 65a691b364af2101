"""A puzzle without bricks, as a graph and a space: formulations solve it, the judge proves it."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import seqopt
from formulations.states._search import ThresholdSearch
from seqopt.errors import SolverError
from seqopt.graph._explore import Explorer
from seqopt.graph.formulation import find_formulation, formulations
from seqopt.graph.instance import Instance, _Cap, _Target
from seqopt.graph.space import Moves, Space
from seqopt.problem.problem import Aim

JUGS, WANTED = (5, 3), 4  # liters that jugs hold, and liters to be measured
EVERY = formulations("goals", "instance")
SUMS = [name for name, f in EVERY.items() if f.aim is not Aim.PEAK]
PEAKS = [*EVERY]  # whatever their own aim is


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


class Jugs(Space):
    """The same puzzle, explored as far as needed: the most water in both jugs, then moves."""

    first = levels = 1
    peaks = (True, False)

    def start(self):
        return "jugs", np.zeros((1, 2), dtype=int)

    def codes(self, part, states):
        return states @ [JUGS[1] + 1, 1]

    def within(self, part, states):
        moves = [(k, t) for k, s in enumerate(states.tolist()) for t in {*poured(s)} - {tuple(s)}]
        source, after = zip(*moves, strict=True)
        return Moves(np.array(source), np.array(after), np.zeros((len(moves), 0)))

    def onward(self, part, states):
        yield from ()

    def values(self, part, states, *, rough, most):
        return np.column_stack([states.sum(axis=1), 0 * states[:, 0]]) * 1.0, states[:, 0] >= 0

    def amounts(self, values, taken):
        return values + np.array([0.0, 1.0])

    def ended(self, part, states):
        return states[:, 0] == WANTED


def least_of_space(cap=12):
    """The least (most water, moves) of all sequences of at most so many moves, by trying all."""
    found, reached = [], {((0, 0), 0)}
    for moves in range(1, cap + 1):
        reached = {(t, max(most, sum(t))) for s, most in reached for t in poured(s)}
        found += [(most, moves) for s, most in reached if s[0] == WANTED]
    return min(found)


def whole(goals):
    """The whole space as an instance with goals, and the number of every state."""
    explorer = Explorer(Jugs())
    assert explorer.rise()
    graph, ((_, _, states),) = explorer.graph()
    rows = np.column_stack([np.zeros(len(states), int), states])
    arcs, names = (graph.source, graph.target, graph.ends), ("water", "moves")
    one = Instance("jugs", *arcs, names, graph.amounts, goals, states=rows)
    return one, {tuple(state): number for number, state in enumerate(states.tolist())}


WATER, MOVES = _Target("water", "peak", (0,)), _Target("moves", "sum", (1,))


def by_thresholds(numbers):
    """A formulation that searches the space itself, by thresholds, as schedules are searched."""
    found = ThresholdSearch(Jugs()).best()
    path = tuple((numbers[tuple(state)],) for _, *state in found.states)
    return replace(found, states=path, visited=())


def test_the_search_by_thresholds_solves_it_and_is_judged():
    one, numbers = whole((WATER, MOVES))
    answer = by_thresholds(numbers)
    assert answer.objective == answer.bound == least_of_space()
    known = find_formulation("schedule_search")
    plan = seqopt.solve(one, replace(known, solve=lambda *_, **__: answer))
    assert (plan.status, plan.certificate.gap) == ("optimal", 0.0)
    assert plan.objective == dict(zip(("water", "moves"), least_of_space(), strict=True))
    for lie in (
        replace(answer, objective=tuple(0.9 * v for v in answer.objective), bound=(0.0, 0.0)),
        replace(answer, states=answer.states[:-1]),
    ):
        with pytest.raises(SolverError):
            seqopt.solve(one, replace(known, solve=lambda *_, lie=lie, **__: lie))


def test_the_search_leaves_out_what_takes_more_than_the_best():
    """With less water than both jugs hold, states above the best value are not visited."""
    search = ThresholdSearch(Jugs())
    best_value = search.best().objective[0]
    visited = np.concatenate(search.wide.visited())
    assert visited.sum(axis=1).max() <= best_value < sum(JUGS)
