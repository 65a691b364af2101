r"""The cheapest path within caps on sums, by setting labels: exact, or a bound on what is left.

A label is a beginning of a path, with what it costs, :math:`C`, and what it takes of capped sums,
:math:`S`. Labels are continued by all moves from their states, move count by move count, and
dropped

- if another label of the same state costs no more and takes no more of any sum,
- if what it has taken and the least that the rest takes exceed a cap,
- if it cannot lead to less than the best path :math:`U` that is known: with multipliers
  :math:`\lambda` and :math:`V_\lambda(v)`, the least priced cost from :math:`v` to an end,

.. math::

   C + \lambda^T (S - B) + V_\lambda(v) \ge U .

First few labels are kept at a time, those with the least such bound; that gives a good :math:`U`.
Then more, until none is left out that could lead to less. If there are too many, or time is over,
the least bound of those left out bounds all paths.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph
from seqopt.graph.paths import TIED, distances, moves_out

NARROW, WIDER = 256, 16  # labels kept at first, and how many times as many then
AT_ONCE = 2_000_000  # moves that are looked at together
LOOK_BACK = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)  # earlier labels that one is compared with


class Labels(NamedTuple):
    """Beginnings of paths.

    ``state`` is the last one, ``priced`` what they cost with multipliers, ``cost`` without,
    ``taken`` (n, B) of capped sums; ``move`` their last one, ``back`` the label each came from.
    """

    state: Ints
    priced: Floats
    cost: Floats
    taken: Floats
    move: Ints
    back: Ints

    def of(self, rows: Ints | Bools | slice) -> Labels:
        """Return some of them."""
        return Labels._make(each[rows] for each in self)


class Ground(NamedTuple):
    """What labels are made of: costs (m,), capped sums (m, B), and the least of each to an end."""

    graph: Graph
    costs: Floats
    amounts: Floats
    caps: Floats
    prices: Floats
    priced: Floats  # (m,)
    rest: Floats  # (n,), priced
    least: Floats  # (n, B)


def ground(
    graph: Graph, costs: Floats, amounts: Floats, caps: Sequence[float], prices: Floats
) -> Ground:
    """Return what labels are made of; ``prices`` (B,) from 0 lead the search and prove bounds."""
    priced = costs + amounts @ prices
    least = [distances(graph, each, back=True) for each in amounts.T]
    rest = distances(graph, priced, back=True)
    most = np.asarray(caps, dtype=float)
    return Ground(graph, costs, amounts, most, prices, priced, rest, np.column_stack(least))


class LabelSearch(NamedTuple):
    """The moves of the best path that was met, none if there is none, and a bound on all paths."""

    moves: Ints | None
    cost: float
    bound: float


def cheapest_within(
    asked: Ground, best: LabelSearch, watch: Watch, most: int, *, any_path: bool = False
) -> LabelSearch:
    """Return the cheapest path within caps.

    ``best``: what is known before; ``most``: how many labels are kept at a time; ``any_path``:
    whether it ends with the first path that is found.
    """
    width = min(NARROW, most)
    while not watch.over and best.bound < best.cost:
        found, left = _pass(asked, best.cost, width, watch)
        if found is not None:
            cost = float(asked.costs[found].sum())
            if cost < best.cost:
                best = LabelSearch(found, cost, best.bound)
        best = best._replace(bound=max(best.bound, min(left, best.cost)))
        watch.tell(best.cost, best.bound)
        if width >= most or (any_path and best.moves is not None):
            break
        width = min(width * WIDER, most)
    return best


def _pass(asked: Ground, limit: float, width: int, watch: Watch) -> tuple[Ints | None, float]:
    """Return the best path that a number of labels leads to, and the least bound left out."""
    graph, none = asked.graph, np.zeros(1, dtype=np.int64)
    start = asked.rest[0] * 0.0 - float(asked.prices @ asked.caps)
    now = Labels(none, np.array([start]), np.zeros(1), np.zeros((1, len(asked.caps))), none, none)
    rounds, closed, left = [now], now.of(slice(0)), np.inf
    best: tuple[int, int] | None = None
    while len(now.state):
        if watch.over:
            return None, -np.inf
        closed = Labels._make(map(np.concatenate, zip(closed, now, strict=True)))
        now, out = _narrowed(asked, _extended(asked, now, limit), 4 * width)
        now, more = _narrowed(asked, _undominated(closed, now), width)
        left = min(left, out, more)
        rounds.append(now)
        ended = np.flatnonzero(graph.ends[now.state])
        if len(ended) and now.cost[ended].min() < limit:
            row = int(ended[np.argmin(now.cost[ended])])
            best, limit = (len(rounds) - 1, row), float(now.cost[row])
    return _moves_to(rounds, best), left


def _moves_to(rounds: Sequence[Labels], best: tuple[int, int] | None) -> Ints | None:
    """Return the moves that lead to a label, by which each continues another one."""
    if best is None:
        return None
    (count, row), out = best, list[int]()
    for labels in reversed(rounds[1 : count + 1]):
        out.append(int(labels.move[row]))
        row = int(labels.back[row])
    return np.array(out[::-1], dtype=np.int64)


def _extended(asked: Ground, now: Labels, limit: float) -> Labels:
    """Return labels with one more move that may lead to less than a limit, within the caps."""
    tight = limit - TIED * abs(limit) if np.isfinite(limit) else limit
    per = max(1, len(asked.graph.source) // asked.graph.states)
    size, parts = max(1, AT_ONCE // per), []
    for start in range(0, len(now.state), size):
        part = now.of(slice(start, start + size))
        row, move = moves_out(asked.graph, part.state)
        state = asked.graph.target[move].astype(np.int64)
        priced = part.priced[row] + asked.priced[move]
        keep = np.flatnonzero(priced + asked.rest[state] < tight)
        row, move, state, priced = row[keep], move[keep], state[keep], priced[keep]
        taken = part.taken[row] + asked.amounts[move]
        fits: Bools = np.asarray((taken + asked.least[state] <= asked.caps).all(axis=1))
        cost = part.cost[row] + asked.costs[move]
        parts.append(Labels(state, priced, cost, taken, move, row + start).of(fits))
    return Labels._make(map(np.concatenate, zip(*parts, strict=True)))


def _narrowed(asked: Ground, labels: Labels, width: int) -> tuple[Labels, float]:
    """Return the labels with the least bounds, and the least bound of the others."""
    if len(labels.state) <= width:
        return labels, np.inf
    bounds = labels.priced + asked.rest[labels.state]
    order = np.argpartition(bounds, width)
    return labels.of(np.sort(order[:width])), float(bounds[order[width]])


def _undominated(closed: Labels, new: Labels) -> Labels:
    """Return new labels without those that another one of the same state beats in everything.

    Not every such label is found; with one sum all are.
    """
    both = Labels._make(map(np.concatenate, zip(closed, new, strict=True)))
    is_new = np.arange(len(both.state)) >= len(closed.state)
    order = np.lexsort((is_new, *both.taken.T[::-1], both.cost, both.state))
    state, taken = both.state[order], both.taken[order]
    if taken.shape[1] == 1:
        beaten = _beaten(state, taken[:, 0])
    else:
        beaten = np.zeros(len(state), dtype=bool)
        for back in LOOK_BACK:
            same = state[back:] == state[:-back]
            beaten[back:] |= same & (taken[:-back] <= taken[back:]).all(axis=1)
    return both.of(np.sort(order[is_new[order] & ~beaten]))


def _beaten(state: Ints, taken: Floats) -> Bools:
    """Return where an earlier label of the same state takes no more of the one sum."""
    new = np.ones(len(state), dtype=bool)
    new[1:] = state[1:] != state[:-1]
    apart = (taken.max(initial=0.0) - taken.min(initial=0.0) + 1.0) * (np.cumsum(new) - 1)
    lowest = np.minimum.accumulate(taken - apart)  # every state lies below the one before
    out = np.zeros(len(state), dtype=bool)
    out[1:] = ~new[1:] & (taken[1:] - apart[1:] >= lowest[:-1])
    return out
