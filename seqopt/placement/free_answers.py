"""What the judge of free schedules asks the engine: grip sets and what goals take of them."""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Want
from seqopt.errors import MechanismError
from seqopt.placement.free_goals import LARGEST, Goal
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.requirements import state_costs
from seqopt.responses.quantities import CHOSEN_BY, lengths

BATCH = 2048  # grip sets whose fields are held at once


class Answers(NamedTuple):
    """What is known of grip sets.

    Attributes
    ----------
    worth : (S, g) float
        What every goal takes of them; zero of one that is about moves or margins.
    forces : (S, r) float
        Of their grips, N.
    fit : (S,) bool
        Which hang together and are within all limits.
    """

    worth: Floats
    forces: Floats
    fit: Bools


def ask(problem: FreeProblem, bricks: int, grips: Ints, most: float = np.inf) -> Answers:
    """Return what is known about grip sets, computed again by the engine.

    Parameters
    ----------
    problem : FreeProblem
    bricks : int
    grips : (S, r) int
        Nodes held.
    most : float, optional
        Over scenarios, what the first goal takes more of in one is not asked of the next.
    """
    if problem.each:
        return _worst(problem, bricks, grips, most)
    parts = [_asked(problem, bricks, grips[:0])]
    for start in range(0, len(grips), BATCH):
        parts.append(_asked(problem, bricks, grips[start : start + BATCH]))
    return Answers(*map(np.concatenate, zip(*parts, strict=True)))


def _worst(problem: FreeProblem, bricks: int, grips: Ints, most: float) -> Answers:
    """Return the largest of all scenarios, of what is passed by those before."""
    out = np.zeros((len(grips), len(problem.goals)))
    forces, fit = np.zeros(grips.shape), np.ones(len(grips), dtype=bool)
    for each in problem.each:
        rows = np.flatnonzero(fit & (out[:, 0] <= most))
        found = ask(each, bricks, grips[rows])
        out[rows] = np.maximum(out[rows], found.worth)
        forces[rows], fit[rows] = np.maximum(forces[rows], found.forces), found.fit
    return Answers(out, forces, fit)


def _asked(problem: FreeProblem, bricks: int, grips: Ints) -> Answers:
    """Return the same of a few sets; those that leave something loose are found by halving."""
    if not len(grips):
        shapes = (0, len(problem.goals)), grips.shape, (0,)
        return Answers(np.zeros(shapes[0]), np.zeros(shapes[1]), np.zeros(0, dtype=bool))
    named = [CHOSEN_BY[name] for name in problem.named if name != LARGEST]
    want = reduce(or_, (response.needs for response in named), Want(0))
    try:
        fields = problem.engine.solve(bricks, grips, want)
    except MechanismError:
        if len(grips) == 1:
            worth = np.full((1, len(problem.goals)), np.inf)
            return Answers(worth, np.full(grips.shape, np.inf), np.zeros(1, dtype=bool))
        half = len(grips) // 2
        halves = [_asked(problem, bricks, part) for part in (grips[:half], grips[half:])]
        return Answers(*map(np.concatenate, zip(*halves, strict=True)))
    found = {r.name: r.of(problem.network, fields) for r in named}
    forces = lengths(fields.grip_force)
    found[LARGEST] = forces.max(axis=1, initial=0.0)
    fit = np.ones(len(grips), dtype=bool)
    for limit in problem.limits:
        fit &= ~limit.exceeded(found.get(limit.response, np.zeros(len(grips))))
    worth = np.column_stack([_costs(problem, goal, found, bricks, fit) for goal in problem.goals])
    return Answers(worth, forces, fit & np.isfinite(worth).all(axis=1))


def _costs(
    problem: FreeProblem, goal: Goal, found: dict[str, Floats], bricks: int, fit: Bools
) -> Floats:
    if goal.response and not goal.of_margins:
        return found[goal.response]
    if goal.of_states and not goal.of_margins:
        return state_costs(problem.criterion, found, bricks, fit)
    return np.zeros(len(fit))
