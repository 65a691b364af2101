"""The space of a problem, and what is known of all its plans before any is sought."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from seqopt.arrays import Ints
from seqopt.graph._explore import Explorer
from seqopt.graph._orders import MOST_PARTS, OrderSpace, order_rules, whole_bound
from seqopt.graph.states._visits import StateSpace
from seqopt.graph.states.states import States


def build_space(
    problem: States,
    *,
    regrips: bool = True,
    every: bool = True,
    standing: bool = False,
    most: int | None = None,
) -> StateSpace | OrderSpace:
    """Return the states and moves of a problem: of its schedule, or of all orders of its bricks.

    ``regrips``, ``standing``: as of `StateSpace`; ``every``: whether all orders that are sought are
    looked at, or the scene's own alone, if it is one of them; ``most``: how many sets of bricks
    with a newest one there may be, where orders are sought; by default `MOST_PARTS`.
    """
    if problem.orders is None:
        return StateSpace(problem, regrips, standing)
    own = problem.network.scene.build_order
    if not every and order_rules(problem).allows(own):
        return StateSpace(problem.at(own), regrips, standing, order=own)
    return OrderSpace(problem, MOST_PARTS if most is None else most, regrips, standing)


def floors_of_goals(problem: States) -> tuple[float, ...]:
    """Return lower bounds of goals that are known before the search.

    No worst step is better than the end that all builds have in common, no build shorter than its
    bricks and robots allow. Minus infinity where nothing is known.
    """
    space, out = problem.space, [-np.inf] * len(problem.goals)
    values, within = np.zeros((1, len(out))), np.zeros(1, dtype=bool)
    if space.ends_bare:
        values, within = problem.values(space.levels, np.zeros_like(space.start()))
    for k, goal in enumerate(problem.goals):
        if within[0] and goal.is_peak:
            out[k] = float(values[0, k])
        if goal.least is not None:
            out[k] = goal.least(space)
    if problem.orders is not None:  # whatever the order, the whole is passed
        out[0] = max(out[0], whole_bound(problem))
    return tuple(out)


def barred(problem: States) -> tuple[int, Ints] | None:
    """Return a state that every plan passes and that is infeasible; None if there is none.

    Of a free schedule that is the finished structure that nobody holds, of others every step in
    which no grip is open. Result: its level, and the state (1, c). Without limits and demands
    nothing is asked.
    """
    space = StateSpace(problem, standing=bool(problem.demands))
    asked = problem.demands or problem.limits or problem.filters
    for level, state in problem.space.without_choice() if asked else ():
        if not space.values(level, state, rough=False)[1].all():
            return level, state
    return None


def explore(
    problem: States,
    ceiling: float = np.inf,
    width: int | None = None,
    tell: Callable[[Explorer], object] = lambda _: None,
) -> Explorer:
    """Return the visited states of a problem below a ceiling, its stability requirement included.

    ``ceiling``: upper bound of the first goal, if it is a peak; ``width``: how many new states of a
    brick count are kept, and without regrips; ``tell``: called after every level; may raise to end
    the search. Nothing is visited where a state that every plan passes is infeasible.
    """
    asked = bool(problem.demands) or any(goal.margins for goal in problem.goals)
    few = width is not None
    space = build_space(problem, regrips=not few, every=not few, standing=asked)
    found = Explorer(space, width, tell)
    if barred(problem) is None:
        found.rise(ceiling)
    return found
