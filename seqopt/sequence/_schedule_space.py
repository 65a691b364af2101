"""States of a schedule with open grips, and the moves between them, many at a time.

A state is a step and which node every robot holds in it: rows of integers as in
`seqopt.sequence._rule_space`, a column per robot of the scene. However many grips are open in a
step, each move goes from one step to the next.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, Terse
from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.sequence._rule_space import Moves, RobotKind, node_numbers, number_rows
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.sequence.steps import Step, StepKind, check_sequence


@dataclass(frozen=True, repr=False)
class ScheduleSpace(Terse):
    """The states of a schedule and the moves between them; a level for every step.

    ``caps``: largest force of a robot's grip, by its name, N; none of those that are not named;
    ``parks``: whether free robots stay where they were, for their travel. Raises `StepError` if the
    states cannot be numbered.
    """

    network: Network
    schedule: Schedule
    caps: Mapping[str, float]
    parks: bool = False

    def __post_init__(self) -> None:
        base = 1 + (2 if self.parks else 1) * 2 * len(self.network.inner)
        if base**self.robots >= 2**62:
            raise StepError(
                f"scene {self.network.scene.name}: so many nodes and robots have more states than "
                "can be numbered; let fewer robots take part"
            )

    @property
    def robots(self) -> int:
        """How many robots the scene has."""
        return len(self.network.scene.robots)

    @property
    def levels(self) -> int:
        """How many steps there are."""
        return len(self.schedule.steps)

    @property
    def ends_bare(self) -> bool:
        """Whether nobody holds anything in the last step."""
        return all(grip is None for grip in self.schedule.steps[-1].grips)

    @property
    def fewest_steps(self) -> int:
        """How many steps a build has: all have as many."""
        return self.levels

    def bricks_at(self, level: int) -> int:
        """Return how many bricks stand after so many steps."""
        return self.schedule.steps[level - 1].bricks if level else 0

    @cached_property
    def kinds(self) -> tuple[RobotKind, ...]:
        """Every robot by itself: of a schedule none could change places."""
        every = np.ones(2 * len(self.network.inner), dtype=bool)
        robots = enumerate(self.network.scene.robots)
        return tuple(
            RobotKind((i,), every, every, places=True, cap=self.caps.get(robot.name, np.inf))
            for i, robot in robots
        )

    def start(self) -> Ints:
        """Return the one state before the first step, (1, robots) int."""
        return np.zeros((1, self.robots), dtype=np.int32)

    def codes(self, states: Ints) -> Ints:
        """Return a number for every state that no other one of its step has, (n,)."""
        last = 2 * len(self.network.inner)
        return number_rows(states, self.robots, -last if self.parks else 0, last)

    def held(self, states: Ints) -> Ints:
        """Return which nodes are held, sorted, zeros for robots that are free first."""
        return np.sort(states.clip(min=0), axis=1)

    def grips(self, states: Ints) -> Ints:
        """Return how many grips are held, (n,)."""
        return np.asarray((states > 0).sum(axis=1))

    @property
    def slots(self) -> tuple[tuple[int, int], ...]:
        """First column of every robot, and the one after it."""
        return tuple((robot, robot + 1) for robot in range(self.robots))

    def within(self, level: int, states: Ints) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves that stay in a step: there are none."""
        return ()

    def onward(self, level: int, states: Ints) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves to the next step, and whether they are regrips."""
        step, before = self.schedule.steps[level], self._before(level)
        after, fresh = states.copy(), []
        for robot, grip in enumerate(step.grips):
            if grip is None:
                after[:, robot] = -np.abs(states[:, robot]) if self.parks else 0
            elif not isinstance(grip, OpenGrip):
                after[:, robot] = self._place[grip]
            elif before is None or before.grips[robot] != grip:
                fresh.append((robot, self._places[grip.move]))
        grids = np.meshgrid(*(places for _, places in fresh), indexing="ij")
        count = prod(len(places) for _, places in fresh)
        chosen = np.array([grid.ravel() for grid in grids], dtype=int).reshape(len(fresh), count)
        source = np.repeat(np.arange(len(states)), chosen.shape[1])
        after = after[source]
        for (robot, _), places in zip(fresh, chosen, strict=True):
            after[:, robot] = np.tile(places, len(states))
        kept = _apart(after)
        source, after = source[kept], after[kept]
        way = self._ways(states[source], after) if self.parks else np.zeros(len(source))
        return ((Moves(source, after, way), step.kind is StepKind.REPOSITION),)

    def _before(self, level: int) -> OpenStep | None:
        return self.schedule.steps[level - 1] if level else None

    def _ways(self, before: Ints, after: Ints) -> Floats:
        """Return how far robots go that take grips, m."""
        gone = (after > 0) & (after != before) & (before != 0)
        at = self._at[np.abs(after)] - self._at[np.abs(before)]
        return np.asarray((np.linalg.norm(at, axis=2) * gone).sum(axis=1))

    @cached_property
    def _at(self) -> Floats:
        at = self.network.node_position[self.network.inner.ravel()]
        return np.concatenate([np.zeros((1, 3)), at])

    @cached_property
    def _place(self) -> dict[int, int]:
        return {node: i for i, node in enumerate(node_numbers(self.network), start=1)}

    @cached_property
    def _places(self) -> list[Ints]:
        """Candidates of every move, as places."""
        return [np.array([self._place[n] for n in m.candidates]) for m in self.schedule.moves]

    def ended(self, states: Ints) -> Bools:
        """Return which states of the last step end the build: all, (n,) bool."""
        return np.ones(len(states), dtype=bool)

    def steps(self, rows: Ints) -> tuple[Step, ...]:
        """Return the checked steps of states (levels, robots), one after the other."""
        numbers = [None, *node_numbers(self.network)]
        pairs = zip(self.schedule.steps, rows.tolist(), strict=True)
        steps = [
            Step(s.number, s.kind, s.bricks, tuple(numbers[max(n, 0)] for n in row))
            for s, row in pairs
        ]
        return check_sequence(self.network.scene, steps)


def _apart(states: Ints) -> Bools:
    """Return in which states no two robots hold the same node."""
    held = np.sort(states.clip(min=0), axis=1)
    return np.asarray(~((held[:, 1:] == held[:, :-1]) & (held[:, 1:] > 0)).any(axis=1))
