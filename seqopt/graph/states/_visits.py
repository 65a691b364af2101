"""The states and moves of a schedule as an explorer visits them, and the steps that they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph._explore import Visited
from seqopt.graph.space import Found, Moves, Space
from seqopt.graph.states.states import States
from seqopt.problem.amounts import NONE, STEPS, MoveArrays
from seqopt.problem.resources import StepArrays
from seqopt.scene.scene import Order
from seqopt.sequence import _space as free_space
from seqopt.sequence._space import FreeSpace, ScheduleSpace
from seqopt.sequence.steps import Step, _begin_step, check_sequence


def steps_in_hands(
    space: FreeSpace | ScheduleSpace,
    states: Sequence[Sequence[int]],
    grips: Sequence[Sequence[int]],
) -> tuple[Step, ...]:
    """Return the checked steps with the robot assignment given by ``grips``, if any.

    ``grips``: of every step, the place that each robot holds, 0 for none. Raises `SolverError` if
    they are not those of the states.
    """
    steps = space.steps(states)
    if not grips:
        return steps
    numbers = [None, *space.network.scene.placed_nodes]
    if [len(row) for row in grips] != [len(step.grips) for step in steps] or not all(
        0 <= n < len(numbers) for row in grips for n in row
    ):
        raise SolverError("the grips of robots are none of this scene, or not of every state")
    out = []
    for step, row in zip(steps, grips, strict=True):
        own = replace(step, grips=tuple(numbers[n] for n in row))
        if {*own.held} != {*step.held}:
            raise SolverError(f"step {step.number}: robots hold other nodes than its state says")
        out.append(own)
    scene = space.network.scene
    return check_sequence(scene, out, _begin_step(scene, space.rules.begin))


@dataclass(frozen=True)
class StateSpace(Space):
    """The states of one schedule, a part for every level: by its open grips, or by rules.

    Moves take a column each: whether they are regrips, and how far robots go, m. Where totals over
    scenarios count, a column for every scenario stands in the place of the goal.

    ``regrips``: whether robots may take grips on bricks that stand; ``standing``: whether it is
    asked of every state that it stands, and by which margins; ``order``: of its bricks, if that was
    sought.
    """

    problem: States
    regrips: bool = True
    standing: bool = False
    order: Order = ()

    @property
    def levels(self) -> int:
        return self.problem.space.levels

    @property
    def first(self) -> int:
        return self.problem.space.first

    @property
    def peaks(self) -> tuple[bool, ...]:
        return scenario_peaks(self.problem)

    def start(self) -> tuple[int, Ints]:
        return self.first, self.problem.space.start()

    def codes(self, part: int, states: Ints) -> Ints:
        return self.problem.space.codes(states)

    def within(self, part: int, states: Ints) -> Moves:
        return _joined(self.problem.space.within(part, states, regrips=self.regrips), states)

    def onward(self, part: int, states: Ints) -> Iterator[tuple[int, Moves]]:
        rows = self.able(part, states)
        moves = self.placed(part, states[rows])
        yield part + 1, moves._replace(source=rows[moves.source])

    def able(self, part: int, states: Ints) -> Ints:
        """Return the rows of states from which a brick may be placed."""
        return np.flatnonzero(self.problem.space.may_place(part, states))

    def placed(self, level: int, states: Ints) -> Moves:
        """Return the moves from a level to the next."""
        return _joined(self.problem.space.onward(level, states), states)

    @property
    def complete(self) -> bool:
        return self.regrips and not self.order

    @property
    def floors(self) -> bool:
        """Whether values may be lower bounds, from some of the scenarios."""
        return bool(self.problem.each) and not self.problem.totals

    def values(
        self, part: int, states: Ints, *, rough: bool, most: float = np.inf
    ) -> tuple[Floats, Bools]:
        if self.problem.totals:
            return self._totals(part, states)
        if self.standing:
            return self.problem.standing_values(part, states, most=most)
        return self.problem.values(part, states, rough=rough, most=most)

    def _totals(self, level: int, states: Ints) -> tuple[Floats, Bools]:
        """Return values of the goal by scenario, (n, S), and which states are feasible in all."""
        out = np.full((len(states), len(self.peaks)), np.inf)
        rows = np.arange(len(states))
        for k, problem in enumerate(self.problem.each):
            asked = problem.standing_values if self.standing else problem.values
            found, allowed = asked(level, states[rows])
            out[rows, k] = found[:, 0]
            rows = rows[allowed]
        return out, np.isin(np.arange(len(states)), rows)

    def amounts(self, values: Floats, taken: Floats) -> Floats:
        return values if self.problem.totals else move_amounts(self.problem, values, taken)

    def to_go(self, part: int, states: Ints) -> Floats | None:
        if self.problem.goals[1:2] != (STEPS,) or self.problem.demands or self.problem.budgets:
            return None
        return self.problem.space.steps_to_go(part, states)

    def ended(self, part: int, states: Ints) -> Bools:
        return self.problem.space.ended(states)

    def stand(self, part: int, states: Ints) -> Bools:
        asked = self.problem.demands and not self.standing
        return self.problem.stand(part, states) if asked else super().stand(part, states)

    def known(self, part: int, states: Ints) -> Ints:
        return self.problem.recalled(part, states)

    def schedule(self, part: int, asked: States) -> tuple[int, States]:
        """Return the level of a part, and the given problem, of which its states are."""
        return part, asked

    def path(self, found: Found) -> tuple[Order, tuple[tuple[int, ...], ...]]:
        return self.order, super().path(found)[1]

    @property
    def effort(self) -> tuple[int, int]:
        return (1, self.problem.models) if self.order else (0, 0)

    def rows(self, part: int, states: Ints) -> Ints:
        """Return labels of states: the level, and the node that each robot holds, 0: none."""
        numbers = np.array([0, *self.problem.network.scene.placed_nodes])
        held = states[:, : self.problem.space.robots].astype(np.int64)
        named = np.where(held > 0, numbers[held.clip(min=0)], 0)
        return np.column_stack([np.full(len(held), part), named])


def seen_steps(problem: States, visited: Visited) -> StepArrays:
    """Return the moves among visited states as resources see them."""
    space, graph = problem.space, visited.graph
    rows = np.concatenate([own[:, : space.robots] for *_, own in visited.states])
    counts = [len(own) for *_, own in visited.states]
    bricks = np.repeat([space.bricks_at(level) for level, *_ in visited.states], counts)
    robots = [robot for kind in space.kinds for robot in kind.robots]
    nodes = np.full((len(rows), len(problem.network.scene.robots)), NONE)
    nodes[:, robots] = np.array([NONE, *problem.network.scene.placed_nodes])[rows.clip(min=0)]
    return StepArrays(bricks[graph.target], nodes[graph.source], nodes[graph.target])


def scenario_peaks(problem: States) -> tuple[bool, ...]:
    """Return by goal whether the largest amount counts; of totals by scenario, of which none is."""
    if problem.totals:
        return (False,) * len(problem.each)
    return tuple(goal.is_peak for goal in problem.goals)


def move_amounts(problem: States, values: Floats, taken: Floats) -> Floats:
    """Return the values of goals of moves, (m, g).

    ``values`` (m, g): what they take of the states that the moves lead to; ``taken`` (m, 2):
    whether the moves are regrips, and how far robots go, m. Result (m, g).
    """
    out, moves = values.copy(), MoveArrays(*taken.T)
    for k, goal in enumerate(problem.goals):
        if goal.moves is not None:
            out[:, k] = goal.value(moves)
    return out


def _joined(found: Sequence[tuple[free_space.Moves, bool]], states: Ints) -> Moves:
    """Return moves together, with whether they are regrips and how far robots go."""
    parts = [Moves(np.zeros(0, dtype=np.int64), states[:0], np.zeros((0, 2)))]
    for moves, regrip in found:
        taken = np.column_stack([np.full(len(moves.way), float(regrip)), moves.way])
        parts.append(Moves(moves.source, moves.states, taken))
    return Moves(*map(np.concatenate, zip(*parts, strict=True)))
