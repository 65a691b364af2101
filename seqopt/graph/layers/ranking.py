"""Where candidates rank, and what the two ways to rank pairs make of a choice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Floats
from seqopt.graph.layers.compiled import best_in_order
from seqopt.graph.layers.costs import TINY, LayeredCosts
from seqopt.graph.layers.layers import Layers
from seqopt.problem.criteria import Ranked, RankSum
from seqopt.problem.problem import Aim

Objectives = dict[str, dict[str, float] | None]


def split_gap(problem: Layers, choice: Sequence[int]) -> dict[str, float]:
    """Return the gap of a choice to the exact optimum, in two parts.

    ``problem``: ranks candidates; its sums are what choices are charged; ``choice``: a candidate
    for every move. Result: over the sum of the costs that the choice meets. ``short_sight``:
    against an exact optimum of the conditional objective, both charged as the problem does: what is
    lost by not looking ahead. Negative where looking ahead would not have served. ``objective``:
    what that optimum itself gives up: the change of objective. Raises `InfeasibleError` if no
    choice is allowed.
    """
    charged, conditional = problem.sums, problem.ranked(Ranked.CONDITIONAL).sums
    scale = max(sum(map(abs, charged.parts(choice))), TINY)
    there, best = _least_among_least(conditional, charged), _least_among_least(charged)
    return {
        "short_sight": (charged.cost(choice) - there) / scale,
        "objective": (there - best) / scale,
    }


def objectives(problem: Layers, choice: Sequence[int], *, heuristic: bool) -> Objectives:
    """Return the value of a choice under both objectives, and of heuristics the parts of its gap.

    ``choice``: a candidate for every move. Result: ``objectives``, its sums over ``pairs`` and
    ``conditional``, and ``gap_parts``, as of `split_gap`; None if the criterion has no ranks, or
    responses are not kept that the other objective would need.
    """
    if not isinstance(problem.criterion, RankSum) or problem.evaluation.streams:
        return {"objectives": None, "gap_parts": None}
    values = {ranked.value: problem.ranked(ranked).sums.cost(choice) for ranked in Ranked}
    return {"objectives": values, "gap_parts": split_gap(problem, choice) if heuristic else None}


def _least_among_least(*costs: LayeredCosts) -> float:
    """Return the least last sum, of the choices whose sums before it are least, in their order."""
    return costs[-1].cost(best_in_order([(each, Aim.SUM) for each in costs]))


TIED = 1e-9  # costs this close, relative to the largest, are equal


def move_costs(problem: Layers, move: int, before: int) -> Floats:
    """Return the costs of a move's candidates, the choice before it being fixed.

    The search of a single move (equation 1 of Bruun et al.): each step of the window is ranked over
    the candidates of this move alone.

    ``problem``: whose responses are evaluated if they are not yet; ``move``, ``before``: a move,
    and the candidate chosen for the move before it. Result (C_k,).
    """
    costs = map(problem.step_costs, problem.window_choices(move, before))
    return np.asarray(sum(costs, np.zeros(len(problem.schedule.moves[move].candidates))))


def rank_of(costs: Floats, chosen: int) -> int:
    """Return the rank of a candidate: 1 if none costs less.

    ``costs`` (C,): equal if they differ by less than ``TIED`` of the largest; ``chosen``: index of
    the candidate.
    """
    tie = TIED * float(np.abs(costs[np.isfinite(costs)]).max(initial=0.0))
    return int((costs < costs[chosen] - tie).sum()) + 1
