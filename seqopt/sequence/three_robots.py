"""Methods with a third robot, and all methods whose open grips an optimization chooses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from seqopt.errors import StepError, did_you_mean
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.sequence.loops import robot_loop, two_robot_loop
from seqopt.sequence.moves import open_schedule
from seqopt.sequence.roles import find_robots
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.sequence.steps import Step, StepKind, reachable
from seqopt.sequence.two_robots import sequential


class ScheduleMethod(Protocol):
    """A rule that makes a schedule."""

    def __call__(self, network: Network | Scene, robots: Sequence[str] = ()) -> Schedule:
        """Return the schedule of the build.

        Parameters
        ----------
        network : Network or Scene
        robots : sequence of str, optional
            Names of the robots in the order of their roles; found from their reach by default.

        Returns
        -------
        Schedule
        """


def three_robot_loop(network: Network | Scene, robots: Sequence[str] = ()) -> Schedule:
    """Return the four-step loop of three robots whose roles rotate.

    The first three robots place a brick each. Then four steps are repeated for every brick. The
    robot whose grip was chosen in the round before releases, and places the next brick. The robot
    that placed the brick before releases, and takes a new grip, which is to be chosen. From the
    second step on, at least two robots grip and the newest brick is held. Source: section 5.2.2
    and figure 12 of Bruun et al.

    Parameters
    ----------
    network : Network or Scene
        Of a scene with at least three robots and four bricks.
    robots : sequence of str, optional
        Names of three robots in the order in which they place the first bricks; by default the
        first three of the scene whose reach allows the build.

    Returns
    -------
    Schedule
        With one move for every brick except the last three.

    Raises
    ------
    StepError
        If there are fewer robots or bricks, or a robot does not reach the brick that it is to
        place.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> schedule = seqopt.three_robot_loop(network)
    >>> [(step.kind.value, step.moves) for step in schedule.steps[5:8]]
    [('release', (0,)), ('reposition', (0, 1)), ('release', (1,))]
    """
    network = network_of(network)
    if robots:
        find_robots(network.scene, robots, "three-robot", 3)
    return robot_loop(network, robots or 3)


def modified_sequential(network: Network | Scene, robots: Sequence[str] = ()) -> Schedule:
    """Return the sequential method with a third support, chosen again after every brick.

    Once two robots hold the arch, the third takes a grip for three steps: its own reposition, the
    release that follows and the next placing; then it releases. Source: section 5.2.1 and table 8
    of Bruun et al.

    Parameters
    ----------
    network : Network or Scene
        Of a scene with at least three robots.
    robots : sequence of str, optional
        Names of the two that take turns, and of the one that supports. By default the first two are
        those of `seqopt.sequential`, and the first robot that is free supports, as long as it can.

    Returns
    -------
    Schedule
        With one move for every brick except the first and the last; no two are open in one step.

    Raises
    ------
    StepError
        If there are fewer robots, one does not reach the brick that it is to place, or none is free
        to support.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> schedule = seqopt.modified_sequential(network)
    >>> len(schedule.steps), len(schedule.moves), schedule.moves[0].robot
    (95, 23, 'rob3')
    """
    network = network_of(network)
    chosen = find_robots(network.scene, robots, "modified-sequential", 3)
    plain = sequential(network, robots[:2])
    steps = _supported(network.scene, plain, chosen[2:] if robots else chosen)
    return open_schedule("modified-sequential", network, steps)


def _supported(scene: Scene, plain: Sequence[Step], helpers: Sequence[int]) -> list[OpenStep]:
    """Return the steps of the sequential method with the grip of a helper."""
    steps: list[OpenStep] = []
    moves, helper = 0, helpers[0]

    def add(kind: StepKind, step: Step, support: OpenGrip | None) -> None:
        grips = [support if i == helper and support else g for i, g in enumerate(step.grips)]
        steps.append(OpenStep(len(steps) + 1, kind, step.bricks, tuple(grips)))

    for k, step in enumerate(plain):
        support = OpenGrip(moves - 1) if moves and step.held else None
        add(step.kind, step, support)
        if step.kind is StepKind.RELEASE:
            continue
        if support is not None:
            add(StepKind.RELEASE, step, None)
        if 1 < step.bricks < len(scene.placed):
            moves += 1
            helper = _free(scene, plain[k : k + 3], [helper, *helpers])
            add(StepKind.REPOSITION, step, OpenGrip(moves - 1))
    return steps


def _free(scene: Scene, window: Sequence[Step], helpers: Sequence[int]) -> int:
    """Return the first helper that holds nothing in some steps and reaches a node held by none."""
    held = {node for step in window for node in step.held}
    for robot in helpers:
        idle = all(step.grips[robot] is None for step in window)
        if idle and {*reachable(scene, scene.robots[robot], window[0].bricks)} - held:
            return robot
    raise StepError(
        f"brick {scene.placed[window[0].bricks - 1].name}: no robot is left that reaches a node to "
        "support; extend a reach, or name who takes turns and who supports"
    )


SCHEDULES: dict[str, ScheduleMethod] = {
    "three-robot": three_robot_loop,
    "modified-sequential": modified_sequential,
    "two-robot": two_robot_loop,
    "loop": robot_loop,
}


def make_schedule(name: str, network: Network | Scene, robots: Sequence[str] = ()) -> Schedule:
    """Return a schedule by name.

    Parameters
    ----------
    name : str
        A key of `SCHEDULES`; ``"loop"`` is the loop of all robots of the scene.
    network : Network or Scene
    robots : sequence of str, optional
        Names of the robots in the order of their roles; found from their reach by default.

    Raises
    ------
    StepError
        If there is none of that name, or the scene cannot be built by it.
    """
    if name not in SCHEDULES:
        why = f"does not exist{did_you_mean(name, SCHEDULES)}; give one of {', '.join(SCHEDULES)}"
        raise StepError(f"schedule {name!r} {why}")
    return SCHEDULES[name](network, robots)
