"""States of a schedule and the moves between them, in batches: of rules, or with open grips.

A state is a brick count, or a step, and the node that every robot holds. States of one level are
rows of integers, a column per robot: 0 for a free robot, n for one that holds the n-th node (from
1, brick by brick in build order). Robots of one kind of a free schedule are interchangeable: their
columns are adjacent, and their entries sorted, largest first, which removes symmetric states. If a
rule limits regrips, a further column counts those since the last brick. If travel counts, a free
robot stays at the node that it held last, -n.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, chain, pairwise
from math import prod
from typing import Any, NamedTuple

import numpy as np

from seqopt._registry import required
from seqopt.arrays import Bools, Floats, FrozenValue, Ints, Terse
from seqopt.errors import SolverError, StepError
from seqopt.network.network import Network
from seqopt.scene._checks import settle
from seqopt.scene.scene import Scene, can_carry
from seqopt.sequence.methods import placing_node
from seqopt.sequence.rules import Ending, FreeRules, Newest, Payload
from seqopt.sequence.schedule import Move, OpenGrip, OpenStep, Schedule, carried, islands
from seqopt.sequence.steps import Site, Step, StepKind, _begin_step, check_sequence


@dataclass(frozen=True, eq=False, repr=False)
class RobotKind(FrozenValue):
    """Robots of equal reach, force limit, and bricks that they may place."""

    robots: tuple[int, ...]  # indices of the scene's robots
    reach: Bools  # (2B,); nodes that they may hold, as in ``network.inner.ravel()``
    newest: Bools  # (2B,); at which they hold a brick when they place it, and as the newest
    places: Bools  # (B,); bricks in build order that they may place or take away: they carry them
    cap: float  # largest force of a grip, N


class Moves(NamedTuple):
    """Moves from states of one brick count."""

    source: Ints  # (m,); row of the state that each leads from
    states: Ints  # (m, c); the states that they lead to
    way: Floats  # (m,); how far the robot goes that takes a grip, m; zero where ways do not count


class Candidates(NamedTuple):
    """All choices of the grips that are open at a level, whether or not a build reaches them."""

    columns: tuple[int, ...]  # of the robots whose grips are open, those taken first before others
    places: tuple[Ints, ...]  # (C,) each; the places that each of them may hold
    states: Ints  # (P, c); of possible choices: a place for each robot that no other one holds
    possible: Bools  # (C,) or (C, D); which choices these are, in the same order

    def rows(self, states: Ints) -> tuple[Ints, ...]:
        """Return where choices of states (n, c) stand in arrays of the shape of ``possible``."""
        found = []
        for column, places in zip(self.columns, self.places, strict=True):
            order = np.argsort(places)
            found.append(order[np.searchsorted(places, states[:, column], sorter=order)])
        return tuple(found)

    def spread(self, values: Floats) -> Floats:
        """Return values (P,) of the possible choices in the shape of all; NaN of others."""
        out = np.full(self.possible.shape, np.nan)
        out[self.possible] = values
        return out


def sort_entries(states: Ints, first: int, end: int) -> None:
    """Sort the entries of a kind's robots, columns of (n, c), largest first, in place."""
    if end - first > 1:
        states[:, first:end] = -np.sort(-states[:, first:end], axis=1)


def _join_moves(parts: Sequence[Moves], states: Ints) -> Moves:
    """Concatenate moves from states (n, c)."""
    none = Moves(np.zeros(0, dtype=np.int64), states[:0], np.zeros(0))
    return Moves(*map(np.concatenate, zip(none, *parts, strict=True)))


_PAIRS = 4_000_000  # of states and nodes that are looked at together


