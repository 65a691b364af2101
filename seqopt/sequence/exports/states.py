"""The state of every block in every step: absent, placed or held."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step


class BlockState(Enum):
    """The state of a block in a step."""

    ABSENT = "absent"
    PLACED = "placed"
    HELD = "held"  # placed, and held by a robot


@dataclass(frozen=True)
class StepStates:
    """A step by its blocks.

    Attributes
    ----------
    step : Step
    new : tuple of int
        Names of the bricks that this step places.
    holds : dict of str to (int, int)
        Node and brick that robots hold, by the robots' names.
    states : dict of int to BlockState
        By the names of all bricks of the scene, in build order.
    """

    step: Step
    new: tuple[int, ...]
    holds: dict[str, tuple[int, int]]
    states: dict[int, BlockState]


def step_states(scene: Scene, steps: Sequence[Step]) -> Iterator[StepStates]:
    """Yield what becomes of every block in every step.

    Parameters
    ----------
    scene : Scene
    steps : sequence of Step
        Checked, of a plan for the scene.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> steps = seqopt.sequential(seqopt.build_network(scene))
    >>> second = [*step_states(scene, steps)][1]
    >>> second.new, [second.states[name].value for name in (1, 2, 3)]
    ((2,), ['held', 'held', 'absent'])
    """
    before = 0
    names = [brick.name for brick in scene.placed]
    for step in steps:
        holds = {
            robot.name: (node, scene.brick_of_node[node].name)
            for robot, node in zip(scene.robots, step.grips, strict=True)
            if node is not None
        }
        held = {brick for _, brick in holds.values()}
        states = {
            name: BlockState.ABSENT
            if i >= step.bricks
            else BlockState.HELD
            if name in held
            else BlockState.PLACED
            for i, name in enumerate(names)
        }
        yield StepStates(step, tuple(names[before : step.bricks]), holds, states)
        before = step.bricks
