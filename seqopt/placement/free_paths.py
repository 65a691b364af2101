"""Best paths through the states of a free schedule, for one goal after the other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from seqopt.arrays import Bools, Floats
from seqopt.placement.free_goals import Measure
from seqopt.placement.free_graph import NOTHING, Arcs, Level, Rows, StateGraph

TIED = 1e-9  # of the least: by how much a path may exceed it and still be one of the best
Join = Callable[[Floats, Floats], Floats]


def least_from_start(graph: StateGraph, goal: int) -> list[Floats]:
    """Return the least that a goal takes on the way to every state.

    Parameters
    ----------
    graph : StateGraph
    goal : int
        Its place among the problem's goals.

    Returns
    -------
    list of (n,) float
        By level; infinite where no way leads.
    """
    join = _join(graph, goal)
    out = [np.zeros(len(graph.levels[0].states))]
    for b, level in enumerate(graph.levels[1:], start=1):
        entry = graph.levels[b - 1].onward
        reached = np.full(len(level.states), np.inf)
        through = join(out[-1][entry.source], graph.costs(goal, b, entry))
        np.minimum.at(reached, entry.target, through)
        out.append(settle(reached, level.inner, graph.costs(goal, b, level.inner), join))
    return out


def least_to_end(graph: StateGraph, goal: int) -> list[Floats]:
    """Return the least that a goal takes on the way from every state to the end.

    Parameters
    ----------
    graph : StateGraph
        With all levels.
    goal : int
        Its place among the problem's goals.

    Returns
    -------
    list of (n,) float
        By level, the state itself not counted; infinite where no way leads.
    """
    join = _join(graph, goal)
    out: list[Floats] = []
    for b in range(len(graph.levels) - 1, -1, -1):
        level = graph.levels[b]
        left = np.full(len(level.states), np.inf)
        if not out:
            left[graph.ends()] = 0.0
        else:
            onward = level.onward
            through = join(out[-1][onward.target], graph.costs(goal, b + 1, onward))
            np.minimum.at(left, onward.source, through)
        inner = level.inner
        back = Arcs(inner.target, inner.source, inner.regrip, inner.way)
        out.append(settle(left, back, graph.costs(goal, b, inner), join))
    return out[::-1]


def keep_best(graph: StateGraph, goal: int) -> tuple[StateGraph, float]:
    """Return the part of a graph whose paths all reach the least of a goal, and that least.

    Parameters
    ----------
    graph : StateGraph
        In which some path leads to the end; it is used up.
    goal : int
        Its place among the problem's goals.

    Returns
    -------
    graph : StateGraph
    least : float
    """
    join = _join(graph, goal)
    before, after = least_from_start(graph, goal), least_to_end(graph, goal)
    least = float(after[0].min())
    most = least + TIED * abs(least)

    def tight(b: int, to: int, arcs: Arcs) -> Bools:
        costs = graph.costs(goal, to, arcs)
        through = join(join(before[b][arcs.source], costs), after[to][arcs.target])
        return np.asarray(through <= most)

    nodes = [join(first, last) <= most for first, last in zip(before, after, strict=True)]
    rank = _ranks(nodes)
    levels = []
    for b, level in enumerate(graph.levels):
        inner, onward = level.inner.only(tight(b, b, level.inner)), level.onward
        if b + 1 < len(graph.levels):
            onward = onward.only(tight(b, b + 1, onward))
        levels.append(_part(level, nodes[b], (inner, onward), rank[b : b + 2]))
        graph.levels[b] = NOTHING  # or both graphs would need memory at once
    return StateGraph(graph.problem, levels, held=graph.held), least


def shortest(graph: StateGraph) -> list[tuple[int, int]]:
    """Return a path of fewest steps, the first of them in the order of states.

    Parameters
    ----------
    graph : StateGraph
        In which some path leads to the end.

    Returns
    -------
    list of (int, int)
        Level and row of every state after the first.
    """
    after = _steps_to_end(graph)
    b, row, path = 0, 0, list[tuple[int, int]]()
    while after[b][row] > 0:
        level = graph.levels[b]
        ways = [(b, level.inner), (b + 1, level.onward)]
        found = []
        for to, arcs in ways:
            targets = arcs.target[arcs.source == row]
            found += [(to, int(t)) for t in targets if after[to][t] == after[b][row] - 1]
        b, row = min(found)
        path.append((b, row))
    return path


def _steps_to_end(graph: StateGraph) -> list[Floats]:
    out: list[Floats] = []
    for level in reversed(graph.levels):
        left = np.full(len(level.states), np.inf)
        if not out:
            left[graph.ends()] = 0.0
        else:
            np.minimum.at(left, level.onward.source, out[-1][level.onward.target] + 1)
        inner = level.inner
        back = Arcs(inner.target, inner.source, inner.regrip, inner.way)
        out.append(settle(left, back, np.ones(len(inner.source)), np.add))
    return out[::-1]


def _join(graph: StateGraph, goal: int) -> Join:
    return np.maximum if graph.problem.goals[goal].measure is Measure.PEAK else np.add


def settle(least: Floats, arcs: Arcs, costs: Floats, join: Join) -> Floats:
    """Return the least at every state of a level, moves among them counted.

    Parameters
    ----------
    least : (n,) float
        Where the level is entered.
    arcs : Arcs
        Among its states.
    costs : (m,) float
        Of the moves.
    join : callable
        How costs add up along a way.

    Returns
    -------
    (n,) float
    """
    while len(costs):
        better = least.copy()
        np.minimum.at(better, arcs.target, join(least[arcs.source], costs))
        if np.array_equal(better, least):
            break
        least = better
    return least


def _ranks(nodes: list[Bools]) -> list[Rows]:
    """Return the rows of kept states among those that are kept, level by level."""
    return [np.cumsum(kept, dtype=np.int32) - 1 for kept in nodes]


def _part(level: Level, kept: Bools, arcs: tuple[Arcs, Arcs], rank: list[Rows]) -> Level:
    """Return the kept states of a level; of the ranks, its own come first, then the next one's."""
    inner, onward = arcs
    inner = Arcs(rank[0][inner.source], rank[0][inner.target], inner.regrip, inner.way)
    if len(onward.source):
        ends = rank[0][onward.source], rank[1][onward.target]
        onward = Arcs(*ends, onward.regrip, onward.way)
    return Level(level.states[kept], level.values[kept], inner, onward)


