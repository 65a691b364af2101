"""The judge of builds in time: what is wrong is refused, what is not proven is claimed."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import seqopt
from formulations.times._search import plan_in_time
from seqopt.errors import SolverError
from seqopt.graph.formulation import Formulation, FormulationKind, find_formulation
from seqopt.graph.graph import LabelProof
from seqopt.judge._schedules import judge_schedule
from seqopt.plan.plan import Status
from tests.brute_force import ONES
from tests.times.builders import RULES, SLOW, engine_of


@pytest.fixture(scope="module")
def plan():
    problem = seqopt.pose(engine_of(4, 3, SLOW), RULES, ONES, "makespan")
    return seqopt.solve(problem)


def judged(plan, **changes):
    return judge_schedule(replace(plan.graph), replace(plan.selection, **changes), plan.steps)


def test_what_is_claimed_is_proven_by_labels(plan):
    proof = judged(plan)
    assert proof.gap == 0
    assert len(plan.selection.proofs[0].labels) > 0


def test_a_wrong_time_is_refused(plan):
    wrong = plan.makespan - 1.0
    with pytest.raises(SolverError, match=r"makespan is .* as claimed"):
        judged(plan, objective=(wrong,), bound=(wrong,))


def test_a_slower_plan_is_not_the_least(plan):
    """The plan with robots that do not take turns well is refused as the least."""
    twin = replace(plan.graph)
    steps = seqopt.solve(seqopt.pose(twin.engine, RULES, ONES, "minmax,steps")).steps
    value = seqopt.GivenSequence(twin.engine, steps).makespan
    assert value > plan.makespan
    claimed = replace(plan.selection, objective=(value,), bound=(value,))
    with pytest.raises(SolverError, match="labels do not prove"):
        judge_schedule(twin, claimed, steps)


@pytest.mark.parametrize("change", ["one less", "later", "freer", "none"])
def test_labels_that_do_not_close_are_seen(plan, change):
    states, labels, prices = plan.selection.proofs[0]
    labels, first = labels.copy(), int(np.flatnonzero(states[:, 0] == 1)[0])
    if change == "one less":
        states, labels = states[1:], labels[1:]
    elif change == "later":
        labels[first:, 0] += 1.0
    elif change == "freer":
        labels[first:, 1:] += 30.0
    else:
        states, labels = states[:0], labels[:0]
    proof = (LabelProof(states, labels, prices),)
    if change == "none":  # prices alone prove less
        assert judged(plan, proofs=proof).gap > 0
        return
    with pytest.raises(SolverError, match="labels do not prove"):
        judged(plan, proofs=proof)


def test_without_the_twin_of_a_room_the_certificate_says_claimed(plan):
    goals = tuple(replace(goal, twin=None) for goal in plan.graph.goals)
    proof = judge_schedule(replace(plan.graph, goals=goals), plan.selection, plan.steps)
    assert proof.values == plan.selection.objective
    assert (proof.bounds, proof.gap) == ((-np.inf,), np.inf)


def test_without_labels_it_is_claimed(plan):
    def told(problem, **_):
        found = find_formulation("makespan_labels").solve(problem)
        return replace(found, proofs=())

    liar = Formulation("liar", "says so", FormulationKind.EXACT, None, told, answers=("time",))
    found = seqopt.solve(plan.problem, liar)
    assert found.status is Status.CLAIMED
    assert found.certificate.gap == np.inf  # nothing is proven


def test_other_grips_than_those_of_the_states_are_refused(plan):
    def told(problem, **_):
        found = find_formulation("makespan_labels").solve(problem)
        return replace(found, grips=found.grips[::-1])

    liar = Formulation("liar", "says so", FormulationKind.EXACT, None, told, answers=("time",))
    with pytest.raises(SolverError, match="robots hold other nodes"):
        seqopt.solve(plan.problem, liar)


def test_a_search_that_ends_early_leaves_a_plan_and_a_proven_bound(plan):
    """What multipliers say of the first path, before any label is set."""
    early = partial(plan_in_time, least=lambda _, __, first, *___: first._replace(late=True))
    formulation = Formulation("early", "x", FormulationKind.EXACT, None, early, answers=("time",))
    found = seqopt.solve(plan.problem, formulation)
    assert (found.status, found.stopped) == (Status.FEASIBLE, "time")
    bound = found.certificate.bounds[0]
    assert 0 < bound < plan.makespan <= found.makespan
    assert found.gap == pytest.approx(1 - bound / found.makespan)
    assert found.summary()["bound"] == {"makespan": bound}
