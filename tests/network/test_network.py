"""The double-cross network: counts, numbers, presence."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given

from experiments.harness.scenes import running_bond
from seqopt.network.build import build_network
from seqopt.network.network import PartKind
from tests.strategies import arches


def test_edge_counts_of_the_study(engine25):
    """T_pct of Tables A.1 and A.2 counts 3n + 1 edges for n < 25 bricks and 77 for 25."""
    net = engine25.network
    assert [net.count_edges(n) for n in range(1, 25)] == [3 * n + 1 for n in range(1, 25)]
    assert net.count_edges(25) == 77


def test_graph_carries_the_numbers(engine25, arch25):
    for bricks in (1, 7, 25):
        graph = engine25.network.graph(bricks)
        inner = [n for n, kind in graph.nodes(data="kind") if kind is PartKind.INNER]
        assert sorted(inner) == list(range(2 * bricks))  # node 0 exists but is never gripped
        numbers = [number for _, _, number in graph.edges(data="number")]
        assert sorted(numbers) == list(range(1, graph.number_of_edges() + 1))
        assert nx.is_connected(graph)
        for node in inner:
            assert graph.nodes[node]["position"] == pytest.approx(arch25.node_position(node))


def test_partial_structures_are_prefixes(engine25):
    """An edge keeps its number from the brick that brings it on."""
    small, large = engine25.network.graph(10), engine25.network.graph(11)
    assert set(small.edges) < set(large.edges)
    for a, b, number in small.edges(data="number"):
        assert large.edges[a, b]["number"] == number


@given(scene=arches())
def test_chains(scene):
    net = build_network(scene)
    total = len(scene.bricks)
    for bricks in range(1, total + 1):
        closed = bricks == total and len(scene.grounds) == 2
        open_end = bricks < total or closed
        assert net.count_edges(bricks) == 3 * bricks + int(open_end) + int(closed)
        graph = net.graph(bricks)
        assert graph.number_of_edges() == net.count_edges(bricks)
        assert graph.number_of_nodes() == net.count_nodes(bricks)


def test_a_wall_has_loops():
    net = build_network(running_bond(4, 3))
    graph = net.graph(12)
    assert graph.number_of_edges() == net.count_edges(12)
    assert len(nx.cycle_basis(graph)) > 0
    assert (np.bincount(net.edge_kind) > 0).all()
    assert net.node_kind[net.inner].max() == PartKind.INNER
