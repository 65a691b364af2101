"""Costs and budgets as arrays; paths."""

from dataclasses import dataclass, replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from experiments.harness.layers import LayeredCosts
from formulations._search import exact_best
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError
from seqopt.graph import Explorer, Graph, lexicographic
from seqopt.graph._budgets import Plane, Polyhedron, highest_bound, is_beyond, within_budgets
from seqopt.graph.graph import _sum_bound, distances, lexicographic_bounds, reached
from seqopt.graph.space import Moves, Space
from seqopt.judge.arithmetic import budget_bounds
from tests.layered import Costs
from tests.random_graphs import graphs, simple_paths, values_of

INF = np.inf


def three_moves():
    """Costs of which every sum of three single and three shared ones is another number."""
    single = (np.array([1.0, 2.0]), np.array([10.0, 20.0, 40.0]), np.array([100.0, 200.0]))
    shared = (
        np.array([[1e3, 2e3]]),
        np.array([[1e4, 2e4, 3e4], [4e4, 5e4, 6e4]]),
        np.array([[1e5, 2e5], [3e5, 4e5], [5e5, 6e5]]),
    )
    return LayeredCosts(single, shared)


def changed(part, move, value):
    """The costs of three moves with those of a move replaced."""
    costs = three_moves()
    arrays = list(getattr(costs, part))
    arrays[move] = value
    return replace(costs, **{part: tuple(arrays)})


def test_a_choice_meets_its_own_costs_and_those_it_shares_with_the_one_before():
    costs = three_moves()
    assert costs.sizes == (2, 3, 2)
    assert costs.parts((1, 2, 0)) == [2.0, 2e3, 40.0, 6e4, 100.0, 5e5]
    assert costs.cost((1, 2, 0)) == 562142.0
    assert costs.worst((1, 2, 0)) == 5e5
    assert costs.worst((0, 0, 1)) == 2e5
    with pytest.raises(ValueError, match="zip"):
        costs.parts((1, 2))


def test_costs_are_copies_that_cannot_be_written_to():
    given_array = np.array([1.0, 2.0])
    costs = LayeredCosts((given_array,), (np.zeros((1, 2)),))
    given_array[0] = 9.0
    assert costs.single[0][0] == 1
    for array in (*costs.single, *costs.shared):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 1


@pytest.mark.parametrize(
    ("part", "move", "value", "named"),
    [
        ("single", 0, [INF, INF], "move 1: none of its 2 candidates"),
        ("shared", 1, np.full((2, 3), INF), "move 2: none of its 3 candidates"),
        ("single", 2, [INF, INF], "move 3: none of its 2 candidates"),
    ],
)
def test_the_move_that_ends_every_choice_is_named(part, move, value, named):
    with pytest.raises(InfeasibleError, match=named):
        Costs(changed(part, move, np.array(value))).compiled()


def test_a_move_without_candidates_is_named():
    with pytest.raises(ProblemError, match="move 1 has no candidates"):
        changed("single", 0, np.zeros(0))


# paths, bounds, multipliers and visits of an explorer against brute force and other solvers


few = settings(max_examples=25)


@given(graph=graphs())
@few
def test_the_best_path_and_its_bounds_equal_brute_force(graph):
    found = sorted(values_of(graph, moves) for moves in simple_paths(graph))
    if not found:
        assert lexicographic_bounds(graph, (0.0, 0.0))[0] == np.inf
        with pytest.raises(InfeasibleError):
            lexicographic(graph)
        return
    best = lexicographic(graph)
    assert best.values == pytest.approx(found[0])
    assert lexicographic_bounds(graph, best.values) == pytest.approx(found[0])
    fewest = min(len(m) for m in simple_paths(graph) if values_of(graph, m) == best.values)
    assert len(best.path) == fewest


