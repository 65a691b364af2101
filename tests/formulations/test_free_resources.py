"""Who solves grip sets: no plan depends on it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

import seqopt
from seqopt.errors import ProblemError
from tests.brute_force import ONES
from tests.builders import small_arch

AIM = "minmax,steps"


def solved(schedule="free", **means):
    search = seqopt.Search(**means)
    return seqopt.optimize(small_arch(5), schedule, ONES, aim=AIM, search=search)


@pytest.mark.parametrize("schedule", ["free", "three-robot"])
def test_a_plan_does_not_depend_on_who_solves_it(schedule):
    first = solved(schedule)
    with ThreadPoolExecutor(2) as executor:
        again = solved(schedule, executor=executor)
    assert (again.steps, again.objective) == (first.steps, first.objective)
    assert again.certificate.bounds == first.certificate.bounds


def test_processes_of_our_own_give_the_same_and_end():
    first, again = solved(), solved(workers=2)
    assert (again.steps, again.objective) == (first.steps, first.objective)


def test_lazily_is_how_states_are_always_looked_at():
    assert solved(lazy=True).objective == solved().objective
    with pytest.raises(ProblemError, match="proof"):
        solved(lazy=True, proof=False)
