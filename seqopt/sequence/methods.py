"""Methods: rules that turn a scene into the steps that build it, with given or with open grips.

Roles (which robot places and which holds) are filled by reach or by name. A method lists its acts,
and `_schedule` makes steps of them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from functools import cache
from itertools import permutations

import numpy as np

from seqopt.errors import StepError, did_you_mean
from seqopt.network.network import Network, PartKind, network_of
from seqopt.scene.parts import Brick, Robot, Side
from seqopt.scene.scene import Scene, _reachable
from seqopt.sequence.schedule import Move, OpenGrip, OpenStep, Schedule, check_support
from seqopt.sequence.steps import Step, StepKind

_Pair = tuple[int, int]  # who places, who holds meanwhile: indices of the scene's robots
_Way = tuple[int, tuple[_Pair, ...]]  # changes so far, pairs so far
_Grip = int | OpenGrip | None
_Act = tuple[StepKind, int, Mapping[int, _Grip]]  # kind, brick count, and grips that change

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six")


def _in_words(number: int) -> str:
    """Return a small number in words, a larger one in digits."""
    return _NUMBERS[number] if number < len(_NUMBERS) else str(number)


def _find_robots(scene: Scene, names: Sequence[str], method: str, roles: int) -> list[int]:
    """Return the indices of the robots that a method may use, in the order of its roles.

    By default all robots of the scene, which must be at least as many as roles.
    """
    known = [robot.name for robot in scene.robots]
    if not names and len(known) < roles:
        raise StepError(
            f"scene {scene.name}: {len(known)} robots; this method needs {_in_words(roles)}"
        )
    for name in names:
        if name not in known:
            why = f"does not exist{did_you_mean(name, known)}; give some of {', '.join(known)}"
            raise StepError(f"robot {name!r} {why}")
    listed = f"robots {', '.join(names)}"
    if len({*names}) < len(names):
        raise StepError(f"{listed}: one occurs twice; name different ones")
    if names and len(names) != roles:
        raise StepError(f"{listed}: {len(names)} named; {method} takes {_in_words(roles)}")
    return [known.index(name) for name in names or known]


def _take_turns(
    network: Network, swap_after: Set[int], robots: Sequence[int], starts: Sequence[_Pair] = ()
) -> list[_Pair]:
    """Return the placing and the holding robot of every brick, two robots at a time.

    After bricks in ``swap_after``, names, the placing robot holds on, after others the holding one.
    The pair stays the same if its reach allows; otherwise a third robot replaces the free one, with
    the fewest replacements. Ties go to the order of robots. ``starts``: pairs of the robot that
    places the first brick and its partner; by default any two.
    """
    scene = network.scene
    rank = {robot: i for i, robot in enumerate(robots)}
    ways: dict[_Pair, _Way] = {  # the best one to every pair that can be at work
        (placer, holder): (0, ((rank[placer], rank[holder]),))
        for placer, holder in starts or permutations(robots, 2)
    }
    for k, brick in enumerate(scene.placed):
        able = {robot for robot in rank if scene.within_reach(scene.robots[robot])[k]}
        possible = {pair: way for pair, way in ways.items() if pair[0] in able}
        if not possible:
            nodes = [node for node in brick.nodes if node not in scene.blocked_nodes]
            names = [scene.robots[robot].name for robot in sorted({pair[0] for pair in ways})]
            reach = "reach" if len(names) > 1 else "reaches"
            why = f"{' and '.join(names)} {reach} none of its free nodes {nodes}"
            if able and k:
                why += f"; {scene.robots[min(able)].name} does, and holds the brick before"
            raise StepError(
                f"brick {brick.name}: {why}; extend a reach, or let another robot place it"
            )
        ways = {}
        for (placer, holder), (changes, path) in possible.items():
            stays = k == 0 or brick.name in swap_after
            free, held = (holder, placer) if stays else (placer, holder)
            for after in (robot for robot in rank if robot != held):
                way = (changes + (after != free), (*path, (rank[after], rank[held])))
                ways[after, held] = min(way, ways.get((after, held), way))
    path = min(possible.values())[1]
    return [(robots[placer], robots[holder]) for placer, holder in path]


def _cast(scene: Scene, roles: Sequence[Set[int]], robots: Sequence[int]) -> list[int]:
    """Assign a robot to every role that reaches all bricks which the role places.

    Bricks are indices in build order; of all assignments the lexicographically first, by role.
    """
    reach = {r: scene.within_reach(scene.robots[r]) for r in robots}
    fits = [[r for r in robots if all(reach[r][b] for b in role)] for role in roles]

    @cache  # as many calls as there are sets of robots, not orders
    def match(role: int, taken: frozenset[int]) -> list[int] | None:
        if role == len(fits):
            return []
        for robot in fits[role]:
            if robot not in taken and (rest := match(role + 1, taken | {robot})) is not None:
                return [robot, *rest]
        return None

    if (found := match(0, frozenset())) is not None:
        return found
    role = min(range(len(roles)), key=lambda r: len(fits[r]))
    names, fit = (", ".join(scene.robots[r].name for r in some) for some in (robots, fits[role]))
    bricks = ", ".join(str(scene.placed[b].name) for b in sorted(roles[role]))
    raise StepError(
        f"scene {scene.name}: not every role has a robot of its own of {names}: one places bricks "
        f"{bricks}, all within reach of {fit or 'none'}; take the free schedule (--schedule free), "
        "extend a reach, name other robots, or write a schedule of your own"
    )


def lies_along(network: Network) -> frozenset[int]:
    """Return the names of bricks along the structure: joints meet both of their inner nodes."""
    if "along" not in network.derived:  # asked for every brick
        edges = network.graph.edges.data()
        met = {node for node, _, data in edges if data["kind"] is PartKind.JOINT}
        own = (brick.name for brick in network.scene.placed if met.issuperset(brick.nodes))
        network.derived["along"] = frozenset(own)
    return network.derived["along"]  # type: ignore[no-any-return]


def placing_node(network: Network, robot: Robot, brick: Brick) -> int:
    """Return the node at which a robot holds a brick that it places.

    A robot on one side takes the node nearer to its side of a brick that lies across; any other
    case takes the brick's own placing node where it is within reach.
    """
    free = network.scene.within_reach(robot)[network.scene.since[brick.name] - 1]
    if not free:
        raise StepError(
            f"brick {brick.name}: {robot.name} reaches none of its free nodes {list(brick.nodes)}; "
            "extend a reach, or let another robot place it"
        )
    if isinstance(robot.reach, Side) and brick.name not in lies_along(network):
        toward = np.array(robot.reach.toward)
        return max(free, key=lambda node: float(toward @ np.array(brick.node_position(node))))
    return brick.placing_node if brick.placing_node in free else free[0]


def _schedule(method: str, network: Network, acts: Iterable[_Act]) -> Schedule:
    """Return the schedule of acts, numbered from 1; an act that changes no grip is no step."""
    grips: tuple[_Grip, ...] = (None,) * len(network.scene.robots)
    steps: list[OpenStep] = []
    for kind, bricks, changes in acts:
        before = grips
        grips = tuple(changes.get(robot, grip) for robot, grip in enumerate(before))
        if grips != before:
            steps.append(OpenStep(len(steps) + 1, kind, bricks, grips))
    return open_schedule(method, network, steps)


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
        nodes = _reachable(scene, robot, first.bricks)
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


def _alternate(
    network: Network, method: str, swaps: Set[int], robots: Sequence[str], *, open_: bool = False
) -> Schedule:
    """Return the schedule of two robots that place and hold by turns, at placing or at open nodes.

    After each brick one of the two releases, if it holds anything; after the last one both do.
    ``swaps``: names of bricks after which the robot that placed them holds on.
    """
    scene, acts = network.scene, list[_Act]()
    chosen = _find_robots(scene, robots, method, 2)
    pairs = _take_turns(network, swaps, chosen, [(chosen[0], chosen[1])] if robots else [])
    for count, (brick, (placer, holder)) in enumerate(zip(scene.placed, pairs, strict=True), 1):
        node = None if open_ else placing_node(network, scene.robots[placer], brick)
        acts.append((StepKind.PLACE, count, {placer: OpenGrip(count - 1) if open_ else node}))
        stays = placer if count == 1 or brick.name in swaps else holder
        leave = {*range(len(scene.robots))} - {stays if count < len(pairs) else -1}
        acts.append((StepKind.RELEASE, count, dict.fromkeys(leave)))
    return _schedule(method, network, acts)


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
    return _alternate(network, "sequential", {*network.scene.build_order}, robots).fill(())


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

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> [(step.kind.value, step.held) for step in seqopt.cantilever(network)[5:8]]
    [('place', (1, 7)), ('release', (7,)), ('place', (8, 7))]
    """
    network = network_of(network)
    springs, tied = network.springs, defaultdict[int, set[int]](set)
    for a, b in springs.bodies[springs.stiffness.any(axis=1)].tolist():
        tied[b].add(a)  # the lower one first
    swaps, stretch = {*lies_along(network)}, set[int]()  # what is held while others are placed
    for k, brick in enumerate(network.scene.placed):
        if stretch.isdisjoint(tied[k]):  # it begins elsewhere; so does the first one
            swaps.add(brick.name)
        stretch = {k} if brick.name in swaps else stretch | {k}
    return _alternate(network, "cantilever", swaps, robots).fill(())


