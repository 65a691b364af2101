"""Partial arches on springs at the corners of faces, as rigid blocks in discrete elements have.

A face is springs at its corners, each with an equal share of its area. It is three times too stiff
against bending, as the corners of a rectangle are √3 times as far out as points that stand for an
even bed. With the spread "even" the faces are therefore drawn in by √3 and _stiffened threefold.

`AtCorners` is the discrete-element engine with such faces. For LMGC90, `padded` makes the pads of a
`Pinch` contacts with the ground; `bed_at_corners` then says where exactly these springs let the
blocks rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg, sparse

from seqopt import Step
from seqopt.arrays import Floats, Ints
from seqopt.contact._elastic_limits import opening_maps
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import bare_assembly, step_assembly
from seqopt.contact.mortar import EPOXY, BedStiffness, Mortar
from seqopt.engines._grip_compliance import GripCompliance
from seqopt.engines.discrete._system import Held, System, build_system
from seqopt.engines.discrete.engine import DiscreteEngine, _Spring
from seqopt.engines.interface import Fields, Want
from seqopt.network._mechanics import point_motion
from seqopt.network.network import GROUND, Network
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


STIFFER = 10  # contacts per pad: its joint over those between bricks, as in section 3.2.3
CLEAR = 1e-3  # m, between a pad's plane and the joints' corners: on one plane, facets would merge
SPREADS = ("corners", "even")


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


def padded(
    network: Network, step: Step, pinch: Pinch, spread: str = "even", *, flush: bool = False
) -> Assembly:
    """Return a step held by two pads; a pad is `STIFFER` contacts with the ground in one place.

    LMGC90's blocks are convex hulls of their contacts, and the joint's corners reach beyond the
    plane of a pad by half the mortar. A pad therefore leans, by a few degrees about its middle,
    until it is a facet with the joint spread as asked; ``flush`` leaves it on the brick's surface.
    """
    assembly = step_assembly(network, step.bricks, step.grips)
    brick = network.scene.brick_of_node[step.held[0]]
    block, node = int(assembly.grip_block[0]), assembly.grip_position[0]
    length, width = np.array(brick.length_axis), np.array(brick.width_axis)
    axes = np.stack([length, width, np.cross(length, width)])
    touching = (assembly.bodies == block).any(axis=1)[assembly.contact]
    corner = posed(assembly, spread)[0].corner[touching]
    faces, inward = [], []
    for sign in np.repeat([-1.0, 1.0], STIFFER):
        out = sign * axes[pinch.across]
        middle = node + 0.5 * brick.dimensions[pinch.across] * out
        away = corner - middle
        lean = 0.0 if flush else np.arctan2(away @ out + CLEAR, -away @ length).max()
        along = np.cos(lean) * length - np.sin(lean) * out if lean > 0 else length
        other = axes[3 - pinch.across]
        square = [a * along + b * other for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        faces.append(middle + 0.5 * pinch.side * np.array(square))
        normal = np.cross(along, other)
        inward.append(normal if normal @ out < 0 else -normal)
    count = len(faces)
    return replace(  # the block is on further faces of the ground and no longer gripped
        assembly,
        contact_name=assembly.contact_name + ("pad",) * count,
        bodies=np.vstack([assembly.bodies, np.tile([GROUND, block], (count, 1))]),
        normal=np.vstack([assembly.normal, *inward]),
        corner=np.vstack([assembly.corner, *faces]),
        contact=np.append(assembly.contact, len(assembly.bodies) + np.repeat(np.arange(count), 4)),
        grip_block=np.empty(0, dtype=np.int64),
        grip_position=np.empty((0, 3)),
        payload=np.empty(0),
    )


def drawn_in(assembly: Assembly) -> Assembly:
    """Return the assembly with every face drawn in about its middle by √3."""
    count = np.bincount(assembly.contact)
    middle = np.stack(
        [np.bincount(assembly.contact, weights=x) / count for x in assembly.corner.T], axis=1
    )[assembly.contact]
    return replace(assembly, corner=middle + (assembly.corner - middle) / np.sqrt(3))


def posed(assembly: Assembly, spread: str) -> tuple[Assembly, BedStiffness]:
    """Return an assembly with its faces spread as asked, and the stiffness they need."""
    if spread == "corners":
        return assembly, STUDY_BED
    return drawn_in(assembly), BedStiffness(3 * STUDY_BED.normal, 3 * STUDY_BED.tangential)


def bed_at_corners(assembly: Assembly, bed: BedStiffness) -> tuple[Floats, Floats]:
    """Return twists (B, 6) of the blocks and forces (K, 3) on second bodies at the corners.

    Forces are normal and tangential, N.
    """
    moduli = np.array([bed.normal, bed.tangential, bed.tangential])
    stiffness = (shares(assembly)[:, None] * moduli).ravel()
    own = assembly.contact_map
    load = assembly.load() * assembly.scales[0]
    motion = linalg.solve((own.multiply(stiffness) @ own.T).toarray(), load, assume_a="pos")
    twist = motion.reshape(-1, 6) / np.repeat([1.0, assembly.scales[1]], 3)
    return twist, -(stiffness * (own.T @ motion)).reshape(-1, 3)


def ground_forces(assembly: Assembly, corner_force: Floats) -> Floats:
    """Return the forces (F, 3) of the ground on the blocks, a row per contact with it, N."""
    force = np.einsum("ki,kij->kj", corner_force, assembly.axes[assembly.contact])
    total = np.stack([np.bincount(assembly.contact, weights=x) for x in force.T], axis=1)
    return np.asarray(total[assembly.bodies[:, 0] == GROUND])


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
