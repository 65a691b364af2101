"""Graphs of decisions, with the forced moves behind each, against the whole graphs."""

import numpy as np
import pytest
from hypothesis import given, settings

from seqopt.graph import Graph, lexicographic
from seqopt.graph.graph import _on_paths, contracted, keep_best, path_values
from tests.random_graphs import graphs, simple_paths, values_of


@given(graph=graphs())
@settings(max_examples=60)
def test_the_best_paths_of_decisions_are_those_of_the_whole_graph(graph):
    graph = graph.only(_on_paths(graph))
    if not len(graph.source):
        return
    short = contracted(graph)
    for goal in range(graph.goals):
        assert keep_best(short.graph, goal)[1] == pytest.approx(keep_best(graph, goal)[1])
    best = lexicographic(short.graph)
    assert best.values == pytest.approx(lexicographic(graph).values)
    path = short.expanded(best.path)
    moves = {*zip(graph.source.tolist(), graph.target.tolist(), strict=True)}
    assert {*zip((0, *path), path, strict=False)} <= moves
    assert graph.ends[path[-1]]
    assert path_values(graph, path) == pytest.approx(best.values)


@given(graph=graphs())
@settings(max_examples=60)
def test_every_path_is_one_of_decisions(graph):
    graph = graph.only(_on_paths(graph))
    if not len(graph.source):
        return
    small = contracted(graph).graph
    whole, found = ({values_of(g, path) for path in simple_paths(g)} for g in (graph, small))
    assert whole <= found


def test_decisions_that_lead_to_the_same_state_stay_apart():
    """One way or the other to a state from which one move leads to the next decision."""
    moves = [(0, 1), (0, 2), (1, 3), (2, 3), (3, 4), (4, 5), (4, 6)]
    amounts = np.array([[1.0], [2.0], [10.0], [20.0], [100.0], [1000.0], [3000.0]])
    source, target = np.array(moves, dtype=np.int32).T
    graph = Graph(source, target, amounts, (False,), np.arange(7) >= 5)
    short = contracted(graph)
    assert short.kept.tolist() == [0, 1, 2, 5, 6]
    paths = {
        short.expanded(np.array(short.graph.target)[list(path)].tolist()): path
        for path in simple_paths(short.graph)
    }
    assert {*paths} == {(first, 3, 4, last) for first in (1, 2) for last in (5, 6)}
    for path, small in paths.items():
        assert values_of(short.graph, small) == path_values(graph, path)


def test_where_nothing_is_left_to_decide_one_move_leads_to_the_end():
    source, target = np.array([[0, 1, 2], [1, 2, 3]], dtype=np.int32)
    amounts = np.array([[1.0, 5.0], [2.0, 7.0], [4.0, 6.0]])
    short = contracted(Graph(source, target, amounts, (False, True), np.arange(4) == 3))
    assert short.graph.amounts.tolist() == [[7.0, 7.0]]
    assert short.expanded((1,)) == (1, 2, 3)
