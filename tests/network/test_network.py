"""The double-cross network: counts, numbers, presence."""

from collections import Counter
from dataclasses import replace
from unittest.mock import patch

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import integers

from seqopt.network import network as networks
from seqopt.network.network import PartKind, build_network
from seqopt.scene.scene_file import load_scene
from tests.builders import running_bond
from tests.strategies import arches, walls


def test_edge_counts_of_the_study(engine25):
    """T_pct of Tables A.1 and A.2 counts 3n + 1 edges for n < 25 bricks and 77 for 25."""
    net = engine25.network
    assert [net.count_edges(n) for n in range(1, 25)] == [3 * n + 1 for n in range(1, 25)]
    assert net.count_edges(25) == 77


def graph_of(net, bricks):
    """Return a partial structure as a graph of its nodes, by index; the arrays agree with it."""
    graph = nx.Graph(net.edge_nodes[: net.count_edges(bricks)].tolist())
    assert {*graph} == {*range(net.count_nodes(bricks))}
    names = dict(enumerate(net.node_name))
    assert nx.utils.graphs_equal(
        nx.relabel_nodes(graph, names), nx.Graph(net.partial(bricks).edges)
    )
    return graph


@pytest.mark.parametrize("count", [6, 9, 30])
def test_the_graph_of_a_chain_has_closed_counts(count):
    graph = build_network(load_scene(f"chain:bricks={count}")).graph
    nodes, edges = (
        Counter(kind for *_, kind in part.data("kind")) for part in (graph.nodes, graph.edges)
    )
    inner, joint, base = PartKind
    assert nodes == {inner: 2 * count, joint: count + 1, base: 2}
    assert edges == {inner: count, joint: 2 * count, base: 2}
    assert {s for _, s in graph.nodes.data("spring")} == {-1, *range(count + 1)}
    with pytest.raises(nx.NetworkXError, match="Frozen graph"):
        graph.add_edge(0, 1)


@given(scene=walls() | arches(), seed=integers(0, 99))
def test_no_array_depends_on_the_order_in_which_a_graph_is_made(scene, seed):
    rng, made = np.random.default_rng(seed), networks._double_cross

    def shuffled(*given):
        graph, out = made(*given), nx.DiGraph()
        for add, parts in ((out.add_node, graph.nodes), (out.add_edge, graph.edges)):
            listed = list(parts.data())
            for i in rng.permutation(len(listed)):
                *names, data = listed[i]
                add(*names, **{key: data[key] for key in rng.permutation([*data])})
        return out

    with patch.object(networks, "_double_cross", shuffled):
        other = build_network(scene)
    assert other == build_network(scene)


def test_parts_of_a_partial_structure_come_first(engine25, arch25):
    net = engine25.network
    for bricks in (1, 7, 25):
        assert nx.is_connected(graph_of(net, bricks))
        kinds = net.node_kind[: net.count_nodes(bricks)]
        inner = {net.node_name[i]: i for i in np.flatnonzero(kinds == PartKind.INNER)}
        assert sorted(inner) == list(range(2 * bricks))  # node 0 exists but is never gripped
        for name, i in inner.items():
            assert net.node_position[i] == pytest.approx(arch25.node_position(name))


@given(scene=arches())
def test_chains(scene):
    net = build_network(scene)
    total = len(scene.bricks)
    for bricks in range(1, total + 1):
        closed = bricks == total and len(scene.grounds) == 2
        open_end = bricks < total or closed
        assert net.count_edges(bricks) == 3 * bricks + int(open_end) + int(closed)
        assert graph_of(net, bricks).number_of_edges() == net.count_edges(bricks)


def test_a_wall_has_loops():
    net = build_network(running_bond(4, 3))
    graph = graph_of(net, 12)
    assert graph.number_of_edges() == net.count_edges(12)
    assert len(nx.cycle_basis(graph)) > 0
    assert (np.bincount(net.edge_kind) > 0).all()
    assert net.node_kind[net.inner].max() == PartKind.INNER


def test_a_grips_compliance_is_one_value(arch25):
    """Of rigid hands zero, of soft ones what their stiffness says; one kind for all that agree."""
    rigid, soft = (build_network(s).compliances for s in (arch25, arch25.with_grips(1e6)))
    assert not rigid.compliance.any()
    assert soft.compliance[0, :3, :3] == pytest.approx(1e-6 * np.eye(3))
    first, *others = arch25.robots
    mixed = arch25.with_robots(replace(first, stiffness=1e5, rotational_stiffness=1e4), *others)
    found = build_network(mixed).compliances
    assert found.transmits_moment.tolist() == [True, False]
    assert found.compliance[0].diagonal() == pytest.approx([1e-5] * 3 + [1e-4] * 3)
    assert not found.compliance[1].any()
    kinds = np.array([[0, 1, 0]])
    assert (found.at(np.array([[3, 5, 7]]), kinds) == kinds).all()
