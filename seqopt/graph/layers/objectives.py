"""The two objectives of a criterion of ranks: over all pairs, and given the choice before.

A search that chooses one move after the other ranks a shared step among the candidates of the later
move, given the choice before. What it is charged for that step is a rank over all pairs. Both are
costs of pairs, so either has an exact optimum (``RankSum.ranked``). What such a search gives up has
therefore two parts: that it does not look ahead, and that it makes least something else than what
it is charged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from seqopt.arrays import Bools, Floats
from seqopt.graph.layers.costs import TINY, LayeredCosts
from seqopt.graph.layers.layers import Layers
from seqopt.problem.criteria import RankSum
from seqopt.problem.ranks import Ranked

TIED = 1e-9  # sums of ranks this close, relative to the least, are equal


@dataclass(frozen=True)
class GapParts:
    """The gap of a choice to the exact optimum, split in two parts.

    ``short_sight``: against an exact optimum of the conditional objective, both charged as the
    problem does: what is lost by not looking ahead. Negative where looking ahead would not have
    served. ``objective``: what that optimum itself gives up: the change of objective.
    """

    short_sight: float
    objective: float

    @property
    def gap(self) -> float:
        """Both parts."""
        return self.short_sight + self.objective


def under(problem: Layers, ranked: Ranked) -> Layers | None:
    """Return a problem with its ranks taken another way.

    ``problem``: whose responses are shared. Result: None if the criterion has no ranks, or
    responses are not kept that others would need.
    """
    if not isinstance(problem.criterion, RankSum):
        return None
    if problem.criterion.ranked is ranked:
        return problem
    if problem.evaluation.streams:
        return None
    criterion = replace(problem.criterion, ranked=ranked)
    return problem.others.setdefault(criterion, replace(problem, criterion=criterion))


def under_both(problem: Layers, choice: Sequence[int]) -> dict[str, float | None]:
    """Return the value of a choice under both objectives.

    ``choice``: a candidate for every move. Result (dict of str to (float or None)): ``pairs`` and
    ``conditional``; None if the criterion has no ranks.
    """
    found = {ranked.value: under(problem, ranked) for ranked in Ranked}
    return {name: None if p is None else p.sums.cost(choice) for name, p in found.items()}


def split_gap(problem: Layers, choice: Sequence[int]) -> GapParts | None:
    """Return the gap of a choice, in two parts.

    ``problem``: its sums are what choices are charged; ``choice``: a candidate for every move.
    Result: over the sum of the costs that the choice meets; None if the criterion has no ranks, or
    no choice is allowed.
    """
    conditional = under(problem, Ranked.CONDITIONAL)
    if conditional is None:
        return None
    charged = problem.sums
    there, best = least_among_least(conditional.sums, charged), least_among_least(charged, charged)
    scale = max(sum(map(abs, charged.parts(choice))), TINY)
    if not np.isfinite([there, best]).all():
        return None
    return GapParts((charged.cost(choice) - there) / scale, (there - best) / scale)


def least_among_least(first: LayeredCosts, second: LayeredCosts) -> float:
    """Return the least second cost of the choices whose first cost is least.

    ``first``, ``second``: of the same choices. Result: infinite if no choice is allowed.
    """
    arcs = [shared + single for shared, single in zip(first.shared, first.single, strict=True)]
    reached, ways = np.zeros(1), []
    for arc in arcs:
        ways.append(reached)
        reached = (reached[:, None] + arc).min(axis=0)
    least = float(reached.min())
    kept = on_a_least_path(arcs, ways, least + TIED * max(abs(least), TINY))
    total = np.zeros(1)
    for single, shared, mask in zip(second.single, second.shared, kept, strict=True):
        total = np.where(mask, total[:, None] + shared + single, np.inf).min(axis=0)
    return float(total.min())


def on_a_least_path(arcs: Sequence[Floats], ways: Sequence[Floats], most: float) -> list[Bools]:
    """Return which pairs lie on a path of at most a cost, move by move.

    ``arcs`` (sequence of (C_{k-1}, C_k) float): what a pair and its later choice cost together;
    ``ways`` (sequence of (C_{k-1},) float): the least cost up to every candidate of the move
    before. Result (list of (C_{k-1}, C_k) bool).
    """
    to_go = np.zeros(arcs[-1].shape[1])
    out = []
    for arc, way in zip(reversed(arcs), reversed(ways), strict=True):
        through = arc + to_go
        whole = way[:, None] + through
        out.append(np.isfinite(whole) & (whole <= most))
        to_go = through.min(axis=1)
    return out[::-1]
