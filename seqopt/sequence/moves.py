"""From open steps to a schedule: who makes each move, and which nodes are open to it."""

from __future__ import annotations

from collections.abc import Sequence

from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.sequence.schedule import Move, OpenGrip, OpenStep, Schedule
from seqopt.sequence.steps import StepKind, reachable
from seqopt.sequence.support import check_support


def open_schedule(method: str, network: Network, steps: Sequence[OpenStep]) -> Schedule:
    """Return the schedule of open steps, with the candidates of every move.

    Open to a move is every free node within reach when it is made that no given grip holds while
    it lasts; to a move that places a brick, the nodes of this brick alone.

    Parameters
    ----------
    method : str
        Name of the schedule.
    network : Network
    steps : sequence of OpenStep
        Moves numbered from 0 in the order in which they are made.

    Raises
    ------
    StepError
        If more than two moves are open at once, nothing is open to a move, or an island is not sure
        to be held.
    """
    moves = tuple(_move(network, steps, k) for k in range(1 + max(_numbers(steps), default=-1)))
    schedule = Schedule(method, network.scene, tuple(steps), moves)
    check_support(network, steps, moves)
    return schedule


def _numbers(steps: Sequence[OpenStep]) -> list[int]:
    return [number for step in steps for number in step.moves]


def _move(network: Network, steps: Sequence[OpenStep], number: int) -> Move:
    """Return a move with its candidates."""
    scene = network.scene
    present = [step for step in steps if number in step.moves]
    first = present[0]
    robot = scene.robots[first.grips.index(OpenGrip(number))]
    held = {grip for step in present for grip in step.grips if isinstance(grip, int)}
    nodes = reachable(scene, robot, first.bricks)
    if first.kind is StepKind.PLACE:  # what places a brick holds it
        nodes = tuple(n for n in nodes if n in scene.placed[first.bricks - 1].nodes)
    free = tuple(node for node in nodes if node not in held)
    if not free:
        raise StepError(
            f"step {first.number} ({first.kind.value}): no node is open to {robot.name}: of those "
            f"that it may hold it reaches {len(nodes)}, and others hold these; extend its reach or "
            "let another robot take this grip"
        )
    return Move(robot.name, first.number, first.bricks, free)