def below(graph: StateGraph, bounds: Floats) -> StateGraph | None:
    """Return the states all of whose values are below bounds, and the moves among them.

    Parameters
    ----------
    graph : StateGraph
    bounds : (g,) float
        By goal.

    Returns
    -------
    StateGraph or None
        None where a level has no such state.
    """
    nodes = [np.asarray((level.values < bounds).all(axis=1)) for level in graph.levels]
    nodes[0][:] = True  # the empty site has no values
    if not all(kept.any() for kept in nodes):
        return None
    rank = _ranks(nodes)
    levels = []
    for b, level in enumerate(graph.levels):
        inner, onward = level.inner, level.onward
        inner = inner.only(nodes[b][inner.source] & nodes[b][inner.target])
        if b + 1 < len(graph.levels):
            onward = onward.only(nodes[b][onward.source] & nodes[b + 1][onward.target])
        levels.append(_part(level, nodes[b], (inner, onward), rank[b : b + 2]))
    return StateGraph(graph.problem, levels, held=graph.held)


def reaches_end(graph: StateGraph) -> bool:
    """Return whether some path leads from the empty site to an end.

    Parameters
    ----------
    graph : StateGraph

    Returns
    -------
    bool
    """
    reached = np.ones(1, dtype=bool)
    for before, level in zip(graph.levels, graph.levels[1:], strict=False):
        now = np.zeros(len(level.states), dtype=bool)
        now[before.onward.target[reached[before.onward.source]]] = True
        count = 0
        while count < (count := int(now.sum())):
            now[level.inner.target[now[level.inner.source]]] = True
        if not count:
            return False
        reached = now
    return bool((reached & graph.ends()).any())
