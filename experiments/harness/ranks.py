"""Where the nodes of a plan rank among those that could have been chosen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from experiments.harness.layers import LayeredCosts, cost_layers
from seqopt.arrays import Floats
from seqopt.graph.states import States
from seqopt.problem.problem import Problem

TIED = 1e-9  # costs this close, relative to the largest, are equal


def rank_choice(problem: Problem | States, nodes: Sequence[int]) -> pd.DataFrame:
    """Return where chosen nodes rank, move by move, the choice before each being fixed.

    ``nodes``: one for every move. Columns: ``step``, and ``rank_in_window`` of the move alone.
    """
    found = cost_layers(problem)
    choice = [m.candidates.index(node) for m, node in zip(found.moves, nodes, strict=True)]
    ranks = map(rank_of, windows(found.alone, choice), choice)
    return pd.DataFrame({"step": [m.step for m in found.moves], "rank_in_window": [*ranks]})


def windows(alone: LayeredCosts, choice: Sequence[int]) -> list[Floats]:
    """Return the costs (C_k,) of every move's candidates after the choice before, as is searched.

    ``alone``: as of `Layers`.
    """
    every = zip(alone.single, alone.shared, (0, *choice), strict=False)
    return [own + pairs[before] for own, pairs, before in every]


def rank_of(costs: Floats, chosen: int) -> int:
    """Return the rank of a candidate: 1 if none costs less.

    ``costs`` (C,): equal if they differ by less than ``TIED`` of the largest; ``chosen``: index of
    the candidate.
    """
    tie = TIED * float(np.abs(costs[np.isfinite(costs)]).max(initial=0.0))
    return int((costs < costs[chosen] - tie).sum()) + 1
