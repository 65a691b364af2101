"""What the engine answers of grip sets to a judge, which believes nothing that is kept anywhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.states.states import States
from seqopt.judge._prop_rules import props_that_hold
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.problem import LARGEST, Goal, Measure
from seqopt.problem.requirements import state_costs
from seqopt.responses._blocks import Block
from seqopt.responses._grip_sets import solve_sets
from seqopt.sequence._rule_check import RuleBook


class Answers(NamedTuple):
    """What is known of grip sets.

    ``values`` (S, g): what every goal takes of them; zero of one that is about moves or margins;
    ``forces`` (S, r): of their grips, N; ``fit`` (S,): which hang together and are within all
    limits.
    """

    values: Floats
    forces: Floats
    fit: Bools


BAND = 1e-3  # share of a value within which six digits do not decide, far more than they err


def ask(
    problem: States, bricks: int, grips: Ints, most: float = np.inf, *, rough: bool = False
) -> Answers:
    """Return what is known about grip sets, computed again by the engine.

    ``grips`` (S, r): nodes held; ``most``: over scenarios, what the first goal takes more of in one
    is not asked of the next; ``rough``: whether six digits are enough.
    """
    if problem.each:
        return _worst(problem, bricks, grips, most, rough=rough)
    return _asked(problem, bricks, grips, rough=rough)


def _worst(problem: States, bricks: int, grips: Ints, most: float, *, rough: bool) -> Answers:
    """Return the largest of all scenarios, of what is passed by those before."""
    out = np.zeros((len(grips), len(problem.goals)))
    forces, fit = np.zeros(grips.shape), np.ones(len(grips), dtype=bool)
    for number, each in enumerate(problem.each):
        rows = np.flatnonzero(fit & (out[:, 0] <= most))
        found = ask(each, bricks, grips[rows], rough=rough)
        out[rows] = problem.joined(out[rows], found.values, number)
        forces[rows], fit[rows] = np.maximum(forces[rows], found.forces), found.fit
    return Answers(out, forces, fit)


def _asked(problem: States, bricks: int, grips: Ints, *, rough: bool) -> Answers:
    """Return the same of one scenario; nothing that is kept anywhere is believed."""
    names = tuple(name for name in problem.named if name != LARGEST)
    held = props_that_hold(problem.network.scene, bricks, grips.shape[1])
    block = Block(bricks, grips, names, rough, tuple(number for number, _ in held))
    rows = solve_sets(problem.engine, block, problem.resources)
    found, forces = dict(zip(names, rows.T, strict=False)), rows[:, len(names) :]
    found[LARGEST] = forces.max(axis=1, initial=0.0)
    fit = np.asarray(np.isfinite(rows).all(axis=1))
    for limit in problem.limits:
        fit &= ~limit.exceeded(found.get(limit.response, np.zeros(len(grips))))
    worth = np.column_stack([_costs(problem, goal, found, bricks, fit) for goal in problem.goals])
    if problem.spares and bricks == len(problem.network.inner) and not grips.shape[1]:
        worth[:] = 0.0  # the whole that nobody holds, where a take-down begins
    return Answers(worth, forces, fit & np.isfinite(worth).all(axis=1))


def _costs(
    problem: States, goal: Goal, found: dict[str, Floats], bricks: int, fit: Bools
) -> Floats:
    if goal.response and not goal.of_margins:
        return found[goal.response]
    if goal.of_states and not goal.of_margins:
        return state_costs(problem.criterion, found, bricks, fit)
    return np.zeros(len(fit))


def alike(
    book: RuleBook, most: Mapping[int, float], *, timed: bool = False
) -> list[tuple[int, ...]]:
    """Return the robots that could change places, group by group; ``timed``: also in time."""
    scene, last = book.network.scene, len(book.network.inner)
    groups: dict[object, list[int]] = {}
    for r in book.team:
        may = tuple(book.places(r, b) for b in range(1, last + 1))
        nodes = [book.newest_nodes[r, b] for b in range(1, last + 1)]
        own = scene.robots[r]
        gives = (own.stiffness, own.rotational_stiffness, own.payload)  # tolerances are of these
        arm = own.arm and r  # no other robot is where it is
        takes = own.durations if timed else None
        key = (book.reached[r, last], tuple(nodes), may, most[r], gives, arm, takes)
        groups.setdefault(key, []).append(r)
    return [tuple(group) for group in groups.values() if len(group) > 1]


def screens(problem: States) -> bool:
    """Return whether six digits of responses tell nearly as much of what goals take of states."""
    ratios = isinstance(problem.criterion, WorstRatio)
    of_states = [goal for goal in problem.goals if goal.of_states and not goal.of_margins]
    peaks = all(g.measure is Measure.PEAK and (g.response or ratios) for g in of_states)
    return peaks and not problem.limits


def near(values: Floats, bounds: Floats) -> Bools:
    """Return the rows (n,) of which a value (n, k) is so close to a bound that digits decide."""
    finite = bounds[np.isfinite(bounds)]
    return np.asarray((np.abs(values[:, :, None] - finite) <= BAND * np.abs(finite)).any((1, 2)))
