"""What may follow from many states of a free schedule at once, looked up in a book of rules.

The book says in plain words which nodes a robot may hold and what a state must keep to; here its
words are tables. A state is a row: the place in build order of the node that each robot of the team
holds, from 1, zero for a robot that is free, or where travel counts the place that it held last
with a minus; then how many grips were taken since the last brick where that counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.network.network import Network
from seqopt.scene._armed import posture_rules
from seqopt.scene.scene import Scene
from seqopt.sequence._rule_check import RuleBook, unbearable
from seqopt.sequence.rules import Ending, Newest
from seqopt.sequence.schedule import Hold, Schedule, holds, islands
from seqopt.sequence.steps import StepKind

PAIRS = 1_000_000  # of states and places that are looked at together


class Follows(NamedTuple):
    """What follows from states by steps of one kind.

    ``level``: how many bricks stand then, or steps of a schedule were taken; ``source`` (m,): the
    row of the state before; ``states`` (m, c): some of them more than once; ``regrip``: whether a
    grip is taken on a brick that stands; ``way`` (m,): how far the robot goes that takes a grip, m.
    """

    level: int
    source: Ints
    states: Ints
    regrip: bool
    way: Floats


class _Places(NamedTuple):
    """Places that count with so many bricks: lists by robot, and rows over places."""

    reach: list[list[int]]  # that robots may take hold of
    newest: list[list[int]]  # at which they hold the newest brick
    holds: Bools  # the same as rows
    parts: list[Bools]  # of bricks that nothing ties to the ground


class RuleTables:
    """A book of rules for many states at once.

    ``groups``: robots that could change places, by their indices: of these the entries are sorted;
    ``parks``: whether it counts where a free robot was last.
    """

    def __init__(
        self, book: RuleBook, groups: Sequence[tuple[int, ...]], *, parks: bool = False
    ) -> None:
        scene = book.network.scene
        self._rules, placed = book.rules.begun(scene), scene.placed
        (self.first, self.last), self._parks = book.span, parks
        self._top = 0  # of a take-down: one more than the bricks at its begin, which is level 1
        if self._rules.takes_down:
            self._top = self.first + 1
            self.first, self.last = 1, self._top - self.last
        at = [brick.node_position(node) for brick in placed for node in brick.nodes]
        self._at = np.array([[np.nan] * 3, *at])
        self.nodes = np.array([-1, *(node for brick in placed for node in brick.nodes)])
        place = {node: i for i, node in enumerate(self.nodes.tolist())}
        self._groups = [[book.team.index(r) for r in group] for group in groups]
        self._book, self._place = book, place
        self._least = self._rules.fewest_grips(scene)
        holders = [prop.node for prop in book.network.scene.props]
        self._propped = np.isin(self.nodes, holders)  # of places; none of a node that is none
        self._postures = posture_rules(book.network.scene, book.team)
        self._known: dict[int, _Places] = {}

    def _of(self, bricks: int) -> _Places:
        """Return the places that count with so many bricks, looked up once."""
        if bricks not in self._known:
            book, robots = self._book, range(self.robots)
            reach = [[self._place[n] for n in book.takes[r, bricks]] for r in book.team]
            newest = [
                [self._place[n] for n in (book.newest_nodes[r, bricks] if bricks else ())]
                for r in book.team
            ]
            holds = np.zeros((self.robots, len(self.nodes)), dtype=bool)
            for robot in robots:
                holds[robot, newest[robot]] = True
            owner, parts = book.network.scene.brick_of_node, []
            for part in islands(book.network, bricks) if bricks else ():
                own = [n >= 0 and owner[n].name in part for n in self.nodes.tolist()]
                parts.append(np.array(own))
            self._known[bricks] = _Places(reach, newest, holds, parts)
        return self._known[bricks]

    @property
    def team(self) -> tuple[int, ...]:
        """Indices of the robots of the columns."""
        return self._book.team

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Columns of robots that could change places; those of others alone."""
        alone = {*range(self.robots)} - {column for group in self._groups for column in group}
        return (*(tuple(group) for group in self._groups), *((column,) for column in sorted(alone)))

    @property
    def robots(self) -> int:
        """How many robots take part."""
        return len(self.team)

    def start(self) -> Ints:
        """Return the state (1, c) in which the build begins."""
        limited = self._rules.regrips is not None
        out: Ints = np.zeros((1, self.robots + limited), dtype=np.int32)
        _, held, regrips = self._book.start
        out[0, : self.robots] = [0 if held[r] is None else self._place[held[r]] for r in self.team]
        out[0, self.robots :] = min(regrips, self._rules.regrips or 0)
        stays = self._rules.begin.stays if self._rules.begin and self._parks else ()
        for column, robot in enumerate(self.team if stays else ()):
            node = stays[robot]
            if held[robot] is None and node is not None:
                out[0, column] = -self._place[node]
        return self.in_order(out)

    def bricks_at(self, level: int) -> int:
        """Return how many bricks stand on a level."""
        return self._top - level if self._top else level

    def follow(self, level: int, states: Ints) -> Iterator[Follows]:
        """Yield what follows from states (n, c) by one step each, of those that the rules allow."""
        rows, bricks = np.arange(len(states)), self.bricks_at(level)
        keeps = rows[self.keep(bricks, states)] if bricks else rows
        begins = (
            self._rules.begin is not None and level == self.first and not self._is_let_go(level)
        )
        able = rows if begins else keeps
        if bricks and self._rules.regrips is not None:
            able = able[states[able, -1] < self._rules.regrips]
        for robot in self._takers() if bricks else ():
            source, after, way = self._taken(states, able, robot, self._of(bricks).reach[robot])
            after[:, self.robots :] += 1
            ok = self._postures.allow(bricks, after)
            held = self.in_order(after[ok])
            yield Follows(level, source[ok], held, regrip=True, way=way[ok])
        for source, after in self._released(level, states):
            none = np.zeros(len(source))
            yield Follows(level, source, self.in_order(after), regrip=False, way=none)
        if level == self.last:
            return
        if self._top:
            yield from self._removed(level, states, keeps)
            return
        for robot in self._takers():
            if self._book.places(self.team[robot], bricks + 1):
                newest = self._of(bricks + 1).newest[robot]
                source, after, way = self._taken(states, keeps, robot, newest)
                after[:, self.robots :] = 0
                ok = self.keep(bricks + 1, after) & self._postures.allow(bricks + 1, after)
                placed = self.in_order(after[ok])
                yield Follows(bricks + 1, source[ok], placed, regrip=False, way=way[ok])

    def _removed(self, level: int, states: Ints, rows: Ints) -> Iterator[Follows]:
        """Yield what follows where a robot takes the newest brick away that it alone holds."""
        bricks = self.bricks_at(level)
        brick = (2 * bricks - 1, 2 * bricks)  # places of its nodes
        holders = np.isin(states[rows, : self.robots], brick).sum(axis=1)
        rows = rows[holders == 1]
        for robot in range(self.robots):
            if not self._book.places(self.team[robot], bricks):
                continue
            source = rows[np.isin(states[rows, robot], self._of(bricks).newest[robot])]
            after = states[source]
            after[:, robot] = -after[:, robot] if self._parks else 0
            after[:, self.robots :] = 0
            if bricks > 1:
                ok = self.keep(bricks - 1, after) & self._postures.allow(bricks - 1, after)
                source, after = source[ok], after[ok]
            none = np.zeros(len(source))
            yield Follows(level + 1, source, self.in_order(after), regrip=False, way=none)

    def _taken(
        self, states: Ints, rows: Ints, robot: int, places: Sequence[int]
    ) -> tuple[Ints, Ints, Floats]:
        """Return what follows where a free robot took one of the places that nobody holds."""
        free = rows[states[rows, robot] <= 0]
        wanted, step = np.array(places, dtype=np.int64), max(1, PAIRS // max(1, len(places)))
        parts = [(free[:0], states[:0], np.zeros(0))]
        for start in range(0, len(free) if len(wanted) else 0, step):
            block = free[start : start + step]
            held = states[block, : self.robots, None] == wanted
            row, at = np.nonzero(~held.any(axis=1))
            source, after = block[row], states[block[row]]
            way = np.zeros(len(row))
            if self._parks:  # who held nothing yet comes from nowhere: that is no way
                between = self._at[-after[:, robot]] - self._at[wanted[at]]
                way = np.nan_to_num(np.linalg.norm(between, axis=1))
            after[:, robot] = wanted[at]
            parts.append((source, after, way))
        source, after, way = map(np.concatenate, zip(*parts, strict=True))
        return source, after, way

    def _takers(self) -> Iterator[int]:
        """Yield the robots of which one could take a grip: of a group the last, if it is free."""
        first = {robot for group in self._groups for robot in group[:-1] if not self._parks}
        yield from (robot for robot in range(self.robots) if robot not in first)

    def _released(self, level: int, states: Ints) -> Iterator[tuple[Ints, Ints]]:
        """Yield the states after one robot let go, or at the end all, and those before."""
        bricks = self.bricks_at(level)
        ending = self._rules.how_it_ends
        for robot in range(self.robots):
            source = np.flatnonzero(states[:, robot] > 0)
            after = states[source]
            after[:, robot] = -after[:, robot] if self._parks else 0
            if not self._is_let_go(level):
                ok = self.keep(bricks, after)
                source, after = source[ok], after[ok]
            yield source, after
        if level == self.last and ending is Ending.RELEASED:
            source = np.flatnonzero((states[:, : self.robots] > 0).any(axis=1))
            after = states[source]
            after[:, : self.robots] = 0
            yield source, after

    def _is_let_go(self, level: int) -> bool:
        """Return whether robots let go one by one there, whatever else the rules say, and only so.

        Who stands there against the rules has begun to let go.
        """
        return level == self.last and self._rules.how_it_ends is Ending.ONE_BY_ONE

    def certain(self) -> Iterator[tuple[int, Ints]]:
        """Yield the level and the places held (1, robots) in states that every build passes."""
        if self._rules.how_it_ends is not Ending.HELD:
            yield self.last, np.zeros((1, self.robots), dtype=np.int64)

    def least_steps(self) -> int:
        """Return how many steps a build has at least.

        Each brick is placed by a robot that is free, so that others let go before, one in a step,
        of all that it is not holding at the end: there they let go together, one by one or never.
        Each brick is removed by a robot that took hold of it in a step, or holds it at first.
        """
        ending, placed = self._rules.how_it_ends, self.last - self.first
        held = int(np.count_nonzero(self.start()[:, : self.robots] > 0))
        if self._top:
            return max(placed, 2 * placed - held)
        kept = min(self.robots, placed + held) if ending is not Ending.ONE_BY_ONE else 0
        return 2 * placed + held - kept + (ending is Ending.RELEASED)

    def keep(self, bricks: int, states: Ints) -> Bools:
        """Return which states (n, c) keep the rules as long as the build goes on, from 1 brick."""
        ok = self._keep(bricks, states, self._propped)
        if bricks == self.last and self._propped.any():  # where nobody holds, props are struck
            bare = (states[:, : self.robots] <= 0).all(axis=1)
            ok[bare] = self._keep(bricks, states[bare], np.zeros_like(self._propped))
        return ok

    def _keep(self, bricks: int, states: Ints, props: Bools) -> Bools:
        """Return the same with props at places."""
        grips = states[:, : self.robots].clip(min=0)
        ok = np.ones(len(states), dtype=bool)
        propped = props[: 2 * bricks + 1]
        if bricks > 1:
            ok &= np.count_nonzero(grips, axis=1) + propped.sum() >= self._least
        if self._rules.newest is not Newest.FREE and not propped[-2:].any():
            ok &= self._of(bricks).holds[np.arange(self.robots), grips].any(axis=1)
        for part in self._of(bricks).parts:
            if not (part & props).any():
                ok &= part[grips].any(axis=1)
        return ok

    def ends(self, level: int, states: Ints) -> Bools:
        """Return which states (n, c) end the build."""
        if level < self.last:
            return np.zeros(len(states), dtype=bool)
        grips = states[:, : self.robots].clip(min=0)
        if self._rules.how_it_ends is not Ending.HELD:
            return np.asarray(~grips.any(axis=1))
        site = self._rules.finish
        if site is None or site.grips is None:
            return self.keep(self.bricks_at(level), states)
        wanted = [0 if site.grips[r] is None else self._place[site.grips[r]] for r in self.team]
        both = self.in_order(np.concatenate([grips, [wanted]]))
        return np.asarray((both[:-1] == both[-1]).all(axis=1))

    def codes(self, states: Ints) -> Ints:
        """Return a number for every state (n, c) that no other one of its brick count has."""
        shift = len(self.nodes) if self._parks else 0
        bases = [len(self.nodes) + shift] * self.robots + [2 + (self._rules.regrips or 0)]
        weights = np.cumprod([1, *bases[: states.shape[1] - 1]], dtype=np.int64)
        return np.asarray(states @ weights + shift * weights[: self.robots].sum())

    def in_order(self, states: Ints) -> Ints:
        """Sort the entries of robots that could change places in states (n, c); return these."""
        for group in self._groups:
            states[:, group] = np.sort(states[:, group], axis=1)[:, ::-1]
        return states


class ScheduleTables:
    """The holds of a schedule for many states at once.

    ``parks``: whether it counts where a free robot was last; ``worlds``: scenes of scenarios.
    """

    def __init__(
        self,
        schedule: Schedule,
        network: Network,
        *,
        parks: bool = False,
        worlds: tuple[Scene, ...] = (),
    ) -> None:
        scene, self.first = network.scene, 0
        self._heavy = unbearable((scene, *worlds), schedule.steps, schedule.begin)
        self._schedule, self._parks = schedule, parks
        self.last, self.robots = len(schedule.steps), len(scene.robots)
        self._before = schedule.steps[0].number - 1
        self.team = tuple(range(self.robots))
        self.groups = tuple((column,) for column in self.team)
        self.nodes = np.array([-1, *(node for brick in scene.placed for node in brick.nodes)])
        at = [scene.node_position(node) for node in self.nodes[1:].tolist()]
        self._at = np.array([[np.nan] * 3, *at])
        self._place = {node: i for i, node in enumerate(self.nodes.tolist())}
        self._postures = posture_rules(scene, self.team)
        self._holds = {
            (hold.robot, number): hold
            for hold in holds(scene, schedule.steps)
            for number in range(hold.first, hold.last + 1)
        }

    def start(self) -> Ints:
        """Return the state before the first step, (1, robots) int."""
        site, out = self._schedule.begin, np.zeros((1, self.robots), dtype=np.int64)
        for robot, node in enumerate(() if site is None else site.grips or ()):
            stay = site.stays[robot] if site and site.stays and self._parks else None
            if node is not None or stay is not None:
                out[0, robot] = self._place[node] if node is not None else -self._place[stay]
        return out

    def bricks_at(self, level: int) -> int:
        """Return how many bricks stand after so many steps."""
        begin = self._schedule.begin.bricks if self._schedule.begin else 0
        return max((step.bricks for step in self._schedule.steps[:level]), default=begin)

    def follow(self, level: int, states: Ints) -> Iterator[Follows]:
        """Yield what follows from states (n, robots) by the next step, if there is one."""
        number = self._before + level + 1
        if level == self.last or number in self._heavy:
            return
        source, after, way = np.arange(len(states)), states, np.zeros(len(states))
        for robot in range(self.robots):
            source, after, way = self._moved(robot, number, (source, after, way))
        ok = self._postures.allow(self.bricks_at(level + 1), after)
        source, after, way = source[ok], after[ok], way[ok]
        regrip = self._schedule.steps[level].kind is StepKind.REPOSITION
        yield Follows(level + 1, source, after, regrip=regrip, way=way)

    def _moved(
        self, robot: int, number: int, rows: tuple[Ints, Ints, Floats]
    ) -> tuple[Ints, Ints, Floats]:
        """Return rows in which a robot does what it does in a step, after those before it."""
        source, states, way = rows
        hold = self._holds.get((robot, number))
        if hold is not None and hold.first < number:
            return rows
        out = states.copy()
        if hold is None:
            out[:, robot] = -np.abs(states[:, robot]) if self._parks else 0
            return source, out, way
        wanted = self._wanted(hold)
        others = self._held_by_others(states, robot, number)
        row, at = np.nonzero(~(others[:, :, None] == wanted).any(axis=1))
        source, out, way = source[row], states[row], way[row]
        if self._parks:
            between = self._at[np.abs(out[:, robot])] - self._at[wanted[at]]
            way = way + np.nan_to_num(np.linalg.norm(between, axis=1))
        out[:, robot] = wanted[at]
        return source, out, way

    def _held_by_others(self, states: Ints, robot: int, number: int) -> Ints:
        """Return what others hold in a step already: those before it, and who goes on holding."""
        out = np.delete(states, robot, axis=1)
        for column, other in enumerate(r for r in range(self.robots) if r != robot):
            hold = self._holds.get((other, number))
            if hold is None or (other > robot and hold.first == number):
                out[:, column] = 0
        return out

    def _wanted(self, hold: Hold) -> Ints:
        """Return the places that a hold may take."""
        nodes = (hold.node,) if hold.move is None else self._schedule.moves[hold.move].candidates
        return np.array([self._place[node] for node in nodes if node is not None], dtype=np.int64)

    def certain(self) -> Iterator[tuple[int, Ints]]:
        """Yield the level and the places held (1, robots) of steps in which no hold is chosen."""
        for level in range(self.last, 0, -1):
            own = [self._holds.get((robot, self._before + level)) for robot in range(self.robots)]
            if all(hold is None or hold.move is None for hold in own):
                yield level, np.array([[0 if h is None else self._wanted(h)[0] for h in own]])

    def least_steps(self) -> int:
        """Return how many steps a build has."""
        return self.last

    def ends(self, level: int, states: Ints) -> Bools:
        """Return which states (n, robots) end the build: all after the last step."""
        return np.full(len(states), level == self.last)

    def codes(self, states: Ints) -> Ints:
        """Return a number for every state that no other one of its step has, (n,)."""
        base = 2 * len(self.nodes)
        return np.asarray((states + len(self.nodes)) @ base ** np.arange(self.robots))

    def in_order(self, states: Ints) -> Ints:
        """Return states as they are: no two robots could change places."""
        return states
