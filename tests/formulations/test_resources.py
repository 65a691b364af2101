"""A resource of one's own, on a loop and on a free schedule: found, judged, and claimed alone."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

import seqopt
from seqopt.errors import InfeasibleError, ProblemError, SeqoptError
from seqopt.graph._spaces import explore
from seqopt.graph.formulation import LabelProof, find_formulation
from seqopt.plan.solve import graph_of
from seqopt.problem import Resource
from seqopt.sequence.rules import FreeRules
from tests.brute_force import ONES
from tests.builders import small_arch

MOST = {"loop": 1, "free": 0, "sum": 1}  # grips in a row at the near ends of bricks


def warmed(most, steps, values):
    """A tool warms up by grips at even nodes, one after the other; one at an odd node cools it."""
    fresh = (steps.after >= 0) & (steps.after[:, :, None] != steps.before[:, None]).all(axis=2)
    even = (fresh & (steps.after % 2 == 0)).any(axis=1)[:, None]
    odd = (fresh & (steps.after % 2 == 1)).any(axis=1)[:, None]
    heat = np.where(odd, 0.0, values + even)
    return np.where(heat > most, np.inf, heat)


def warmed_again(most, steps, values):
    """The same, label by label."""
    out = np.full(values.shape, np.inf)
    for row, (before, after) in enumerate(zip(steps.before, steps.after, strict=True)):
        heat = heated(values[row, 0], before.tolist(), after.tolist())
        out[row] = heat if heat <= most else np.inf
    return out


def heated(heat, before, after):
    """How warm the tool is after a step, from nodes that are held."""
    taken = {*after} - {*before, None, -1, 0}
    heat = heat + 1 if any(node % 2 == 0 for node in taken) else heat
    return 0.0 if any(node % 2 for node in taken) else heat


def heat(space, change=lambda steps, old, new: new):
    """The resource, changed in the search alone."""
    most = MOST[space]
    twin = Resource("heat", (0.0,), partial(warmed_again, most))
    return Resource("heat", (0.0,), lambda s, v: change(s, v, warmed(most, s, v)), twin=twin)


HELD = FreeRules(ending="held")
BRICKS = {"loop": 6, "free": 4, "sum": 5}
AIMS = {"loop": "F_largest", "free": "F_largest,steps", "sum": "sum(T_max)"}


@cache
def posed(space):
    engine = seqopt.make_engine("compliance", small_arch(BRICKS[space]))
    moves = seqopt.three_robot_loop(engine.network) if space == "loop" else HELD
    return seqopt.pose(engine, moves, ONES, AIMS[space])


def heats(plan):
    """How warm the tool is at most along a plan."""
    before, now, out = (None,) * len(plan.steps[0].grips), 0, 0
    for step in plan.steps:
        now, before = heated(now, before, step.grips), step.grips
        out = max(out, now)
    return out


@pytest.mark.parametrize("space", AIMS)
def test_plans_keep_it_and_are_proven(space):
    free = seqopt.solve(posed(space))
    plan = seqopt.solve(posed(space).but(limits=[heat(space)]))
    assert (str(free.status), str(plan.status)) == ("optimal", "optimal")
    assert heats(plan) <= MOST[space] < heats(free)
    assert plan.certificate.values[0] > free.certificate.values[0] * (space != "loop")
    assert len(plan.selection.proofs[0].labels) > 0


@pytest.mark.parametrize("space", AIMS)
def test_no_path_that_keeps_it_is_better(space):
    """By a graph of its own, of states with how warm the tool is, and the least of all paths."""
    found = explore(graph_of(posed(space)))
    one, states = found.graph()
    rows = [row[1:] for _, key, own in states for row in found.space.rows(key, own).tolist()]
    moves = one.source.tolist(), one.target.tolist(), one.amounts[:, 0].tolist()
    least = {(0, 0.0): 0.0}
    for _ in range(len(states) * 3 + 3):
        for s, t, amount in zip(*moves, strict=True):
            for now in range(MOST[space] + 1):
                then = heated(now, rows[s], rows[t])
                if (s, now) in least and then <= MOST[space]:
                    before = least[s, now]
                    value = before + amount if space == "sum" else max(before, amount)
                    least[t, then] = min(value, least.get((t, then), np.inf))
    best = min(value for (state, _), value in least.items() if one.ends[state])
    plan = seqopt.solve(posed(space).but(limits=[heat(space)]))
    assert plan.certificate.values[0] == pytest.approx(best)


def test_without_a_twin_it_is_claimed():
    plan = seqopt.solve(posed("free").but(limits=[replace(heat("free"), twin=None)]))
    assert str(plan.status) == "claimed optimal"
    assert not np.isfinite(plan.certificate.bounds).any()


def test_it_is_asked_for_by_its_name():
    seqopt.register(heat("free"))
    problem = posed("free").but(limits="heat")
    assert [*map(str, problem.paths)] == ["heat"]
    assert "1 path)" in repr(problem)
    plan = seqopt.solve(problem)
    assert plan.summary()["resources"] == ["heat"]


def test_what_no_plan_keeps_is_claimed_to_be_infeasible():
    never = Resource("never", (0.0,), lambda steps, values: values + np.inf)
    with pytest.raises(InfeasibleError, match=r"no plan keeps never; leave it out"):
        seqopt.solve(posed("free").but(limits=[never]))


def test_a_build_may_have_to_end_with_something():
    """Only an even number of grips may be taken in all: it decides where a build may end."""

    def counted(steps, values):
        fresh = (steps.after >= 0) & (steps.after[:, :, None] != steps.before[:, None]).all(axis=2)
        return (values + fresh.any(axis=1)[:, None]) % 2

    def same(first, other):
        return (first == other).all(axis=1)

    def even(values):
        return values[:, 0] == 0

    parity = Resource("parity", (0.0,), counted, may_end=even, dominates=same)
    parity = replace(parity, twin=replace(parity))
    plans = {}
    for start in (0.0, 1.0):
        own = replace(parity, start=(start,), twin=replace(parity, start=(start,)))
        plans[start] = seqopt.solve(posed("free").but(goals="steps", limits=[own]))
        assert str(plans[start].status) == "optimal"
    counts = {start: len(plan.steps) for start, plan in plans.items()}
    assert counts[0.0] != counts[1.0]


def test_it_goes_with_makespans_and_budgets():
    words = "fetch=30,place=10,approach=10,grip=5,release=5"
    scene = small_arch(4).with_durations(words)
    engine = seqopt.make_engine("compliance", scene)
    problem = seqopt.pose(engine, HELD, ONES, "makespan,F_largest", limits=[heat("free")])
    plan = seqopt.solve(problem)
    free = seqopt.solve(problem.but(limits=()))
    assert (str(plan.status), heats(plan) == 0) == ("optimal", True)
    assert plan.makespan >= free.makespan
    few = seqopt.solve(problem.but(budgets="regrips=1"))
    assert (str(few.status), heats(few) == 0) == ("optimal", True)


@pytest.mark.parametrize("words", [{"orders": "tied"}, {"over": "worst-total"}])
def test_what_is_not_modeled_beside_it_is_refused(words):
    problem = posed("free").but(limits=[heat("free")])
    if "over" in words:
        scene = problem.scene
        problem = problem.but(goals="sum(T_max)", scenarios=[scene, scene])
    with pytest.raises(ProblemError, match="resource heat"):
        seqopt.solve(problem.but(**words))


def test_a_formulation_that_knows_no_resources_is_refused():
    with pytest.raises(ProblemError, match="resources"):
        seqopt.solve(posed("free").but(limits=[heat("free")]), "schedule_search")


@pytest.mark.parametrize(
    "extend",
    [lambda steps, values: values[:1], lambda steps, values: 1 / 0, lambda s, v: v * np.nan],
)
def test_a_function_that_fails_is_named(extend):
    with pytest.raises(ProblemError, match="resource wrong: its function"):
        seqopt.solve(posed("free").but(limits=[Resource("wrong", (0.0,), extend)]))


# what the search gets wrong about it, the judge sees
def is_refused(problem):
    try:
        plan = seqopt.solve(problem)
    except SeqoptError as error:
        return "failed" not in str(error)
    return str(plan.status) != "optimal"


@pytest.mark.parametrize("space", AIMS)
def test_a_constant_that_is_added_is_seen(space):
    assert not is_refused(posed(space).but(limits=[heat(space)]))
    wrong = heat(space, lambda steps, old, new: new + 0.5)
    assert is_refused(posed(space).but(limits=[wrong]))


@pytest.mark.parametrize("space", AIMS)
def test_a_label_that_is_let_through_is_seen(space):
    wrong = heat(space, lambda steps, old, new: np.where(np.isfinite(new), new, MOST[space]))
    assert is_refused(posed(space).but(limits=[wrong]))


@pytest.mark.slow
@pytest.mark.parametrize("space", ["loop", "free", "sum"])
def test_a_label_that_is_left_out_is_missed(space):
    """Whatever label of the best plan: a plan as good is found, or the judge finds a better."""
    plan = seqopt.solve(posed(space).but(limits=[heat(space)]))
    value, met = plan.certificate.values[0], False
    for step in plan.steps[::-1]:
        held = np.array([-1 if node is None else node for node in step.grips])

        def lost(steps, old, new, held=held, bricks=step.bricks):
            same = (np.sort(steps.after, axis=1) == np.sort(held)).all(axis=1)
            return np.where((same & (steps.bricks == bricks))[:, None], np.inf, new)

        problem = posed(space).but(limits=[heat(space, lost)])
        if is_refused(problem):
            met = True
            break
        assert seqopt.solve(problem).certificate.values[0] == pytest.approx(value)
    assert met


def test_labels_that_are_left_out_of_a_proof_are_missed():
    problem = posed("sum").but(limits=[heat("sum")])
    known = find_formulation("makespan_labels")

    def fewer(asked, **words):
        found = known.solve(asked, **words)
        proofs = tuple(LabelProof(p.states[1:], p.labels[1:], p.prices) for p in found.proofs)
        return replace(found, proofs=proofs)

    with pytest.raises(SeqoptError, match="labels do not prove"):
        seqopt.solve(problem, replace(known, solve=fewer))


def test_one_that_falls_without_end_is_refused_and_one_with_an_end_is_not(monkeypatch):
    monkeypatch.setattr("seqopt.graph._budgets.CYCLES", 20)
    endless = Resource("rest", (0.0,), lambda _, values: values - 1.0)
    with pytest.raises(ProblemError, match="falls whenever the same steps are repeated"):
        seqopt.solve(posed("free").but(limits=[endless]))
    ended = Resource("rest", (0.0,), lambda _, values: np.maximum(values - 1.0, -3.0))
    plan = seqopt.solve(posed("free").but(limits=[ended]))
    assert plan.objective == seqopt.solve(posed("free")).objective
