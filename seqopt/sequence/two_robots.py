"""Methods: rules that turn a scene into the sequence of steps that builds it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence, Set
from typing import Protocol, TypeVar

import numpy as np

from seqopt.errors import StepError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.parts import Brick, Robot, Side
from seqopt.scene.scene import Scene
from seqopt.sequence.roles import Pair, find_robots, take_turns
from seqopt.sequence.steps import Step, StepKind, check_sequence
from seqopt.sequence.stretches import begins_elsewhere, lies_along
from seqopt.sequence.support import check_support

Grip = TypeVar("Grip")


class Method(Protocol):
    """A rule that makes a sequence of steps."""

    def __call__(self, network: Network, robots: Sequence[str] = ()) -> tuple[Step, ...]:
        """Return the steps of the build.

        Parameters
        ----------
        network : Network
        robots : sequence of str, optional
            Names of the robots in the order of their roles; found from their reach by default.

        Returns
        -------
        tuple of Step
            Checked; every grip is given.
        """


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
    free = [
        node
        for node in brick.nodes
        if node not in network.scene.blocked_nodes and robot.reach.covers(brick.node_position(node))
    ]
    if not free:
        raise StepError(
            f"brick {brick.name}: {robot.name} reaches none of its free nodes {list(brick.nodes)}; "
            "extend its reach or let another robot place it"
        )
    if isinstance(robot.reach, Side) and brick.name not in lies_along(network):
        toward = np.array(robot.reach.toward)
        return max(free, key=lambda node: float(toward @ np.array(brick.node_position(node))))
    return brick.placing_node if brick.placing_node in free else free[0]


def sequential(network: Network | Scene, robots: Sequence[str] = ()) -> tuple[Step, ...]:
    """Two robots take turns: one places the next brick while the other holds the last one.

    Source: section 4.1 of Bruun et al.

    Parameters
    ----------
    network : Network or Scene
        The network of a scene with at least two robots.
    robots : sequence of str, optional
        Names of two robots; the first one places the first brick. By default the first two of the
        scene whose reach allows the build; a third robot helps if no two are enough.

    Returns
    -------
    tuple of Step
        The checked steps. The newest brick is held until the next one is placed.

    Raises
    ------
    StepError
        If there are fewer robots, no free robot reaches the next brick, or nobody would hold a
        part that no joint connects to the ground.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> [(step.kind.value, step.held) for step in seqopt.sequential(network)[:3]]
    [('place', (1,)), ('place', (1, 2)), ('release', (2,))]
    >>> seqopt.sequential(network, robots=("rob3", "rob2"))[1].grips
    (None, 2, 1)
    """
    network = network_of(network)
    every = {brick.name for brick in network.scene.bricks}
    return _two_robots(network, "sequential", every, robots)


def cantilever(network: Network | Scene, robots: Sequence[str] = ()) -> tuple[Step, ...]:
    """One robot holds, the other places bricks up to one that lies along; then they swap.

    A brick lies along the structure if joints meet both of its inner nodes. The robots also swap
    after a brick that no joint connects to the stretch being built, so that the held brick is
    always where the build continues. In a chain this happens only after the first brick. Source:
    section 4.2 of Bruun et al.

    Parameters
    ----------
    network : Network or Scene
        Of a scene with at least two robots.
    robots : sequence of str, optional
        As in `sequential`.

    Returns
    -------
    tuple of Step
        Checked; every grip is given.

    Raises
    ------
    StepError
        As in `sequential`.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> [(step.kind.value, step.held) for step in seqopt.cantilever(network)[5:8]]
    [('place', (1, 7)), ('release', (7,)), ('place', (8, 7))]
    """
    network = network_of(network)
    swaps = lies_along(network) | begins_elsewhere(network)
    return _two_robots(network, "cantilever", swaps, robots)


METHODS: dict[str, Method] = {"sequential": sequential, "cantilever": cantilever}


def alternate(
    network: Network,
    swap_after: Set[int],
    pairs: Sequence[Pair],
    grip: Callable[[int, int], Grip],
) -> Iterator[tuple[StepKind, int, tuple[Grip | None, ...]]]:
    """Yield the steps in which two robots place and hold.

    After each brick one of the two releases, if it holds anything; after the last one both do.

    Parameters
    ----------
    network : Network
    swap_after : set of int
        Names of the bricks after which who placed stays and holds.
    pairs : sequence of (int, int)
        Who places and who holds, for every brick; see `seqopt.sequence.roles.take_turns`.
    grip : callable
        What a robot holds of the brick that it places, from the robot's index and the brick count.

    Yields
    ------
    kind : StepKind
    bricks : int
    grips : tuple
        By robot of the scene.
    """
    scene = network.scene
    grips: list[Grip | None] = [None] * len(scene.robots)
    for count, (brick, pair) in enumerate(zip(scene.placed, pairs, strict=True), start=1):
        placer, holder = pair
        grips[placer] = grip(placer, count)
        placed = tuple(grips)
        yield StepKind.PLACE, count, placed
        stays = placer if count == 1 or brick.name in swap_after else holder
        last = count == len(scene.placed)
        grips = [None if last or i != stays else held for i, held in enumerate(grips)]
        if tuple(grips) != placed:
            yield StepKind.RELEASE, count, tuple(grips)


def _two_robots(
    network: Network, method: str, swap_after: Set[int], robots: Sequence[str]
) -> tuple[Step, ...]:
    """Return the sequence in which holder and placer swap after placing some of the bricks."""
    scene = network.scene
    chosen = find_robots(scene, robots, method, 2)
    starts = [(chosen[0], chosen[1])] if robots else []
    pairs = take_turns(network, swap_after, chosen, starts)

    def node(robot: int, count: int) -> int:
        return placing_node(network, scene.robots[robot], scene.placed[count - 1])

    parts = alternate(network, swap_after, pairs, node)
    steps = [Step(number, *part) for number, part in enumerate(parts, start=1)]
    check_support(network, steps)
    return check_sequence(scene, steps)
