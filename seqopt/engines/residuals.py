"""Residuals of the equations of equilibrium for the fields of an engine.

Deformations, wrenches and balances are written out here once more, on purpose: a check that used
the maps of `seqopt.network.kinematics` would share their errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Fields
from seqopt.network.network import GROUND, Network


@dataclass(frozen=True)
class Residuals:
    """What is left of the equations when fields are put in, without unit.

    Attributes
    ----------
    equilibrium : float
        Force or moment left on a brick over the largest sum of magnitudes on one.
    joints : float
        Wrench of a joint less stiffness times deformation, over the sum of the magnitudes in it, or
        over the weight of a brick where they are smaller.
    grips : float
        Motion of a held node over the largest motion of any brick, or over what the weight of a
        brick does to the stiffest joint where all are smaller.
    plain : float
        Stiffness times motions less load, over the load: no measure of quality, shown to compare.
    """

    equilibrium: float
    joints: float
    grips: float
    plain: float

    @property
    def backward_error(self) -> float:
        """The largest of the three that measure quality."""
        return max(self.equilibrium, self.joints, self.grips)


def residual(network: Network, bricks: int, columns: Ints, fields: Fields) -> Residuals:
    """Return the residuals of the first grip set's fields, from the network alone.

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    columns : (r,) int
        Grips as indices into ``network.inner.ravel()``.
    fields : Fields
        With joint wrenches and brick twists.
    """
    springs, center = network.springs, network.centroid[:bricks]
    acting = springs.acting(bricks)
    bodies, at, axes = springs.bodies[acting], springs.position[acting], springs.axes[acting]
    raw = springs.stiffness[acting]
    wrench, twist = fields.joint_wrench[0, acting], fields.brick_twist[0]
    gap, moved = np.zeros_like(wrench), np.zeros_like(wrench)
    for side, sign in ((0, -1.0), (1, 1.0)):
        there = np.flatnonzero(bodies[:, side] != GROUND)
        body = bodies[there, side]
        parts = _moved(twist[body], at[there] - center[body])
        gap[there] += sign * parts.sum(axis=0)
        moved[there] += np.abs(parts).sum(axis=0)
    law = _spring_force(axes, raw, gap)
    size = raw.reshape(-1, 2, 3).max(axis=2)[:, :, None]
    scale = (size * moved.reshape(-1, 2, 3) + np.abs(wrench).reshape(-1, 2, 3)).max(axis=2)
    heavy, least = _beside_weight(network, bricks, raw)
    apart = np.abs(wrench + law).reshape(-1, 2, 3).max(axis=2)
    node = network.node_position[network.inner[:bricks].ravel()]
    owner = columns // 2
    grip = np.hstack([fields.grip_force[0], np.zeros((len(columns), 3))])
    still = _moved(twist[owner], node[columns] - center[owner]).sum(axis=0)[:, :3]
    every = np.repeat(np.arange(bricks), 2)
    motion = np.abs(_moved(twist[every], node - center[every])[:, :, :3]).sum(axis=0).max()
    dead = np.hstack([network.weight[:bricks], np.zeros((bricks, 3))])
    outside = [(np.arange(bricks), center, dead), (owner, node[columns], grip)]
    left = _balance(center, [*_both(bodies, at, wrench), *outside])
    plain = _balance(center, [*_both(bodies, at, -law), *outside])[0]
    return Residuals(
        equilibrium=_ratio(left[0], left[1]),
        joints=float((apart / np.maximum(scale, heavy)).max()),
        grips=float(np.abs(still).max(initial=0.0) / max(motion, least)),
        plain=float(np.linalg.norm(plain[:, :3]) / np.linalg.norm(dead)),
    )


def _beside_weight(network: Network, bricks: int, stiffness: Floats) -> tuple[Floats, float]:
    """Return the weight of a brick, its moment over a brick's length, and what it moves, m."""
    tiny = np.finfo(float).tiny
    heavy = float(np.linalg.norm(network.weight[:bricks], axis=1).max())
    ends = network.node_position[network.inner[:bricks]]
    longest = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max())
    moved = heavy / max(stiffness[:, :3].max(initial=0.0), tiny)
    return np.maximum([heavy, heavy * longest], tiny), max(moved, tiny)


Pull = tuple[Ints, Floats, Floats]  # bricks, points and wrenches about them


def _both(bodies: Ints, at: Floats, wrench: Floats) -> list[Pull]:
    """Return the wrenches of springs on both of their bodies."""
    pulls = []
    for side, sign in ((0, -1.0), (1, 1.0)):
        there = np.flatnonzero(bodies[:, side] != GROUND)
        pulls.append((bodies[there, side], at[there], sign * wrench[there]))
    return pulls


def _moved(twist: Floats, arm: Floats) -> Floats:
    """Return what two bricks' translation and rotation add to the motion at an arm, (2, n, 6)."""
    zero = np.zeros_like(arm)
    turning = np.hstack([np.cross(twist[:, 3:], arm), twist[:, 3:]])
    return np.stack([np.hstack([twist[:, :3], zero]), turning])


def _spring_force(axes: Floats, stiffness: Floats, gap: Floats) -> Floats:
    """Return stiffness times deformation in global axes, (s, 6)."""
    own = np.einsum("sij,shj->shi", axes, gap.reshape(-1, 2, 3)) * stiffness.reshape(-1, 2, 3)
    return np.asarray(np.einsum("sij,shi->shj", axes, own).reshape(-1, 6))


def _balance(center: Floats, pulls: list[Pull]) -> tuple[Floats, Floats]:
    """Return the sums (b, 6) of wrenches on every brick about its centroid, and of magnitudes."""
    total, size = np.zeros((2, len(center), 6))
    for body, point, wrench in pulls:
        turn = np.hstack([np.zeros_like(point), np.cross(point - center[body], wrench[:, :3])])
        np.add.at(total, body, wrench + turn)
        np.add.at(size, body, np.abs(wrench) + np.abs(turn))
    return total, size


def _ratio(total: Floats, size: Floats) -> float:
    """Return the larger of forces and moments left over, each over its largest magnitude."""
    rest, most = (np.abs(a).reshape(-1, 2, 3).max(axis=(0, 2)) for a in (total, size))
    return float((rest / np.maximum(most, np.finfo(float).tiny)).max())
