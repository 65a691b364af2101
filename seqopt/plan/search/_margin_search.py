"""The best margin of stability with which a free schedule exists, found by bisection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi

from seqopt.errors import InfeasibleError
from seqopt.graph._explore import Explorer
from seqopt.graph.states._visits import explore
from seqopt.graph.states.states import States
from seqopt.problem.problem import Goal, Measure
from seqopt.problem.standing import Standing, StandingSets, slack
from seqopt.stability.assessment import ROUGHEST

WORST = {"bond": 1e9, "friction": ROUGHEST, "tilt": pi / 2}  # as goals count them
FIRST = {"bond": 1e3, "friction": 0.5, "tilt": pi / 2 - 0.05}  # where the search begins
WIDTH = 50  # states of a brick count from which a quick look for a plan goes on


def best_margin(
    problem: States, tell: Callable[[Explorer], object] = lambda _: None
) -> tuple[float, float, States]:
    """Return the best value of the first goal, a margin, and what is left to choose at it.

    ``tell``: called with the states that are reached; may raise to end the search. Results:
    ``value``: with which plans exist in which every state is proven to stand; ``bound``: with which
    none does; ``rest``: of the goals after it, with the demand that all stand with that value.
    Raises `InfeasibleError` if there is no plan, whatever the margin.
    """
    name, asked = problem.goals[0].response, list[StandingSets]()

    def demanding(value: float, goals: tuple[Goal, ...]) -> States:
        found = replace(with_margin(problem, name, value), goals=goals)
        found.stability.others = asked
        asked.append(found.stability)
        return found

    def exists(value: float) -> bool:
        reach = demanding(value, (Goal(Measure.STEPS),))
        return explore(reach, width=WIDTH, tell=tell).whole or explore(reach, tell=tell).whole

    if problem.demands and not exists(WORST[name]):
        raise InfeasibleError("no plan of the free schedule stands as is demanded")
    low, high = bisected(name, exists)
    return high, low, demanding(high, problem.goals[1:] or (Goal(Measure.STEPS),))


def bisected(name: str, exists: Callable[[float], bool]) -> tuple[float, float]:
    """Return two values of a margin, as close as is promised: no plan exists with the first.

    ``exists``: whether one does with a value. Raises `InfeasibleError` if none does with any.
    """
    if name != "tilt" and exists(0.0):
        return 0.0, 0.0
    low, high = 0.0, FIRST[name]
    while not exists(high):
        if high >= WORST[name]:
            raise InfeasibleError("no plan of the free schedule stands, whatever the margin")
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
