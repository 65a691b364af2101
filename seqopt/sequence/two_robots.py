"""Methods: rules that turn a scene into the sequence of steps that builds it."""

from __future__ import annotations

from collections.abc import Callable, Set

import numpy as np

from seqopt.errors import StepError
from seqopt.network.build import network_of
from seqopt.network.network import Network, PartKind
from seqopt.scene.parts import Brick, Robot
from seqopt.scene.reach import Side
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind, check_sequence, reachable

Method = Callable[[Network], tuple[Step, ...]]


def lies_along(network: Network) -> frozenset[int]:
    """Return the bricks that lie along the structure: joints meet both of their inner nodes.

    Parameters
    ----------
    network : Network

    Returns
    -------
    frozenset of int
        Names of the bricks.
    """
    half = network.edge_kind == PartKind.JOINT
    touched = set(network.edge_nodes[half, 0].tolist())
    return frozenset(
        brick.name
        for brick, (first, second) in zip(network.scene.placed, network.inner, strict=True)
        if first in touched and second in touched
    )


def placing_node(network: Network, robot: Robot, brick: Brick) -> int:
    """Return the node at which a robot holds a brick that it places.

    A robot on one side takes the node nearer to its side of a brick that lies across; any other
    case takes the brick's own placing node where it is within reach.

    Parameters
    ----------
    network : Network
    robot : Robot
        One of the scene's.
    brick : Brick
        The one to be placed.

    Returns
    -------
    int
        One of the brick's two nodes.

    Raises
    ------
    StepError
        If the robot reaches no free node of the brick.
    """
    scene = network.scene
    free = [node for node in reachable(scene, robot, len(scene.placed)) if node in brick.nodes]
    if not free:
        raise StepError(
            f"brick {brick.name}: {robot.name} reaches none of its free nodes {list(brick.nodes)}; "
            "extend its reach or let another robot place it"
        )
    if isinstance(robot.reach, Side) and brick.name not in lies_along(network):
        toward = np.array(robot.reach.toward)
        return max(free, key=lambda node: float(toward @ np.array(brick.node_position(node))))
    return brick.placing_node if brick.placing_node in free else free[0]


def sequential(network: Network | Scene) -> tuple[Step, ...]:
    """Two robots take turns: one places the next brick while the other holds the last one.

    Source: section 4.1 of Bruun et al.

    Parameters
    ----------
    network : Network or Scene
        Of a scene with at least two robots; the first two build.

    Returns
    -------
    tuple of Step
        Checked; every grip is given.

    Raises
    ------
    StepError
        If there are fewer robots, or one does not reach the brick that it is to place.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> [(step.kind.value, step.held) for step in seqopt.sequential(network)[:3]]
    [('place', (1,)), ('place', (1, 2)), ('release', (2,))]
    """
    network = network_of(network)
    return _two_robots(network, swap_after={brick.name for brick in network.scene.bricks})


def cantilever(network: Network | Scene) -> tuple[Step, ...]:
    """One robot holds while the other places bricks, up to one that lies along; then they swap.

    A brick lies along the structure if joints meet both of its inner nodes. Source: section 4.2 of
    Bruun et al.

    Parameters
    ----------
    network : Network or Scene
        Of a scene with at least two robots; the first two build.

    Returns
    -------
    tuple of Step
        Checked; every grip is given.

    Raises
    ------
    StepError
        If there are fewer robots, or one does not reach the brick that it is to place.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> [(step.kind.value, step.held) for step in seqopt.cantilever(network)[5:8]]
    [('place', (1, 7)), ('release', (7,)), ('place', (8, 7))]
    """
    network = network_of(network)
    return _two_robots(network, swap_after=lies_along(network))


METHODS: dict[str, Method] = {"sequential": sequential, "cantilever": cantilever}


def _two_robots(network: Network, swap_after: Set[int]) -> tuple[Step, ...]:
    """Return the sequence in which holder and placer swap after placing some of the bricks.

    After each brick the robot that places next releases, if it holds anything.
    """
    scene = network.scene
    if len(scene.robots) < 2:
        raise StepError(f"scene {scene.name}: {len(scene.robots)} robots; this method needs two")
    holder, placer = 1, 0
    grips: list[int | None] = [None] * len(scene.robots)
    steps: list[Step] = []
    for count, brick in enumerate(scene.placed, start=1):
        grips[placer] = placing_node(network, scene.robots[placer], brick)
        steps.append(Step(len(steps) + 1, StepKind.PLACE, count, tuple(grips)))
        if count == 1 or brick.name in swap_after:
            holder, placer = placer, holder
        grips[placer] = None
        if count == len(scene.placed):
            grips[holder] = None
        if tuple(grips) != steps[-1].grips:
            steps.append(Step(len(steps) + 1, StepKind.RELEASE, count, tuple(grips)))
    return check_sequence(scene, steps)