class StateRows(Terse):
    """Base class of spaces of states: rows with a column per robot."""

    network: Network
    rules: Any
    kinds: tuple[RobotKind, ...]
    parks: bool
    first: int  # level at the beginning of the build
    levels: int  # level at its end
    ends_bare: bool  # whether every build ends without grips
    robots: int  # how many take part
    slots: tuple[tuple[int, int], ...]  # first column of every kind, and the one after its last
    _bricks: Sequence[int]  # how many stand, by level
    _span: tuple[int, int]  # of rules: how many stand at the beginning and at the end
    _place: Mapping[int | None, int]  # of nodes in build order, from 1
    _at: Floats  # (2B + 1, 3); positions of nodes, m; the first is for none

    def __post_init__(self) -> None:
        scene, counts = self.network.scene, [len(kind.robots) for kind in self.kinds]
        base = 1 + (2 if self.parks else 1) * 2 * len(self.network.inner)
        regrips = getattr(self.rules, "regrips", None) or 0
        if base ** sum(counts) * (1 + regrips) >= 2**62:  # codes of a level are int64
            raise StepError(
                f"scene {scene.name}: {len(self.network.inner)} bricks and {sum(counts)} robots "
                "have more states than can be numbered; let fewer robots take part"
            )
        settle(
            self,
            robots=sum(counts),
            slots=tuple(pairwise(accumulate(counts, initial=0))),
            _place={node: i for i, node in enumerate(scene.placed_nodes, start=1)},
            _at=np.pad(self.network.node_position[self.network.inner.ravel()], ((1, 0), (0, 0))),
        )

    def bricks_at(self, level: int) -> int:
        """Return how many bricks stand on a level."""
        return self._bricks[level]

    def for_arms(self, bricks: int, states: Ints) -> Bools:
        """Return which states (n, c) are feasible for arms at a brick count, (n,)."""
        scene = self.network.scene
        if not scene.has_arms:  # nothing is copied for nobody: this is asked of all states
            return np.ones(len(states), dtype=bool)
        held = np.zeros((len(states), len(scene.robots)), dtype=np.int64)
        held[:, [r for kind in self.kinds for r in kind.robots]] = states[:, : self.robots]
        return np.asarray(required("permits")(scene).allowed(bricks, held))

    def codes(self, states: Ints) -> Ints:
        """Return a code (n,) per state (n, c), unique in its level."""
        last = 2 * len(self.network.inner)
        least = -last if self.parks else 0
        out = states[:, self.robots :].sum(axis=1, dtype=np.int64)  # grips since the last brick
        for column in range(self.robots):
            out *= 1 + last - least
            out += states[:, column]
            out -= least
        return np.asarray(out)

    def open_columns(self, level: int) -> tuple[int, ...]:
        """Return the columns of robots whose grips are open at a level, in the order of moves."""
        return ()

    def held(self, states: Ints) -> Ints:
        """Return the nodes held (n, robots), ascending, zeros of free robots first."""
        return np.sort(states[:, : self.robots].clip(min=0), axis=1)

    def grips(self, states: Ints) -> Ints:
        """Return the number of grips, (n,)."""
        return np.asarray((states[:, : self.robots] > 0).sum(axis=1))


