"""States of a schedule's open grips, a level for every step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.sequence._rule_space import Candidates, Moves, RobotKind, StateRows
from seqopt.sequence.schedule import Move, OpenGrip, OpenStep, Schedule, can_carry, carried
from seqopt.sequence.steps import Step, StepKind, check_sequence


@dataclass(frozen=True, eq=False, repr=False)
class ScheduleSpace(StateRows):
    """The states of a schedule and the moves between them; a level for every step."""

    network: Network
    rules: Schedule  # whose open grips are to be chosen
    caps: Mapping[str, float]  # largest forces of robots' grips, by their names, N
    parks: bool = False  # free robots stay where they were, for their travel
    worlds: tuple[Scene, ...] = ()  # of scenarios, in which robots must carry their bricks as well

    first = 0  # the level before the first step

    @property
    def levels(self) -> int:
        """Number of steps, equal for all builds."""
        return len(self.rules.steps)

    @property
    def ends_bare(self) -> bool:
        """Whether the last step has no grips."""
        return all(grip is None for grip in self.rules.steps[-1].grips)

    def steps_to_go(self, level: int, states: Ints) -> Floats:
        """Return the number of steps to the end, (n,)."""
        return np.full(len(states), float(self.levels - level))

    def bricks_at(self, level: int) -> int:
        """Return the brick count after a number of steps."""
        return self.rules.steps[level - 1].bricks if level else 0

    def may_place(self, level: int, states: Ints) -> Bools:
        """Return from which states the next step is feasible: all, (n,)."""
        return np.ones(len(states), dtype=bool)

    @cached_property
    def kinds(self) -> tuple[RobotKind, ...]:  # type: ignore[override]  # no field here
        """A kind per robot: robots of a schedule are not interchangeable, steps say who carries."""
        every = np.ones(2 * len(self.network.inner), dtype=bool)
        caps = [self.caps.get(robot.name, np.inf) for robot in self.network.scene.robots]
        return tuple(RobotKind((i,), every, every, every[::2], c) for i, c in enumerate(caps))

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

    def candidates(self, level: int) -> Candidates:
        step, columns = self.rules.steps[level - 1], self.open_columns(level)
        moves = [self.rules.moves[m] for m in step.moves]
        places = tuple(np.array([self._place[n] for n in move.candidates]) for move in moves)
        own = [0 if isinstance(grip, OpenGrip) else self._place.get(grip, 0) for grip in step.grips]
        grid = np.meshgrid(*places, indexing="ij")
        states: Ints = np.tile(np.array(own, dtype=np.int32), (grid[0].size, 1))
        states[:, columns] = np.stack([each.ravel() for each in grid], axis=1)
        possible = self._possible(step, states)
        shaped = possible.reshape(grid[0].shape)
        return Candidates(columns, places, states[possible], shaped)

    def decided_by(self, level: int) -> Move:
        return self.rules.moves[self.rules.steps[level - 1].moves[-1]]

    def without_choice(self) -> Iterator[tuple[int, Ints]]:
        """Yield the levels, last first, of steps without an open grip, and their state (1, r)."""
        for level, step in reversed([*enumerate(self.rules.steps, start=1)]):
            held = [grip for grip in step.grips if not isinstance(grip, OpenGrip)]
            if len(held) == len(step.grips):
                places = [self._place.get(grip, 0) for grip in held]
                yield level, np.array([places], dtype=np.int32)

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
