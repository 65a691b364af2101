"""Ranks among the candidates that are possible after the choice before.

A node that the robot of the move before holds cannot be taken. That choice is impossible, but where
the robot has let go, the steps of the later move alone rank the node with the others, though nobody
can have taken it. With ``RankSum(among=Among.POSSIBLE)`` it is left out there too: what such a step
costs then depends on the choice before, and it is a cost of pairs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seqopt.problem.criteria import RankSum
from seqopt.problem.ranks import Among, Ranked
from seqopt.problem.requirements import Criterion
from seqopt.responses.choices import StepChoices
from seqopt.sequence.schedule import Schedule


def compared(
    choices: StepChoices, schedule: Schedule, criterion: Criterion, after: int | None = None
) -> StepChoices:
    """Return a step as its choices are compared: for itself, or after every choice before.

    ``choices``: with one open move, or two; ``after``: the candidate chosen for the move before,
    where responses are (C_k,) of that choice. Result: the same, or over pairs with responses
    (C_{k-1}, C_k), NaN where both would be one node; of one choice before (C_k,).
    """
    among = getattr(criterion, "among", Among.ALL)
    move = choices.moves[-1]
    if among is Among.ALL or len(choices.moves) == 2 or not _meets(schedule, move):
        return choices
    before, now = (np.array(schedule.moves[k].candidates) for k in (move - 1, move))
    same = before[:, None] == now if after is None else before[after] == now
    responses = {name: np.where(same, np.nan, v) for name, v in choices.responses.items()}
    return replace(choices, moves=(move - 1, move), responses=responses)


def _meets(schedule: Schedule, move: int) -> bool:
    """Return whether a move shares a step with the one before."""
    return any(step.moves == (move - 1, move) for step in schedule.steps)


def spread_over_pairs(choices: StepChoices, criterion: Criterion) -> Criterion:
    """Return the criterion by which a step as it is compared is judged.

    ``choices``: from `compared`. Result: that ranks row by row if one open move was spread over
    pairs.
    """
    if len(choices.moves) == len(choices.step.moves) or not isinstance(criterion, RankSum):
        return criterion
    return replace(criterion, ranked=Ranked.CONDITIONAL)
