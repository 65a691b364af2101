"""Methods: rules that turn a scene into the sequence of steps that builds it.

Roles (which robot places and which holds) are filled by reach or by name.
"""

from __future__ import annotations

import math
import typing
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import replace
from functools import wraps
from itertools import permutations
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from seqopt.arrays import Bools
from seqopt.errors import StepError, did_you_mean
from seqopt.network.build import build_network, network_of
from seqopt.network.network import Network, PartKind
from seqopt.scene._armed import within_reach
from seqopt.scene.parts import Anywhere, Brick, Robot, Side, Sphere
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import check_support
from seqopt.sequence.steps import Step, StepKind, check_sequence

_Make = TypeVar("_Make", bound=Callable[..., Any])
ASKS = "extend a reach"  # of errors: what says so is answered by the reach that is enough
_MM = 1000.0


def _enough_reach(scene: Scene, exists: Callable[[Scene], bool]) -> Iterator[str]:
    """Yield the least sufficient reach of a single robot, else of all robots, in words.

    ``exists``: whether the problem is feasible in a scene with other reaches.
    """
    limited = {
        robot.name: robot.reach
        for robot in scene.robots
        if robot.arm is None and not isinstance(robot.reach, Anywhere)
    }
    alone = 0
    for name, reach in limited.items():
        if more := _least(scene, {name: reach}, exists):
            alone += 1
            if isinstance(reach, Sphere):
                radius = math.ceil(_MM * (reach.radius + more) - 1e-6) / _MM
                yield f"a reach of {radius:.6g} m of {name} ({reach.radius:.6g} m now)"
            else:
                yield f"a reach of {name} that is {more:.6g} m longer"
    if not alone and len(limited) > 1 and (more := _least(scene, limited, exists)):
        yield f"a reach that is {more:.6g} m longer of every robot that does not reach everything"


def _least(
    scene: Scene, reaches: Mapping[str, Side | Sphere], exists: Callable[[Scene], bool]
) -> float:
    """Return the least sufficient extension of reaches, in whole mm; zero if none suffices.

    Only lengths at which a further node is reached are tried. ``reaches``: by robot.
    """
    points = [brick.node_position(node) for brick in scene.placed for node in brick.nodes]
    lacks = (reach.lack(point) for reach in reaches.values() for point in points)
    steps = sorted({math.ceil(_MM * lack - 1e-6) / _MM for lack in lacks if lack > 0})

    def is_enough(more: float) -> bool:
        robots = (
            replace(robot, reach=reaches[robot.name].longer(more))
            if robot.name in reaches
            else robot
            for robot in scene.robots
        )
        return exists(scene.with_robots(*robots))

    if not steps or not is_enough(steps[-1]):
        return 0.0
    return steps[bisect_left(steps, 1, hi=len(steps) - 1, key=is_enough)]


def _says_reach(make: _Make) -> _Make:
    """Decorate a method so that errors about reach name the least sufficient one."""

    @wraps(make)
    def made(network: Network | Scene, robots: int | Sequence[str] = ()) -> object:
        try:
            return make(network, robots)
        except StepError as error:
            said = str(error)
            if ASKS not in said:
                raise

        def exists(other: Scene) -> bool:
            with suppress(StepError):
                make(build_network(other), robots)
                return True
            return False

        scene = network if isinstance(network, Scene) else network.scene
        ways = " or ".join(_enough_reach(scene, exists))
        raise StepError(said.replace(ASKS, f"give {ways}") if ways else said)

    return typing.cast(_Make, made)


_Pair = tuple[int, int]  # who places, who holds meanwhile: indices of the scene's robots
_Way = tuple[int, tuple[_Pair, ...]]  # changes so far, pairs so far


