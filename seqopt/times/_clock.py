"""The time of builds as their judge follows it: readiness, ages of mortar, and bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph.graph import TIME, Graph, _Target, _to_go
from seqopt.judge._proof import Rebuilt
from seqopt.judge._states import StateEvaluator
from seqopt.judge.arithmetic import Book, Closed, Stage, _is_beyond_limits, _sum_bound
from seqopt.judge.certificate import limit_below
from seqopt.network.network import Network
from seqopt.stability.standing import Standing
from seqopt.times._curing import CuringStates, FallCuts, JointsInTime
from seqopt.times._curing_law import Curing
from seqopt.times._graph import HELD, NOW, TimedGraph
from seqopt.times._steps import require_durations

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


class Clock(Book):
    """When steps end, since when robots are free, and how old mortar is where it cures.

    ``acts``: all that may be taken; ``multipliers`` (L, 1 + c): of the time of all and of robots,
    made valid; ``most``: s; ``strict``: whether what ends then is no better either.
    """

    def __init__(self, acts: Acts, multipliers: Floats, most: float, *, strict: bool) -> None:
        self._acts, self._limit, columns = acts, (np.array([most]), np.array([strict])), acts.count
        valid = np.where(np.isfinite(multipliers), multipliers, 0.0).clip(min=0.0)
        valid = valid.reshape(-1, 1 + columns)  # from 0, at most one together, alike of alike ones
        for group in acts.groups:
            alike = [1 + column for column in group]
            valid[:, alike] = valid[:, alike].mean(axis=1, keepdims=True)
        self._multipliers = valid / np.maximum(1.0, valid.sum(axis=1, keepdims=True))
        self._left = [_to_go(acts.graph, acts.work @ each) for each in self._multipliers]
        # of all builds, by multipliers alone, s
        self.bound = max((float(left[0]) for left in self._left), default=0.0)
        placed = np.zeros(0) if acts.cured is None else acts.cured.placed
        self.first = np.concatenate([np.zeros(1 + columns), placed])

    def follow(self, arc: Ints, values: Floats) -> Floats:
        last = 1 + self._acts.count
        before = values[:, 0], values[:, 1:last], values[:, last:]
        return np.column_stack(self._acts.follow(arc, *before))

    def beyond(self, state: Ints, values: Floats) -> Bools:
        end, since = values[:, 0], values[:, 1 : 1 + self._acts.count]
        busy = np.where(self._acts.entries[state] <= 0, since, end[:, None])
        ends, over = end.copy(), self._acts.graph.ends[state]
        for multipliers, left in zip(self._multipliers, self._left, strict=True):
            bound = multipliers[0] * end + busy @ multipliers[1:] + left[state]
            ends = np.where(over, ends, np.maximum(ends, bound))
        return _is_beyond_limits(ends[:, None], *self._limit)

    def counted(self, state: Ints, values: Floats) -> Floats:
        """Return labels with the readiness and ages that count.

        Who is free for longer than any preparation takes could as well be so for as long: who acts
        again acts no sooner, and who does not is done.
        """
        acts, last = self._acts, 1 + self._acts.count
        out, columns = values.copy(), slice(1, last)
        later = np.maximum(values[:, columns], values[:, [0]] - acts.longest)
        out[:, columns] = np.where(acts.entries[state] <= 0, later, 0.0)
        if acts.cured is not None:  # what has its full bond could as well be older
            older = np.maximum(values[:, last:], values[:, [0]] - acts.cured.full)
            stands = np.arange(older.shape[1]) < acts.cured.bricks[state][:, None]
            out[:, last:] = np.where(stands, older, 0.0)
        return out


class TimedRows:
    """The states that a better build could pass, rebuilt, in time."""

    def __init__(
        self, evaluator: StateEvaluator, rebuilt: Rebuilt, motions: Sequence[Floats]
    ) -> None:
        tables, problem = evaluator.tables, evaluator.problem
        self._rules, self._team_columns = problem.rules, len(tables.team)
        self._level = np.array(rebuilt.parts)[rebuilt.part_of()]
        rows = np.concatenate([own[:, : tables.robots] for own in rebuilt.states])
        self._rows = rows.astype(np.int64)
        self._cured: CuringStates | None = None
        standing, begin = problem.standing, problem.rules.begin
        self.cures = standing is not None and standing.curing is not None
        if standing is not None and self.cures:
            counts = [tables.bricks_at(level) if level else 0 for level in rebuilt.parts]
            bricks, floors = np.array(counts), Floors(problem.network, standing, motions)
            grips = [evaluator.held_to_stand(rows) for rows in rebuilt.states]
            held, payload = (np.concatenate([each[k] for each in grips]) for k in (0, 1))
            asked = bricks[rebuilt.part_of()], held, payload
            placed, ages = np.zeros(len(floors.full)), () if begin is None else begin.ages
            placed[: len(ages)] = [-age for age in ages]
            self._cured = CuringStates(floors.starts, *asked, floors.full, placed)
        scene, own = problem.network.scene, require_durations(problem.network.scene, tables.team)
        times = np.array([[d.fetch, d.place, d.approach, d.grip, d.release] for d in own])
        slow = np.array([0.0 if d.speed is None else 1 / d.speed for d in own])
        at = [scene.node_position(node) for node in tables.nodes[1:].tolist()]
        self._team = Team(times, slow, tables.groups, np.array([(0.0,) * 3, *at]), problem.parks)

    def acts(self, graph: Graph) -> Acts:
        """Return who may act in the moves of a graph of these states, and for how long."""
        places = self._rules.places(self._level[graph.source], self._level[graph.target])
        return acts_of_rows(graph, self._rows, places, self._team, self._cured)

    def clock(
        self, graph: Graph, multipliers: Floats, most: float, *, strict: bool
    ) -> tuple[Clock, Ints]:
        """Return the book of a graph of these states, and which moves its arcs are."""
        if multipliers.ndim != 2 or multipliers.shape[1] != 1 + self._team_columns:
            raise SolverError("there is no multiplier for every robot")
        acts = self.acts(graph)
        return Clock(acts, multipliers, most, strict=strict), acts.move

    def in_order(self, entries: Ints, values: Floats) -> Floats:
        """Return labels with readiness in the order of entries (N, c), as robots are alike."""
        out, free = values.copy(), slice(1, 1 + self._team_columns)
        out[:, free] = alike_in_order(self._team.groups, entries, out[:, free])
        return out


Grips = tuple[Ints, Floats]
CLOSE = 1e-9  # of a time: what rounding may take from an age


class Floors:
    """Lower bounds of waits for mortar, by motions in which states fall; each is checked.

    ``motions``: that are claimed, (b, 6) in m and rad.
    """

    def __init__(self, network: Network, standing: Standing, motions: Sequence[Floats]) -> None:
        curing = standing.curing or Curing()
        joints = JointsInTime(network, curing)
        self._cuts = FallCuts(network, standing.mortar, joints)
        for motion in motions:
            if len(motion) <= len(network.inner):
                self._cuts.add(motion)
        self._brick, self._points = joints.closing, curing.points
        self.full = np.zeros(len(network.inner))  # age at which all joints of a brick are cured, s
        self.full[self._brick] = max((age for age, _ in curing.points), default=0.0)

    def starts(self, bricks: int, grips: Grips, placed: Floats, start: Floats) -> Floats:
        """Return from when on, no sooner than times (k,), s, states are not proven to fall.

        ``grips``: nodes held, ascending, as places in build order from 1, and largest forces, N,
        (k, r); ``placed`` (k, b): when bricks were in their places, infinite for the one that is
        placed. Result: infinite where no wait is enough.
        """
        out, rows = start.copy(), np.arange(len(start))
        joints = [j for j, brick in enumerate(self._brick.tolist()) if brick < bricks]
        while len(rows):
            now, bond = out[rows], np.zeros((len(rows), len(joints)))
            later = np.full(len(rows), np.inf)  # when the next joint has more of its bond
            for j in joints:
                since = placed[rows, self._brick[j]]
                age = np.maximum(now - since, 0.0) + CLOSE * np.abs(now)
                for at, share in self._points:
                    bond[age >= at, j] = share
                    ahead = since + at > now + 2 * CLOSE * np.abs(now)
                    later = np.where(ahead & (since + at < later), since + at, later)
            falls = self._cuts.fall(bricks, (grips[0][rows], grips[1][rows]), bond)
            rows, later = rows[falls], later[falls]
            out[rows] = later
            rows = rows[np.isfinite(later)]
        return out


def claimed_time(instance: Any, stage: Stage, claim: Any, prices: Sequence[float]) -> float:
    """Return when the last act ends at the earliest, by shares of the time of robots.

    ``prices``: multipliers of the caps of a stage.
    """
    timed = instance.timed
    assert timed is not None  # an instance that asks for a time has it
    every, some = (
        graph.source.astype(np.int64) * graph.states + graph.target
        for graph in (instance.graph, stage.graph)
    )
    kept = np.isin(every, some)
    shares = _shares(timed.sizes.astype(float), claim.shares)
    if claim.labels is not None and claim.value is not None:
        (nodes, values), width = claim.labels, 1 + len(timed.kinds) + len(stage.limited)
        named = len(nodes) == 0 or (nodes.min() >= 0 and nodes.max() < instance.nodes)
        if values.shape != (len(nodes), width) or not named or not np.isfinite(values).all():
            raise SolverError(f"labels: give nodes, and for each a row of {width} numbers")
        acts = acts_of_instance(timed, stage.graph, kept)
        multipliers = np.column_stack([shares[:, 0], shares[:, 1:][:, timed.kinds]])
        clock = Clock(acts, multipliers, limit_below(claim.value), strict=True)
        books = stage.books(_Target("", TIME), claim.value, acts.move)
        closed = Closed(stage.graph, acts.move, [clock, *books])
        own = values[:, 1 : 1 + acts.count]
        since = alike_in_order(acts.groups, acts.entries[nodes], own)
        values = np.column_stack([values[:, 0], since, values[:, 1 + acts.count :]])
        if closed.is_proof((nodes, values)):
            least: float = claim.value
            return least
        raise SolverError(f"labels do not prove that no path ends before {claim.value:.9g}")
    bounds = [_sum_bound(stage, timed.work[kept] @ own, prices) for own in shares]
    return max(bounds) * (1 - 1e-12)


def _shares(sizes: Floats, given: Floats | None) -> Floats:
    """Return shares (L, 1 + k) that prove a bound; those of one kind each if none are given."""
    if given is None:
        return np.asarray(np.eye(len(sizes)) / sizes)
    shares = np.atleast_2d(given)
    wrong = shares.shape[1] != len(sizes) or not (shares >= 0).all()
    if wrong or (shares @ sizes > 1 + 1e-9).any():
        raise SolverError(
            f"shares: give {len(sizes)} numbers from 0, that of all and one for a robot of every "
            f"kind; with {', '.join(f'{s:g}' for s in sizes)} of each they add up to 1 at most"
        )
    return shares


def path_makespan(timed: TimedGraph, arcs: Ints, acts: Ints | None = None) -> float:
    """Return the makespan of a path, s, under the given or the best assignment of robots.

    ``acts`` (k,): given ones.
    """
    every = acts_of_instance(timed, timed.graph, np.ones(len(timed.prepares), dtype=bool))
    every = replace(every, groups=())  # acts name columns: robots that are alike stay apart
    first = np.searchsorted(timed.move, np.arange(len(timed.prepares) + 1))
    labels = np.zeros((1, 1 + len(timed.kinds)))
    for step, arc in enumerate(arcs.tolist()):
        own = np.arange(first[arc], first[arc + 1]) if acts is None else acts[[step]]
        act, label = np.repeat(own, len(labels)), np.tile(labels, (len(own), 1))
        end, since, _ = every.follow(act, label[:, 0], label[:, 1:], label[:, :0])
        labels = np.unique(np.column_stack([end, since]), axis=0)
        dominated = (labels[:, None] <= labels).all(axis=2)
        labels = labels[dominated.sum(axis=0) == 1]  # by itself alone
    return float(labels[:, 0].min())
