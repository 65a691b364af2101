r"""Decision by decision, with the responses of its candidates alone (equation 1 of Bruun et al.).

At a state with several successors each of them is followed through the steps that are then forced.
What these cost together decides:

.. math:: o_k = \arg\min_i \; \sum_{t \in W_k} c_t(i \mid o_{k-1})

over the steps :math:`W_k` up to the next decision. Nothing else is computed, and nothing proven.
"""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import NothingFoundError, TimeUpError
from seqopt.graph.formulation import Solution, Watch
from seqopt.graph.states.states import States
from seqopt.work._workers import keep


def walk(problem: States, watch: Watch) -> Solution:
    """Return the plan of a search of one decision after the other; its value is not claimed.

    Raises `NothingFoundError` if no candidate is left after the choices before it, while others may
    have led on; `TimeUpError` if time is over; `KeyboardInterrupt`, with the number of steps that
    are decided as its text.
    """
    space, resources = problem.space, problem.resources
    path, state = list[tuple[int, ...]](), space.start()
    try:
        with keep(resources.executor, resources.workers):
            while len(path) < space.levels:
                if watch.over:
                    raise TimeUpError(f"{watch.seconds:.3g} s: {_so_far(problem, path)}; give more")
                costs, trail = _branches(problem, len(path), state)
                if not np.isfinite(costs).any():
                    raise NothingFoundError(
                        f"step {len(path) + 1}: no grip is allowed after the choices before it; "
                        "relax a limit, or let a formulation look at all choices"
                    )
                best = int(np.argmin(costs))
                path += [(len(path) + k, *rows[best].tolist()) for k, rows in enumerate(trail, 1)]
                state = trail[-1][best : best + 1]
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(_so_far(problem, path)) from stop
    return Solution(tuple(path), (np.nan,) * len(problem.goals), (-np.inf,) * len(problem.goals))


def _branches(problem: States, level: int, state: Ints) -> tuple[Floats, list[Ints]]:
    """Return the costs (k,) of a state's successors up to the next decision, and all their states.

    ``state`` (1, c); of every level passed the states (k, c).
    """
    costs, trail = np.zeros(1), list[Ints]()
    while level < problem.space.levels and len(costs):
        ((moves, _),) = problem.space.onward(level, trail[-1] if trail else state)
        if trail and (np.bincount(moves.source) > 1).any():
            break
        level += 1
        trail = [*(rows[moves.source] for rows in trail), moves.states]
        own = problem.candidates.of_branches(level, moves.states)
        costs = costs[moves.source] + own
    return costs, trail


def _so_far(problem: States, path: list[tuple[int, ...]]) -> str:
    """Return how far a build is decided, in words."""
    if not path:
        return "no grip was chosen yet"
    return f"the grips of {len(path)} of {problem.space.levels} steps were chosen"
