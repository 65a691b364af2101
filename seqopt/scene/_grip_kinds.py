"""Kinds of grips: how robots of a scene give way at the nodes that they hold.

Robots that give way alike and carry as much are one kind, in the order of their first robots. One
with an arm whose joints give way is a kind by itself: how, depends on where it stands and holds.
Engines are asked about grips by number: that of the node, and for a robot of kind k more by k times
the span of all node numbers. Where all robots are alike a grip is its node's number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.scene.parts import Robot


@dataclass(frozen=True, eq=False, repr=False)
class GripKinds(FrozenValue):
    """The K kinds of a scene's robots.

    ``compliance`` (K, 6, 6): how a node shifts and turns, m and rad, against the hand that holds
    it for a force and a moment on it, N and N m; zero where the hand is rigid. ``arms`` (K,):
    whether the joints of an arm give way beside it, as `seqopt.arms` knows of every node.
    ``turns`` (K,): whether hands of a kind bear moments; others let their nodes turn. ``payload``
    (K,): N. ``of_robot`` (R,): the kind of every robot. ``first``, ``span``: the least node number,
    and how far apart kinds are.
    """

    compliance: Floats
    arms: Bools
    turns: Bools
    payload: Floats
    of_robot: Ints
    first: int
    span: int

    @cached_property
    def rigid(self) -> bool:
        """Whether all hands are rigid and let their nodes turn."""
        return not (self.compliance.any() or self.turns.any() or self.arms.any())

    @property
    def gives(self) -> Bools:
        """Which kinds (K,) give way to forces."""
        return np.asarray(self.compliance[:, :3, :3].any(axis=(1, 2)) | self.arms)

    def numbers(self, nodes: Ints, robots: Sequence[int]) -> Ints:
        """Return the numbers (..., r) of grips of r robots, by index, on nodes (..., r)."""
        if len(self.turns) == 1:
            return nodes
        return np.asarray(nodes + self.span * self.of_robot[np.asarray(robots, dtype=np.int64)])

    def split(self, numbers: Ints) -> tuple[Ints, Ints]:
        """Return the nodes and the kinds of grips; kinds that there are not, of wrong numbers."""
        if len(self.turns) == 1:
            return numbers, np.zeros(numbers.shape, dtype=np.int64)
        kind = (numbers - self.first) // self.span
        known = (kind >= 0) & (kind < len(self.turns))
        kind = np.where(known, kind, 0)
        return numbers - self.span * kind, kind


def grip_kinds(robots: Sequence[Robot], nodes: Sequence[int]) -> GripKinds:
    """Return the kinds of robots; one that is rigid where there is none. ``nodes``: all numbers."""
    ways = [(r.stiffness, r.rotational_stiffness, r.payload, _soft_arm(r)) for r in robots]
    kinds = list(dict.fromkeys(ways)) or [(None, None, np.inf, "")]
    compliance = np.zeros((len(kinds), 6, 6))
    for own, (shift, turn, *_) in zip(compliance, kinds, strict=True):
        for at, stiffness in ((0, shift), (3, turn)):
            if stiffness is not None:
                own[range(at, at + 3), range(at, at + 3)] = 1 / np.array(stiffness)
    arms = np.array([bool(arm) for *_, arm in kinds])
    turns = np.array([turn is not None for _, turn, *_ in kinds])
    payload = np.array([most for *_, most, _ in kinds])
    of_robot = np.array([kinds.index(way) for way in ways], dtype=np.int64)
    first, span = min(nodes), max(nodes) - min(nodes) + 1
    return GripKinds(compliance, arms, turns, payload, of_robot, first, span)


def _soft_arm(robot: Robot) -> str:
    """Return the name of a robot with an arm whose joints give way; empty for others."""
    return robot.name if robot.arm is not None and robot.arm.joint_stiffness else ""
