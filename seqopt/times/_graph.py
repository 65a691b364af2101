"""The states of a build as a graph in time: their acts, and the bond that they need."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.graph.graph import Graph
from seqopt.graph.space import Visited
from seqopt.graph.states import States
from seqopt.times._curing import CuringStates, FallCuts
from seqopt.times._steps import require_durations

HELD, NOW = -1, -2  # where the readiness of a column comes from: it has none, the end of the act


@dataclass(frozen=True, eq=False, repr=False)
class TimedGraph(FrozenValue):
    """States, moves and acts of a build in time.

    Of states: ``levels`` (n,), of which no move leads to a lower one; ``free`` (n, c), of which
    columns the robots are; ``alike`` (n, c - 1), which columns could change places with the next
    one. ``kinds`` (c,): of the robot of every column; ``longest`` (c,): how long they take at most
    to be prepared, s. Of acts (a,): ``move``; ``column`` of the state before whose robot takes a
    grip, -1 where robots let go; ``origin`` (a, c): from which column of the state before the one
    after has its readiness, or `HELD`, `NOW`. Of moves: ``prepares``, ``acts`` (m,), s; ``work``
    (m, 1 + k): how long they take of the time of all, and of the robots of every kind, s:
    preparing, acting, and holding while others act. ``curing``: what mortar that cures asks for.
    """

    graph: Graph
    levels: Ints
    free: Bools
    alike: Bools
    kinds: Ints
    move: Ints
    column: Ints
    origin: Ints
    prepares: Floats
    acts: Floats
    work: Floats
    longest: Floats
    curing: Any = None

    @property
    def sizes(self) -> Ints:
        """How many there are to share the work: all as one, then robots of every kind, (1 + k,)."""
        return np.array([1, *np.bincount(self.kinds)])

    def only(self, kept: Ints, graph: Graph) -> TimedGraph:
        """Return what is left of it in the ``graph`` of some of its states and their moves."""
        on = np.isin(np.arange(len(self.levels)), kept)
        moves = on[self.graph.source] & on[self.graph.target]
        acts = moves[self.move]
        of_states = {name: getattr(self, name)[on] for name in ("levels", "free", "alike")}
        of_moves = {name: getattr(self, name)[moves] for name in ("prepares", "acts", "work")}
        of_acts = {name: getattr(self, name)[acts] for name in ("column", "origin")}
        move = (np.cumsum(moves) - 1)[self.move[acts]]
        return replace(self, graph=graph, move=move, **of_states, **of_moves, **of_acts)


class _Moves(NamedTuple):
    """What moves do, by column of the state before or after."""

    before: Ints  # (m, c); entries of states
    after: Ints  # (m, c)
    taken: Bools  # (m, c); nodes that are held afterwards and were not
    dropped: Bools  # (m, c); nodes that were held and are not afterwards
    able: Bools  # (m, c); whose robot may be the one who takes the grip
    places: Bools  # (m,); which place a brick


def timed_graph(problem: States, visited: Visited, cuts: FallCuts | None = None) -> TimedGraph:
    """Return the states that were visited, in time; all robots have durations.

    ``cuts``: what is known of states that fall while mortar cures.
    """
    space, graph = problem.space, visited.graph
    rows = np.concatenate([each[:, : space.robots] for *_, each in visited.states])
    levels = np.repeat([key for key, *_ in visited.states], [len(s) for *_, s in visited.states])
    kinds = np.repeat(np.arange(len(space.slots)), [end - first for first, end in space.slots])
    found = _moves(problem, graph, rows.astype(np.int64), levels)
    prepares, acts, longest = _times(problem, found)
    move, column = np.nonzero(found.able)
    others = np.flatnonzero(~found.taken.any(axis=1))
    move, column = np.append(move, others), np.append(column, np.full(len(others), -1))
    order = np.argsort(move, kind="stable")
    move, column = move[order], column[order]
    free = rows <= 0
    alike = np.asarray(free[:, 1:] & (rows[:, 1:] == rows[:, :-1]) & (kinds[1:] == kinds[:-1]))
    origin = _origins(space.slots, found, move, column, parks=space.parks)
    work = [acts]  # of the time of all, and of robots of every kind
    for first, end in space.slots:
        takes = found.taken[:, first:end].any(axis=1)
        work.append(
            acts * ((found.before[:, first:end] > 0).sum(axis=1) + takes) + prepares * takes
        )
    states, taken = (graph, levels, free, alike, kinds), np.column_stack(work)
    timed = TimedGraph(*states, move, column, origin, prepares, acts, taken, longest, None)
    if cuts is None:
        return timed
    every = [(level, *problem.held_to_stand(rows)) for level, _, rows in visited.states]
    bricks = [np.full(len(held), problem.space.bricks_at(level)) for level, held, _ in every]
    held, payload = (np.concatenate([each[k] for each in every]) for k in (1, 2))
    full, begin = cuts.joints.full, problem.rules.begin
    placed = np.zeros(len(full))
    placed[: 0 if begin is None else begin.bricks] = () if begin is None else begin.placed
    needed = CuringStates(cuts.starts, np.concatenate(bricks), held, payload, full, placed)
    return replace(timed, curing=needed)  # the bond that states need


def _moves(problem: States, graph: Graph, rows: Ints, levels: Ints) -> _Moves:
    """Return the acts of moves, kind by kind."""
    before, after = rows[graph.source], rows[graph.target]
    taken, dropped, able = (np.zeros(after.shape, dtype=bool) for _ in range(3))
    for first, end in problem.space.slots:
        old, new = before[:, first:end], after[:, first:end]
        taken[:, first:end] = (new > 0) & ~(new[:, :, None] == old[:, None]).any(axis=2)
        dropped[:, first:end] = (old > 0) & ~(old[:, :, None] == new[:, None]).any(axis=2)
        had, has = ((old[:, :, None] == each[:, None]).sum(axis=2) for each in (old, new))
        able[:, first:end] = (old <= 0) & (had > has)
        able[~taken[:, first:end].any(axis=1), first:end] = False
    places = problem.rules.places(levels[graph.source], levels[graph.target])
    return _Moves(before, after, taken, dropped, able, places)


def _times(problem: States, found: _Moves) -> tuple[Floats, Floats, Floats]:
    """Return how long moves take to be prepared, and to be done, (m,), s.

    And how long robots of columns take at most to be prepared, wherever they go, (c,), s.
    """
    space, network = problem.space, problem.network
    robots = [robot for kind in space.kinds for robot in kind.robots]
    own, at = require_durations(network.scene, robots), network.node_position[network.inner.ravel()]
    slow = np.array([0.0 if d.speed is None else 1 / d.speed for d in own])
    times = np.array([[d.fetch, d.place, d.approach, d.grip, d.release] for d in own])
    prepares, acts = np.zeros(len(found.places)), np.zeros(len(found.places))
    move, column = np.nonzero(found.taken)
    placing = found.places[move]
    prepares[move] = np.where(placing, times[column, 0], times[column, 2])
    acts[move] = np.where(placing, times[column, 1], times[column, 3])
    move, column = np.nonzero(found.dropped)
    np.maximum.at(acts, move, times[column, 4])
    longest = times[:, [0, 2]].max(axis=1) + np.linalg.norm(np.ptp(at, axis=0)) * slow
    if not space.parks:
        return prepares, acts, longest
    at = np.pad(at, ((1, 0), (0, 0)))
    move = np.flatnonzero(found.able.any(axis=1))
    column = found.able[move].argmax(axis=1)
    last, node = -found.before[move, column], (found.after * found.taken)[move].max(axis=1)
    prepares[move] += np.linalg.norm(at[node] - at[last], axis=1) * (last > 0) * slow[column]
    return prepares, acts, longest


def _origins(
    slots: tuple[tuple[int, int], ...], found: _Moves, move: Ints, column: Ints, *, parks: bool
) -> Ints:
    """Return from where columns of the states after acts have their readiness, (a, c).

    Entries of a kind are sorted, held ones first: those of free robots come in the same order in
    the state before, except for who takes a grip, and with those who let go.
    """
    out = np.full((len(move), found.after.shape[1]), HELD)
    for first, end in slots:
        columns = np.arange(first, end)
        before, after = found.before[move, first:end], found.after[move, first:end]
        dropped = found.dropped[move, first:end]
        keys = np.where(dropped, -before if parks else 0, before).astype(float)
        keys[((before > 0) & ~dropped) | (columns == column[:, None])] = -np.inf
        source = np.where(dropped, NOW, columns)
        order = np.argsort(-keys, axis=1, kind="stable")
        source = np.take_along_axis(source, order, axis=1)
        held = (after > 0).sum(axis=1)
        place = np.arange(end - first) - held[:, None]
        sought = np.take_along_axis(source, place.clip(min=0), axis=1)
        out[:, first:end] = np.where(place >= 0, sought, HELD)
    return out