@dataclass(frozen=True, eq=False, repr=False)
class FreeSpace(StateRows):
    """The states of a free schedule and the moves between them; a level is a brick count."""

    network: Network
    rules: FreeRules
    kinds: tuple[RobotKind, ...]
    parks: bool = False  # free robots stay where they were, for their travel

    def __post_init__(self) -> None:
        super().__post_init__()
        first, last = span = self.rules.span(self.network.scene)
        bare = self.rules.how_it_ends is not Ending.HELD
        settle(self, _span=span, first=first, levels=last, ends_bare=bare, _bricks=range(last + 1))

    def without_choice(self) -> Iterator[tuple[int, Ints]]:
        """Yield the level and the state (1, c) in which every build ends, if it is unique."""
        if self.ends_bare:
            yield self.levels, np.zeros_like(self.start())

    def steps_to_go(self, level: int, states: Ints) -> Floats:
        """Return lower bounds of steps to an end: all but a grip per robot are released singly."""
        placed = self.levels - level
        grips = placed + self.grips(states)
        if self.rules.how_it_ends is Ending.ONE_BY_ONE:
            return placed + grips.astype(float)
        return placed + np.maximum(0.0, grips - self.robots) + (self.ends_bare & (grips > 0))

    def within(
        self, level: int, states: Ints, *, regrips: bool = True
    ) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves that change no brick, and whether they are regrips."""
        bricks = self.bricks_at(level)
        if not bricks and level:
            return ()
        releases = (self._releases(bricks, states), False)
        return (releases, (self._holds(bricks, states), True)) if regrips else (releases,)

    def onward(self, level: int, states: Ints) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves that place the next brick; a free robot then holds it: no regrips."""
        nodes = np.array([2 * level, 2 * level + 1])
        moves = self._takes(states, [nodes[k.newest[nodes] & k.places[level]] for k in self.kinds])
        moves.states[:, self.robots :] = 0
        return ((self._lawful_only(level + 1, moves), False),)

    def start(self) -> Ints:
        """Return the initial state, (1, c).

        Its type is the smallest that holds every node: there may be tens of millions of states.
        """
        most = max(2 * len(self.network.inner), self.rules.regrips or 0)
        columns = self.robots + (self.rules.regrips is not None)
        out = np.zeros((1, columns), dtype=np.min_scalar_type(-most - 1))
        site = self.rules.begin
        if site is not None:
            out[0, : self.robots] = self._row(site)
            out[0, self.robots :] = min(site.regrips, self.rules.regrips or 0)
        return out

    def _row(self, site: Site) -> Ints:
        """Return the entries (robots,) of a site."""
        held, out = site.holds(self.network.scene), np.zeros((1, self.robots), dtype=np.int64)
        for kind, (first, end) in zip(self.kinds, self.slots, strict=True):
            for column, robot in enumerate(kind.robots, start=first):
                stay = site.stays[robot] if site.stays and self.parks else None
                out[0, column] = self._place.get(held[robot], -self._place.get(stay, 0))
            sort_entries(out, first, end)
        return np.asarray(out[0])

    def may_place(self, level: int, states: Ints) -> Bools:
        """Return which states (n, c) allow the next move of a brick, (n,); the first may not."""
        bricks = self.bricks_at(level)
        begins = self.rules.begin is not None and 0 < bricks == self._span[0]
        return self.lawful(bricks, states) if begins else np.ones(len(states), dtype=bool)

    def _holds(self, bricks: int, states: Ints) -> Moves:
        """Return the moves in which a free robot grips a placed brick."""
        begins = self.rules.begin is not None and bricks == self._span[0]
        begins &= bricks != self._span[1] or self.rules.how_it_ends is not Ending.ONE_BY_ONE
        able = np.ones(len(states), dtype=bool) if begins else self.lawful(bricks, states)
        if self.rules.regrips is not None:
            able &= states[:, -1] < self.rules.regrips
        rows, near = np.flatnonzero(able), np.arange(2 * bricks)
        if self.rules.candidates:
            near = np.flatnonzero(np.isin(self.network.scene.placed_nodes, self._near[bricks]))
        moves = self._takes(states[rows], [near[kind.reach[near]] for kind in self.kinds])
        moves.states[:, self.robots :] += 1
        ok = self.for_arms(bricks, moves.states)
        return Moves(rows[moves.source[ok]], moves.states[ok], moves.way[ok])

    def _releases(self, bricks: int, states: Ints) -> Moves:
        """Return the feasible moves in which one robot releases, or at the end all do."""
        moves = self._lets_go(states, states[:, : self.robots] > 0)
        if bricks != self._span[1] or self.rules.how_it_ends is not Ending.ONE_BY_ONE:
            moves = self._lawful_only(bricks, moves)  # at the end they may go against the rules
        if bricks != self._span[1] or not self.ends_bare:
            return moves
        if self.rules.how_it_ends is Ending.RELEASED:
            rows = np.flatnonzero(self.grips(states))
            moves = _join_moves([moves, Moves(rows, states[rows], np.zeros(len(rows)))], states)
            moves.states[len(moves.source) - len(rows) :, : self.robots] = 0
        moves.states[self.grips(moves.states) == 0, : self.robots] = 0  # it forgets where they were
        return moves

    def _lets_go(self, states: Ints, may: Bools) -> Moves:
        """Return the moves in which one robot releases; ``may`` (n, robots): the feasible ones."""
        parts = []
        for first, end in self.slots:
            for slot in range(first, end):
                rows = np.flatnonzero(may[:, slot])
                new = states[rows]
                new[:, slot] = -new[:, slot] if self.parks else 0
                sort_entries(new, first, end)
                parts.append(Moves(rows, new, np.zeros(len(rows))))
        return _join_moves(parts, states)

    def lawful(self, bricks: int, states: Ints) -> Bools:
        """Return which states (n, c) satisfy the rules before the end of the build, (n,)."""
        scene = self.network.scene
        props = scene.standing_props(bricks, held=True) if bricks else ()
        propped = [scene.since[scene.brick_of_node[prop.node].name] - 1 for prop in props]
        ok = self._lawful(bricks, states, propped)
        if propped and bricks == self.levels:  # where nobody holds, props are struck
            bare = self.grips(states) == 0
            ok[bare] = self._lawful(bricks, states[bare], ())
        return ok

    def _lawful(self, bricks: int, states: Ints, propped: Sequence[int]) -> Bools:
        """Return which states satisfy the rules; ``propped``: bricks as indices in build order."""
        held = states[:, : self.robots]
        least = self.rules.fewest_grips(self.network.scene) - len(propped) if bricks > 1 else 0
        ok = np.asarray(self.grips(states) >= least)
        if self.rules.newest is not Newest.FREE and bricks - 1 not in propped:
            nodes = 2 * bricks + np.array([-1, 0])
            newest = np.zeros(len(states), dtype=bool)
            for kind, (first, end) in zip(self.kinds, self.slots, strict=True):
                for node in nodes[kind.newest[nodes - 1]]:
                    newest |= (held[:, first:end] == node).any(axis=1)
            ok &= newest
        for part in self._loose[bricks]:
            if {*part}.isdisjoint(propped):
                ok &= np.isin((held - 1) // 2, part).any(axis=1)
        return ok

    def ended(self, states: Ints) -> Bools:
        """Return which states of the last level end the build, (n,)."""
        if self.ends_bare:
            return np.asarray(self.grips(states) == 0)
        if self.rules.finish is None or self.rules.finish.grips is None:
            return self.lawful(self._span[1], states)
        held = states[:, : self.robots].clip(min=0)
        for first, end in self.slots if self.parks else ():
            sort_entries(held, first, end)
        return np.asarray((held == self._row(self.rules.finish).clip(min=0)).all(axis=1))

    def steps(self, states: Sequence[Sequence[int]]) -> tuple[Step, ...]:
        """Return the checked steps that lead from one state to the next.

        ``states``: as of a `seqopt.graph.formulation.Solution`. Raises `SolverError` if they are
        none of this space; `StepError` if no single step leads from one to the next.
        """
        numbers = [None, *self.network.scene.placed_nodes]
        begin = _begin_step(self.network.scene, self.rules.begin)
        grips: list[int | None] = [*begin.grips]
        lasts = (begin.grips, self.rules.begin.stays) if self.rules.begin else ()
        # where a robot was last, as a place from 1
        stays = {r: self._place[n] for nodes in lasts for r, n in enumerate(nodes) if n is not None}
        before, out = begin.bricks, list[Step]()
        for level, *entries in states:
            if len(entries) < self.robots or not all(abs(n) < len(numbers) for n in entries):
                raise SolverError(f"the state {[level, *entries]} is none of this free schedule")
            bricks, took = self.bricks_at(level), False
            for kind, (first, end) in zip(self.kinds, self.slots, strict=True):
                took |= _follow(kind.robots, entries[first:end], grips, stays, numbers)
            stays = stays if self.parks else {}
            step = StepKind.PLACE if bricks > before else StepKind.REPOSITION
            number = begin.number + len(out) + 1
            other = StepKind.REMOVE if bricks < before else StepKind.RELEASE
            out.append(Step(number, step if took else other, bricks, tuple(grips)))
            before = bricks
        return check_sequence(self.network.scene, out, begin)

    @cached_property
    def _near(self) -> tuple[list[int], ...]:
        """By brick count the nodes of placed bricks that may be gripped."""
        counts = range(len(self.network.inner) + 1)
        return tuple([*self.rules.near(self.network.scene, count)] for count in counts)

    @cached_property
    def _loose(self) -> tuple[list[list[int]], ...]:
        """By brick count the parts without joints to the ground: indices in build order."""
        since = self.network.scene.since
        parts = ((), *(islands(self.network, count + 1) for count in range(max(self._span))))
        return tuple([[since[name] - 1 for name in part] for part in level] for level in parts)

    def _takes(self, states: Ints, nodes_of: Sequence[Ints]) -> Moves:
        """Return the moves in which a free robot grips one of the given nodes of its kind."""
        parts = []
        for (first, end), nodes in zip(self.slots, nodes_of, strict=True):
            slots = range(first, end) if self.parks else [end - 1]  # entries are sorted
            step = max(1, _PAIRS // max(1, len(nodes)))
            for slot in slots if len(nodes) else ():
                free = states[:, slot] <= 0
                if slot > first and self.parks:  # one of two that stay at one node
                    free &= states[:, slot] != states[:, slot - 1]
                rows = np.flatnonzero(free)
                for start in range(0, len(rows), step):
                    block = rows[start : start + step]
                    moves = self._grip_pairs(states[block], slot, nodes)
                    sort_entries(moves.states, first, end)
                    parts.append(Moves(block[moves.source], moves.states, moves.way))
        return _join_moves(parts, states)

    def _grip_pairs(self, states: Ints, slot: int, nodes: Ints) -> Moves:
        """Return the moves in which the robot of a column, free in all states, grips a node."""
        held = states[:, : self.robots].clip(min=0)
        taken = np.zeros((len(states), int(max(nodes.max() + 1, held.max())) + 1), dtype=bool)
        for nodes_held in held.T:
            taken[np.arange(len(states)), nodes_held] = True
        source, node = np.nonzero(~taken[:, nodes + 1])
        number = nodes[node] + 1
        new, way = states[source], np.zeros(len(source))
        if self.parks:
            last = -new[:, slot].astype(np.int64)
            way = np.linalg.norm(self._at[last] - self._at[number], axis=1) * (last > 0)
        new[:, slot] = number
        return Moves(source, new, way)

    def _lawful_only(self, bricks: int, moves: Moves) -> Moves:
        ok = self.lawful(bricks, moves.states) & self.for_arms(bricks, moves.states)
        return Moves(moves.source[ok], moves.states[ok], moves.way[ok])


def _follow(
    robots: Sequence[int],
    entries: Sequence[int],
    grips: list[int | None],
    stays: dict[int, int],
    numbers: Sequence[int | None],
) -> bool:
    """Assign robots of a kind to the nodes of their entries; return whether one took a grip."""
    wanted = {numbers[n]: n for n in entries if n > 0}
    left = [-n for n in entries if n <= 0]
    for robot in robots:
        if grips[robot] is not None and grips[robot] not in wanted:
            grips[robot] = None
    fresh = [node for node in wanted if node not in [grips[robot] for robot in robots]]
    for node in fresh:
        free = [robot for robot in robots if grips[robot] is None]
        if not free:
            raise SolverError(f"node {node} is held in a state, and no robot is free to hold it")
        for robot in reversed(free):
            if stays.get(robot, 0) in left and len(free) > 1:  # it is seen to stay free
                left.remove(stays.get(robot, 0))
                free = [r for r in free if r != robot]
        grips[free[0]], stays[free[0]] = node, wanted[node]
    return bool(fresh)


@dataclass(frozen=True, eq=False, repr=False)
class _TakeDownSpace(FreeSpace):
    """The states of a take-down: those of building, with moves that remove bricks."""

    def __post_init__(self) -> None:
        super().__post_init__()
        whole, left = self._span  # each removed brick leads to the next level
        # level 0 is the empty site of builds, before which there is nothing to do
        settle(self, first=1, levels=1 + whole - left, _bricks=range(1 + whole, -1, -1))

    def steps_to_go(self, level: int, states: Ints) -> Floats:
        """Return lower bounds of steps to an end: bricks are gripped before removal."""
        removed = self.levels - level
        return removed + np.maximum(0.0, removed - self.grips(states))

    def onward(self, level: int, states: Ints) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves in which the only robot that holds the newest brick removes it."""
        bricks = self.bricks_at(level)
        held = states[:, : self.robots].astype(np.int64)
        may = (held + 1) // 2 == bricks
        may[may.sum(axis=1) != 1] = False
        for kind, (first, end) in zip(self.kinds, self.slots, strict=True):
            own = slice(first, end)
            may[:, own] &= kind.places[bricks - 1] & kind.newest[held[:, own].clip(min=1) - 1]
        moves = self._lets_go(states, may)
        moves.states[:, self.robots :] = 0
        return ((self._lawful_only(bricks - 1, moves) if bricks > 1 else moves, False),)


def free_space(
    network: Network,
    rules: FreeRules,
    caps: Mapping[str, float] | None = None,
    *,
    parks: bool = False,
    timed: bool = False,
    worlds: Sequence[Scene] = (),
) -> FreeSpace:
    """Return the state space of a free schedule, its robots by kind, in the order of their first.

    ``caps``: force limits of grips besides payloads, by robot, N; ``parks``: whether states track
    the positions of free robots, for their travel; ``timed``: whether robots of a kind must have
    equal durations; ``worlds``: scenes of scenarios, in which robots must carry their bricks too.
    """
    scene, kept = network.scene, rules.payload is Payload.KEPT
    alike: dict[tuple[object, ...], RobotKind] = {}
    for i in rules.team(scene):
        robot = scene.robots[i]
        reach = np.isin(scene.placed_nodes, [*chain.from_iterable(scene.within_reach(robot))])
        newest = reach if rules.newest is not Newest.PLACING else np.zeros_like(reach)
        for k, brick in enumerate(scene.placed if newest is not reach else ()):
            with suppress(StepError):  # it reaches none
                newest[2 * k + brick.nodes.index(placing_node(network, robot, brick))] = True
        places = can_carry((scene, *worlds), i) if kept else np.ones(len(scene.placed), dtype=bool)
        places &= not rules.placers or robot.name in rules.placers
        cap = min(robot.payload if kept else np.inf, (caps or {}).get(robot.name, np.inf))
        alone = (robot.arm and robot.name, scene.grip_kinds.of_robot[i], timed and robot.durations)
        key = (reach.tobytes(), newest.tobytes(), places.tobytes(), cap, *alone)
        first = alike.setdefault(key, RobotKind((), reach, newest, places, cap))
        alike[key] = replace(first, robots=(*first.robots, i))
    space = _TakeDownSpace if rules.takes_down else FreeSpace
    return space(network, rules.in_scene(scene), tuple(alike.values()), parks)


@dataclass(frozen=True, eq=False, repr=False)
class ScheduleSpace(StateRows):
    """The states of a schedule and the moves between them; a level for every step."""

    network: Network
    rules: Schedule  # whose open grips are to be chosen
    caps: Mapping[str, float]  # largest forces of robots' grips, by their names, N
    parks: bool = False  # free robots stay where they were, for their travel
    worlds: tuple[Scene, ...] = ()  # of scenarios, in which robots must carry their bricks as well

    def __post_init__(self) -> None:
        every, robots = np.ones(2 * len(self.network.inner), dtype=bool), self.network.scene.robots
        caps = [self.caps.get(robot.name, np.inf) for robot in robots]
        # a kind per robot: they are not interchangeable, steps say who carries
        kinds = tuple(RobotKind((i,), every, every, every[::2], c) for i, c in enumerate(caps))
        settle(self, kinds=kinds)
        super().__post_init__()
        steps = self.rules.steps  # a level for each, and one before the first
        bare, bricks = not any(g is not None for g in steps[-1].grips), (s.bricks for s in steps)
        settle(self, first=0, levels=len(steps), ends_bare=bare, _bricks=(0, *bricks))

    def steps_to_go(self, level: int, states: Ints) -> Floats:
        """Return the number of steps to the end, (n,)."""
        return np.full(len(states), float(self.levels - level))

    def may_place(self, level: int, states: Ints) -> Bools:
        """Return from which states the next step is feasible: all, (n,)."""
        return np.ones(len(states), dtype=bool)

    @cached_property
    def _too_heavy(self) -> frozenset[int]:
        """Numbers of the steps in which a brick exceeds the payload of its robot."""
        scene = self.network.scene
        able = [can_carry((scene, *self.worlds), robot) for robot in range(self.robots)]
        every = carried(scene, self.rules.steps)
        return frozenset(c.step for c in every if not able[c.robot][scene.since[c.brick] - 1])

    def start(self) -> Ints:
        """Return the initial state, (1, robots) int."""
        return np.zeros((1, self.robots), dtype=np.int32)

    def within(
        self, level: int, states: Ints, *, regrips: bool = True
    ) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves that stay in a step: there are none."""
        return ()

    def onward(self, level: int, states: Ints) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves to the next step, and whether they are regrips."""
        step = self.rules.steps[level]
        before = self.rules.steps[level - 1].grips if level else (None,) * self.robots
        after, fresh = states.copy(), []
        for robot, grip in enumerate(step.grips):
            if grip is None:
                after[:, robot] = -np.abs(states[:, robot]) if self.parks else 0
            elif not isinstance(grip, OpenGrip):
                after[:, robot] = self._place[grip]
            elif before[robot] != grip:
                open_to = self.rules.moves[grip.move].candidates
                fresh.append((robot, [self._place[node] for node in open_to]))
        grids = np.meshgrid(*(places for _, places in fresh), indexing="ij")
        count = prod(len(places) for _, places in fresh)
        source, after = (np.repeat(rows, count, axis=0) for rows in (np.arange(len(states)), after))
        for (robot, _), places in zip(fresh, grids, strict=True):
            after[:, robot] = np.tile(places.ravel(), len(states))
        kept = self._possible(step, after) & (step.number not in self._too_heavy)
        source, after = source[kept], after[kept]
        way, came = np.zeros(len(source)), states[source]
        if self.parks:
            gone = (after > 0) & (after != came) & (came != 0)
            moved = self._at[np.abs(after)] - self._at[np.abs(came)]
            way = (np.linalg.norm(moved, axis=2) * gone).sum(axis=1)
        return ((Moves(source, after, way), step.kind is StepKind.REPOSITION),)

    def _possible(self, step: OpenStep, states: Ints) -> Bools:
        """Return in which states (n, c) of a step every robot has a node of its own, (n,)."""
        held = self.held(states)
        each = ~((held[:, 1:] == held[:, :-1]) & (held[:, 1:] > 0)).any(axis=1)
        return np.asarray(each & self.for_arms(step.bricks, states))

    def open_columns(self, level: int) -> tuple[int, ...]:
        step = self.rules.steps[level - 1] if level else None
        return () if step is None else tuple(step.grips.index(OpenGrip(m)) for m in step.moves)

    def candidates(self, level: int, beside: Ints | None = None) -> Candidates:
        """Return the choices of the grips that are open at a level.

        ``beside`` (robots,): a state whose grips are given, but for the one decided last.
        """
        step, columns = self.rules.steps[level - 1], self.open_columns(level)
        columns = columns if beside is None else columns[-1:]
        moves = [self.rules.moves[m] for m in step.moves[-len(columns) :]]
        places = tuple(np.array([self._place[n] for n in move.candidates]) for move in moves)
        grid = np.meshgrid(*places, indexing="ij")
        states: Ints = np.tile(self._given(step) if beside is None else beside, (grid[0].size, 1))
        states[:, columns] = np.stack([each.ravel() for each in grid], axis=1)
        possible = self._possible(step, states)
        shaped = possible.reshape(grid[0].shape)
        return Candidates(columns, places, states[possible], shaped)

    def _given(self, step: OpenStep) -> Ints:
        """Return the state (1, robots) of a step's given grips, zeros of others."""
        own = [0 if isinstance(grip, OpenGrip) else self._place.get(grip, 0) for grip in step.grips]
        return np.array([own], dtype=np.int32)

    def decided_by(self, level: int) -> Move:
        """Return the move that decides a level: the last of those that are open in it."""
        return self.rules.moves[self.rules.steps[level - 1].moves[-1]]

    def without_choice(self) -> Iterator[tuple[int, Ints]]:
        """Yield the levels, last first, of steps without an open grip, and their state (1, r)."""
        for level, step in reversed([*enumerate(self.rules.steps, start=1)]):
            if not step.moves:
                yield level, self._given(step)

    def ended(self, states: Ints) -> Bools:
        """Return which states of the last step end the build: all, (n,)."""
        return np.ones(len(states), dtype=bool)

    def steps(self, states: Sequence[Sequence[int]]) -> tuple[Step, ...]:
        """Return the checked steps of states, one for each of the schedule; as of free rules."""
        rows = np.array([row[1:] for row in states if len(row) == self.robots + 1], dtype=np.int64)
        if len(rows) != self.levels or [row[0] for row in states] != [*range(1, self.levels + 1)]:
            raise SolverError("the states are none of this schedule: it has one for every step")
        if np.abs(rows).max() > 2 * len(self.network.inner):
            raise SolverError("a state of a schedule holds a node that does not exist")
        numbers = np.array([None, *self.network.scene.placed_nodes])
        grips = numbers[rows.clip(min=0)].tolist()
        steps = [
            Step(s.number, s.kind, s.bricks, tuple(nodes))
            for s, nodes in zip(self.rules.steps, grips, strict=True)
        ]
        return check_sequence(self.network.scene, steps)
