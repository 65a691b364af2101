"""States of a free schedule, and the moves between them, many at a time.

A state is how many bricks stand and which node every robot holds. States of one brick count are
rows of integers, a column per robot, those of one kind side by side: 0 for a robot that is free, n
for one that holds the n-th node (from 1, brick by brick in build order). Robots of one kind could
change places, so their entries are sorted, largest first. A further column counts the grips
taken since the last brick where a rule limits these. Where travel counts, a free robot stays at
the node that it held last, -n.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints, Terse, frozen
from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.scene.parts import Robot
from seqopt.sequence.rules import Ending, FreeRules, Newest, Payload
from seqopt.sequence.schedule import islands
from seqopt.sequence.two_robots import placing_node


class Moves(NamedTuple):
    """Moves from states of one brick count."""

    source: Ints  # (m,); row of the state that each leads from
    states: Ints  # (m, c); the states that they lead to
    way: Floats  # (m,); how far the robot goes that takes a grip, m; zero where ways do not count


def _grip_pairs(
    states: Ints, slot: int, nodes: Ints, robots_and_ways: tuple[int, Floats | None]
) -> Moves:
    """Return the moves in which the robot of a column takes one of some nodes that nobody holds.

    ``states`` (n, c): in which that robot is free. ``slot``: its column. ``nodes`` (m,): from 0.
    ``robots_and_ways``: how many columns are robots; distances between nodes, (2B + 1, 2B + 1), m,
    or None where ways do not count. Result: the entries of a kind are not sorted.
    """
    robots, distance = robots_and_ways
    taken = np.zeros((len(states), int(max(nodes.max() + 1, states[:, :robots].max())) + 1), bool)
    for column in range(robots):
        taken[np.arange(len(states)), states[:, column].clip(min=0)] = True
    source, node = np.nonzero(~taken[:, nodes + 1])
    number = nodes[node] + 1
    new = states[source]
    way = np.zeros(len(new)) if distance is None else distance[-new[:, slot], number]
    new[:, slot] = number
    return Moves(source, new, way)


def sort_entries(states: Ints, first: int, end: int) -> None:
    """Sort the entries of the robots of a kind, largest first, in place.

    ``states`` (n, c); ``first``, ``end``: its first column, and the one after its last.
    """
    if end - first > 1:
        states[:, first:end] = -np.sort(-states[:, first:end], axis=1)


def _join_moves(parts: Sequence[Moves], states: Ints) -> Moves:
    """Return several moves as one. ``states`` (n, c): that they lead from."""
    none = np.zeros(0, dtype=np.int64)
    whole = [Moves(none, states[:0], np.zeros(0)), *parts]
    return Moves(*map(np.concatenate, zip(*whole, strict=True)))


def number_rows(states: Ints, robots: int, least: int, most: int) -> Ints:
    """Return a number for every state that no other one has.

    ``states`` (n, c): columns after those of robots count first; ``robots``: how many columns are
    robots; ``least``, ``most``: between which their entries are. Result (n,).
    """
    further = states.shape[1] > robots
    out = np.zeros(len(states), dtype=np.int64)
    out += states[:, -1] if further else 0
    for column in range(robots):
        out *= 1 + most - least
        out += states[:, column]
        out -= least
    return np.asarray(out)


@dataclass(frozen=True, eq=False, repr=False)
class RobotKind(FrozenValue):
    """Robots that reach the same nodes, may carry as much, and may place or not.

    Nodes are counted as in ``network.inner.ravel()``: brick by brick in build order.

    ``robots``: indices of the scene's robots; ``reach`` (2B,): nodes that they may hold: within
    reach and not blocked; ``newest`` (2B,): nodes at which they hold a brick when they place it,
    and as the newest one; ``places``: whether they may place; ``cap``: largest force of a grip, N.
    """

    robots: tuple[int, ...]
    reach: Bools
    newest: Bools
    places: bool
    cap: float


def sort_robots(
    network: Network, rules: FreeRules, caps: Mapping[str, float] | None = None
) -> tuple[RobotKind, ...]:
    """Return the robots that take part, sorted by kind.

    ``caps``: largest force of a robot's grip beside its payload, by its name, N. Result: in the
    order of their first robots.
    """
    alike: dict[tuple[object, ...], list[int]] = {}
    parts: dict[tuple[object, ...], RobotKind] = {}
    for i in rules.team(network.scene):
        robot = network.scene.robots[i]
        reach = _reached(network, robot)
        newest = reach if rules.newest is not Newest.PLACING else _placing(network, robot, reach)
        places = not rules.placers or robot.name in rules.placers
        cap = robot.payload if rules.payload is Payload.KEPT else np.inf
        cap = min(cap, (caps or {}).get(robot.name, np.inf))
        key = (reach.tobytes(), newest.tobytes(), places, cap)
        alike.setdefault(key, []).append(i)
        parts.setdefault(key, RobotKind((), reach, newest, places, cap))
    return tuple(
        RobotKind(tuple(robots), parts[key].reach, parts[key].newest, parts[key].places, key[3])  # type: ignore[arg-type]
        for key, robots in alike.items()
    )


def node_numbers(network: Network) -> list[int]:
    """Return the scene's numbers of all inner nodes, brick by brick in build order.

    Result: (2B,).
    """
    return [node for brick in network.scene.placed for node in brick.nodes]


def _reached(network: Network, robot: Robot) -> Bools:
    """Return which nodes a robot may hold: within its reach and not blocked. Result (2B,)."""
    scene = network.scene
    return np.array(
        [
            node not in scene.blocked_nodes and robot.reach.covers(brick.node_position(node))
            for brick in scene.placed
            for node in brick.nodes
        ]
    )


def _placing(network: Network, robot: Robot, reach: Bools) -> Bools:
    """Return at which node a robot places every brick."""
    out = np.zeros_like(reach)
    for k, brick in enumerate(network.scene.placed):
        try:
            out[2 * k + brick.nodes.index(placing_node(network, robot, brick))] = True
        except StepError:  # it reaches none
            continue
    return out


_PAIRS = 4_000_000  # of states and nodes that are looked at together


@dataclass(frozen=True, repr=False)
class FreeSpace(Terse):
    """The states of a free schedule and the moves between them.

    ``kinds``: the robots that take part; ``parks``: whether free robots stay where they were, for
    their travel.
    """

    network: Network
    rules: FreeRules
    kinds: tuple[RobotKind, ...]
    parks: bool = False

    @property
    def robots(self) -> int:
        """How many robots take part."""
        return sum(len(kind.robots) for kind in self.kinds)

    @property
    def bricks(self) -> int:
        """How many bricks there are."""
        return len(self.network.inner)

    @property
    def levels(self) -> int:
        """How many bricks there are: states of one brick count are a level."""
        return self.bricks

    def bricks_at(self, level: int) -> int:
        """Return how many bricks stand on a level."""
        return level

    @property
    def ends_bare(self) -> bool:
        """Whether every build ends in the finished structure that nobody holds."""
        return self.rules.ending is not Ending.HELD

    @property
    def fewest_steps(self) -> int:
        """How many steps a build has at least: all but a grip per robot are let go one by one."""
        if self.rules.ending is Ending.ONE_BY_ONE:
            return 2 * self.bricks
        return max(self.bricks, 2 * self.bricks - self.robots) + self.ends_bare

    def within(self, level: int, states: Ints) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves that place no brick, and whether they are regrips."""
        return (self.releases(level, states), False), (self.holds(level, states), True)

    def onward(self, level: int, states: Ints) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves that place the next brick: none of them is a regrip."""
        return ((self.places(level, states), False),)

    @cached_property
    def slots(self) -> tuple[tuple[int, int], ...]:
        """First column of every kind, and the one after its last."""
        ends = np.cumsum([len(kind.robots) for kind in self.kinds]).tolist()
        return tuple(zip([0, *ends[:-1]], ends, strict=True))

    @cached_property
    def _counts(self) -> bool:
        return self.rules.regrips is not None

    @cached_property
    def _distance(self) -> Floats:
        """Distances of nodes, (2B + 1, 2B + 1), m; none from or to node 0."""
        at = self.network.node_position[self.network.inner.ravel()]
        out = np.zeros((len(at) + 1,) * 2)
        out[1:, 1:] = np.linalg.norm(at[:, None] - at[None], axis=2)
        return frozen(out)

    def start(self) -> Ints:
        """Return the one state before the first brick.

        Result (1, c): of the smallest type that holds every node: there may be tens of millions of
        states.
        """
        kind = np.min_scalar_type(-max(2 * self.bricks, self.rules.regrips or 0) - 1)
        return np.zeros((1, self.robots + self._counts), dtype=kind)

    def codes(self, states: Ints) -> Ints:
        """Return a number for every state that no other one of its brick count has.

        ``states`` (n, c). Result (n,).
        """
        last = 2 * self.bricks
        return number_rows(states, self.robots, -last if self.parks else 0, last)

    def held(self, states: Ints) -> Ints:
        """Return which nodes are held, sorted, zeros for robots that are free first.

        ``states`` (n, c). Result (n, robots).
        """
        return np.sort(states[:, : self.robots].clip(min=0), axis=1)

    def grips(self, states: Ints) -> Ints:
        """Return how many grips are held. ``states`` (n, c). Result (n,)."""
        return np.asarray((states[:, : self.robots] > 0).sum(axis=1))

    def places(self, bricks: int, states: Ints) -> Moves:
        """Return the moves that place the next brick; a free robot then holds it.

        ``bricks``: how many bricks stand before; ``states`` (n, c). Result: to lawful states.
        """
        nodes = np.array([2 * bricks, 2 * bricks + 1])
        parts = []
        for k, kind in enumerate(self.kinds):
            if kind.places:
                parts += self._take(k, states, nodes[kind.newest[nodes]])
        moves = _join_moves(parts, states)
        if self._counts:
            moves.states[:, -1] = 0
        return self._lawful_only(bricks + 1, moves)

    def holds(self, bricks: int, states: Ints) -> Moves:
        """Return the moves in which a free robot takes a grip on a brick that stands.

        ``states`` (n, c). Result: to lawful states, as many of them as rules allow.
        """
        able = self.lawful(bricks, states)
        if self.rules.regrips is not None:
            able &= states[:, -1] < self.rules.regrips
        rows = np.flatnonzero(able)
        parts, near = [], self._near(bricks)
        for k, kind in enumerate(self.kinds):
            parts += self._take(k, states[rows], near[kind.reach[near]])
        moves = _join_moves(parts, states)
        if self._counts:
            moves.states[:, -1] += 1
        return Moves(rows[moves.source], moves.states, moves.way)

    def releases(self, bricks: int, states: Ints) -> Moves:
        """Return the moves in which one robot lets go, or at the end all do.

        ``states`` (n, c). Result: to lawful states, and at the last brick to those that the rules'
        ending allows.
        """
        parts = []
        for first, end in self.slots:
            for slot in range(first, end):
                rows = np.flatnonzero(states[:, slot] > 0)
                new = states[rows]
                new[:, slot] = -new[:, slot] if self.parks else 0
                sort_entries(new, first, end)
                parts.append(Moves(rows, new, np.zeros(len(rows))))
        moves = _join_moves(parts, states)
        if bricks < self.bricks or self.rules.ending is not Ending.ONE_BY_ONE:
            moves = self._lawful_only(bricks, moves)
        if bricks < self.bricks or self.rules.ending is Ending.HELD:
            return moves
        return self._let_go(bricks, states, moves)

    def lawful(self, bricks: int, states: Ints) -> Bools:
        """Return which states keep the rules as long as the build goes on.

        ``states`` (n, c). Result (n,).
        """
        held = states[:, : self.robots]
        ok = np.asarray(self.grips(states) >= (self.rules.least_grips if bricks > 1 else 0))
        if self.rules.newest is not Newest.FREE:
            nodes = 2 * bricks + np.array([-1, 0])
            newest = np.zeros(len(states), dtype=bool)
            for kind, (first, end) in zip(self.kinds, self.slots, strict=True):
                for node in nodes[kind.newest[nodes - 1]]:
                    newest |= (held[:, first:end] == node).any(axis=1)
            ok &= newest
        for bricks_of in self._loose[bricks]:
            ok &= np.isin((held - 1) // 2, bricks_of).any(axis=1)
        return ok

    def ended(self, states: Ints) -> Bools:
        """Return which states with all bricks end the build. ``states`` (n, c). Result (n,)."""
        if self.rules.ending is Ending.HELD:
            return self.lawful(self.bricks, states)
        return np.asarray((states[:, : self.robots] <= 0).all(axis=1))

    def _let_go(self, bricks: int, states: Ints, moves: Moves) -> Moves:
        """Return the moves and those in which all let go; who lets go forgets where it was."""
        if self.rules.ending is Ending.RELEASED:
            rows = np.flatnonzero((states[:, : self.robots] > 0).any(axis=1))
            none = states[rows]
            none[:, : self.robots] = 0
            parts = [moves, Moves(rows, none, np.zeros(len(rows)))]
            moves = _join_moves(parts, states)
        bare = (moves.states[:, : self.robots] <= 0).all(axis=1)
        moves.states[bare, : self.robots] = 0
        return moves

    def _near(self, bricks: int) -> Ints:
        """Return the nodes of bricks that stand that may be taken hold of, from 0."""
        if not self.rules.candidates:
            return np.arange(2 * bricks)
        if bricks not in self._near_of:
            near = self.rules.near(self.network.scene, bricks)
            numbers = node_numbers(self.network)[: 2 * bricks]
            self._near_of[bricks] = np.flatnonzero([node in near for node in numbers])
        return self._near_of[bricks]

    @cached_property
    def _near_of(self) -> dict[int, Ints]:
        return {}

    @property
    def _free_grips(self) -> tuple[int, Floats | None]:
        """How many columns are robots, and distances where ways count."""
        return self.robots, self._distance if self.parks else None

    @cached_property
    def _loose(self) -> tuple[list[list[int]], ...]:
        """By brick count the parts that no joint ties to the ground: places in build order."""
        at = {brick.name: i for i, brick in enumerate(self.network.scene.placed)}
        counts = range(1, self.bricks + 1)
        parts = ((), *(islands(self.network, count) for count in counts))
        return tuple([[at[name] for name in part] for part in level] for level in parts)

    def _take(self, k: int, states: Ints, nodes: Ints) -> list[Moves]:
        """Return the moves in which a free robot of a kind takes one of some nodes."""
        first, end = self.slots[k]
        slots = range(first, end) if self.parks else [end - 1]  # entries are sorted
        step = max(1, _PAIRS // max(1, len(nodes)))
        parts = []
        for slot in slots if len(nodes) else ():
            free = states[:, slot] <= 0
            if slot > first and self.parks:  # one of two that stay at one node
                free &= states[:, slot] != states[:, slot - 1]
            rows = np.flatnonzero(free)
            for start in range(0, len(rows), step):
                block = rows[start : start + step]
                moves = _grip_pairs(states[block], slot, nodes, self._free_grips)
                sort_entries(moves.states, first, end)
                parts.append(Moves(block[moves.source], moves.states, moves.way))
        return parts

    def _lawful_only(self, bricks: int, moves: Moves) -> Moves:
        ok = self.lawful(bricks, moves.states)
        return Moves(moves.source[ok], moves.states[ok], moves.way[ok])


def free_space(
    network: Network,
    rules: FreeRules,
    caps: Mapping[str, float] | None = None,
    *,
    parks: bool = False,
) -> FreeSpace:
    """Return the states of a free schedule in a scene.

    ``caps``: largest force of a robot's grip beside its payload, by its name, N; ``parks``: whether
    free robots stay where they were, for their travel. Raises `StepError` if robots do not fit the
    rules, or states cannot be numbered.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> space = free_space(network, FreeRules())
    >>> space.places(0, space.start()).states.tolist()  # node 0 of its first brick is blocked
    [[2, 0, 0], [0, 2, 0], [0, 0, 2]]
    """
    space = FreeSpace(network, rules, sort_robots(network, rules, caps), parks)
    base = 1 + (2 if parks else 1) * 2 * space.bricks
    if base**space.robots * (1 + (rules.regrips or 0)) >= 2**62:
        raise StepError(
            f"scene {network.scene.name}: {space.bricks} bricks and {space.robots} robots have "
            "more states than can be numbered; let fewer robots take part"
        )
    return space
