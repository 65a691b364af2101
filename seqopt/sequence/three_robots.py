"""Methods with open grips for two robots or more, whose grips are optimized."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from seqopt.errors import StepError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene._armed import reachable
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Move, OpenGrip, OpenStep, Schedule, check_support
from seqopt.sequence.steps import Step, StepKind
from seqopt.sequence.two_robots import (
    _says_reach,
    alternate,
    cast,
    find_robots,
    in_words,
    placing_node,
    sequential,
)


def open_schedule(method: str, network: Network, steps: Sequence[OpenStep]) -> Schedule:
    """Return the schedule of open steps, with the candidates of every move.

    Open to a move is every free node within reach when it is made that no given grip holds while
    it lasts; to a move that places a brick, the nodes of this brick alone. Moves are numbered from
    0 in the order in which they are made.
    """
    scene, moves = network.scene, list[Move]()
    for number in range(1 + max((move for step in steps for move in step.moves), default=-1)):
        present = [step for step in steps if number in step.moves]
        first = present[0]
        robot = scene.robots[first.grips.index(OpenGrip(number))]
        nodes = reachable(scene, robot, first.bricks)
        if first.kind is StepKind.PLACE:  # what places a brick holds it
            nodes = tuple(n for n in nodes if n in scene.placed[first.bricks - 1].nodes)
        held = {grip for step in present for grip in step.grips}
        free = tuple(node for node in nodes if node not in held)
        if not free:
            raise StepError(
                f"step {first.number} ({first.kind.value}): no node is open to {robot.name}: of "
                f"those that it may hold it reaches {len(nodes)}, and others hold these; extend "
                "its reach or let another robot take this grip"
            )
        moves.append(Move(robot.name, first.number, first.bricks, free))
    check_support(network, steps, moves)
    return Schedule(method, scene, tuple(steps), tuple(moves))


@_says_reach
def _two_robot_loop(network: Network | Scene, robots: Sequence[str] = ()) -> Schedule:
    """Return the loop of two robots: the sequential method with every grip open.

    While one robot holds the newest brick the other places the next one, at a node that is to be
    chosen among those of this brick, and holds it there until the brick after is placed; then the
    first one releases. A move lasts from its placing to the release after the next placing; it
    shares that placing with the move after it. At least one robot grips, and the newest brick is
    held, at every step before the last. Robots are those of `seqopt.sequential`.

    >>> import seqopt
    >>> schedule = _two_robot_loop(seqopt.build_network(seqopt.load_scene("arch25")))
    >>> [(step.kind.value, step.moves) for step in schedule.steps[1:4]]
    [('place', (0, 1)), ('release', (1,)), ('place', (1, 2))]
    >>> [move.candidates for move in schedule.moves[:3]]
    [(1,), (2,), (4,)]
    """
    network = network_of(network)
    every = {brick.name for brick in network.scene.bricks}
    parts = alternate(network, "two-robot", every, robots, lambda _, count: OpenGrip(count - 1))
    steps = [OpenStep(number, *part) for number, part in enumerate(parts, start=1)]
    return open_schedule("two-robot", network, steps)


@_says_reach
def robot_loop(network: Network | Scene, robots: int | Sequence[str] = ()) -> Schedule:
    """Return the four-step loop of any number of robots whose roles rotate.

    Every robot but the last places a brick, and the last one takes the first open grip on one more.
    Then, once per brick: the robot whose grip was chosen before last releases and places the next
    brick, the robot that has held its brick longest releases, and takes a new grip, which is to be
    chosen. With n robots, at least n - 1 grip at every step once all do: n - 2 hold the bricks that
    they placed, the newest among them, and one holds where it was chosen. With three robots this is
    the loop of Bruun et al.; with two it is `_two_robot_loop`.

    ``robots``: how many take part, or their names in the order in which they place the first
    bricks; by default all robots of the scene. Which of them takes which role follows from reach.

    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> robot_loop(network, 3).steps == seqopt.three_robot_loop(network).steps
    True
    >>> robot_loop(network, 2).method
    'two-robot'
    """
    scene = (network := network_of(network)).scene
    names = () if isinstance(robots, int) else tuple(robots)
    count = robots if isinstance(robots, int) else len(names) or len(scene.robots)
    if count <= 2:
        return _two_robot_loop(network, names)
    if len(scene.robots) < count or len(scene.placed) < count + 1:
        raise StepError(
            f"scene {scene.name}: {len(scene.robots)} robots and {len(scene.placed)} bricks; "
            f"this method needs {in_words(count)} robots and {in_words(count + 1)} bricks"
        )
    longest = [*range(1, count - 1), 0, count - 1]  # who has held longest, again and again
    turns = [
        _Turn(*(longest[(k - ago) % count] for ago in (1, 2, 0)))
        for k in range(len(scene.placed) - count)
    ]
    chosen = find_robots(scene, names, f"the loop of {count}", count)
    roles = [{role} for role in range(count)]
    for brick, turn in enumerate(turns, start=count):
        roles[turn.placer].add(brick)
    steps = _loop(network, chosen if names else cast(scene, roles, chosen), turns)
    return open_schedule(f"{in_words(count)}-robot", network, steps)


class _Turn(NamedTuple):
    """The roles of one turn of the loop, each named by the first brick that it places.

    The robot with the longest grip moves in the next turn, and places in the one after.
    """

    mover: int
    placer: int
    oldest: int


def _loop(network: Network, order: Sequence[int], turns: Sequence[_Turn]) -> list[OpenStep]:
    scene = network.scene
    grips: list[int | OpenGrip | None] = [None] * len(scene.robots)
    steps: list[OpenStep] = []

    def add(kind: StepKind, bricks: int, role: int, grip: int | OpenGrip | None) -> None:
        grips[order[role]] = grip
        steps.append(OpenStep(len(steps) + 1, kind, bricks, tuple(grips)))

    def place(role: int, bricks: int) -> None:
        robot, brick = scene.robots[order[role]], scene.placed[bricks - 1]
        add(StepKind.PLACE, bricks, role, placing_node(network, robot, brick))

    for role in range(len(order) - 1):
        place(role, role + 1)
    for move, turn in enumerate(turns):
        bricks = len(order) + move
        kind = StepKind.PLACE if move == 0 else StepKind.REPOSITION
        add(kind, bricks, turn.mover, OpenGrip(move))
        add(StepKind.RELEASE, bricks, turn.placer, None)
        place(turn.placer, bricks + 1)
        add(StepKind.RELEASE, bricks + 1, turn.oldest, None)
    return steps


@_says_reach
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


@_says_reach
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
    helpers = chosen[2:] if robots else chosen
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
        if 1 < step.bricks < len(network.scene.placed):
            moves += 1
            helper = _free(network.scene, plain[k : k + 3], [helper, *helpers])
            add(StepKind.REPOSITION, step, OpenGrip(moves - 1))
    return open_schedule("modified-sequential", network, steps)


def _free(scene: Scene, window: Sequence[Step], helpers: Sequence[int]) -> int:
    """Return the first helper free in the given steps that reaches a free node."""
    held = {node for step in window for node in step.held}
    for robot in helpers:
        idle = all(step.grips[robot] is None for step in window)
        if idle and {*reachable(scene, scene.robots[robot], window[0].bricks)} - held:
            return robot
    raise StepError(
        f"brick {scene.placed[window[0].bricks - 1].name}: no robot is left that reaches a node to "
        "support; extend a reach, or name who takes turns and who supports"
    )


SCHEDULES: dict[str, Callable[..., Schedule]] = {
    "three-robot": three_robot_loop,
    "modified-sequential": modified_sequential,
    "two-robot": _two_robot_loop,
    "loop": robot_loop,
}
