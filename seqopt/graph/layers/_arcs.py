"""Costs made of other costs, and the least sums of arcs, as searches and judges ask for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from seqopt.arrays import Floats
from seqopt.graph.layers.costs import Budget, LayeredCosts


def array_by_array(made: Callable[..., Floats], *costs: LayeredCosts | Budget) -> LayeredCosts:
    """Return the costs that a function makes of several, given the arrays of one place at once."""
    single = tuple(map(made, *(each.single for each in costs)))
    return LayeredCosts(single, tuple(map(made, *(each.shared for each in costs))))


def where_allowed(costs: LayeredCosts, amounts: LayeredCosts | Budget) -> LayeredCosts:
    """Return amounts of choices that are allowed by costs; the others are infinite."""

    def taken(cost: Floats, amount: Floats) -> Floats:
        return np.where(np.isfinite(cost), amount, np.inf)

    return array_by_array(taken, costs, amounts)


def least_to_go(arcs: Sequence[Floats]) -> list[Floats]:
    """Return the least sum of arcs to the end, from the source, (1,), and every candidate (C_k,).

    ``arcs`` (sequence of (C_{k-1}, C_k) float): as of `LayeredCosts.arcs`.
    """
    rest = [np.zeros(arcs[-1].shape[1])]
    for arc in reversed(arcs):
        rest.insert(0, (arc + rest[0]).min(axis=1))
    return rest


def least_path(arcs: Sequence[Floats], rest: Sequence[Floats]) -> tuple[int, ...]:
    """Return the choice whose arcs add up to least.

    ``rest``: as of `least_to_go`.
    """
    choice: list[int] = []
    for arc, ahead in zip(arcs, rest[1:], strict=True):
        choice.append(int(np.argmin(arc[choice[-1] if choice else 0] + ahead)))
    return tuple(choice)
