"""Costs of steps joined into costs of moves: added up, or the largest taken."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Floats
from seqopt.graph.layers.costs import LayeredCosts


class Joined:
    """The costs of all choices, steps of the same moves joined as they come.

    ``sizes``: how many candidates every move has; ``join``: ``numpy.add`` or ``numpy.maximum``.
    """

    def __init__(self, sizes: Sequence[int], join: np.ufunc) -> None:
        self._sizes, self._join = tuple(sizes), join
        self._found: dict[tuple[int, ...], Floats] = {}
        self._least = np.inf

    def add(self, moves: tuple[int, ...], costs: Floats) -> None:
        """Join the costs of a step.

        ``moves``: open in it: one, or two neighboring ones; ``costs`` ((C,) or (C, D) float).
        """
        finite = costs[np.isfinite(costs)]
        self._least = min(self._least, float(finite.min(initial=np.inf)))
        before = self._found.get(moves)
        if before is None:
            before = np.zeros(1) if self._join is np.add else costs
        self._found[moves] = self._join(before, costs)

    def singles(self) -> tuple[Floats, ...]:
        """Return the costs of each move's candidates where it alone is open.

        Result (tuple of (C_k,) float): `least` where it never is.
        """
        return tuple(self.single(k) for k in range(len(self._sizes)))

    def single(self, move: int) -> Floats:
        """Return the costs of a move's candidates where it alone is open.

        Result (C_k,).
        """
        return self._of((move,), (self._sizes[move],))

    def layered(self) -> LayeredCosts:
        """Return the costs of single choices and of pairs.

        Result: pairs of moves that share no step take no memory.
        """
        pairs = zip([1, *self._sizes[:-1]], self._sizes, strict=True)
        shared = tuple(self._of((k - 1, k), pair) for k, pair in enumerate(pairs))
        return LayeredCosts(self.singles(), shared)

    @property
    def least(self) -> float:
        """What counts where no step is open: nothing, or no more than any cost."""
        if self._join is np.add or np.isinf(self._least):
            return 0.0
        return self._least

    def _of(self, moves: tuple[int, ...], shape: tuple[int, ...]) -> Floats:
        found = self._found.get(moves)
        return np.broadcast_to(self.least, shape) if found is None else found
