"""Methods with a third robot: schedules whose open grips an optimization chooses."""

from __future__ import annotations

from collections.abc import Callable

from seqopt.errors import StepError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Move, OpenGrip, OpenStep, Schedule
from seqopt.sequence.steps import Grips, StepKind, reachable
from seqopt.sequence.two_robots import placing_node, sequential

ScheduleMethod = Callable[[Network], Schedule]


def three_robot_loop(network: Network | Scene) -> Schedule:
    """Return the four-step loop of three robots whose roles rotate.

    The first three robots place a brick each. Then, once per brick: the robot whose grip was chosen
    before last releases and places the next brick, the one that placed the brick before releases,
    and takes a new grip, which is to be chosen. At least two robots grip, and the newest brick is
    held, at every step after the first. Source: section 5.2.2 and figure 12 of Bruun et al.

    Parameters
    ----------
    network : Network or Scene
        Of a scene with at least three robots and four bricks.

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
    scene = network.scene
    total = len(scene.placed)
    if len(scene.robots) < 3 or total < 4:
        raise StepError(
            f"scene {scene.name}: {len(scene.robots)} robots and {total} bricks; "
            "this method needs three robots and four bricks"
        )
    return _schedule("three-robot", network, *_loop(network))


def _loop(network: Network) -> tuple[list[OpenStep], list[int]]:
    """Return the steps of the loop, and which robot makes each move."""
    scene = network.scene
    total = len(scene.placed)
    grips: list[int | OpenGrip | None] = [None] * len(scene.robots)
    steps: list[OpenStep] = []

    def add(kind: StepKind, bricks: int) -> None:
        steps.append(OpenStep(len(steps) + 1, kind, bricks, tuple(grips)))

    def place(robot: int, bricks: int) -> int:
        return placing_node(network, scene.robots[robot], scene.placed[bricks - 1])

    moving, placer, newest = 2, 0, 1
    for robot, bricks in ((0, 1), (1, 2)):
        grips[robot] = place(robot, bricks)
        add(StepKind.PLACE, bricks)
    robots = []
    for move in range(total - 3):
        bricks = move + 3
        robots.append(moving)
        grips[moving] = OpenGrip(move)
        add(StepKind.PLACE if move == 0 else StepKind.REPOSITION, bricks)
        grips[placer] = None
        add(StepKind.RELEASE, bricks)
        grips[placer] = place(placer, bricks + 1)
        add(StepKind.PLACE, bricks + 1)
        grips[newest] = None
        add(StepKind.RELEASE, bricks + 1)
        moving, placer, newest = newest, moving, placer
    return steps, robots


def modified_sequential(network: Network | Scene) -> Schedule:
    """Return the sequential method with a third support, chosen anew after every placed brick.

    Once two robots hold the arch, the third takes a grip for three steps: its own reposition, the
    release that follows and the next placing; then it releases. Source: section 5.2.1 and table 8
    of Bruun et al.

    Parameters
    ----------
    network : Network or Scene
        Of a scene with at least three robots.

    Returns
    -------
    Schedule
        With one move for every brick except the first and the last; no two are open in one step.

    Raises
    ------
    StepError
        If there are fewer robots, or one does not reach the brick that it is to place.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> schedule = seqopt.modified_sequential(network)
    >>> len(schedule.steps), len(schedule.moves), schedule.moves[0].robot
    (95, 23, 'rob3')
    """
    network = network_of(network)
    scene = network.scene
    if len(scene.robots) < 3:
        raise StepError(f"scene {scene.name}: {len(scene.robots)} robots; this method needs three")
    return _schedule("modified-sequential", network, *_supported(network))


def _supported(network: Network) -> tuple[list[OpenStep], list[int]]:
    """Return the sequential method's steps with the third grip, and which robot makes each move."""
    steps: list[OpenStep] = []
    robots: list[int] = []

    def add(kind: StepKind, bricks: int, grips: Grips, support: OpenGrip | None) -> None:
        steps.append(OpenStep(len(steps) + 1, kind, bricks, (*grips[:2], support, *grips[3:])))

    for step in sequential(network):
        support = OpenGrip(len(robots) - 1) if robots and step.held else None
        add(step.kind, step.bricks, step.grips, support)
        if step.kind is StepKind.RELEASE:
            continue
        if support is not None:
            add(StepKind.RELEASE, step.bricks, step.grips, None)
        if 1 < step.bricks < len(network.scene.placed):
            robots.append(2)
            add(StepKind.REPOSITION, step.bricks, step.grips, OpenGrip(len(robots) - 1))
    return steps, robots


def _schedule(method: str, network: Network, steps: list[OpenStep], robots: list[int]) -> Schedule:
    """Return the schedule with the candidates of every move."""
    moves = []
    for number, robot in enumerate(robots):
        present = [step for step in steps if number in step.moves]
        first = present[0]
        held = {g for step in present for g in step.grips if isinstance(g, int)}
        nodes = reachable(network.scene, network.scene.robots[robot], first.bricks)
        if first.kind is StepKind.PLACE:  # what places a brick holds it
            nodes = tuple(n for n in nodes if n in network.scene.placed[first.bricks - 1].nodes)
        free = tuple(node for node in nodes if node not in held)
        moves.append(Move(network.scene.robots[robot].name, first.number, first.bricks, free))
    return Schedule(method, network.scene, tuple(steps), tuple(moves))


SCHEDULES: dict[str, ScheduleMethod] = {
    "three-robot": three_robot_loop,
    "modified-sequential": modified_sequential,
}


def make_schedule(name: str, network: Network | Scene) -> Schedule:
    """Return a schedule by name.

    Parameters
    ----------
    name : str
        A key of `SCHEDULES`.
    network : Network or Scene

    Returns
    -------
    Schedule

    Raises
    ------
    StepError
        If there is none of that name, or the scene cannot be built by it.
    """
    if name not in SCHEDULES:
        raise StepError(f"schedule {name!r}: there is no such; give one of {', '.join(SCHEDULES)}")
    return SCHEDULES[name](network_of(network))
