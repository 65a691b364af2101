"""Several aims in order of importance (lexicographic), solved exactly.

The choices that are best for the first aim are a part of the same layered graph: those pairs that
lie on a best path. Among these the second aim is minimized, and so on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats
from seqopt.errors import ProblemError
from seqopt.graph.layers.costs import TINY, LayeredCosts
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.layers.objectives import TIED, on_a_least_path
from seqopt.problem.aims import Aim


@dataclass(frozen=True)
class InOrder:
    """The best choice for several aims in order of importance.

    ``choice``: a candidate for every move; ``values``: its value for every aim.
    """

    choice: tuple[int, ...]
    values: tuple[float, ...]


def solve_in_order(goals: Sequence[tuple[PlacementProblem, Aim]]) -> InOrder:
    """Return the choice that is best for the first aim; among these best for the second; and so on.

    Exact, sums that differ by less than `seqopt.graph.layers.objectives.TIED` counting as equal.

    ``goals`` (sequence of (PlacementProblem, Aim)): problems of the same moves, each under its own
    criterion, and whether its sum or its peak is to minimize; the most important first. Raises
    `InfeasibleError` if no choice is allowed by all problems; `ProblemError` if there is no goal,
    problems have other moves or candidates, or one has budgets.

    Examples
    --------
    >>> from seqopt.graph.layers.interface import CostProblem
    >>> nothing = np.zeros((1, 2))
    >>> first, second = (
    ...     CostProblem(LayeredCosts((np.array(costs),), (np.zeros((1, 3)),)))
    ...     for costs in ([2.0, 1.0, 1.0], [0.0, 5.0, 4.0])
    ... )
    >>> solve_in_order([(first, Aim.PEAK), (second, Aim.SUM)])
    InOrder(choice=(2,), values=(1.0, 4.0))
    """
    layers = [aim.costs(problem) for problem, aim in goals]
    _require_same(goals, layers)
    masks = _allowed(layers)
    for costs, (_, aim) in zip(layers, goals, strict=True):
        masks = (_least_sums if aim is Aim.SUM else _least_peaks)(costs, masks)
    choice: list[int] = []
    for mask in masks:  # pairs without a way on are left out of every mask
        choice.append(int(np.argmax(mask[choice[-1] if choice else 0])))
    values = tuple(aim.worth(costs, choice) for costs, (_, aim) in zip(layers, goals, strict=True))
    return InOrder(tuple(choice), values)


def _require_same(
    goals: Sequence[tuple[PlacementProblem, Aim]], layers: Sequence[LayeredCosts]
) -> None:
    if not layers:
        raise ProblemError("there is no aim; give at least one")
    if any(problem.budgets for problem, _ in goals):
        raise ProblemError("aims in their order take no budgets; leave them out")
    if len({costs.sizes for costs in layers}) > 1:
        raise ProblemError(
            "the problems have other moves or candidates; pose them with one schedule"
        )


def _allowed(layers: Sequence[LayeredCosts]) -> list[Bools]:
    """Return the pairs that all problems allow and that lie on a path from first to last move."""
    pairs = [(np.isfinite(a + b).astype(float)) for a, b in _parts(layers[0])]
    for costs in layers[1:]:
        pairs = [p * np.isfinite(a + b) for p, (a, b) in zip(pairs, _parts(costs), strict=True)]
    shut = [np.where(pair > 0, 0.0, np.inf) for pair in pairs]
    LayeredCosts(tuple(np.zeros(len(s)) for s in layers[0].single), tuple(shut)).continuable()
    return on_a_least_path(shut, _ways(shut), 0.0)


def _parts(costs: LayeredCosts) -> list[tuple[Floats, Floats]]:
    return [*zip(costs.shared, costs.single, strict=True)]


def _ways(arcs: Sequence[Floats]) -> list[Floats]:
    """Return the least cost up to every candidate of the move before, move by move."""
    reached, ways = np.zeros(1), []
    for arc in arcs:
        ways.append(reached)
        reached = (reached[:, None] + arc).min(axis=0)
    return ways


def _least_sums(costs: LayeredCosts, masks: Sequence[Bools]) -> list[Bools]:
    """Return the pairs of a mask that lie on a path of least sum."""
    parts = zip(masks, _parts(costs), strict=True)
    arcs = [np.where(mask, a + b, np.inf) for mask, (a, b) in parts]
    ways = _ways(arcs)
    least = float((ways[-1][:, None] + arcs[-1]).min())
    size = sum(float(np.abs(arc[mask]).max()) for arc, mask in zip(arcs, masks, strict=True))
    return on_a_least_path(arcs, ways, least + TIED * max(abs(least), TINY, 1e-6 * size))


def _least_peaks(costs: LayeredCosts, masks: Sequence[Bools]) -> list[Bools]:
    """Return the pairs of a mask that lie on a path of least peak."""
    parts = zip(masks, _parts(costs), strict=True)
    arcs = [np.where(mask, np.maximum(a, b), np.inf) for mask, (a, b) in parts]
    reached = np.full(1, -np.inf)
    for arc in arcs:
        reached = np.maximum(reached[:, None], arc).min(axis=0)
    shut = [np.where(arc <= reached.min(), 0.0, np.inf) for arc in arcs]
    return on_a_least_path(shut, _ways(shut), 0.0)
