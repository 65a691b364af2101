"""A path all of whose states pass, where it is dear to ask whether one does.

Only states on a path are asked, that on which the fewest are not known (Dellin and Srinivasa, A
unifying formalism for shortest path problems with expensive edge evaluations, 2016). Where a part
of the graph turned paths down before, it is asked first, and more of it each time: what is left
without a path there is a cut.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.graph.graph import Graph
from seqopt.graph.paths import distances

PASSES, FAILS = 1, -1
OPEN = 2.0  # moves that a path may be longer for a state less to be asked
MOST = 64  # states of a part that are asked at once
Ask = Callable[[int, Ints], Ints]
"""Returns of states (n,) of a part, given by its number, which pass: 1, -1, or 0: not known."""


def lazy_path(
    graph: Graph,
    parts: Ints,
    known: Ints,
    ask: Ask,
    recall: Ask,
    tell: Callable[[], object] = lambda: None,
) -> tuple[int, ...] | None:
    """Return a path of states that pass, the start left out; None if there is none.

    ``parts`` (n,): of every state, from 0; those of one are asked together; ``known`` (n,): 1 where
    a state passes, -1 where it does not, else 0; what is found is added; ``ask``: says which do,
    and what it does not know does not; ``recall``: what can be said without asking; ``tell``:
    called before every path.
    """
    failed = Counter[int]()
    while True:
        tell()
        path, after = _fewest_open(graph, known)
        open_ = path[known[path] == 0]
        if not len(path):
            return None
        if not len(open_):
            return tuple(path.tolist())
        for part in sorted(set(parts[open_].tolist()), key=lambda p: (-failed[p], p)):
            if not _all_pass(part, open_[parts[open_] == part], known, ask):
                failed[part] += 1
                others = np.flatnonzero((parts == part) & (known == 0))
                known[others] = recall(part, others)
                others = others[(known[others] == 0) & np.isfinite(after[others])]
                others = others[np.argsort(after[others], kind="stable")]
                _all_pass(part, others[: min(2 ** failed[part], MOST) // 2], known, ask)
                break


def _all_pass(part: int, rows: Ints, known: Ints, ask: Ask) -> bool:
    """Ask states of a part, and say whether all pass."""
    if len(rows):
        known[rows] = np.where(ask(part, rows) == PASSES, PASSES, FAILS)
    return bool((known[rows] == PASSES).all())


def _fewest_open(graph: Graph, known: Ints) -> tuple[Ints, Floats]:
    """Return the path on which the fewest states are open, of these one of the fewest moves.

    A state that is open counts as much as `OPEN` moves. Empty if there is none. Beside it, what is
    left from every state to an end, (n,).
    """
    part = graph.only((known[graph.target] != FAILS) & (known[graph.source] != FAILS))
    costs = np.where(known[part.target] == PASSES, 1.0, 1.0 + OPEN)
    after = distances(part, costs, back=True)
    if not np.isfinite(after[0]):
        return np.zeros(0, dtype=np.int64), after
    tight = after[part.target] + costs == after[part.source]  # whole numbers
    part, state, path = part.only(tight), 0, list[int]()
    while not graph.ends[state]:
        state = int(part.target[np.searchsorted(part.source, state)])
        path.append(state)
    return np.array(path, dtype=np.int64), after
