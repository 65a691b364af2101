"""What generators of scenes share: checked numbers, robots, and an order in which all touch."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from seqopt.errors import SceneError
from seqopt.scene.checks import positive, short
from seqopt.scene.parts import Brick, Robot

STANDARD_GRAVITY = 9.81  # m/s²
MOST_BRICKS = 20_000  # of a generated scene


def mobile_robots(bricks: Sequence[Brick], count: int = 3) -> tuple[Robot, ...]:
    """Return robots that reach everything, each of which can bear all bricks.

    Returns
    -------
    tuple of Robot
        ``rob1``, ``rob2`` …
    """
    weight = STANDARD_GRAVITY * math.fsum(brick.mass for brick in bricks)
    return tuple(Robot(name=f"rob{i}", payload=weight) for i in range(1, count + 1))


def touching_order(
    count: int, pairs: Iterable[tuple[int, int]], starts: Iterable[int]
) -> list[int]:
    """Return an order in which everything touches what stands before it, or the ground.

    Parameters
    ----------
    count : int
        How many there are; their own order is kept where it can be.
    pairs : iterable of (int, int)
        Which touch each other.
    starts : iterable of int
        Which stand on the ground.

    Returns
    -------
    list of int
        All that can be reached.
    """
    beside: list[set[int]] = [set() for _ in range(count)]
    for a, b in pairs:
        beside[a].add(b)
        beside[b].add(a)
    ready, waiting, order = {*starts}, [*range(count)], list[int]()
    while found := next((i + 1 for i in waiting if i in ready), 0):
        order.append(found - 1)
        waiting.remove(found - 1)
        ready |= beside[found - 1]
    return order


def whole_number(where: str, value: int, least: int) -> int:
    """Return a whole number that is large enough, and at most `MOST_BRICKS`.

    Parameters
    ----------
    where : str
        What it is, for the message.
    value : int
    least : int

    Raises
    ------
    SceneError
        If it is something else.
    """
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not least <= value <= MOST_BRICKS:
        raise SceneError(
            f"{where} is {short(value)}; give a whole number from {least} to {MOST_BRICKS}"
        )
    return int(value)


def few_enough(where: str, bricks: int) -> None:
    """Raise an error if a structure would have more than `MOST_BRICKS`.

    Parameters
    ----------
    where : str
        What it is, for the message.
    bricks : int

    Raises
    ------
    SceneError
        Saying how many it would have.
    """
    if bricks > MOST_BRICKS:
        raise SceneError(f"{where}: {bricks} bricks; give numbers that make at most {MOST_BRICKS}")


def joint_width(where: str, value: float) -> float:
    """Return the width of a joint, which may be none.

    Parameters
    ----------
    where : str
        What it is, for the message.
    value : float
        m.

    Raises
    ------
    SceneError
        If it is negative or not finite.
    """
    return 0.0 if value == 0 else positive(where, value, "m, or 0")
