"""Small graphs with whole amounts, and every path of them."""

import numpy as np
from hypothesis import strategies as st

from seqopt.graph import Graph


@st.composite
def graphs(draw, goals=2):
    """A graph of up to six states, some moves of it side by side, with small whole amounts."""
    states = draw(st.integers(2, 6))
    move = st.tuples(st.integers(0, states - 1), st.integers(1, states - 1))
    moves = draw(st.lists(move, min_size=1, max_size=14))
    amount = st.tuples(*[st.integers(0, 3)] * goals)
    amounts = draw(st.lists(amount, min_size=len(moves), max_size=len(moves)))
    peaks = tuple(draw(st.lists(st.booleans(), min_size=goals, max_size=goals)))
    ends = np.zeros(states, dtype=bool)
    ends[draw(st.lists(st.integers(1, states - 1), min_size=1, max_size=2))] = True
    source, target = np.array(moves, dtype=np.int32).T
    return Graph(source, target, np.array(amounts, dtype=float), peaks, ends)


def simple_paths(graph):
    """Every path that meets no state twice, as the places of its moves."""
    work = [((0,), ())]
    while work:
        states, moves = work.pop()
        if graph.ends[states[-1]]:
            yield moves
        for move in np.flatnonzero(graph.source == states[-1]).tolist():
            if graph.target[move] not in states:
                work.append(((*states, int(graph.target[move])), (*moves, move)))


def values_of(graph, moves):
    columns = graph.amounts[list(moves)]
    joined = zip(graph.peaks, columns.T, strict=True)
    return tuple(float(c.max(initial=0.0) if peak else c.sum()) for peak, c in joined)