def find_robots(scene: Scene, names: Sequence[str], method: str, roles: int) -> list[int]:
    """Return the indices of the robots that a method may use, in the order of its roles.

    By default all robots of the scene, which must be at least as many as roles.
    """
    known = [robot.name for robot in scene.robots]
    if not names:
        if len(known) < roles:
            raise StepError(
                f"scene {scene.name}: {len(known)} robots; this method needs {in_words(roles)}"
            )
        return list(range(len(known)))
    for name in names:
        if name not in known:
            why = f"does not exist{did_you_mean(name, known)}; give some of {', '.join(known)}"
            raise StepError(f"robot {name!r} {why}")
    listed = f"robots {', '.join(names)}"
    if len({*names}) < len(names):
        raise StepError(f"{listed}: one occurs twice; name different ones")
    if len(names) != roles:
        raise StepError(f"{listed}: {len(names)} named; {method} takes {in_words(roles)}")
    return [known.index(name) for name in names]


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
        able = {robot for robot in rank if within_reach(scene, scene.robots[robot])[k]}
        possible = {pair: way for pair, way in ways.items() if pair[0] in able}
        if not possible:
            raise _nobody(scene, [pair[0] for pair in ways], able, k)
        ways = {}
        for (placer, holder), (changes, path) in possible.items():
            stays = k == 0 or brick.name in swap_after
            free, held = (holder, placer) if stays else (placer, holder)
            for after in (robot for robot in rank if robot != held):
                way = (changes + (after != free), (*path, (rank[after], rank[held])))
                ways[after, held] = min(way, ways.get((after, held), way))
    path = min(possible.values())[1]
    return [(robots[placer], robots[holder]) for placer, holder in path]


def _nobody(scene: Scene, free: Sequence[int], able: Set[int], k: int) -> StepError:
    """Return the error that no robot can place a brick."""
    brick = scene.placed[k]
    nodes = [node for node in brick.nodes if node not in scene.blocked_nodes]
    names = " and ".join(scene.robots[robot].name for robot in sorted({*free}))
    reach = "reach" if " and " in names else "reaches"
    why = f"brick {brick.name}: {names} {reach} none of its free nodes {nodes}"
    if able and k:
        why += f"; {scene.robots[min(able)].name} does, and holds the brick before"
    return StepError(f"{why}; extend a reach, or let another robot place it")


def cast(scene: Scene, roles: Sequence[Set[int]], robots: Sequence[int]) -> list[int]:
    """Assign a robot to every role that reaches all bricks which the role places.

    Bricks are indices in build order; of all assignments the lexicographically first, by role.
    """
    reach = {r: within_reach(scene, scene.robots[r]) for r in robots}
    fits = [[r for r in robots if all(reach[r][b] for b in role)] for role in roles]
    found = _first_match(fits)
    if found:
        return found
    role = min(range(len(roles)), key=lambda r: len(fits[r]))
    names, fit = (", ".join(scene.robots[r].name for r in some) for some in (robots, fits[role]))
    bricks = ", ".join(str(scene.placed[b].name) for b in sorted(roles[role]))
    raise StepError(
        f"robots {names}: not every role has a robot of its own: one places bricks {bricks}, all "
        f"within reach of {fit or 'none'}; extend a reach, name other robots, or write a schedule "
        "of your own"
    )


def _first_match(fits: Sequence[Sequence[int]]) -> list[int]:
    """Return the lexicographically first assignment of robots to roles; None if there is none."""
    for robot in fits[0] if fits else ():
        rest = [[other for other in fit if other != robot] for fit in fits[1:]]
        if not all(rest):
            continue
        count = 1 + max(map(max, rest), default=0)
        able = np.array([np.isin(np.arange(count), fit) for fit in rest], bool).reshape(-1, count)
        if (maximum_bipartite_matching(csr_array(able), perm_type="column") >= 0).all():
            return [robot, *_first_match(rest)]
    return []


def in_words(number: int) -> str:
    """Return a small number in words, a larger one in digits."""
    words = ("no", "one", "two", "three", "four", "five", "six")
    return words[number] if number < len(words) else str(number)


def lies_along(network: Network) -> frozenset[int]:
    """Return the names of bricks along the structure: joints meet both of their inner nodes."""
    along = _along(network, slice(None))
    return frozenset(network.scene.placed[i].name for i in np.flatnonzero(along).tolist())


def _along(network: Network, bricks: slice) -> Bools:
    """Return which of the given bricks lie along the structure."""
    half = network.edge_kind == PartKind.JOINT.value
    return np.asarray(np.isin(network.inner[bricks], network.edge_nodes[half, 0]).all(axis=1))


def _begins_elsewhere(network: Network) -> frozenset[int]:
    """Return the names of bricks at which the cantilever method turns to another part.

    A stretch is a brick that is held while others are placed, and these others. A brick begins
    elsewhere if no joint ties it to the stretch that is being built; so does the first one.
    """
    placed = network.scene.placed
    along, stretch, out = lies_along(network), set[int](), set[int]()
    tied = network.bodies(len(placed))
    for k, brick in enumerate(placed):
        if stretch.isdisjoint(tied[k]):
            out.add(brick.name)
        if brick.name in along | out:
            stretch = set()
        stretch.add(k)
    return frozenset(out)


