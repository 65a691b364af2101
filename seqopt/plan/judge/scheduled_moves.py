"""What a schedule with open grips allows, looked up hold by hold: the judge's own version.

`seqopt.sequence.schedule_space` reads the grips of steps; here every hold says from which step to
which a robot holds what, and states follow robot by robot. Rows are those of that module.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.plan.judge.rule_moves import Follows
from seqopt.sequence.schedule import Hold, OpenGrip, Schedule, holds
from seqopt.sequence.steps import Step, StepKind


class ScheduleTables:
    """The holds of a schedule for many states at once.

    ``parks``: whether it counts where a free robot was last.
    """

    def __init__(self, schedule: Schedule, network: Network, *, parks: bool = False) -> None:
        scene = network.scene
        self._schedule, self._parks = schedule, parks
        self.last, self.robots = len(schedule.steps), len(scene.robots)
        self.team = tuple(range(self.robots))
        self.nodes = np.array([-1, *(node for brick in scene.placed for node in brick.nodes)])
        at = [scene.node_position(node) for node in self.nodes[1:].tolist()]
        self._at = np.array([[np.nan] * 3, *at])
        self._place = {node: i for i, node in enumerate(self.nodes.tolist())}
        self._holds = {
            (hold.robot, number): hold
            for hold in holds(scene, schedule.steps)
            for number in range(hold.first, hold.last + 1)
        }

    def start(self) -> Ints:
        """Return the state before the first step, (1, robots) int."""
        return np.zeros((1, self.robots), dtype=np.int32)

    def bricks_at(self, level: int) -> int:
        """Return how many bricks stand after so many steps."""
        return max((step.bricks for step in self._schedule.steps[:level]), default=0)

    def follow(self, level: int, states: Ints) -> Iterator[Follows]:
        """Yield what follows from states (n, robots) by the next step, if there is one."""
        if level == self.last:
            return
        source, after, way = np.arange(len(states)), states, np.zeros(len(states))
        for robot in range(self.robots):
            source, after, way = self._moved(robot, level + 1, (source, after, way))
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


def check_scheduled(schedule: Schedule, steps: Sequence[Step]) -> None:
    """Raise a `StepError` unless a sequence is the schedule, each open grip at one candidate."""
    if len(steps) != len(schedule.steps):
        raise StepError(f"{len(steps)} steps; schedule {schedule.method} has {len(schedule.steps)}")
    chosen: dict[int, object] = {}
    for step, planned in zip(steps, schedule.steps, strict=True):
        same = (step.number, step.kind, step.bricks) == (
            planned.number,
            planned.kind,
            planned.bricks,
        )
        for node, grip in zip(step.grips, planned.grips, strict=True):
            if isinstance(grip, OpenGrip):
                found = chosen.setdefault(grip.move, node)
                same &= found == node and node in schedule.moves[grip.move].candidates
            else:
                same &= node == grip
        if not same:
            raise StepError(f"step {step.number} is none of schedule {schedule.method}")
