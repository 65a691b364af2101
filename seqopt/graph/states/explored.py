"""The space of a problem, facts about all its plans, and the best margin of stability.

The best margin with which a plan exists is found by bisection.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import pi

import numpy as np

from seqopt.arrays import Ints
from seqopt.errors import InfeasibleError
from seqopt.graph._budgets import within_budgets
from seqopt.graph._explore import Explorer
from seqopt.graph._orders import MOST_PARTS, OrderSpace, order_rules
from seqopt.graph.paths import FAILS, PASSES, _lazy_path
from seqopt.graph.states._visits import StateSpace
from seqopt.graph.states.states import States
from seqopt.problem.amounts import STEPS as COUNT
from seqopt.problem.amounts import Amount
from seqopt.problem.standing import Standing, slack
from seqopt.scene.scene import Order
from seqopt.stability.assessment import ROUGHEST


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


WORST = {"bond": 1e9, "friction": ROUGHEST, "tilt": pi / 2}  # as goals count them
FIRST = {"bond": 1e3, "friction": 0.5, "tilt": pi / 2 - 0.05}  # where the search begins
Ordered = tuple[Order, tuple[tuple[int, ...], ...]]  # an order, if it was sought, and states
STEPS = (COUNT,)


def best_margin(
    problem: States, tell: Callable[[Explorer], object] = lambda _: None
) -> tuple[float, float, States, Ordered]:
    """Return objective and lower bound of the first goal, a margin, and the space left at it.

    ``tell``: called with the states that are reached; may raise to end the search. Third, the
    problem of the goals after it, all states standing with that margin; fourth, the order and
    states of a plan that does. Raises `InfeasibleError` if no plan stands with any margin;
    `NothingFoundError` if it is open whether there is one within several budgets.
    """
    name, look = problem.goals[0].name, StandingLook(problem, tell)
    if problem.demands and not look.exists(look.demanding(WORST[name])):
        raise InfeasibleError("no plan of the free schedule stands as is demanded")
    low, high = bisected(name, lambda value: look.exists(look.demanding(value)))
    return high, low, look.demanding(high, problem.goals[1:] or STEPS), look.found


class StandingLook:
    """The states of a problem within limits, and their stability as far as known."""

    def __init__(self, problem: States, tell: Callable[[Explorer], object]) -> None:
        self._problem = problem
        self._first: States | None = None  # with whom all others share their proofs
        self._budgets = problem.budgets
        steps = replace(problem, goals=(*STEPS, *problem.goals[len(problem.aims) :]))
        self._space = build_space(steps)
        self._found = Explorer(self._space, tell=tell)
        self._found.rise()
        self._tell: Callable[[Explorer], object] = tell
        self.found: Ordered = ((), ())
        self._schedules = dict[tuple[object, ...], tuple[int, States]]()
        self._visited = self._found.graph()
        self._graph, self._states = self._visited
        counts = [len(rows) for *_, rows in self._states]
        self._parts = np.repeat(np.arange(len(counts)), counts)
        self._starts = np.cumsum([0, *counts])

    def demanding(self, value: float, goals: tuple[Amount, ...] = STEPS) -> States:
        """Return the problem in which every state must stand with a value as well."""
        name = self._problem.goals[0].name
        return self.proving(replace(with_margin(self._problem, name, value), goals=goals))

    def proving(self, asked: States) -> States:
        """Return a problem with other demands that shares the proofs of those before."""
        first = self._first = self._first or asked
        asked.share_proofs(first)
        return asked

    def exists(self, asked: States) -> bool:
        """Return whether some plan meets the stability requirement in all states; keep one."""
        known = np.zeros(len(self._parts), dtype=np.int64)
        known[0] = PASSES

        def ask(part: int, rows: Ints) -> Ints:
            level, problem, states = self._part(part, rows, asked)
            return np.where(problem.stand(level, states), PASSES, FAILS)

        def recall(part: int, rows: Ints) -> Ints:
            level, problem, states = self._part(part, rows, asked)
            return problem.recalled(level, states)

        tell = partial(self._tell, self._found)
        if self._budgets:
            path = self._within(known, ask, tell)
        else:
            path = _lazy_path(self._graph, self._parts, known, ask, recall, tell)
        if path is None:
            return False
        self.found = self._space.path(self._visited.of(path))
        return True

    def _within(
        self, known: Ints, ask: Callable[[int, Ints], Ints], tell: Callable[[], object]
    ) -> tuple[int, ...] | None:
        """Return a path within budgets of states that stand, or None; arguments of `_lazy_path`."""
        while True:
            tell()
            left = self._graph.only(known[self._graph.target] != FAILS)
            try:
                path = np.array(within_budgets(left, self._budgets).path)
            except InfeasibleError:
                return None
            open_ = path[known[path] == 0]
            if not len(open_):
                return tuple(path.tolist())
            for row in open_.tolist():
                known[row] = ask(int(self._parts[row]), np.array([row]))[0]

    def _part(self, part: int, rows: Ints, asked: States) -> tuple[int, States, Ints]:
        """Return the level of states, the problem that they are of with its demands, and them."""
        _, key, states = self._states[part]
        own = (part, asked.standing, asked.settled)
        if own not in self._schedules:
            self._schedules[own] = self._space.schedule(key, asked)
        return *self._schedules[own], states[rows - self._starts[part]]


def bisected(name: str, exists: Callable[[float], bool]) -> tuple[float, float]:
    """Return the bracket of a margin, as close as is promised: no plan exists at its lower end.

    Raises `InfeasibleError` if none does with any value.
    """
    if name != "tilt" and exists(0.0):
        return 0.0, 0.0
    low, high = 0.0, FIRST[name]
    while not exists(high):
        if high >= WORST[name]:
            raise InfeasibleError("no plan of the free schedule stands, at any margin")
        low, high = high, min(WORST[name], 4 * high)
    while high - low > 0.6 * slack(name, high):  # the rest is for sets that stay open
        middle = (low + high) / 2
        if name != "tilt":
            middle = (low * high) ** 0.5 if low else high / 16
        low, high = (low, middle) if exists(middle) else (middle, high)
    return low, high


def with_margin(problem: States, name: str, value: float) -> States:
    """Return a problem in which every state must have a margin as well.

    ``name``: one of `seqopt.problem.standing.MARGINS`; ``value``: as goals count it.
    """
    demand = (problem.standing or Standing()).demanding(name, value)
    return replace(problem, settled=(*problem.settled, demand))
