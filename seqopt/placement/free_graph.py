"""The states of a free schedule that a search reaches, level by level, and the moves between them.

A level holds the states of one brick count. Responses are asked for once a state is reached, all
new states of a round together; a state above the ceiling is left out, and nothing is reached
through it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from seqopt.arrays import Bools, Floats, Ints, frozen
from seqopt.placement.free_goals import Measure
from seqopt.placement.free_problem import FreeProblem
from seqopt.sequence.free_moves import Moves

Rows = NDArray[np.int32]


@dataclass(eq=False)
class Arcs:
    """Moves between kept states, by their rows in the levels that they lead from and to.

    Attributes
    ----------
    source, target : (m,) int
        Rows.
    regrip : (m,) bool
        Whether a robot takes a grip on a brick that stands.
    way : (m,) float
        How far it goes, m; empty where ways do not count.
    """

    source: Rows
    target: Rows
    regrip: Bools
    way: Floats

    def only(self, kept: Bools) -> Arcs:
        """Return some of the moves.

        Parameters
        ----------
        kept : (m,) bool

        Returns
        -------
        Arcs
        """
        way = self.way[kept] if len(self.way) else self.way
        return Arcs(self.source[kept], self.target[kept], self.regrip[kept], way)


@dataclass(eq=False)
class Level:
    """The kept states of one brick count.

    Attributes
    ----------
    states : (n, c) int
        In the order of their codes.
    values : (n, g) float
        What goals take of them.
    inner : Arcs
        Moves among them.
    onward : Arcs
        Moves to those with one brick more.
    """

    states: Ints
    values: Floats
    inner: Arcs
    onward: Arcs


_NONE: Rows = frozen(np.zeros(0, dtype=np.int32))
NO_ARCS = Arcs(_NONE, _NONE, frozen(np.zeros(0, dtype=bool)), frozen(np.zeros(0)))
NOTHING = Level(frozen(np.zeros((0, 0), dtype=int)), frozen(np.zeros((0, 0))), NO_ARCS, NO_ARCS)


@dataclass(eq=False)
class StateGraph:
    """The kept states of all brick counts from none on.

    Attributes
    ----------
    problem : FreeProblem
    levels : list of Level
        By brick count; as many as were reached.
    excluded : float
        The least that the first goal takes of a state that was left out for it.
    held : int or None
        How many grips are held where the build ends; any number by default.
    """

    problem: FreeProblem
    levels: list[Level] = field(default_factory=list)
    excluded: float = np.inf
    held: int | None = None

    @property
    def whole(self) -> bool:
        """Whether some state is reached that ends the build."""
        return len(self.levels) > self.problem.space.bricks and bool(self.ends().any())

    def ends(self) -> Bools:
        """Return which states of the last level end the build.

        Returns
        -------
        (n,) bool
        """
        states = self.levels[-1].states
        ends = self.problem.space.ended(states)
        return ends if self.held is None else ends & (self.problem.space.grips(states) == self.held)

    @property
    def nbytes(self) -> int:
        """How much memory states and moves take."""
        total = 0
        for level in self.levels:
            total += level.states.nbytes + level.values.nbytes
            for arcs in (level.inner, level.onward):
                total += sum(getattr(arcs, each.name).nbytes for each in fields(arcs))
        return total

    def costs(self, goal: int, level: int, arcs: Arcs) -> Floats:
        """Return what a goal takes of moves to a level.

        Parameters
        ----------
        goal : int
        level : int
            That the moves lead to.
        arcs : Arcs

        Returns
        -------
        (m,) float
        """
        measure = self.problem.goals[goal].measure
        if measure is Measure.STEPS:
            return np.ones(len(arcs.source))
        if measure is Measure.REGRIPS:
            return arcs.regrip.astype(float)
        if measure is Measure.TRAVEL:
            return arcs.way
        return np.asarray(self.levels[level].values[arcs.target, goal])


def explore(
    problem: FreeProblem,
    ceiling: float = np.inf,
    width: int | None = None,
    tell: Callable[[StateGraph], None] = lambda _: None,
) -> StateGraph:
    """Return all states that can be reached through states within limits and a ceiling.

    Parameters
    ----------
    problem : FreeProblem
    ceiling : float, optional
        The first goal must not take more of a state, where it is about a peak.
    width : int, optional
        From how many new states of a brick count the search goes on, those of least worth, and
        without any regrip; from all by default.
    tell : callable, optional
        Called after every level with what was reached; may raise to end the search.

    Returns
    -------
    StateGraph
        With fewer levels where no state of the next one is reached.
    """
    graph, space = StateGraph(problem), problem.space
    level = Level(space.start(), np.zeros((1, len(problem.goals))), NO_ARCS, NO_ARCS)
    for bricks in range(1, space.bricks + 1):
        graph.levels.append(level)
        tell(graph)
        moves = space.places(bricks - 1, level.states)
        following, excluded = close_level(problem, bricks, moves.states, (ceiling, width))
        graph.excluded = min(graph.excluded, excluded)
        level.onward = arcs_to(problem, moves, following.states, regrip=False)
        level = following
        if not len(level.states):
            return graph
    graph.levels.append(level)
    tell(graph)
    return graph


def close_level(
    problem: FreeProblem, bricks: int, entry: Ints, most: tuple[float, int | None]
) -> tuple[Level, float]:
    """Return the level of all states that can be reached from some without placing a brick.

    Parameters
    ----------
    problem : FreeProblem
    bricks : int
    entry : (n, c) int
        Where the level is entered, some states perhaps more than once.
    most : tuple of (float, int or None)
        Ceiling and width of `explore`.

    Returns
    -------
    level : Level
        Without moves onward.
    excluded : float
        The least that the first goal takes of a state that was left out.
    """
    space = problem.space
    seen, excluded = np.zeros(0, dtype=np.int64), np.inf
    kept = [(entry[:0], np.zeros((0, len(problem.goals))))]
    parts: list[tuple[Moves, bool]] = []
    fresh = entry
    while len(fresh):
        codes, first = np.unique(space.codes(fresh), return_index=True)
        new = ~np.isin(codes, seen, assume_unique=True)
        seen = np.concatenate([seen, codes[new]])
        states, values, least = _chosen(problem, bricks, fresh[first[new]], most)
        excluded = min(excluded, least)
        offset = sum(len(part) for part, _ in kept)
        kept.append((states, values))
        moves = [space.releases(bricks, states)]
        moves += [space.holds(bricks, states)] if most[1] is None else []
        parts += [(Moves(m.source + offset, *m[1:]), i == 1) for i, m in enumerate(moves)]
        fresh = np.concatenate([m.states for m in moves])
    states, values = (np.concatenate(part) for part in zip(*kept, strict=True))
    order = np.argsort(space.codes(states), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    states, values = states[order], values[order]
    arcs = [
        arcs_to(problem, Moves(rank[m.source], *m[1:]), states, regrip=hold) for m, hold in parts
    ]
    return Level(states, values, _joined(arcs), NO_ARCS), excluded


def _chosen(
    problem: FreeProblem, bricks: int, states: Ints, most: tuple[float, int | None]
) -> tuple[Ints, Floats, float]:
    """Return the new states with which the search goes on, their values, and what is left out."""
    ceiling, width = most
    values, within, excluded = problem.worth(bricks, states, ceiling)
    states, values = states[within], values[within]
    if width is not None and len(states) > width:
        best = np.argsort(values[:, problem.leading], kind="stable")[:width]
        states, values = states[best], values[best]
    return states, values, excluded


def arcs_to(problem: FreeProblem, moves: Moves, states: Ints, *, regrip: bool) -> Arcs:
    """Return the moves that lead to kept states.

    Parameters
    ----------
    problem : FreeProblem
    moves : Moves
    states : (n, c) int
        Kept ones, in the order of their codes.
    regrip : bool
        Whether the moves are regrips.

    Returns
    -------
    Arcs
    """
    known, codes = problem.space.codes(states), problem.space.codes(moves.states)
    at = np.searchsorted(known, codes)
    kept = np.zeros(len(codes), dtype=bool)
    inside = at < len(known)
    kept[inside] = known[at[inside]] == codes[inside]
    way = moves.way[kept] if problem.space.parks else np.zeros(0)
    source, target = (ids[kept].astype(np.int32) for ids in (moves.source, at))
    return Arcs(source, target, np.full(len(source), regrip), way)


def _joined(parts: list[Arcs]) -> Arcs:
    if not parts:
        return NO_ARCS
    names = ("source", "target", "regrip", "way")
    return Arcs(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
