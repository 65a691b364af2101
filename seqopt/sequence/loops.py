"""Loops: schedules in which roles rotate and one grip per brick is open, for two robots or more."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from seqopt.errors import StepError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.sequence.moves import open_schedule
from seqopt.sequence.roles import cast, find_robots, in_words, take_turns
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.sequence.steps import StepKind
from seqopt.sequence.two_robots import alternate, placing_node


def two_robot_loop(network: Network | Scene, robots: Sequence[str] = ()) -> Schedule:
    """Return the loop of two robots: the sequential method with every grip open.

    While one robot holds the newest brick the other places the next one, at a node that is to be
    chosen among those of this brick, and holds it there until the brick after is placed; then the
    first one releases. A move lasts from its placing to the release after the next placing; it
    shares that placing with the move after it. At least one robot grips, and the newest brick is
    held, at every step before the last.

    Parameters
    ----------
    network : Network
        Of a scene with at least two robots.
    robots : sequence of str, optional
        As in `seqopt.sequential`.

    Returns
    -------
    Schedule
        With one move for every brick. Filled with the nodes of the sequential method, it is this.

    Raises
    ------
    StepError
        As `seqopt.sequential` does.

    Examples
    --------
    >>> import seqopt
    >>> schedule = two_robot_loop(seqopt.build_network(seqopt.load_scene("arch25")))
    >>> [(step.kind.value, step.moves) for step in schedule.steps[1:4]]
    [('place', (0, 1)), ('release', (1,)), ('place', (1, 2))]
    >>> [move.candidates for move in schedule.moves[:3]]
    [(1,), (2,), (4,)]
    """
    network = network_of(network)
    chosen = find_robots(network.scene, robots, "two-robot", 2)
    starts = [(chosen[0], chosen[1])] if robots else []
    every = {brick.name for brick in network.scene.bricks}
    pairs = take_turns(network, every, chosen, starts)
    parts = alternate(network, every, pairs, lambda _, bricks: OpenGrip(bricks - 1))
    steps = [OpenStep(number, *part) for number, part in enumerate(parts, start=1)]
    return open_schedule("two-robot", network, steps)


def robot_loop(network: Network | Scene, robots: int | Sequence[str] = ()) -> Schedule:
    """Return the four-step loop of any number of robots whose roles rotate.

    Every robot but the last places a brick, and the last one takes the first open grip on one more.
    Then, once per brick: the robot whose grip was chosen before last releases and places the next
    brick, the robot that has held its brick longest releases, and takes a new grip, which is to be
    chosen. With n robots, at least n - 1 grip at every step once all do: n - 2 hold the bricks that
    they placed, the newest among them, and one holds where it was chosen. With three robots this is
    the loop of Bruun et al.; with two it is `two_robot_loop`.

    Parameters
    ----------
    network : Network
        Of a scene with at least one brick more than robots take part.
    robots : int or sequence of str, optional
        How many robots take part, or their names in the order in which they place the first bricks;
        by default all robots of the scene. Which of them takes which role follows from reach.

    Returns
    -------
    Schedule
        With one move for every brick except the last n; with two robots for every brick.

    Raises
    ------
    StepError
        If there are fewer robots or bricks, or none is left that reaches all bricks of a role.

    Examples
    --------
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
        return two_robot_loop(network, names)
    if len(scene.robots) < count or len(scene.placed) < count + 1:
        raise StepError(
            f"scene {scene.name}: {len(scene.robots)} robots and {len(scene.placed)} bricks; "
            f"this method needs {in_words(count)} robots and {in_words(count + 1)} bricks"
        )
    turns = _rotation(count, len(scene.placed) - count)
    steps = _loop(network, _order(network, names, turns), turns)
    return open_schedule(f"{in_words(count)}-robot", network, steps)


@dataclass(frozen=True)
class _Turn:
    """The roles of one turn of the loop: who moves, who places next, who releases after that."""

    mover: int
    placer: int
    oldest: int


def _rotation(count: int, turns: int) -> list[_Turn]:
    """Return who does what, turn by turn; a role is named by the first brick that it places."""
    mover, placer, holding = count - 1, 0, deque(range(1, count - 1))
    out = []
    for _ in range(turns):
        out.append(_Turn(mover, placer, holding.popleft()))
        holding.append(placer)
        mover, placer = out[-1].oldest, mover
    return out


def _order(network: Network, names: Sequence[str], turns: Sequence[_Turn]) -> list[int]:
    """Return which robot has which role, the first way in which each can place its bricks."""
    count = turns[0].mover + 1
    chosen = find_robots(network.scene, names, f"the loop of {count}", count)
    roles = [{role} for role in range(count)]
    for k, turn in enumerate(turns):
        roles[turn.placer].add(count + k)
    return chosen if names else cast(network.scene, roles, chosen)


def _loop(network: Network, order: Sequence[int], turns: Sequence[_Turn]) -> list[OpenStep]:
    """Return the steps of the loop; `order` says which robot has which role."""
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
