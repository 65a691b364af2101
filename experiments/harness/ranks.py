"""Where the nodes of a plan rank among those that could have been chosen."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.graph.decision_costs import LayeredCosts
from seqopt.graph.decisions import Decisions, Windows
from seqopt.problem.problem import Aim

TIED = 1e-9  # costs this close, relative to the largest, are equal


def rank_choice(problem: Decisions, choice: Sequence[int]) -> pd.DataFrame:
    """Return where chosen nodes rank, move by move, the choice before each being fixed.

    ``choice``: a candidate for every move. Result: a row per move. Columns: ``move``, ``step``,
    ``bricks``, ``robot``, ``node``, ``candidates`` (how many there are), ``first_in_window`` (the
    node that ranks first), and three ranks: ``rank_in_window`` of the move alone, ``rank_overlap``
    with the least sum of costs to the end of the build added, ``rank_peak`` with the least worst
    cost to the end.
    """
    sums, peaks = to_go(problem.sums, Aim.SUM), to_go(problem.peaks, Aim.PEAK)
    rows, windows = [], Windows(problem, [*choice])
    for k, (before, now) in enumerate(pairwise((0, *choice))):
        move, window = problem.schedule.moves[k], windows.costs(k)
        what = {"move": k + 1, "step": move.step, "bricks": move.bricks, "robot": move.robot}
        ranks = {
            "node": move.candidates[now],
            "candidates": len(move.candidates),
            "first_in_window": move.candidates[int(window.argmin())],
            "rank_in_window": rank_of(window, now),
            "rank_overlap": rank_of(problem.sums.shared[k][before] + sums[k], now),
            "rank_peak": rank_of(np.maximum(problem.peaks.shared[k][before], peaks[k]), now),
        }
        rows.append(what | ranks)
    return pd.DataFrame(rows)


def to_go(costs: LayeredCosts, aim: Aim) -> list[Floats]:
    """Return the least cost from each candidate (C_k,) to the end, its own included."""
    out, join = [costs.single[-1]], aim.join
    for own, pairs in zip(costs.single[-2::-1], costs.shared[:0:-1], strict=True):
        out.insert(0, join(own, join(pairs, out[0]).min(axis=1)))
    return out


def rank_of(costs: Floats, chosen: int) -> int:
    """Return the rank of a candidate: 1 if none costs less.

    ``costs`` (C,): equal if they differ by less than ``TIED`` of the largest; ``chosen``: index of
    the candidate.
    """
    tie = TIED * float(np.abs(costs[np.isfinite(costs)]).max(initial=0.0))
    return int((costs < costs[chosen] - tie).sum()) + 1
