"""Robots that pinch a brick between two square pads, as in the study's discrete-element model."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from itertools import product

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, Ints
from seqopt.contact.mortar import EPOXY, Mortar
from seqopt.engines._grip_compliance import GripCompliance
from seqopt.engines.discrete._bed import BedStiffness
from seqopt.engines.discrete._equilibrium_path import Held
from seqopt.engines.discrete._system import System
from seqopt.engines.discrete.engine import DiscreteEngine, _Spring
from seqopt.network._mechanics import point_motion
from seqopt.network.network import Network
from seqopt.scene.scene import Scene


class Across(IntEnum):
    """Which way two pads press on a brick: along its width or its thickness."""

    WIDTH = 1
    THICKNESS = 2


@dataclass(frozen=True)
class Pinch:
    """Two square pads that hold a brick on either side of its node and do not slip.

    ``stiffness``: of the pads; ``side``: of a pad, m.
    """

    across: Across
    stiffness: BedStiffness
    side: float


class PaddedEngine(DiscreteEngine):
    """Discrete elements with robots that pinch their bricks; without a pinch they hold nodes."""

    def __init__(
        self,
        network: Network | Scene,
        mortar: Mortar = EPOXY,
        bed: BedStiffness | None = None,
        pinch: Pinch | None = None,
    ) -> None:
        super().__init__(network, mortar, bed)
        self._pinch = pinch

    def _hold(
        self, system: System, columns: Ints, compliance: GripCompliance, springs: list[_Spring]
    ) -> Held:
        if self._pinch is None:
            return super()._hold(system, columns, compliance, springs)
        far = compliance.offsets(1, len(columns))[0]
        blocks = [sparse.csr_array((6, 6))] * (len(system.load) // 6)
        units, pull = np.outer(system.unit[:6], system.unit[:6]), np.zeros_like(system.load)
        inner = self.network.node_position[self.network.inner.ravel()]
        for column, moved in zip(columns, far, strict=True):
            body = column // 2
            pads = pad_stiffness(self.network, body, inner[column], self._pinch) * units
            blocks[body] = blocks[body] + sparse.csr_array(pads)
            pull[6 * body : 6 * body + 6] += pads[:, :3] @ (moved / system.unit[:3])
        every = sparse.eye_array(len(system.load), format="csr")
        pads_of = sparse.csr_array(sparse.block_diag(blocks, format="csr"))
        return Held(system, every, pads_of, np.zeros_like(pull), pull)


def pad_stiffness(network: Network, index: int, node: Floats, pinch: Pinch) -> Floats:
    """Return the stiffness (6, 6) with which two pads beside a node hold a brick's twists."""
    brick = network.scene.placed[index]
    out, sides = brick.frame[pinch.across], np.delete(brick.frame, pinch.across, axis=0)
    moduli = pinch.stiffness.tangential * np.eye(3)
    moduli += (pinch.stiffness.normal - pinch.stiffness.tangential) * np.outer(out, out)
    total = np.zeros((6, 6))
    reach = pinch.side / np.sqrt(12)  # four points here have a square's second moments
    for sign, a, b in product((-0.5, 0.5), (-reach, reach), (-reach, reach)):
        point = node + sign * brick.dimensions[pinch.across] * out + a * sides[0] + b * sides[1]
        moved = point_motion(point - network.centroid[index])
        total += pinch.side**2 / 4 * moved.T @ moduli @ moved
    return total
