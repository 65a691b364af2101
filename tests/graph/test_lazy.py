"""Paths of states that pass, asked as few as may be, against every path there is."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.graph import Graph
from seqopt.graph.paths import FAILS, PASSES, _lazy_path
from tests.random_graphs import graphs, simple_paths


def sought(graph, passes, parts, *, recalls=False):
    """What is found, what is known then, and which states were asked."""
    asked = []
    known = np.zeros(graph.states, dtype=np.int64)
    known[0] = PASSES

    def ask(part, rows):
        assert set(parts[rows].tolist()) == {part}
        asked.extend(rows.tolist())
        return np.where(passes[rows], PASSES, FAILS)

    def recall(part, rows):
        return np.where(passes[rows], 0, FAILS * recalls)

    return _lazy_path(graph, parts, known, ask, recall), known, asked


@given(graph=graphs(), data=st.data(), recalls=st.booleans())
@settings(max_examples=40)
def test_a_path_is_found_where_there_is_one(graph, data, recalls):
    passes = np.array(data.draw(st.lists(st.booleans(), min_size=6, max_size=6)))[: graph.states]
    passes[0] = True
    parts = np.arange(graph.states) // 2
    path, known, asked = sought(graph, passes, parts, recalls=recalls)
    states = ((0, *(int(graph.target[m]) for m in moves)) for moves in simple_paths(graph))
    assert (path is not None) == any(passes[[*each]].all() for each in states)
    assert len(asked) == len({*asked}), "a state is asked twice"
    assert (passes[known == PASSES]).all()
    assert not passes[known == FAILS].any()
    if path is not None:
        moves = {*zip(graph.source.tolist(), graph.target.tolist(), strict=True)}
        assert {*zip((0, *path), path, strict=False)} <= moves
        assert graph.ends[path[-1]]
        assert passes[[*path]].all()


def test_a_cut_is_found_without_asking_what_lies_before_it():
    """Twenty ways lead to one state that fails: it is asked soon, most of the others never."""
    ways = np.arange(1, 21)
    source = np.concatenate([np.zeros(20), ways, [21]]).astype(np.int32)
    target = np.concatenate([ways, np.full(20, 21), [22]]).astype(np.int32)
    ends = np.arange(23) == 22
    graph = Graph(source, target, np.ones((41, 1)), (False,), ends)
    parts = np.array([0, *[1] * 20, 2, 3])
    path, known, asked = sought(graph, np.arange(23) != 21, parts)
    assert path is None
    assert known[21] == FAILS
    assert len(asked) <= 4
