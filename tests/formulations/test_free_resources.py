"""Who solves grip sets: no plan depends on it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

import seqopt
from tests.brute_force import ONES
from tests.builders import small_arch

AIM = "minmax,steps"


def solved(**means):
    search = seqopt.Search(**means)
    return seqopt.optimize(small_arch(5), "free", ONES, aim=AIM, search=search)


def test_a_plan_does_not_depend_on_who_solves_it():
    first = solved()
    with ThreadPoolExecutor(2) as executor:
        again = solved(executor=executor)
    assert (again.steps, again.objective) == (first.steps, first.objective)
    assert again.certificate.bounds == first.certificate.bounds


@pytest.mark.slow
def test_processes_of_our_own_give_the_same_and_end():
    first, again = solved(), solved(workers=2)
    assert (again.steps, again.objective) == (first.steps, first.objective)
