"""Which robot places and which holds: the roles of a method, filled by reach or by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from itertools import permutations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from seqopt.errors import StepError, did_you_mean
from seqopt.network.network import Network
from seqopt.scene.parts import Brick, Robot
from seqopt.scene.scene import Scene

Pair = tuple[int, int]  # who places, who holds meanwhile: indices of the scene's robots
_Ways = dict[Pair, tuple[int, tuple[Pair, ...]]]  # by pair: changes so far, pairs so far


def find_robots(scene: Scene, names: Sequence[str], method: str, roles: int) -> list[int]:
    """Return which robots a method may use, in the order of its roles.

    Parameters
    ----------
    scene : Scene
    names : sequence of str
        Of robots, in the order of the roles; none for all robots of the scene.
    method : str
        Whose roles they are, for the message.
    roles : int
        How many roles the method has.

    Returns
    -------
    list of int
        Indices of the scene's robots.

    Raises
    ------
    StepError
        If there are not as many as roles, or one is not in the scene or named twice.
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
    if len({*names}) < len(names):
        raise StepError(f"robots {', '.join(names)}: one occurs twice; name different ones")
    if len(names) != roles:
        wanted = in_words(roles)
        raise StepError(f"robots {', '.join(names)}: {len(names)} named; {method} takes {wanted}")
    return [known.index(name) for name in names]


def can_place(scene: Scene, robot: Robot, brick: Brick) -> bool:
    """Return whether a robot reaches a node by which it can place a brick.

    Parameters
    ----------
    scene : Scene
        With the nodes that are blocked.
    robot : Robot
    brick : Brick
    """
    return any(
        node not in scene.blocked_nodes and robot.reach.covers(brick.node_position(node))
        for node in brick.nodes
    )


def take_turns(
    network: Network, swap_after: Set[int], robots: Sequence[int], starts: Sequence[Pair] = ()
) -> list[Pair]:
    """Return who places every brick and who holds meanwhile, two robots at a time.

    After some bricks the one that placed stays and holds, after the others the one that held. The
    two are the same all along where their reach allows it; otherwise a third robot takes the place
    of the one that is free, as seldom as possible. Ties go to the order of the robots.

    Parameters
    ----------
    network : Network
    swap_after : set of int
        Names of the bricks after which who placed stays.
    robots : sequence of int
        Indices of the robots that may take part.
    starts : sequence of (int, int), optional
        Who may place the first brick, and who is its partner; by default any two.

    Returns
    -------
    list of (int, int)
        For every brick in build order.

    Raises
    ------
    StepError
        Naming the first brick that nobody can place who does not hold.
    """
    scene = network.scene
    rank = {robot: i for i, robot in enumerate(robots)}
    ways: _Ways = {
        (placer, holder): (0, ((rank[placer], rank[holder]),))
        for placer, holder in starts or permutations(robots, 2)
    }
    for k, brick in enumerate(scene.placed):
        able = {robot for robot in rank if can_place(scene, scene.robots[robot], brick)}
        possible = {pair: way for pair, way in ways.items() if pair[0] in able}
        if not possible:
            raise _nobody(scene, [pair[0] for pair in ways], able, k)
        ways = _go_on(possible, rank, swapped=k == 0 or brick.name in swap_after)
    path = min(possible.values())[1]
    return [(robots[placer], robots[holder]) for placer, holder in path]


def _go_on(ways: _Ways, rank: Mapping[int, int], *, swapped: bool) -> _Ways:
    """Return the best way to every pair that can be at work at the next brick."""
    out: _Ways = {}
    for (placer, holder), (changes, path) in ways.items():
        free, held = (holder, placer) if swapped else (placer, holder)
        for after in rank:
            if after != held:
                way = (changes + (after != free), (*path, (rank[after], rank[held])))
                out[after, held] = min(way, out.get((after, held), way))
    return out


def _nobody(scene: Scene, free: Sequence[int], able: Set[int], k: int) -> StepError:
    """Return the error that nobody is left to place a brick."""
    brick = scene.placed[k]
    nodes = [node for node in brick.nodes if node not in scene.blocked_nodes]
    names = " and ".join(scene.robots[robot].name for robot in sorted({*free}))
    reach = "reach" if " and " in names else "reaches"
    why = f"brick {brick.name}: {names} {reach} none of its free nodes {nodes}"
    if able and k:
        why += f"; {scene.robots[min(able)].name} does, and holds the brick before"
    return StepError(f"{why}; extend a reach or let another robot place it")


def cast(scene: Scene, roles: Sequence[Set[int]], robots: Sequence[int]) -> list[int]:
    """Return a different robot for every role that reaches all bricks which the role places.

    Parameters
    ----------
    scene : Scene
    roles : sequence of set of int
        By role, which bricks it places: indices in build order.
    robots : sequence of int
        Who may take a role; of all ways the first in this order is taken, role by role.

    Returns
    -------
    list of int
        Indices of the scene's robots.

    Raises
    ------
    StepError
        Naming the role for which nobody is left, and its bricks.
    """
    fits = [
        [r for r in robots if all(can_place(scene, scene.robots[r], scene.placed[b]) for b in role)]
        for role in roles
    ]
    found = _first_match(fits)
    if found:
        return found
    role = min(range(len(roles)), key=lambda r: len(fits[r]))
    names = ", ".join(scene.robots[robot].name for robot in robots)
    bricks = ", ".join(str(scene.placed[b].name) for b in sorted(roles[role]))
    fit = ", ".join(scene.robots[robot].name for robot in fits[role]) or "none"
    raise StepError(
        f"robots {names}: not every role has a robot of its own: one places bricks {bricks}, all "
        f"within reach of {fit}; extend a reach, name other robots, or write a schedule of your own"
    )


def _first_match(fits: Sequence[Sequence[int]]) -> list[int]:
    """Return the first way to give every role a robot of its own; none if there is no way."""
    for robot in fits[0] if fits else ():
        rest = [[other for other in fit if other != robot] for fit in fits[1:]]
        if _matched(rest):
            return [robot, *_first_match(rest)]
    return []


def _matched(fits: Sequence[Sequence[int]]) -> bool:
    """Return whether every role can have a robot that no other has."""
    if not fits or not all(fits):
        return not fits
    able = np.zeros((len(fits), 1 + max(map(max, fits))), dtype=bool)
    for role, robots in enumerate(fits):
        able[role, list(robots)] = True
    return bool((maximum_bipartite_matching(csr_array(able), perm_type="column") >= 0).all())


def in_words(number: int) -> str:
    """Return a small number in words, a larger one in digits."""
    words = ("no", "one", "two", "three", "four", "five", "six")
    return words[number] if number < len(words) else str(number)
