"""Acts of a build in time as its judge has them: rebuilt from states, or of an instance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.graph import Graph
from seqopt.times._fall_cuts import CuringStates
from seqopt.times._graph import HELD, NOW, TimedGraph

Groups = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, eq=False)
class Acts:
    """Who may act in moves between states, for how long, and how readiness is extended.

    Of states: ``entries`` (n, c): above 0 where the robot of a column holds, equal where robots of
    one of the ``groups`` of columns are alike. Of acts (a,), by move: ``move``; ``column`` whose
    robot takes a grip, -1 where robots let go; ``prepares``, ``lasts``, s; ``origin`` (a, c): from
    which column the readiness of every column comes, or `HELD`, `NOW`. Of moves (m,): ``work`` (m,
    1 + c): how long they take of the time of all, and of robots, s; ``places``: which place a
    brick. ``longest`` (c,): how long robots take at most to be prepared, s; ``cured``: what states
    ask of mortar, where it cures.
    """

    graph: Graph
    entries: Ints
    groups: Groups
    move: Ints
    column: Ints
    prepares: Floats
    lasts: Floats
    origin: Ints
    work: Floats
    longest: Floats
    places: Bools
    cured: CuringStates | None = None

    @property
    def count(self) -> int:
        """How many columns there are."""
        return int(self.entries.shape[1])

    def follow(
        self, act: Ints, end: Floats, since: Floats, placed: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return labels after acts (k,): when they end (k,), and since when robots are free.

        ``end`` (k,), ``since`` (k, c), ``placed`` (k, b): of the labels before. Results: ``end``
        (k,), infinite where mortar never lets it; ``since`` (k, c), sorted where robots are alike;
        ``placed`` (k, b).
        """
        move, column, to = self.move[act], self.column[act], self.graph.target[self.move[act]]
        ready = since[np.arange(len(act)), column] + self.prepares[act]
        begins = np.where(column < 0, end, np.maximum(end, ready))
        if self.cured is not None:
            placed, own = placed.copy(), np.flatnonzero(self.places[move])
            brick = self.cured.bricks[to[own]] - 1
            placed[own, brick] = np.inf
            begins = self.cured.starts(to.astype(np.int64), placed, begins)
            placed[own, brick] = begins[own] + self.lasts[act[own]]
        ends, origin = begins + self.lasts[act], self.origin[act]
        passed = np.take_along_axis(since, origin.clip(min=0).astype(np.int64), axis=1)
        passed = np.where(origin == NOW, ends[:, None], np.where(origin == HELD, 0.0, passed))
        return ends, alike_in_order(self.groups, self.entries[to], passed), placed


def alike_in_order(groups: Groups, entries: Ints, since: Floats) -> Floats:
    """Return readiness (k, c) of entries (k, c), in order where robots are alike."""
    out = np.where(entries > 0, 0.0, since)
    for group in groups:
        own, times = entries[:, group], out[:, group]
        order = np.lexsort((times, -own), axis=1)
        out[:, group] = np.take_along_axis(times, order, axis=1)
    return out


@dataclass(frozen=True, eq=False)
class Team:
    """The robots of the columns of rows: how long they take, and which could change places.

    ``times`` (c, 5): fetch, place, approach, grip, release, s; ``slow`` (c,): s per m, 0 where ways
    take no time; ``groups``: columns of robots that are alike; ``at`` (nodes,): places, m;
    ``parks``: whether it counts where a free robot was last.
    """

    times: Floats
    slow: Floats
    groups: Groups
    at: Floats
    parks: bool