@given(graph=graphs(goals=1))
@few
def test_distances_are_those_of_networkx(graph):
    outside = nx.DiGraph()
    outside.add_nodes_from(range(graph.states))
    moves = zip(graph.source.tolist(), graph.target.tolist(), graph.amounts[:, 0], strict=True)
    for source, target, cost in moves:  # of moves side by side the least counts
        known = outside.get_edge_data(source, target, {"weight": np.inf})["weight"]
        outside.add_edge(source, target, weight=min(known, cost))
    lengths = nx.single_source_dijkstra_path_length(outside, 0)
    expected = [lengths.get(state, np.inf) for state in range(graph.states)]
    assert distances(graph, graph.amounts[:, 0]).tolist() == expected
    assert reached(graph).tolist() == [np.isfinite(length) for length in expected]


def line():
    """Two ways to the end: one takes 3, one 2 and 2."""
    source, target = np.array([0, 0, 1]), np.array([2, 1, 2])
    amounts = np.array([[3.0], [2.0], [2.0]])
    return Graph(source, target, amounts, (False,), np.array([False, False, True]))


def test_potentials_that_a_move_violates_prove_nothing():
    graph = line()
    costs = graph.amounts[:, 0]
    right = distances(graph, costs)
    assert _sum_bound(graph, costs, right) == 3.0
    wrong = right.copy()
    wrong[2] = 3.5  # more than the move from the start takes
    assert _sum_bound(graph, costs, wrong) == -np.inf
    assert _sum_bound(graph, costs, right + 1) == -np.inf  # the start has a potential of its own


def test_amounts_that_pay_without_end_are_refused():
    with pytest.raises(ProblemError, match="to repeat it would pay without end"):
        replace(line(), amounts=-line().amounts)
    with pytest.raises(ProblemError, match="an amount is no number"):
        replace(line(), amounts=np.full((3, 1), np.nan))
    replace(line(), amounts=-line().amounts, peaks=(True,))  # the largest of them is -3 or -2


@dataclass(frozen=True)
class Ladder(Space):
    """Places 0 to 3 on every level, with values from a table; steps sideways and straight on."""

    table: np.ndarray
    peaks: tuple[bool, ...] = (True, False)
    floors: bool = False
    first = 0

    @property
    def levels(self):
        return len(self.table) - 1

    def start(self):
        return 0, np.zeros((1, 1), dtype=np.int64)

    def codes(self, part, states):
        return states[:, 0]

    def within(self, part, states):
        beside = states + np.array([[-1, 1]])
        row, step = np.nonzero((beside >= 0) & (beside < 4))
        after = beside[row, step][:, None]
        return Moves(row, after, np.zeros((len(row), 0)))

    def onward(self, part, states):
        yield part + 1, Moves(np.arange(len(states)), states, np.zeros((len(states), 0)))

    def values(self, part, states, *, rough, most):
        values = self.table[part, states[:, 0]] * (1 + 1e-7 * rough)
        if self.floors:  # no more is said of what is above than that it is
            values = np.where(values > most, np.minimum(values, max(most + 0.25, 0.1)), values)
        return np.column_stack([values, np.zeros(len(states))]), np.isfinite(values)

    def amounts(self, values, taken):
        return np.column_stack([values[:, 0], np.ones(len(values))])

    def ended(self, part, states):
        return np.ones(len(states), dtype=bool)


tables = st.lists(
    st.lists(st.sampled_from([1.0, 2.0, 3.0, np.inf]), min_size=4, max_size=4),
    min_size=2,
    max_size=5,
)


