"""BLAS keeps to one thread inside engines, and to its own number outside."""

from __future__ import annotations

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid._refinement import Refinement
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.work._threads import one_thread
from tests.builders import hinged, six_bricks


def threads():
    """How many threads NumPy's and SciPy's linear algebra use; others may know but one."""
    found = [lib for lib in threadpool_info() if lib["user_api"] == "blas"]
    return {lib["num_threads"] for lib in found if "scipy" in lib["prefix"]}


@pytest.fixture
def two_threads():
    with threadpool_limits(limits=2, user_api="blas"):
        if threads() != {2}:
            pytest.skip("NumPy's linear algebra has but one thread here")
        yield


def test_one_thread_inside_and_two_after(two_threads):
    with one_thread():
        assert threads() == {1}
    assert threads() == {2}
    with pytest.raises(ZeroDivisionError), one_thread():
        _ = 1 / 0
    assert threads() == {2}


@pytest.mark.parametrize(
    ("owner", "name", "loose"), [(OperatorBuilder, "operator", False), (Refinement, "solve", True)]
)
def test_engines_keep_to_one_thread(two_threads, monkeypatch, owner, name, loose):
    seen = []
    work = getattr(owner, name)

    def watched(self, *asked):
        seen.append(threads())
        return work(self, *asked)

    monkeypatch.setattr(owner, name, watched)
    scene = hinged(six_bricks(), 2) if loose else six_bricks()
    ComplianceEngine(build_network(scene)).solve(6, [[3, 8, 11]])
    assert seen == [{1}]
    assert threads() == {2}
