"""Windows of a schedule: the steps that one move decides, and what is possible in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from seqopt.arrays import Bools, Ints
from seqopt.problem.criteria import RankSum
from seqopt.problem.ranks import Among, Ranked
from seqopt.problem.requirements import Criterion
from seqopt.responses.choices import Evaluation, StepChoices
from seqopt.sequence.schedule import OpenGrip, Schedule


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


def window(
    schedule: Schedule, move: int, nodes: Sequence[int] | Mapping[int, int], *, alone: bool = False
) -> Schedule:
    """Return the steps that a move shares with the one before, as a schedule of that move alone.

    ``schedule``: with all moves open; ``move``: index of a move; ``nodes``: chosen for the moves
    before; that of the last of them is asked for; ``alone``: whether the steps in which the move
    alone is open belong to it too. Result: of one move; without steps if it shares none.
    """

    def grip(held: int | OpenGrip | None) -> int | OpenGrip | None:
        if not isinstance(held, OpenGrip):
            return held
        return OpenGrip(0) if held.move == move else nodes[held.move]

    found = schedule.steps_of.get((move - 1, move), ())
    if alone:
        found = (*found, *schedule.steps_of.get((move,), ()))
    steps = [
        replace(step, grips=tuple(grip(held) for held in step.grips))
        for step in sorted(found, key=lambda step: step.number)
    ]
    return replace(schedule, steps=tuple(steps), moves=(schedule.moves[move],))


def possible_after(schedule: Schedule, move: int, before: int) -> Bools:
    """Return which candidates of a move are possible while the choice before is still held.

    Responses do not tell where all candidates are impossible: then nothing is known of any.

    ``move``, ``before``: a move, and the candidate chosen for the move before it. Result (C_k,).
    """
    candidates = np.array(schedule.moves[move].candidates)
    if (move - 1, move) not in schedule.steps_of:
        return np.ones(len(candidates), dtype=bool)
    return np.asarray(candidates != schedule.moves[move - 1].candidates[before])


def window_anew(evaluation: Evaluation, move: int, before: int) -> tuple[StepChoices, ...]:
    """Return the steps that a move decides, solved for its candidates alone.

    ``evaluation``: whose responses are not kept; ``move``, ``before``: a move, and the candidate
    chosen for the move before it. Result: in order.
    """
    schedule = evaluation.schedule
    nodes = {move - 1: schedule.moves[move - 1].candidates[before]} if move else {}
    found = replace(
        evaluation,
        schedule=window(schedule, move, nodes, alone=True),
        resources=evaluation.resources.alone(),
    )
    moves = {step.number: step.moves for step in schedule.steps}
    return tuple(replace(each, moves=moves[each.step.number]) for each in found.steps)


def by_move(steps: Sequence[StepChoices]) -> Mapping[int, Sequence[StepChoices]]:
    """Return the steps that each move decides: those in which it is the last that is open."""
    found: dict[int, list[StepChoices]] = {}
    for choices in steps:
        found.setdefault(choices.moves[-1], []).append(choices)
    return found


def window_kept(decided: Sequence[StepChoices], before: int) -> tuple[StepChoices, ...]:
    """Return the steps that a move decides, for its candidates alone, from those of all choices.

    ``before``: the candidate chosen for the move before it. Result: in order.
    """
    out = []
    for choices in decided:
        row = before if len(choices.moves) == 2 else slice(None)
        responses = {name: values[row] for name, values in choices.responses.items()}
        out.append(StepChoices(choices.step, choices.moves, responses))
    return tuple(out)


def pairs_as_moves(
    schedule: Schedule, asked: Sequence[tuple[int, int]], wanted: Sequence[Ints]
) -> Schedule:
    """Return the steps of pairs as a schedule with a move for every row.

    ``asked`` (sequence of (int, int)): a move, and a candidate of the move before it; ``wanted``
    (sequence of (c,) int): the candidates of the move that are looked at.
    """
    moves, steps = [], []
    for n, ((k, before), some) in enumerate(zip(asked, wanted, strict=True)):
        move = schedule.moves[k]
        moves.append(replace(move, candidates=tuple(move.candidates[i] for i in some)))
        node = schedule.moves[k - 1].candidates[before]
        takes: dict[object, int | OpenGrip] = {OpenGrip(k): OpenGrip(n), OpenGrip(k - 1): node}
        for step in schedule.steps_of[k - 1, k]:
            grips = tuple(takes[g] if isinstance(g, OpenGrip) else g for g in step.grips)
            steps.append(replace(step, grips=grips))
    return replace(schedule, steps=tuple(steps), moves=tuple(moves))
