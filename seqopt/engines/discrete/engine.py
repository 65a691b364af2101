"""The discrete-element engine: rigid bricks on beds of springs that open, slip and break.

A joint is its own elastic spring in series with a bed of points over the face between its bricks,
so that within the elastic limits the answer is that of exactly rigid bricks; the bed takes over
where tension or shear exceeds what the mortar holds (`seqopt.engines.discrete._system`). With
a `BedStiffness` the bed alone is the joint, as in the discrete-element models of Bruun et al.
(section 3.2.3). Every grip holds its node and lets its brick turn.

One grip set at a time: Newton's method with the exact tangent, the load in steps once a bond
breaks. What it finds is an equilibrium within all limits, reached from rest with grips that only
react. `seqopt.stability` asks less: only that balanced forces exist.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from seqopt.arrays import Floats, Ints
from seqopt.contact.mortar import EPOXY, BedStiffness, Mortar
from seqopt.engines.discrete._system import Held, Settled, System, build_system, settle
from seqopt.engines.interface import Fields, GripCompliance, OpeningEngine, grip_springs
from seqopt.engines.rigid._mixed import Solution, mechanism_error, require_resistance, respond
from seqopt.errors import SolverError
from seqopt.network._mechanics import build_statics, node_motion, point_motion
from seqopt.network.network import Network
from seqopt.scene.scene import Scene


class DiscreteEngine(OpeningEngine):
    """Solves each grip set by discrete elements.

    Raises `MechanismError`: also if the structure moves a tenth of a brick's length and is not
    stopped by then; `SolverError`: also if it neither comes to rest nor goes; `SceneError` if the
    faces of a joint do not overlap.

    ``mortar``: what the joints hold; the epoxy of Bruun et al. by default. ``bed``: the joints
    themselves; by default they are as stiff as the scene says.
    """

    def __init__(
        self, network: Network | Scene, mortar: Mortar = EPOXY, bed: BedStiffness | None = None
    ) -> None:
        super().__init__(network)
        self._mortar, self._bed = mortar, bed
        self._systems: dict[int, System] = {}

    def _answer(self, bricks: int, columns: Ints, compliance: GripCompliance) -> Fields:
        network = self.network
        require_resistance(network, bricks, columns, compliance)
        if bricks not in self._systems:
            self._systems[bricks] = build_system(network, bricks, self._mortar, self._bed)
        system = self._systems[bricks]
        nodes, springs = network.inner.ravel()[columns], list[_Spring]()
        for grip, ways, flexibility, offset in grip_springs(compliance, len(columns)):
            body = int(columns[grip] // 2)
            arm = network.node_position[nodes[grip]] - network.centroid[body]
            every = np.vstack([point_motion(arm), np.eye(6)[3:]]) * system.unit[:6]
            stiffness = np.asarray(np.linalg.inv(flexibility), float)
            springs.append(_Spring(grip, body, ways, every[ways], stiffness, offset))
        held = _held_nodes(network, system, columns, compliance, springs)
        found = settle(held)
        if found.rests:
            return _fields(network, held, found, columns, springs)
        if held.gone(found):
            moved = (system.unit * held.moved(found.motion))[: 6 * bricks]
            said = "joints open or slip and brick {brick} becomes unstable; add a grip, a bond or "
            raise mechanism_error(network, moved, said + "friction")
        names = ", ".join(str(network.node_name[node]) for node in nodes) or "nothing"
        raise SolverError(
            f"{bricks} bricks held at {names}: the discrete elements neither came to rest nor "
            "became unstable; assess the step's stability to learn whether there is an equilibrium"
        )


class _Spring(NamedTuple):
    """A compliant grip."""

    grip: int
    body: int
    ways: list[int]  # in which of shifts and turns it is compliant, w
    motion: Floats  # (w, 6); how its node shifts and turns with the body, scaled as the system is
    stiffness: Floats  # (w, w)
    far: Floats  # (w,); how far its end is moved


def _held_nodes(
    network: Network,
    system: System,
    columns: Ints,
    compliance: GripCompliance,
    springs: list[_Spring],
) -> Held:
    """Return a system whose nodes are held: rigidly, or by springs of compliant grips."""
    count = len(system.load) // 6
    blocks, taken = [np.eye(6)] * count, np.zeros_like(system.load)
    pads, pull = [sparse.csr_array((6, 6))] * count, np.zeros_like(system.load)
    rigid, far = ~compliance.compliant(1, len(columns))[0], compliance.offsets(1, len(columns))[0]
    nodes = network.node_position[network.inner.ravel()[columns]]
    for body in np.unique(columns[rigid] // 2):
        mine = rigid & (columns // 2 == body)
        moved = point_motion(nodes[mine] - network.centroid[body]).reshape(-1, 6)
        moved *= system.unit[:6]
        own = slice(6 * body, 6 * body + 6)
        blocks[body] = linalg.null_space(moved)
        taken[own] = np.linalg.lstsq(moved, far[mine].ravel(), rcond=None)[0]
    for spring in springs:
        own = slice(6 * spring.body, 6 * spring.body + 6)
        pad = spring.motion.T @ spring.stiffness @ spring.motion
        pads[spring.body] = pads[spring.body] + sparse.csr_array(pad)
        pull[own] += spring.motion.T @ spring.stiffness @ spring.far
    free = sparse.csr_array(sparse.block_diag([sparse.csr_array(block) for block in blocks]))
    return Held(system, free, sparse.csr_array(sparse.block_diag(pads)), taken, pull)


def _fields(
    network: Network, held: Held, found: Settled, columns: Ints, springs: list[_Spring]
) -> Fields:
    """Return the fields of one grip set.

    Two rigid grips on one brick share so that their forces are as small as can be.
    """
    system, moved = held.system, held.moved(found.motion)
    wrench = np.zeros((len(network.springs.since), 6))
    wrench[system.acting] = system.bed_wrenches(found.force)
    exerted = -held.reaction(found.motion, found.force)
    (force, moment), compliant = np.zeros((2, len(columns), 3)), np.zeros(len(columns), dtype=bool)
    for spring in springs:
        both, twist = np.zeros(6), moved[6 * spring.body : 6 * spring.body + 6]
        both[spring.ways] = spring.stiffness @ (spring.far - spring.motion @ twist)
        force[spring.grip], moment[spring.grip] = both[:3], both[3:]
        compliant[spring.grip] = 0 in spring.ways
    nodes = network.node_position[network.inner.ravel()[columns]]
    for body in np.unique(columns[~compliant] // 2):
        mine = np.flatnonzero(~compliant & (columns // 2 == body))
        rows = slice(6 * body, 6 * body + 6)
        if len(mine) == 1:
            force[mine[0]] = exerted[rows][:3]
        else:
            maps = point_motion(nodes[mine] - network.centroid[body]).reshape(-1, 6).T
            pulls = np.linalg.lstsq(maps, exerted[rows] / system.unit[rows], rcond=None)[0]
            force[mine] = pulls.reshape(-1, 3)
    twist = (system.unit * moved)[None, : 6 * system.bricks]
    solution = Solution(twist, wrench[None], force[None], moment[None], compliant[None])
    motion, statics = node_motion(network, system.bricks), build_statics(network)
    return respond(network, statics, motion, columns[None], solution)
