"""From the states of a free schedule to its steps: which robot of a kind it is that moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.errors import SolverError
from seqopt.sequence.free_space import FreeSpace, node_numbers
from seqopt.sequence.schedule_space import ScheduleSpace
from seqopt.sequence.steps import Step, StepKind, check_sequence


def steps_of(space: FreeSpace | ScheduleSpace, states: Sequence[Sequence[int]]) -> tuple[Step, ...]:
    """Return the checked steps that lead from one state to the next.

    ``states``: as of a `seqopt.plan.calling.state_path.StatePath`. Raises
    `SolverError` if the states are none of this space; `StepError` if no single step leads from one
    state to the next.
    """
    if isinstance(space, ScheduleSpace):
        return _scheduled_steps(space, states)
    numbers = [None, *node_numbers(space.network)]
    grips: list[int | None] = [None] * len(space.network.scene.robots)
    stays: dict[int, int] = {}  # where a robot was last, as a place from 1
    before, out = 0, list[Step]()
    for bricks, *entries in states:
        if len(entries) < space.robots or not all(abs(n) < len(numbers) for n in entries):
            raise SolverError(f"the state {[bricks, *entries]} is none of this free schedule")
        took = False
        for kind, (first, end) in zip(space.kinds, space.slots, strict=True):
            took |= _follow(kind.robots, entries[first:end], grips, stays, numbers)
        stays = stays if space.parks else {}
        step = StepKind.PLACE if bricks > before else StepKind.REPOSITION
        out.append(Step(len(out) + 1, step if took else StepKind.RELEASE, bricks, tuple(grips)))
        before = bricks
    return check_sequence(space.network.scene, out)


def _scheduled_steps(space: ScheduleSpace, states: Sequence[Sequence[int]]) -> tuple[Step, ...]:
    """Return the checked steps of states of a schedule, one for each of its steps."""
    rows = np.array([row[1:] for row in states if len(row) == space.robots + 1], dtype=np.int64)
    if len(rows) != space.levels or [row[0] for row in states] != [*range(1, space.levels + 1)]:
        raise SolverError("the states are none of this schedule: it has one for every step")
    if np.abs(rows).max() > 2 * len(space.network.inner):
        raise SolverError("a state of a schedule holds a node that does not exist")
    return space.steps(rows)


def _follow(
    robots: Sequence[int],
    entries: Sequence[int],
    grips: list[int | None],
    stays: dict[int, int],
    numbers: Sequence[int | None],
) -> bool:
    """Let robots of a kind hold what their entries say; return whether one took a grip."""
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
        robot = free[0]
        grips[robot] = node
        stays[robot] = wanted[node]
    return bool(fresh)