@given(
    table=tables,
    thresholds=st.lists(st.sampled_from([0.5, 1.0, 2.0]), max_size=3),
    floors=st.booleans(),
)
@few
def test_an_explorer_that_rises_visits_what_one_that_starts_high_does(table, thresholds, floors):
    """And nothing above its threshold, and values close to the best are exact in the end."""
    space = Ladder(np.array(table))
    slow, fast = Explorer(replace(space, floors=floors)), Explorer(space)
    for threshold in [*thresholds, 2.0]:
        slow.rise(threshold)
    assert fast.rise(2.0) == slow.whole == fast.whole
    assert slow.excluded <= fast.excluded if floors else slow.excluded == fast.excluded
    assert slow.excluded > 2
    (first, states), (second, others) = slow.graph(), fast.graph()
    assert first == second
    for (level, part, rows), other in zip(states, others, strict=True):
        assert level == part == other[0]
        assert rows.tolist() == other[2].tolist()
        assert not level or (space.table[level, rows[:, 0]] <= 2).all()
    rows = fast.way()
    assert (rows is not None) == fast.whole
    if slow.whole:
        way, path = exact_best(fast, among=rows)
        assert len(path.path) < sum(map(len, rows.values()))
        assert path.values[0] == max(space.table[level, s[0]] for level, _, s in way.of(path.path))
        assert lexicographic(first).values[0] <= path.values[0] * (1 + 1e-6) <= 2.1
        best = lexicographic(first)
        while slow.refine(best.values):
            best = lexicographic(slow.graph().graph)
        assert best.values[0] in (1.0, 2.0)
        kept = np.array(table)
        low = Explorer(Ladder(np.where(kept < best.values[0], kept, np.inf)))
        assert not low.rise()  # below its worst value nothing connects both ends


def test_what_is_closed_is_not_passed():
    space = Ladder(np.array([[1.0] * 4, [1, 1, 3, 3], [1, 1, 1, 1]]))
    found = Explorer(space)
    assert found.rise(1.0)
    assert len(lexicographic(found.graph().graph).path) == 2
    assert [*map(len, found.way().values())] == [1, 1, 1]
    found.close((1, 1), np.array([[0]]))
    assert found.way() is None
    with pytest.raises(InfeasibleError):
        lexicographic(found.graph().graph)


def test_a_narrow_visit_keeps_the_best():
    space = Ladder(np.array([[1.0] * 4, [3, 1, 2, 2], [1, 1, 1, 1]]))
    narrow = Explorer(space, width=1)
    assert narrow.rise()
    assert len(narrow.graph().states[1][2]) == 4  # one of every round


@given(graph=graphs(goals=3), cap=st.integers(0, 6))
@few
def test_a_path_within_a_budget_is_found_and_bounded(graph, cap):
    graph = replace(graph, peaks=(*graph.peaks[:2], False))
    values = sorted(values_of(graph, moves) for moves in simple_paths(graph))
    able = [each for each in values if each[2] <= cap]
    if not able:
        with pytest.raises(InfeasibleError, match="no path is within all budgets"):
            within_budgets(graph, (cap,))
        return
    found = within_budgets(graph, (cap,))
    assert found.values[2] <= cap
    assert found.values in able
    assert found.values[:2] >= able[0][:2]
    assert found.bounds[0] <= able[0][0] * (1 + 1e-9)
    if graph.peaks[0]:
        assert found.values[0] == found.bounds[0] == able[0][0]
    proven = budget_bounds(graph, found.values, found.bounds, ((cap,), found.prices))
    assert proven[0] >= found.bounds[0] - 1e-6 * abs(found.bounds[0])


@given(graph=graphs(goals=3), caps=st.tuples(st.integers(0, 6), st.integers(0, 6)))
@few
def test_whether_a_path_is_within_two_budgets_is_decided(graph, caps):
    """Mixtures of paths may be where no path is; the judge believes neither."""
    graph = replace(graph, peaks=(graph.peaks[0], False, False))
    able = [
        values
        for values in (values_of(graph, moves) for moves in simple_paths(graph))
        if values[1] <= caps[0] and values[2] <= caps[1]
    ]
    if not able:
        with pytest.raises(InfeasibleError, match="no path is within all budgets"):
            within_budgets(graph, caps)
        return
    assert not is_beyond(graph, caps)
    found = within_budgets(graph, caps)
    assert all(value <= cap for value, cap in zip(found.values[1:], caps, strict=True))
    assert found.bounds[0] <= min(able)[0] * (1 + 1e-9) + 1e-12


