"""How grips of arms give way whose joints do: in the one posture in which each holds each node.

An arm whose joints have stiffnesses holds a node in one posture, the same in all build orders and
plans, so that it is known how its grip gives way. It is chosen by the bricks that it hits, by how
often it is in the way of those of other arms, and, where that leaves a choice, by how stiff it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from seqopt.arms._model import ArmModel
from seqopt.arms._reached import Site, choose
from seqopt.arms.reach import PostureTable, find_postures
from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.scene.arm import Arm
from seqopt.scene.scene import Scene

_SITES = 16  # of which it is kept, the last ones that were asked for
_STIFFER = 1e-6  # share of a posture's use that counts as much as how stiff it is
_KEY = "_held_postures"


@dataclass(frozen=True, eq=False, repr=False)
class HeldPostures(FrozenValue):
    """The postures of A arms whose joints give way, at N nodes, one of each arm at each node.

    ``robots`` (A,): indices of the scene's robots; ``nodes`` (N,): ascending; ``rows`` (A, N):
    postures of the table, -1 for none; ``jacobians``: by arm (N, 6, J), how a node moves with
    joints, m and rad, in the axes of the scene; NaN where there is no posture.
    """

    robots: Ints
    nodes: Ints
    rows: Ints
    jacobians: tuple[Floats, ...]

    def row(self, robot: int, node: int) -> int | None:
        """Return the posture of a robot at a node, -1 if there is none; None if any will do."""
        own = np.flatnonzero(self.robots == robot)
        if not len(own):
            return None
        return int(self.rows[own[0], np.searchsorted(self.nodes, node)])

    def compliance(self, scene: Scene) -> Floats:
        """Return how grips give way by the joints alone, (A, N, 6, 6); m and rad, N and N m."""
        out = []
        for robot, jacobian in zip(self.robots.tolist(), self.jacobians, strict=True):
            arm = scene.robots[robot].arm
            assert arm is not None
            stiffness = np.array(arm.joint_stiffness)
            out.append(np.einsum("nij,nkj->nik", jacobian / stiffness, jacobian))
        return np.array(out)


def held_postures(scene: Scene) -> HeldPostures | None:
    """Return the postures in which arms hold whose joints give way; None if there are no such arms.

    They are computed once, and go along with a scene to other processes.
    """
    if not scene.grip_kinds.arms.any():
        return None
    if _KEY not in vars(scene):
        table = find_postures(scene)
        assert table is not None
        arms = tuple((robot.name, robot.arm) for robot in scene.robots)
        vars(scene)[_KEY] = _held(Site.of(scene), table, arms)
    found = vars(scene)[_KEY]
    assert isinstance(found, HeldPostures)
    return found


def can_hold(scene: Scene, kind: int, node: int) -> bool:
    """Return whether it is known how grips of a kind give way at a node."""
    held = held_postures(scene)
    if held is None or not scene.grip_kinds.arms[kind]:
        return True
    return held.row([*scene.grip_kinds.of_robot].index(kind), node) != -1


def hold_alike(nominal: Scene, scene: Scene) -> Scene:
    """Return a variation of a scene in which robots hold in the postures of the nominal one.

    It is as it was where it has other arms: joints may have other stiffnesses.
    """
    arms = [[_bare(robot.arm) for robot in each.robots] for each in (nominal, scene)]
    if arms[0] == arms[1] and {*nominal.brick_of_node} == {*scene.brick_of_node}:
        found = held_postures(nominal)
        if found is not None:
            scene = replace(scene)
            vars(scene)[_KEY] = found
    return scene


def _bare(arm: Arm | None) -> object:
    """Return what counts of an arm for its postures, and whether its joints give way."""
    return arm and (replace(arm, postures=1, joint_stiffness=()), bool(arm.joint_stiffness))


@lru_cache(maxsize=_SITES)
def _held(
    site: Site, table: PostureTable, arms: tuple[tuple[str, Arm | None], ...]
) -> HeldPostures:
    order = np.argsort(table.nodes)
    chosen, robots, rows, found = _chosen(site, table)[:, order], [], [], []
    for robot, (name, arm) in enumerate(arms):
        if arm is None or not arm.joint_stiffness:
            continue
        model, own = ArmModel(arm), chosen[table.robots.index(name)]
        jacobian = np.full((len(own), 6, model.joints), np.nan)
        for place in np.flatnonzero(own >= 0).tolist():
            jacobian[place] = model.jacobian(table.joints[own[place], : model.joints])
        robots.append(robot)
        rows.append(own)
        found.append(jacobian)
    return HeldPostures(
        np.array(robots), np.array(table.nodes)[order], np.array(rows), tuple(found)
    )


def _chosen(site: Site, table: PostureTable) -> Ints:
    """Return the posture of every arm at every node, (R, N), -1 where there is none.

    What is near counts most: bricks near the node, which stand when it is held, and postures at
    nodes near by, which are held with it. The build order does not count.
    """
    at = np.array([b.node_position(n) for b in site.bricks for n in b.nodes])
    middle = np.array([brick.position for brick in site.bricks])
    size = np.mean([max(brick.dimensions) for brick in site.bricks])
    near = 1 / (1 + np.linalg.norm(at[:, None] - middle, axis=2) / size)
    together = 1 / (1 + np.linalg.norm(at[:, None] - at, axis=2) / size)
    own = near[table.node]
    usable = 1 - (table.hits * own).sum(axis=1) / own.sum(axis=1)
    give = np.nan_to_num(np.trace(table.compliance[:, :3, :3], axis1=1, axis2=2))
    usable -= _STIFFER * give / max(give.max(initial=0.0), np.finfo(float).tiny)
    return choose((table.robot, table.node), usable, table.collide, together, len(table.robots))
