"""Orders in which everything touches the ground or what stands."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from seqopt.scene.library.common import _touching_order


@given(
    count=st.integers(1, 12),
    links=st.lists(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=30),
    rank=st.lists(st.integers(0, 5), min_size=12, max_size=12),
)
def test_each_touches_what_stands(count, links, rank):
    pairs = [(a, b) for a, b in links if a < count and b < count and a != b]
    order = _touching_order(rank[:count], pairs, [0])
    reached, before = {0}, set()
    while reached != before:
        before = set(reached)
        reached |= {b for pair in pairs for a, b in (pair, pair[::-1]) if a in reached}
    assert sorted(order) == sorted(reached)
    for k, i in enumerate(order):
        assert i == 0 or any({i, j} in ({a, b} for a, b in pairs) for j in order[:k])