def test_where_labels_are_too_many_it_is_open(monkeypatch):
    """Four ways, none within two budgets, the mean of two within both."""
    rows = ([0, 0, 1, 1, 2, 2], [1, 2, 3, 3, 3, 3])
    taken = [[0, 2], [2, 0], [0, 2], [4, 0], [0, 4], [2, 0]]
    amounts = np.column_stack([np.ones(6), taken])
    source, target = (np.array(row, dtype=np.int32) for row in rows)
    graph = Graph(source, target, amounts, (True, False, False), np.arange(4) == 3)
    assert not is_beyond(graph, (3.0, 3.0))
    assert is_beyond(graph, (1.9, 1.9))  # no mixture is either
    with pytest.raises(InfeasibleError):
        within_budgets(graph, (3.0, 3.0))
    monkeypatch.setattr("seqopt.graph._budgets.LABELS", 0)
    with pytest.raises(NothingFoundError, match="mixtures of plans are within all budgets"):
        within_budgets(graph, (3.0, 3.0))
    with pytest.raises(InfeasibleError):
        within_budgets(graph, (1.9, 1.9))


BUDGETS, WEIGHTS, SHARES = range(3)


def drawn(rng, kind):
    """The planes of a dozen paths, and the multipliers that may be chosen."""
    size = int(rng.integers(1, 5))
    slopes = rng.uniform(0.0, 10.0 ** rng.integers(-3, 4), (12, size))
    if kind == BUDGETS:
        caps = np.quantile(slopes, 0.5, axis=0)
        scale = 10.0 ** rng.integers(-3, 4)
        return rng.uniform(0.0, scale, 12), slopes - caps, Polyhedron(1e6, units=caps)
    counts = np.ones(size) if kind == WEIGHTS else rng.integers(1, 4, size).astype(float)
    most = max(1.0 / size, 0.6) if kind == WEIGHTS else np.inf
    return np.zeros(12), slopes, Polyhedron(most, counts=counts)


def at_once(constants, slopes, polyhedron):
    """The highest point below all planes."""
    size, scale = slopes.shape[1], np.abs(slopes).max()
    sums = polyhedron.counts is not None
    found = linprog(
        [*[0.0] * size, -1.0],
        A_ub=np.column_stack([-slopes / scale, np.ones(len(slopes))]),
        b_ub=constants,
        A_eq=[[*polyhedron.counts, 0.0]] if sums else None,
        b_eq=[1.0] if sums else None,
        bounds=[*[(0.0, polyhedron.most if sums else None)] * size, (None, None)],
    )
    return -found.fun * (scale if sums else 1.0)


@pytest.mark.parametrize("kind", [BUDGETS, WEIGHTS, SHARES])
@pytest.mark.parametrize("seed", range(4))
def test_the_highest_bound_is_that_of_one_program(kind, seed):
    constants, slopes, polyhedron = drawn(np.random.default_rng(seed), kind)

    def oracle(multipliers):
        heights = constants + slopes @ multipliers
        least = int(np.argmin(heights))
        return Plane(constants[least], slopes[least], heights[least])

    size = slopes.shape[1]
    counts = np.ones(size) if polyhedron.counts is None else polyhedron.counts
    start = np.zeros(size) if kind == BUDGETS else 1 / counts / size
    found = highest_bound(oracle, start, polyhedron, lambda _: False, rounds=100, closed=1e-9)
    assert found.bound == oracle(found.multipliers).bound  # it is proven, whatever it is
    assert found.bound == pytest.approx(at_once(constants, slopes, polyhedron), rel=1e-6)
    first = highest_bound(oracle, start, polyhedron, lambda _: True, rounds=100, closed=1e-9)
    assert first.bound == oracle(start).bound <= found.bound  # stopped after one plane


def test_no_path_is_no_bound_on_any():
    polyhedron = Polyhedron(1e6, units=np.ones(2))
    found = highest_bound(
        lambda _: None, np.zeros(2), polyhedron, lambda _: False, rounds=9, closed=0
    )
    assert found.bound == np.inf
