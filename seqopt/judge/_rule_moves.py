"""Successors of many states at once, by the second book of rules as tables.

The book says in plain words which nodes a robot may hold and what a state must keep to. A state is
a row: the place in build order of the node that each robot of the team holds, from 1; zero for a
robot that is free, or minus the place that it held last, where travel counts; then how many grips
were taken since the last brick, where that counts.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from math import prod
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.problem.problem import Orders
from seqopt.scene.scene import Scene, _posture_rules
from seqopt.sequence.rules import Ending, FreeRules, Newest, Payload, _RuleBook, _unbearable
from seqopt.sequence.schedule import Hold, Schedule, holds, islands
from seqopt.sequence.steps import Grips, Step, StepKind

PAIRS = 1_000_000  # pairs of a state and a place in one chunk


class Transitions(NamedTuple):
    """Successors of states by steps of one kind.

    ``level``: how many bricks stand then, or steps of a schedule were taken; ``source`` (m,): row
    of the state before; ``states`` (m, c): not all different; ``regrip``: whether a grip is taken
    on a brick that stands; ``distance`` (m,): how far the robot goes that takes a grip, m.
    """

    level: int
    source: Ints
    states: Ints
    regrip: bool
    distance: Floats


class Choices(NamedTuple):
    """All choices of the grips that are open in a step: by whom, and how many of each.

    ``states`` (n, c): of the possible ones; ``possible``: which these are of all, in the shape of
    ``sizes``; ``moves``: robots that choose, in the order of their moves; ``decided_at``: bricks
    that stand at the last of these.
    """

    bricks: int
    states: Ints
    possible: Bools
    moves: tuple[int, ...]
    sizes: tuple[int, ...]
    decided_at: int

    def spread(self, values: Floats) -> Floats:
        """Return values (n,) in the shape of all choices; NaN of those that are impossible."""
        out = np.full(self.possible.shape, np.nan)
        out[self.possible] = np.where(np.isfinite(values), values, np.nan)
        return out


class _Tables:
    """Places of nodes, and the checks of rows of them that rules and schedules share.

    ``nodes`` (p,): by place; -1 of none; ``team``: robots of the columns, by index; ``robots``: how
    many; ``groups``: those that could change places, by index: their entries are sorted;
    ``parks``: whether it counts where a free robot was last.
    """

    def __init__(
        self,
        scene: Scene,
        team: tuple[int, ...],
        groups: Sequence[Sequence[int]] = (),
        *,
        parks: bool,
    ) -> None:
        self.team, self.robots, self._parks = team, len(team), parks
        self._groups = [[team.index(robot) for robot in group] for group in groups]
        nodes = [node for brick in scene.placed for node in brick.nodes]
        self.nodes = np.array([-1, *nodes])
        self._at = np.array([[np.nan] * 3, *(scene.node_position(node) for node in nodes)])
        self._place = {node: place for place, node in enumerate(self.nodes.tolist())}
        self._postures = _posture_rules(scene, team)
        self._shift = len(self.nodes) if parks else 0
        base = len(self.nodes) + self._shift
        self._weights = np.cumprod([1, *[base] * self.robots], dtype=np.int64)

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Columns of robots that could change places; those of others alone."""
        alone = {*range(self.robots)} - {column for group in self._groups for column in group}
        return (*(tuple(group) for group in self._groups), *((column,) for column in sorted(alone)))

    def codes(self, states: Ints) -> Ints:
        """Return a number for every state (n, c) that no other one of its level has, (n,)."""
        weights = self._weights[: states.shape[1]]
        return np.asarray(states @ weights + self._shift * weights[: self.robots].sum())

    def in_order(self, states: Ints) -> Ints:
        """Sort the entries of robots that could change places in states (n, c); return these."""
        for group in self._groups:
            states[:, group] = np.sort(states[:, group], axis=1)[:, ::-1]
        return states

    def row(self, held: Grips, stays: Grips = ()) -> Ints:
        """Return the row (1, robots) of nodes that robots hold, or held last where that counts."""
        out: Ints = np.zeros((1, self.robots), dtype=np.int32)
        for column, robot in enumerate(self.team):
            if (node := held[robot]) is not None:
                out[0, column] = self._place[node]
            elif self._parks and stays and (node := stays[robot]) is not None:
                out[0, column] = -self._place[node]
        return out

    def _take(
        self, states: Ints, rows: Ints, robot: int, wanted: Sequence[int], held: Ints
    ) -> tuple[Ints, Ints, Floats]:
        """Return source, state and distance where a robot takes one of the wanted places.

        ``rows`` (n,): of the states before; ``held`` (n, k): places that others hold by then.
        """
        places, step = np.array(wanted, dtype=np.int64), max(1, PAIRS // max(1, len(wanted)))
        parts = [(rows[:0], states[:0], np.zeros(0))]
        for start in range(0, len(rows), step):
            chunk = slice(start, start + step)
            row, at = np.nonzero(~(held[chunk, :, None] == places).any(axis=1))
            source = rows[chunk][row]
            after, distance = states[source], np.zeros(len(row))
            if self._parks:  # who held nothing yet comes from nowhere: that is no distance
                between = self._at[np.abs(after[:, robot])] - self._at[places[at]]
                distance = np.nan_to_num(np.linalg.norm(between, axis=1))
            after[:, robot] = places[at]
            parts.append((source, after, distance))
        source, after, distance = map(np.concatenate, zip(*parts, strict=True))
        return source, after, distance

    def _let_go(self, states: Ints, column: int) -> Ints:
        """Return states in which a robot has let go."""
        after = states.copy()
        after[:, column] = -np.abs(states[:, column]) if self._parks else 0
        return after


class _Places(NamedTuple):
    """Tables of a brick count.

    ``reach``: by robot, the places that it may take; ``changes``: those at which it may place or
    remove the newest brick; ``newest`` (r, p): whether it holds that brick there; ``loose``: places
    of bricks that nothing ties to the ground, by part.
    """

    reach: list[list[int]]
    changes: list[list[int]]
    newest: Bools
    loose: list[Bools]


class RuleTables(_Tables):
    """A book of rules for many states at once; a level is a brick count."""

    def choices(self, level: int) -> Choices:
        """Raise an error: rules leave no grips of given steps open."""
        raise NotImplementedError

    def __init__(
        self, book: _RuleBook, groups: Sequence[tuple[int, ...]], *, parks: bool = False
    ) -> None:
        scene = book.network.scene
        super().__init__(scene, book.team, groups, parks=parks)
        self._book, self._rules = book, book.rules.in_scene(scene)
        self.first, self.last = book.span
        self._top = 0  # of a take-down: one more than the bricks at its begin, which is level 1
        if self._rules.takes_down:
            self._top = self.first + 1
            self.first, self.last = 1, self._top - self.last
        self._least = self._rules.fewest_grips(scene)
        self._propped = np.isin(self.nodes, [prop.node for prop in scene.props])  # by place
        self._limited = self._rules.regrips is not None
        self._known: dict[int, _Places] = {}

    def _places(self, bricks: int) -> _Places:
        """Return cached tables of so many bricks."""
        if bricks not in self._known:
            book, scene = self._book, self._book.network.scene
            reach, on = (
                [[self._place[n] for n in nodes[r, bricks]] for r in self.team]
                for nodes in (book.takes, book.newest_nodes)
            )
            newest = np.zeros((self.robots, len(self.nodes)), dtype=bool)
            for robot, own in enumerate(on):
                newest[robot, own] = True
            changes = [
                p if book.places(r, bricks) else [] for r, p in zip(self.team, on, strict=True)
            ]
            owners = [0, *(scene.brick_of_node[n].name for n in self.nodes[1:].tolist())]
            loose = [np.isin(owners, [*part]) for part in islands(book.network, bricks)]
            for part in loose:
                part[0] = False
            self._known[bricks] = _Places(reach, changes, newest, loose)
        return self._known[bricks]

    def start(self) -> Ints:
        """Return the state (1, c) in which the build begins."""
        _, held, regrips = self._book.start
        row = self.row(held, self._rules.begin.stays if self._rules.begin else ())
        if self._limited:
            row = np.pad(row, ((0, 0), (0, 1)))
            row[0, -1] = min(regrips, self._rules.regrips or 0)
        return self.in_order(row)

    def bricks_at(self, level: int) -> int:
        """Return how many bricks stand on a level."""
        return self._top - level if self._top else level

    def successors(
        self, level: int, states: Ints, kinds: Collection[StepKind] = tuple(StepKind)
    ) -> Iterator[Transitions]:
        """Yield the successors of states (n, c) that the rules allow, by kind of step."""
        rows, bricks = np.arange(len(states)), self.bricks_at(level)
        # who stands there against the rules has begun to let go, one by one, and may only do that
        lets_go = level == self.last and self._rules.how_it_ends is Ending.ONE_BY_ONE
        keeps = rows[self.keep(bricks, states)] if bricks else rows
        if bricks and StepKind.REPOSITION in kinds:
            begins = self._rules.begin is not None and level == self.first and not lets_go
            able = rows if begins else keeps
            if self._limited:
                able = able[states[able, -1] < self._rules.regrips]
            yield from self._taken(level, states, able, self._places(bricks).reach, regrip=True)
        if bricks and StepKind.RELEASE in kinds:
            yield from self._released(level, states, checked=not lets_go)
        if level < self.last and self._top and StepKind.REMOVE in kinds:
            yield from self._removed(level, states, keeps)
        elif level < self.last and not self._top and StepKind.PLACE in kinds:
            wanted = self._places(bricks + 1).changes
            yield from self._taken(level + 1, states, keeps, wanted, regrip=False)

    def _taken(
        self, level: int, states: Ints, rows: Ints, wanted: Sequence[Sequence[int]], *, regrip: bool
    ) -> Iterator[Transitions]:
        """Yield successors in which a free robot takes one of the places wanted of it.

        Of robots that could change places it is the last, if it is free. ``level``: of the
        successors; ``regrip``: whether the brick stands already; otherwise the robot places it.
        """
        first = {robot for group in self._groups for robot in group[:-1] if not self._parks}
        bricks = self.bricks_at(level)
        takers = [robot for robot in range(self.robots) if robot not in first and wanted[robot]]
        for robot in takers:
            free = rows[states[rows, robot] <= 0]
            held = states[free, : self.robots]
            source, after, distance = self._take(states, free, robot, wanted[robot], held)
            after[:, self.robots :] = after[:, self.robots :] + 1 if regrip else 0
            ok = self._postures.allow(bricks, after)
            if not regrip:
                ok = self.keep(bricks, after) & ok
            yield Transitions(level, source[ok], self.in_order(after[ok]), regrip, distance[ok])

    def _released(self, level: int, states: Ints, *, checked: bool) -> Iterator[Transitions]:
        """Yield successors in which one robot lets go, or at the end all."""
        for robot in range(self.robots):
            source = np.flatnonzero(states[:, robot] > 0)
            after = self._let_go(states[source], robot)
            if checked:
                ok = self.keep(self.bricks_at(level), after)
                source, after = source[ok], after[ok]
            yield self._without_way(level, source, after)
        if level == self.last and self._rules.how_it_ends is Ending.RELEASED:
            source = np.flatnonzero((states[:, : self.robots] > 0).any(axis=1))
            after = states[source]
            after[:, : self.robots] = 0
            yield self._without_way(level, source, after)

    def _removed(self, level: int, states: Ints, keeps: Ints) -> Iterator[Transitions]:
        """Yield successors in which a robot takes the newest brick away that it alone holds."""
        bricks = self.bricks_at(level)
        brick = (2 * bricks - 1, 2 * bricks)  # places of its nodes
        rows = keeps[np.isin(states[keeps, : self.robots], brick).sum(axis=1) == 1]
        for robot, newest in enumerate(self._places(bricks).changes):
            source = rows[np.isin(states[rows, robot], newest)]
            after = self._let_go(states[source], robot)
            after[:, self.robots :] = 0
            if bricks > 1:
                ok = self.keep(bricks - 1, after) & self._postures.allow(bricks - 1, after)
                source, after = source[ok], after[ok]
            yield self._without_way(level + 1, source, after)

    def _without_way(self, level: int, source: Ints, after: Ints) -> Transitions:
        none = np.zeros(len(source))
        return Transitions(level, source, self.in_order(after), regrip=False, distance=none)

    def certain(self) -> Iterator[tuple[int, Ints]]:
        """Yield the level and the places held (1, robots) in states that every build passes."""
        if self._rules.how_it_ends is not Ending.HELD:
            yield self.last, np.zeros((1, self.robots), dtype=np.int64)

    def steps_to_go(self, level: int, states: Ints) -> Floats:
        """Return how many steps builds have at least from states (n, c) on, (n,).

        Each brick is placed by a robot that is free, so that others let go before, one in a step,
        of all that it is not holding at the end: there they let go together, one by one or never.
        Each brick is removed by a robot that took hold of it in a step, or holds it at first.
        """
        ending, placed = self._rules.how_it_ends, float(self.last - level)
        held = np.count_nonzero(states[:, : self.robots] > 0, axis=1)
        if self._top:
            return np.asarray(np.maximum(placed, 2 * placed - held))
        every = placed + held
        kept = 0 if ending is Ending.ONE_BY_ONE else np.minimum(self.robots, every)
        last = (every > 0) & (ending is Ending.RELEASED)
        return np.asarray(placed + every - kept + last)

    def keep(self, bricks: int, states: Ints) -> Bools:
        """Return which states (n, c) keep the rules as long as the build goes on, from 1 brick."""
        return np.asarray(~np.any([*self._broken(bricks, states).values()], axis=0))

    def _broken(self, bricks: int, states: Ints) -> dict[str, Bools]:
        """Return which states (n, c) break which rules, by what they say; the ending apart."""
        grips = np.maximum(states[:, : self.robots], 0)
        count = (grips > 0).sum(axis=1)
        struck = (bricks == self._book.span[1]) & (count == 0)  # where nobody holds, props are
        props = self._propped[: 2 * bricks + 1]
        held = np.where(struck, 0, count + props.sum())
        known = self._places(bricks)
        fewer = f"{held.min(initial=self.robots)} grips, fewer than least_grips={self._least}"
        out = {fewer: held < self._least * (bricks > 1)}
        if self._rules.newest is not Newest.FREE:
            on = known.newest[np.arange(self.robots), grips].any(axis=1) | (
                props[-2:].any() & ~struck
            )
            out[f"nobody holds the newest brick (newest={self._rules.newest.value})"] = ~on
        for k, part in enumerate(known.loose):
            on = part[grips].any(axis=1) | ((part & self._propped).any() & ~struck)
            out[f"part {k + 1} that no joint ties to the ground is held by nobody"] = ~on
        return out

    def fault(self, bricks: int, state: Ints) -> str:
        """Return which rule a state (1, c) breaks, in a few words; empty if none."""
        every = self._broken(bricks, state) if bricks else {}
        held = [self.nodes[place].item() for place in state[0, : self.robots] if place > 0]
        every[f"arms cannot hold {held} together"] = ~self._postures.allow(bricks, state)
        return next((words for words, broken in every.items() if broken[0]), "")

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
        both = self.in_order(np.concatenate([grips, self.row(site.grips)]))
        return np.asarray((both[:-1] == both[-1]).all(axis=1))


class ScheduleTables(_Tables):
    """The holds of a schedule for many states at once; a level is a number of steps.

    ``worlds``: scenes of scenarios.
    """

    def __init__(
        self,
        schedule: Schedule,
        network: Network,
        *,
        parks: bool = False,
        worlds: tuple[Scene, ...] = (),
    ) -> None:
        scene = network.scene
        super().__init__(scene, tuple(range(len(scene.robots))), parks=parks)
        self._schedule, self.first, self.last = schedule, 0, len(schedule.steps)
        self._heavy = _unbearable((scene, *worlds), schedule.steps, None)
        self._holds = {
            (hold.robot, number): hold
            for hold in holds(scene, schedule.steps)
            for number in range(hold.first, hold.last + 1)
        }

    def start(self) -> Ints:
        """Return the state before the first step, (1, robots) int."""
        return self.row((None,) * self.robots)

    def bricks_at(self, level: int) -> int:
        """Return how many bricks stand after so many steps."""
        return max((step.bricks for step in self._schedule.steps[:level]), default=0)

    def successors(self, level: int, states: Ints) -> Iterator[Transitions]:
        """Yield the successors of states (n, robots) by the next step, if there is one."""
        number = level + 1
        if level == self.last or number in self._heavy:
            return
        source, after, distance = np.arange(len(states)), states, np.zeros(len(states))
        now = [self._holds.get((robot, number)) for robot in range(self.robots)]
        for robot, hold in enumerate(now):
            if hold is None:
                after = self._let_go(after, robot)
            elif hold.first == number:
                held = after.copy()  # by others: robots before, and those that go on
                for other, own in enumerate(now):
                    if own is None or (other >= robot and own.first == number):
                        held[:, other] = 0
                rows, wanted = np.arange(len(after)), self._wanted(hold)
                row, after, more = self._take(after, rows, robot, wanted, held)
                source, distance = source[row], distance[row] + more
        ok = self._postures.allow(self.bricks_at(level + 1), after)
        regrip = self._schedule.steps[level].kind is StepKind.REPOSITION
        yield Transitions(level + 1, source[ok], after[ok], regrip, distance[ok])

    def _wanted(self, hold: Hold) -> list[int]:
        """Return the places that a hold may take."""
        nodes = (hold.node,) if hold.move is None else self._schedule.moves[hold.move].candidates
        return [self._place[node] for node in nodes if node is not None]

    def choices(self, level: int) -> Choices:
        """Return what may be chosen in a step, whether or not a build reaches it."""
        bricks, held = self.bricks_at(level), range(self.robots)
        own = {r: h for r in held if (h := self._holds.get((r, level))) is not None}
        wanted = {robot: self._wanted(hold) for robot, hold in own.items()}
        by_move = sorted((h.move, r) for r, h in own.items() if h.move is not None)
        robots = tuple(robot for _, robot in by_move)
        sizes = tuple(len(wanted[robot]) for robot in robots)
        places = np.indices(sizes).reshape(len(sizes), prod(sizes))
        states = np.zeros((places.shape[1], self.robots), dtype=self.start().dtype)
        for robot, of_robot in wanted.items():
            states[:, robot] = of_robot[0]
        for robot, at in zip(robots, places, strict=True):
            states[:, robot] = np.array(wanted[robot])[at]
        ok = (np.diff(np.sort(states[:, [*own]], axis=1), axis=1) > 0).all(axis=1)
        ok &= self._postures.allow(bricks, states)
        last = by_move[-1][0] if by_move else None
        decided = 0 if last is None else self._schedule.moves[last].bricks
        return Choices(bricks, states[ok], ok.reshape(sizes), robots, sizes, decided)

    def certain(self) -> Iterator[tuple[int, Ints]]:
        """Yield the level and the places held (1, robots) of steps in which no hold is chosen."""
        for level in range(self.last, 0, -1):
            own = [self._holds.get((robot, level)) for robot in range(self.robots)]
            if all(hold is None or hold.move is None for hold in own):
                yield level, np.array([[0 if h is None else self._wanted(h)[0] for h in own]])

    def steps_to_go(self, level: int, states: Ints) -> Floats:
        """Return how many steps builds have from states (n, c) on, (n,)."""
        return np.full(len(states), float(self.last - level))

    def ends(self, level: int, states: Ints) -> Bools:
        """Return which states (n, robots) end the build: all after the last step."""
        return np.full(len(states), level == self.last)


def may_follow(scene: Scene, among: Orders, stand: Collection[int], brick: int) -> bool:
    """Return whether orders allow that a brick is placed next, by names, the others standing."""
    if brick in stand or among is Orders.ANY:
        return brick not in stand
    for ground in scene.grounds:
        closing = ground.brick if ground.closes_with is None else ground.closes_with
        if ground.brick == brick and (closing == brick or closing in stand):
            return True
    return any(
        brick in joint.bricks
        and not {*joint.bricks}.isdisjoint(stand)
        and max(*joint.translational_stiffness, *joint.rotational_stiffness) > 0
        for joint in scene.joints
    )


def check_free(
    network: Network, rules: FreeRules, steps: Sequence[Step], worlds: tuple[Scene, ...] = ()
) -> None:
    """Require that a checked sequence keeps the rules of a free schedule; forces are not asked."""
    tables, heavy = RuleTables(_RuleBook(network, rules, worlds), []), dict[int, str]()
    if rules.payload is Payload.KEPT:
        heavy = _unbearable((network.scene, *worlds), steps, rules.in_scene(network.scene).begin)
    level, state = tables.first, tables.start()
    for step in steps:
        if step.number in heavy:
            raise StepError(f"step {step.number} ({step.kind.value}): {heavy[step.number]}")
        to = level + (step.kind in (StepKind.PLACE, StepKind.REMOVE))
        wanted, regrip = tables.row(step.grips), step.kind is StepKind.REPOSITION
        found = [
            move.states[(move.states[:, : tables.robots] == wanted).all(axis=1)]
            for move in tables.successors(level, state, (step.kind,))
            if (move.level, move.regrip) == (to, regrip) and tables.bricks_at(to) == step.bricks
        ]
        after = np.concatenate([state[:0], *found])[:1]
        others = (n for r, n in enumerate(step.grips) if r not in tables.team)
        if not len(after) or any(node is not None for node in others):
            why = tables.fault(step.bricks, wanted) or "no rule allows it after the one before"
            raise StepError(f"step {step.number} ({step.kind.value}) of a free schedule: {why}")
        level, state = to, after
    if not tables.ends(level, state)[0]:
        raise StepError(
            f"step {len(steps)}: the build does not end there (ending={rules.ending.value})"
        )
