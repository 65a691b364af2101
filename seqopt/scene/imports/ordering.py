"""An order of building for assemblies that have none: from the bottom up, each on what stands."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence

from seqopt.errors import SceneError


def upward_order(
    rank: Sequence[tuple[float, ...]],
    pairs: Iterable[tuple[int, int]],
    starts: Iterable[int],
    keys: Sequence[str],
) -> list[int]:
    """Return blocks in an order in which each touches the ground or what stands before it.

    Parameters
    ----------
    rank : sequence of tuple of float
        Of every block; of those that can be placed, the lowest is next.
    pairs : iterable of tuple of 2 int
        Which touch each other.
    starts : iterable of int
        Which touch the ground.
    keys : sequence of str
        What blocks are called, for the message.

    Raises
    ------
    SceneError
        If some touch nothing that leads to the ground.

    Examples
    --------
    >>> upward_order([(0,), (2,), (1,)], [(0, 2), (2, 1)], [0], "abc")
    [0, 2, 1]
    """
    beside = _beside(len(rank), pairs)
    ready = [(rank[i], i) for i in sorted(set(starts))]
    heapq.heapify(ready)
    seen, order = {i for _, i in ready}, list[int]()
    while ready:
        i = heapq.heappop(ready)[1]
        order.append(i)
        for j in beside[i] - seen:
            seen.add(j)
            heapq.heappush(ready, (rank[j], j))
    lost = [keys[i] for i in range(len(rank)) if i not in seen]
    if lost:
        raise SceneError(
            f"{len(lost)} blocks touch nothing that leads to the ground, the first of them "
            f"{', '.join(lost[:5])}; name supports, or allow a wider gap between faces"
        )
    return order


def _beside(count: int, pairs: Iterable[tuple[int, int]]) -> list[set[int]]:
    """Return what each of so many blocks touches."""
    out: list[set[int]] = [set() for _ in range(count)]
    for a, b in pairs:
        out[a].add(b)
        out[b].add(a)
    return out
