"""Costs of pairs in all scenarios at once, and what dynamic programming makes of them.

A choice is a path in a layered graph whose arcs have a cost in every scenario. With a weight for
each scenario an arc has one cost, and the cheapest path is found backward, move by move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.problem.aims import RobustAim

Choice = tuple[int, ...]
BETTER = 1e-12  # by which a value is better than another, over the size of both


@dataclass(frozen=True, eq=False, repr=False)
class ScenarioArcs(FrozenValue):
    """Costs of pairs in all scenarios.

    ``arcs`` (tuple of (S, C_{k-1}, C_k) float): what a pair and its later choice cost together;
    zero where they are not allowed; ``shut`` (tuple of (C_{k-1}, C_k) bool): which pairs are not
    allowed in some scenario.
    """

    aim: RobustAim
    arcs: tuple[Floats, ...]
    shut: tuple[Bools, ...]

    @property
    def scenarios(self) -> int:
        """How many there are."""
        return len(self.arcs[0])

    def totals(self, choice: Sequence[int]) -> Floats:
        """Return the total of a choice in every scenario.

        ``choice``: an allowed candidate for every move. Result (S,).
        """
        before = (0, *choice[:-1])
        parts = [arc[:, i, j] for arc, i, j in zip(self.arcs, before, choice, strict=True)]
        return np.asarray(np.sum(parts, axis=0))

    def to_go(self, weights: Floats) -> tuple[list[Floats], list[Floats]]:
        """Return weighted costs of pairs, and the least from every candidate to the last move.

        ``weights`` (S,). Results: ``costs`` (list of (C_{k-1}, C_k) float): infinite for pairs that
        are not allowed; ``to_go`` (list of (C_{k-1},) float): one more than there are moves: of the
        start, and after every move.
        """
        costs = [
            np.where(shut, np.inf, np.tensordot(weights, arc, 1))
            for arc, shut in zip(self.arcs, self.shut, strict=True)
        ]
        rest = [np.zeros(costs[-1].shape[1])]
        for cost in reversed(costs):
            rest.insert(0, (cost + rest[0]).min(axis=1))
        return costs, rest

    def cheapest(self, weights: Floats) -> tuple[Choice, float]:
        """Return the choice of least weighted total, and that total.

        ``weights`` (S,). Result (tuple of int, float).
        """
        costs, rest = self.to_go(weights)
        choice: list[int] = []
        for cost, after in zip(costs, rest[1:], strict=True):
            choice.append(int(np.argmin(cost[choice[-1] if choice else 0] + after)))
        return tuple(choice), float(rest[0][0])

    def improved(self, choice: Choice) -> tuple[Choice, float]:
        """Return what a choice becomes by changing the one move that helps most, again and again.

        ``choice``: an allowed one. Results: ``value``: what the aim makes of its totals.
        """
        totals = self.totals(choice)
        value = self.aim.value(totals)
        while True:
            found = [self._changed(choice, totals, k) for k in range(len(choice))]
            k = int(np.argmin([worth for _, worth in found]))
            candidate, worth = found[k]
            if not worth < value - BETTER * max(abs(value), abs(worth)):
                return choice, value
            choice = (*choice[:k], candidate, *choice[k + 1 :])
            totals = self.totals(choice)
            value = self.aim.value(totals)

    def _changed(self, choice: Choice, totals: Floats, k: int) -> tuple[int, float]:
        """Return the best candidate of one move, the others staying, and what it is worth."""
        before = choice[k - 1] if k else 0
        to, shut = self.arcs[k][:, before, :], self.shut[k][before]
        if k + 1 < len(choice):
            to = to + self.arcs[k + 1][:, :, choice[k + 1]]
            shut = shut | self.shut[k + 1][:, choice[k + 1]]
        worth = self.aim.each((totals[:, None] - to[:, [choice[k]]] + to).T)
        worth[shut] = np.inf
        best = int(np.argmin(worth))
        return best, float(worth[best])


def scenario_arcs(layers: Sequence[LayeredCosts], aim: RobustAim) -> ScenarioArcs:
    """Return the costs of pairs in all scenarios.

    ``layers``: one for every scenario, of the same moves.
    """
    arcs, shut = [], []
    for k in range(len(layers[0].single)):
        both = np.stack([each.single[k] + each.shared[k] for each in layers])
        closed = np.asarray(~np.isfinite(both).all(axis=0))
        arcs.append(np.where(closed, 0.0, both))
        shut.append(closed)
    return ScenarioArcs(aim, tuple(arcs), tuple(shut))
