"""What arms of robots allow, and the compliance of their grips by the joints.

A room of its own works it out and offers it in `seqopt._registry`: no other one imports it. Nobody
is asked where robots have no arms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from seqopt.arrays import Bools, Ints, Terse
from seqopt.errors import ProblemError
from seqopt.scene.arm import from_arms
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.work.progress import Tell


@dataclass(frozen=True)
class Unreached:
    """A step without compatible postures: its number, the grips, and the reason in words."""

    step: int
    why: str


@dataclass(frozen=True, repr=False)
class PlanPostures(Terse):
    """The postures of a plan.

    ``steps``: by step, which row of ``table`` each robot of the scene is in; None for a robot that
    holds nothing or has no arm, and for all where there is no way. ``unreached``: the steps that
    arms cannot be in, or not without changing a posture while they hold.
    """

    table: Any  # a `seqopt.arms.PostureTable`
    steps: tuple[tuple[int | None, ...], ...]
    unreached: tuple[Unreached, ...]


def find_postures(scene: Scene, cache: Path | str | None = None, tell: Tell | None = None) -> None:
    """Compute the postures of arms, or read them from a folder, before they are asked for."""
    if not (cache is None or (isinstance(cache, str | Path) and str(cache))):
        raise ProblemError(f"cache is {cache!r}; give the path of a folder")
    if scene.has_arms:
        from_arms("find_postures")(scene, cache, tell)


def within_reach(scene: Scene, robot: Robot) -> tuple[tuple[int, ...], ...]:
    """Return the nodes, not blocked, that a robot reaches, brick by brick in build order.

    That of an arm is in reach if a posture of it is possible when the brick is placed.
    """
    own = scene.within_reach(robot)
    if robot.arm is None:
        return own
    until = from_arms("permits")(scene).until[scene.robots.index(robot)]
    return tuple(
        tuple(n for i, n in enumerate(b.nodes) if n in nodes and until[2 * k + i + 1] > k + 1)
        for k, (b, nodes) in enumerate(zip(scene.placed, own, strict=True))
    )


def reachable(scene: Scene, robot: Robot, bricks: int) -> tuple[int, ...]:
    """Return the nodes of the first bricks that a robot may hold while these stand, in order."""
    nodes = tuple(node for brick in within_reach(scene, robot)[:bricks] for node in brick)
    if robot.arm is None:
        return nodes
    until = from_arms("permits")(scene).until[scene.robots.index(robot)]  # ends, by place
    place = {node: i for i, node in enumerate(scene.placed_nodes, start=1)}
    return tuple(node for node in nodes if until[place[node]] > bricks)


def go_together(scene: Scene, bricks: int, held: Ints) -> Bools:
    """Return which states (n,) of a scene with arms have postures that go together.

    ``bricks``: how many stand; ``held`` (n, R): places in build order that robots hold, from 1;
    none above 0 is a free robot.
    """
    out: Bools = from_arms("permits")(scene).allowed(bricks, held)
    return out


class _NoRules:
    """Which states arms can be in, by a second way for the judge: all, of robots without any."""

    def allow(self, bricks: int, states: Ints) -> Bools:
        """Return which states (n, c) of places have postures that go together, (n,)."""
        return np.ones(len(states), dtype=bool)


def posture_rules(scene: Scene, team: Sequence[int]) -> _NoRules:
    """Return the judge's rules of arms; ``team``: robots of the columns of states, by index."""
    rules: _NoRules = from_arms("PostureRules")(scene, team) if scene.has_arms else _NoRules()
    return rules


def check_postures(scene: Scene, steps: Sequence[object]) -> None:
    """Raise a `StepError` if arms have no postures that go together in a step.

    Or if the compliance of their grips is not that of their joints.
    """
    if scene.has_arms:
        from_arms("check_postures")(scene, steps)