METHODS: dict[str, Callable[..., tuple[Step, ...]]] = {
    "sequential": sequential,
    "cantilever": cantilever,
}


def _two_robot_loop(network: Network | Scene, robots: Sequence[str] = ()) -> Schedule:
    """Return the loop of two robots: the sequential method with every grip open.

    A move lasts from its placing to the release after the next placing, which it shares with the
    move after it; its candidates are the nodes of the brick that it places.
    """
    network = network_of(network)
    return _alternate(network, "two-robot", {*network.scene.build_order}, robots, open_=True)


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
    """
    scene = (network := network_of(network)).scene
    names = () if isinstance(robots, int) else tuple(robots)
    count = robots if isinstance(robots, int) else len(names) or len(scene.robots)
    if count <= 2:
        return _two_robot_loop(network, names)
    bricks = len(scene.placed)
    if len(scene.robots) < count or bricks < count + 1:
        raise StepError(
            f"scene {scene.name}: {len(scene.robots)} robots and {bricks} bricks; "
            f"this method needs {_in_words(count)} robots and {_in_words(count + 1)} bricks"
        )
    longest = [*range(1, count - 1), 0, count - 1]  # who has held longest, again and again
    # by brick: who takes a new grip, who places the next brick, and who has held longest
    turns = [[longest[(k - ago) % count] for ago in (1, 2, 0)] for k in range(bricks - count)]
    order = _find_robots(scene, names, f"the loop of {count}", count)
    if not names:
        placing = [*range(count), *(placer for _, placer, _ in turns)]  # roles, brick by brick
        roles = [{b for b, own in enumerate(placing) if own == role} for role in range(count)]
        order = _cast(scene, roles, order)  # the robot of every role
    acts = list[_Act]()

    def place(role: int, bricks: int) -> None:
        node = placing_node(network, scene.robots[order[role]], scene.placed[bricks - 1])
        acts.append((StepKind.PLACE, bricks, {order[role]: node}))

    for role in range(count - 1):
        place(role, role + 1)
    for move, (mover, placer, oldest) in enumerate(turns):
        kind = StepKind.REPOSITION if move else StepKind.PLACE
        acts.append((kind, count + move, {order[mover]: OpenGrip(move)}))
        acts.append((StepKind.RELEASE, count + move, {order[placer]: None}))
        place(placer, count + move + 1)
        acts.append((StepKind.RELEASE, count + move + 1, {order[oldest]: None}))
    return _schedule(f"{_in_words(count)}-robot", network, acts)


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
        _find_robots(network.scene, robots, "three-robot", 3)
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
    scene = (network := network_of(network)).scene
    chosen = _find_robots(scene, robots, "modified-sequential", 3)
    plain = sequential(network, robots[:2])
    helpers = chosen[2:] if robots else chosen
    acts, support, moves = list[_Act](), dict[int, _Grip](), 0

    def is_free(robot: int, window: Sequence[Step]) -> bool:
        held = {node for step in window for node in step.held}
        idle = all(step.grips[robot] is None for step in window)
        return idle and bool({*_reachable(scene, scene.robots[robot], window[0].bricks)} - held)

    for k, step in enumerate(plain):
        given: dict[int, _Grip] = dict(enumerate(step.grips))
        acts.append((step.kind, step.bricks, given | support if step.held else given))
        if step.kind is StepKind.RELEASE:
            continue
        acts.append((StepKind.RELEASE, step.bricks, given))
        if 1 < step.bricks < len(scene.placed):
            window = plain[k : k + 3]  # in which the first helper that is free supports
            helper = next((r for r in (*support, *helpers) if is_free(r, window)), None)
            if helper is None:
                raise StepError(
                    f"brick {scene.placed[step.bricks - 1].name}: no robot is left that reaches a "
                    "node to support; extend a reach, or name who takes turns and who supports"
                )
            support, moves = {helper: OpenGrip(moves)}, moves + 1
            acts.append((StepKind.REPOSITION, step.bricks, given | support))
    return _schedule("modified-sequential", network, acts)


SCHEDULES: dict[str, Callable[..., Schedule]] = {
    "three-robot": three_robot_loop,
    "modified-sequential": modified_sequential,
    "two-robot": _two_robot_loop,
    "loop": robot_loop,
}