def acts_of_rows(
    graph: Graph, rows: Ints, places: Bools, team: Team, cured: CuringStates | None = None
) -> Acts:
    """Return the acts of moves between rows of states (n, c), places of nodes that robots hold.

    A robot of a group takes the node that the group did not hold, if it is free and its own entry
    is one less after the move; where none takes a node robots let go of those that they lose.
    """
    before, after = rows[graph.source], rows[graph.target]
    node, loses, able = (np.zeros(after.shape, dtype=np.int64) for _ in range(3))
    for group in team.groups:
        old, new = before[:, group], after[:, group]
        fresh = np.where((new[:, :, None] == old[:, None]).any(axis=2), 0, new.clip(min=0))
        node[:, group] = fresh.max(axis=1)[:, None]
        loses[:, group] = (old > 0) & ~(old[:, :, None] == new[:, None]).any(axis=2)
        had, has = ((old[:, :, None] == each[:, None]).sum(axis=2) for each in (old, new))
        able[:, group] = (old <= 0) & (had > has) & (node[:, group] > 0)
    releases = ~(node > 0).any(axis=1)
    loses[~releases] = 0
    move, column = np.nonzero(np.column_stack([releases, able]))  # by move, releases first
    column -= 1
    took, own = np.flatnonzero(column >= 0), column.clip(min=0)
    prepares, lasts = np.zeros(len(move)), (loses[move] * team.times[:, 4]).max(axis=1)
    placing, last = places[move], -before[move, own]
    way = np.linalg.norm(team.at[node[move, own]] - team.at[last.clip(min=0)], axis=1)
    ready = np.where(placing, team.times[own, 0], team.times[own, 2])
    prepares[took] = (ready + np.where(last > 0, way, 0.0) * team.slow[own])[took]
    lasts[took] = np.where(placing, team.times[own, 1], team.times[own, 3])[took]
    across = float(np.linalg.norm(np.ptp(team.at[1:], axis=0)))
    longest = np.asarray(team.times[:, [0, 2]].max(axis=1) + across * team.slow)
    work = np.zeros((len(before), 1 + len(team.slow)))  # robots that are alike take as long
    work[move, 0] = lasts
    work[:, 1:] = work[:, [0]] * (before > 0)
    work[move[took], 1 + own[took]] = (lasts + prepares)[took]
    for group in team.groups:  # one of those who could
        first = np.cumsum(able[:, group], axis=1) == 1
        work[:, [1 + c for c in group]] *= np.where(able[:, group] > 0, first, 1)
    origin = _origins(before[move], loses[move] > 0, (column, node[move, own]), team)
    arrays = move, column, prepares, lasts, origin, work, longest, places
    return Acts(graph, rows, team.groups, *arrays, cured)


def _origins(before: Ints, loses: Bools, taken: tuple[Ints, Ints], team: Team) -> Ints:
    """Return the columns (a, c) from which readiness comes: entries of a group stay sorted.

    ``before``, ``loses`` (a, c): entries, and who lets go; ``taken``: by whom which node is taken.
    """
    (column, node), every = taken, np.arange(len(before))
    out: Ints = np.zeros(before.shape, dtype=np.int8)
    out[:] = np.arange(before.shape[1])
    out[before > 0], out[loses] = HELD, NOW
    entries = np.where(loses, -before if team.parks else 0, before)
    takes = column >= 0
    entries[every[takes], column[takes]] = node[takes]
    out[every[takes], column[takes]] = HELD
    for group in team.groups:
        order = np.argsort(-entries[:, group], axis=1, kind="stable")
        out[:, group] = np.take_along_axis(out[:, group], order, axis=1)
    return out


def acts_of_instance(timed: TimedGraph, graph: Graph, kept: Bools) -> Acts:
    """Return the acts of an instance in a subgraph of kept arcs, (m,) bool."""
    columns = timed.free.shape[1]
    own = (np.flatnonzero(timed.kinds == kind).tolist() for kind in np.unique(timed.kinds))
    groups = tuple(tuple(group) for group in own)
    entries = np.zeros(timed.free.shape, dtype=np.int64)
    for c in range(1, columns):
        entries[:, c] = np.where(timed.alike[:, c - 1], entries[:, c - 1], -c)
    entries = np.where(timed.free, entries, columns - np.arange(columns))
    act = np.flatnonzero(kept[timed.move])
    arc = timed.move[act]
    move = (np.cumsum(kept) - 1)[arc]
    work = np.zeros((int(kept.sum()), 1 + columns))  # of a kind, in its first column
    work[:, [0, *(1 + group[0] for group in groups)]] = timed.work[kept]
    return Acts(
        *(graph, entries, groups, move, timed.column[act]),
        *(timed.prepares[arc], timed.acts[arc], timed.origin[act]),
        *(work, timed.longest, np.zeros(len(kept), dtype=bool)),
    )