def degeneration(network: Network, method: str) -> str:
    """Return why a method of `METHODS` degenerates to another one on a structure; else empty.

    Examples
    --------
    >>> import seqopt
    >>> shape = seqopt.ArchShape(pitch=(1.2, 0.4, -0.4, -1.2), pattern="V")
    >>> degeneration(seqopt.build_network(seqopt.arch_scene(shape)), "cantilever")
    'every brick lies along the structure: it is the sequential method here'
    """
    between = {brick.name for brick in network.scene.placed[1:-1]}  # after the last all let go
    if method != "cantilever":
        return ""
    if not between:
        return "no bricks lie between the first and the last: it is the sequential method here"
    along = lies_along(network)
    if along >= between:
        return "every brick lies along the structure: it is the sequential method here"
    swaps = along | _begins_elsewhere(network)
    if swaps >= between:
        return (
            "no brick extends one that is held: each begins elsewhere or lies along; "
            "it is the sequential method here"
        )
    if swaps & between:
        return ""
    first = network.scene.placed[0].name
    return f"no brick lies along the structure: brick {first} is held until the end"


_Grip = TypeVar("_Grip")


def placing_node(network: Network, robot: Robot, brick: Brick) -> int:
    """Return the node at which a robot holds a brick that it places.

    A robot on one side takes the node nearer to its side of a brick that lies across; any other
    case takes the brick's own placing node where it is within reach.
    """
    scene = network.scene
    at = scene.since[brick.name] - 1
    free = within_reach(scene, robot)[at]
    if not free:
        raise StepError(
            f"brick {brick.name}: {robot.name} reaches none of its free nodes {list(brick.nodes)}; "
            "extend a reach, or let another robot place it"
        )
    if isinstance(robot.reach, Side) and not _along(network, slice(at, at + 1)).all():
        toward = np.array(robot.reach.toward)
        return max(free, key=lambda node: float(toward @ np.array(brick.node_position(node))))
    return brick.placing_node if brick.placing_node in free else free[0]


@_says_reach
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


@_says_reach
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
    swaps = lies_along(network) | _begins_elsewhere(network)
    return _two_robots(network, "cantilever", swaps, robots)


METHODS: dict[str, Callable[..., tuple[Step, ...]]] = {
    "sequential": sequential,
    "cantilever": cantilever,
}


def alternate(
    network: Network,
    method: str,
    swap_after: Set[int],
    robots: Sequence[str],
    grip: Callable[[int, int], _Grip],
) -> Iterator[tuple[StepKind, int, tuple[_Grip | None, ...]]]:
    """Yield the steps in which two robots place and hold by turns.

    After each brick one of the two releases, if it holds anything; after the last one both do.
    ``grip`` says what a robot, by its index, holds of the brick that it places, by the brick count.
    """
    placed = network.scene.placed
    chosen = find_robots(network.scene, robots, method, 2)
    pairs = _take_turns(network, swap_after, chosen, [(chosen[0], chosen[1])] if robots else [])
    grips: list[_Grip | None] = [None] * len(network.scene.robots)
    for count, (brick, (placer, holder)) in enumerate(zip(placed, pairs, strict=True), start=1):
        grips[placer] = grip(placer, count)
        before = tuple(grips)
        yield StepKind.PLACE, count, before
        stays = placer if count == 1 or brick.name in swap_after else holder
        last = count == len(placed)
        grips = [None if last or i != stays else held for i, held in enumerate(grips)]
        if tuple(grips) != before:
            yield StepKind.RELEASE, count, tuple(grips)


def _two_robots(
    network: Network, method: str, swap_after: Set[int], robots: Sequence[str]
) -> tuple[Step, ...]:
    """Return the sequence in which holder and placer swap after placing some of the bricks."""
    scene = network.scene

    def node(robot: int, count: int) -> int:
        return placing_node(network, scene.robots[robot], scene.placed[count - 1])

    parts = alternate(network, method, swap_after, robots, node)
    steps = [Step(number, *part) for number, part in enumerate(parts, start=1)]
    check_support(network, steps)
    return check_sequence(scene, steps)
