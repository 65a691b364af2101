"""Which states arms can be in, as a judge sees them: looked up, one by one.

A second route to what `seqopt.arms._permits.Permits` says: it takes from there with which postures
plans are made, and asks the table itself what these hit. The compliance of grips by the joints of
arms is found by moving every joint a little, from places of the flange, without the Jacobian.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from seqopt.arms._permits import find_table, permits
from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import StepError
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

if TYPE_CHECKING:
    from seqopt.arms._model import ArmModel


_LITTLE = 1e-4  # by which joints are moved, rad or m
_SAME = 1e-6  # difference of compliances, over the largest
_REACHED = 1e-3  # how far a node may be off the tip of the tool, over its length


class PostureRules:
    """What a posture table allows to robots in a scene.

    ``team``: the robots of columns of states, by their indices.
    """

    def __init__(self, scene: Scene, team: Sequence[int]) -> None:
        self._table, self._rows = find_table(scene), permits(scene).rows
        self._armed = [(c, r) for c, r in enumerate(team) if scene.robots[r].arm is not None]
        self._known: dict[tuple[int, ...], bool] = {}
        # by bricks, robot and place: postures that hit nothing, as bits of a number
        self._options: dict[tuple[int, int, int], int] = {}
        column = {name: i for i, name in enumerate(self._table.bricks)}
        self._placed = [column[name] for name in scene.build_order]
        self._apart = [
            int.from_bytes(np.packbits(~np.array(row), bitorder="little").tobytes(), "little")
            for row in self._table.collide
        ]

    def allow(self, bricks: int, states: Ints) -> Bools:
        """Return which states have postures that go together while so many bricks stand, (n,).

        ``states`` (n, c): places in build order of the nodes held, from 1; none above 0 is free.
        """
        held = states[:, [column for column, _ in self._armed]].clip(min=0).tolist()
        standing = self._placed[:bricks]
        for places in held:
            if (bricks, *places) in self._known:
                continue
            pairs = zip(self._armed, places, strict=True)
            asked = [(bricks, robot, place) for (_, robot), place in pairs if place]
            for key in asked:
                if key not in self._options:
                    rows = [row for row in self._rows[key[1:]].tolist() if row >= 0]
                    clear = (row for row in rows if not self._table.hits[row, standing].any())
                    self._options[key] = sum(1 << row for row in clear)
            self._known[bricks, *places] = self._fit([self._options[key] for key in asked])
        return np.array([self._known[bricks, *places] for places in held], dtype=bool)

    def _fit(self, masks: Sequence[int]) -> bool:
        """Return whether there is a posture in each set that goes with those in the others."""
        if not masks:
            return True
        first, rest = masks[0], masks[1:]
        while first:
            row = (first & -first).bit_length() - 1
            left = [mask & self._apart[row] for mask in rest]
            if all(left) and self._fit(left):
                return True
            first &= first - 1
        return False


def check_postures(scene: Scene, steps: Sequence[Step]) -> None:
    """Raise a `StepError` if arms have no postures that go together in a step.

    Or if one is not at its node, or the compliance of a grip is not that of its arm's joints.
    """
    rules = PostureRules(scene, range(len(scene.robots)))
    places = {None: 0} | {node: i for i, node in enumerate(scene.placed_nodes, start=1)}
    for step in steps:
        grips = np.array([[places[node] for node in step.grips]])
        if not rules.allow(step.bricks, grips)[0]:
            raise StepError(f"step {step.number}: arms cannot hold {list(step.held)} together")
    held, table = scene.held_postures, find_table(scene)
    if held is None:
        return
    from seqopt.arms._model import ArmModel  # noqa: PLC0415  # few scenes have arms

    for own, robot in enumerate(held.robots.tolist()):  # at all nodes: a proof uses all
        arm, name = scene.robots[robot].arm, scene.robots[robot].name
        assert arm is not None
        model, given = ArmModel(arm), held.compliance(scene.arms)[own]
        for place in np.flatnonzero(held.rows[own] >= 0).tolist():
            node = int(held.nodes[place])
            way, at = _moved(model, table.joints[held.rows[own, place], : model.joints])
            compliance = way / np.array(arm.joint_stiffness) @ way.T
            off = np.linalg.norm(at - np.array(scene.node_position(node)))
            apart = np.abs(compliance - given[place]).max() / np.abs(compliance).max()
            if not (apart <= _SAME and off <= _REACHED * arm.tool_length):
                raise StepError(
                    f"the grip of {name} at node {node} has another compliance than its joints"
                )


def _moved(model: ArmModel, joints: Floats) -> tuple[Floats, Floats]:
    """Return how the tip of the tool moves and turns with joints, (6, J), and where it is."""

    def tip(posture: Floats) -> tuple[Floats, Floats]:
        axes, place = model.flange_pose(posture)
        return axes, place + model.arm.tool_length * axes[:, 2]

    axes, at = tip(joints)
    out = np.zeros((6, len(joints)))
    for k, way in enumerate(_LITTLE * np.eye(len(joints))):
        (turned, ahead), (back, behind) = tip(joints + way), tip(joints - way)
        out[:3, k] = (ahead - behind) / (2 * _LITTLE)
        spin = (turned - back) @ axes.T / (2 * _LITTLE)
        out[3:, k] = spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]
    out[3:] *= 0.5
    return out, at
