"""Who solves grip sets and where answers are kept: no plan depends on it, no proof believes it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import seqopt
from seqopt.errors import ProblemError, SolverError
from seqopt.responses._blocks import Store
from tests.brute_force import ONES
from tests.builders import small_arch

AIM = "minmax,steps"


def solved(schedule="free", **means):
    search = seqopt.Search(**means)
    return seqopt.optimize(small_arch(5), schedule, ONES, aim=AIM, search=search)


@pytest.mark.parametrize("schedule", ["free", "three-robot"])
def test_a_plan_does_not_depend_on_who_solves_it(schedule, tmp_path):
    first = solved(schedule)
    with ThreadPoolExecutor(2) as executor:
        ways = [{"executor": executor}, {"cache": tmp_path}, {"cache": tmp_path}]
        for means in ways:
            again = solved(schedule, **means)
            assert (again.steps, again.objective) == (first.steps, first.objective)
            assert again.certificate.bounds == first.certificate.bounds


def test_processes_of_our_own_give_the_same_and_end():
    first, again = solved(), solved(workers=2)
    assert (again.steps, again.objective) == (first.steps, first.objective)


def test_what_is_kept_is_used(tmp_path, monkeypatch):
    solved(cache=tmp_path)
    used = []
    find = Store.find

    def counted(store, block):
        found = find(store, block)
        used.append(found is not None)
        return found

    monkeypatch.setattr(Store, "find", counted)
    solved(cache=tmp_path)
    assert used
    assert all(used)


def test_false_answers_with_their_checksum_are_not_believed(tmp_path, monkeypatch):
    """Whoever can write the folder can mislead the search, and not the proof."""
    keep = Store.keep

    def half(store, block, answers):
        false = {name: values / 2 for name, values in answers.values.items()}
        keep(store, block, type(answers)(false, answers.forces / 2, answers.tally))

    monkeypatch.setattr(Store, "keep", half)
    true = solved(cache=tmp_path)
    with pytest.raises(SolverError, match="as claimed"):
        solved(cache=tmp_path)
    assert np.isfinite(true.certificate.gap)


def test_lazily_is_how_states_are_always_looked_at():
    assert solved(lazy=True).objective == solved().objective
    with pytest.raises(ProblemError, match="proof"):
        solved(lazy=True, proof=False)
