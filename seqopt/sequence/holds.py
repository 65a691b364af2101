"""Holds: from the step in which a robot takes a grip to the last one before it lets go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral

from seqopt.scene.scene import Scene
from seqopt.sequence.steps import AnyStep, StepKind


@dataclass(frozen=True)
class Hold:
    """One grip, for as long as it lasts.

    Attributes
    ----------
    robot : int
        Index among the scene's robots.
    first, last : int
        Numbers of the first and the last step in which it is held.
    node : int or None
        That is held; None where it is still to be chosen.
    move : int or None
        Index of the move that chooses it, from 0; None where it is given.
    places : int or None
        Name of the brick that is placed with it in its first step; None if none is.
    """

    robot: int
    first: int
    last: int
    node: int | None
    move: int | None
    places: int | None


def holds(scene: Scene, steps: Sequence[AnyStep]) -> tuple[Hold, ...]:
    """Return every grip of a sequence or schedule, for as long as it lasts.

    Parameters
    ----------
    scene : Scene
    steps : sequence of AnyStep
        Of a method, a plan or a schedule, in order.

    Returns
    -------
    tuple of Hold
        By robot, then by first step.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> holds(scene, seqopt.sequential(seqopt.build_network(scene)))[0]
    Hold(robot=0, first=1, last=2, node=1, move=None, places=1)
    """
    out = []
    for robot in range(len(scene.robots)):
        start = 0
        grips = [step.grips[robot] for step in steps]
        for i in range(1, len(steps) + 1):
            if i == len(steps) or grips[i] != grips[start]:
                if grips[start] is not None:
                    out.append(_hold(scene, robot, steps[start], steps[i - 1].number))
                start = i
    return tuple(out)


def _hold(scene: Scene, robot: int, first: AnyStep, last: int) -> Hold:
    """Return the hold that a robot begins in a step: what is begun as a brick comes places it."""
    grip = first.grips[robot]
    is_placing = first.kind is StepKind.PLACE
    return Hold(
        robot=robot,
        first=first.number,
        last=last,
        node=int(grip) if isinstance(grip, Integral) else None,
        move=getattr(grip, "move", None),  # an open grip names its move
        places=scene.placed[first.bricks - 1].name if is_placing else None,
    )
