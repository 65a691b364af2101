"""Partial arches on springs at the corners of faces, as rigid blocks in discrete elements have.

A face is springs at its corners, each with an equal share of its area. It is three times too stiff
against bending, as the corners of a rectangle are √3 times as far out as points that stand for an
even bed. `AtCorners` is the discrete-element engine with such faces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from seqopt.arrays import Floats, Ints
from seqopt.contact._elastic_limits import opening_maps
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import bare_assembly
from seqopt.contact.mortar import EPOXY, BedStiffness, Mortar
from seqopt.engines._grip_compliance import GripCompliance
from seqopt.engines.discrete._system import Held, System, build_system
from seqopt.engines.discrete.engine import DiscreteEngine, _Spring
from seqopt.engines.interface import Fields, Want
from seqopt.network._mechanics import point_motion
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.study.published import STUDY_BED, STUDY_PADS


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


class AtCorners(PaddedEngine):
    """Discrete elements on the paper's bed, all of it at the corners of the faces."""

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.RESPONSES) -> Fields:
        """Return the fields; see `DiscreteEngine.solve`."""
        if bricks not in self._systems:
            self._systems[bricks] = at_corners(self.network, bricks)
        return super().solve(bricks, grips, want)


def at_corners(network: Network, bricks: int) -> System:
    """Return a system whose beds are springs at the corners of the faces."""
    system = build_system(network, bricks, EPOXY, STUDY_BED)
    assembly = bare_assembly(network, bricks)
    area, where = shares(assembly), network.springs.position[system.acting]
    normal, tangential = STUDY_BED.normal * area, STUDY_BED.tangential * area
    return replace(
        system,
        points=replace(system.points, area=area, normal=normal, tangential=tangential),
        face=assembly.contact,
        maps=opening_maps(assembly, assembly.corner, assembly.contact, where),
    )


def pads_at_corners(pinch: Pinch) -> Pinch:
    """Return even pads that hold a brick as a pinch would with springs at its pads' corners."""
    normal, tangential = pinch.stiffness.normal / 3, pinch.stiffness.tangential / 3
    return replace(pinch, side=np.sqrt(3) * pinch.side, stiffness=BedStiffness(normal, tangential))


def shares(assembly: Assembly) -> Floats:
    """Return every corner's share of its face, (K,), m²."""
    return np.asarray((assembly.area / np.bincount(assembly.contact))[assembly.contact])


PADS = (0.012, 0.02, 0.03)  # m
CORNERS = "springs at corners"
JOINTS = {
    "as printed": STUDY_BED,
    "tangential as normal": BedStiffness(STUDY_BED.normal, STUDY_BED.normal),
    "halves in series": BedStiffness(STUDY_BED.normal / 2, STUDY_BED.tangential / 2),
    CORNERS: STUDY_BED,
}


@dataclass(frozen=True)
class Reading:
    """One way to read the paper's model: how the robot holds, and what a joint is."""

    joint: str = "as printed"
    pinch: Pinch | None = None

    @classmethod
    def of(cls, grip: str, side: float, joint: str) -> Reading:
        """Return the reading that the tables call so, from its pads' side in mm."""
        across = [a for a in Across if grip.endswith(a.name.lower())]
        return cls(joint, Pinch(across[0], STUDY_PADS, side=1e-3 * side) if across else None)

    @property
    def grip(self) -> str:
        """What the tables call it."""
        return "node" if self.pinch is None else f"pads, {self.pinch.across.name.lower()}"

    def engine(self, net: Network) -> PaddedEngine:
        """Return the discrete elements so read."""
        if self.joint != CORNERS:
            return PaddedEngine(net, bed=JOINTS[self.joint], pinch=self.pinch)
        pinch = None if self.pinch is None else pads_at_corners(self.pinch)
        return AtCorners(net, bed=STUDY_BED, pinch=pinch)


def readings() -> list[Reading]:
    pinches = [Pinch(across, STUDY_PADS, side=side) for across, side in product(Across, PADS)]
    return [Reading(joint, pinch) for pinch, joint in product((None, *pinches), JOINTS)]
