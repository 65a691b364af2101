r"""The discrete-element engine: rigid bricks on beds of springs that part, slip and break.

A joint is its own elastic spring in series with a bed of points over the face between its bricks,
so that within the elastic limits the answer is that of exactly rigid bricks; the bed takes over
where tension or shear exceeds what the mortar holds (`seqopt.engines.discrete.friction_law`). With a `BedStiffness`
the bed alone is the joint, as in the study's discrete-element models (section 3.2.3). Every grip
holds its node, or pinches its brick between two pads.

One grip set at a time: Newton's method with the exact tangent, the load in steps once a bond
breaks. What it finds is an equilibrium within all limits, reached from rest with grips that only
react. `seqopt certify` asks less: that forces exist, whatever brings them about.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg, sparse

from seqopt.arrays import Floats, Ints, skew
from seqopt.contact.mortar import EPOXY, Mortar
from seqopt.engines.discrete.equilibrium_path import Held, Settled, settle
from seqopt.engines.discrete.system import BedStiffness, Pinch, System, build, pads
from seqopt.engines.interface import Fields, Want, grip_columns
from seqopt.engines.rigid.mechanism import mechanism_error, require_resistance
from seqopt.engines.rigid.recovery import respond, stack
from seqopt.errors import SeqoptError, SolverError
from seqopt.network.kinematics import centroids, node_motion
from seqopt.network.network import Network
from seqopt.network.statics import build_statics

GONE = "joints part or slip and brick {brick} goes; add a grip, a bond or friction"


class DiscreteEngine:
    """Solves each grip set by discrete elements.

    Parameters
    ----------
    network : Network
    mortar : Mortar
        What the joints hold; the study's epoxy by default.
    bed : BedStiffness, optional
        The joints themselves; by default they are as stiff as the scene says.
    pinch : Pinch, optional
        How robots hold; by default a grip holds its node and lets its brick turn.
    """

    def __init__(
        self,
        network: Network,
        mortar: Mortar = EPOXY,
        bed: BedStiffness | None = None,
        pinch: Pinch | None = None,
    ) -> None:
        self._network, self._mortar, self._bed, self._pinch = network, mortar, bed, pinch
        self._systems: dict[int, System] = {}

    @property
    def network(self) -> Network:
        """The network whose nodes and edges the fields follow."""
        return self._network

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.TABLE) -> Fields:
        """Return the fields of the first ``bricks`` bricks; see `seqopt.engines.interface.Engine`.

        All fields are evaluated whatever is asked: finding the equilibrium dominates the cost.

        Raises
        ------
        MechanismError
            Also if the structure moves a tenth of a brick's length and is not stopped by then.
        SolverError
            Also if it neither comes to rest nor goes.
        """
        network = self._network
        columns = grip_columns(network, bricks, grips)
        for row in columns:
            require_resistance(network, bricks, row)
        if bricks not in self._systems:
            self._systems[bricks] = build(network, bricks, self._mortar, self._bed)
        answers = [self._solve_one(self._systems[bricks], row) for row in columns]
        return stack(network, bricks, columns, answers)

    def _solve_one(self, system: System, columns: Ints) -> tuple[Floats, ...]:
        """Return the fields of one grip set, in the order of `Fields`."""
        network, pinch = self._network, self._pinch
        nodes = network.node_position[network.inner.ravel()[columns]]
        held = held_nodes(network, system, columns, nodes)
        if pinch is not None:
            held = pinched(network, system, columns, nodes, pinch)
        found = settle(held)
        if not found.rests:
            raise _not_at_rest(network, held, found, network.inner.ravel()[columns])
        return _fields(network, held, found, columns, nodes)


def _not_at_rest(network: Network, held: Held, found: Settled, nodes: Ints) -> SeqoptError:
    """Return the error of a structure that did not come to rest: it went, or was not followed."""
    system = held.system
    if held.gone(found):
        moved = system.unit * (held.free @ found.motion)
        return mechanism_error(network, moved[: 6 * system.bricks], GONE)
    names = ", ".join(str(network.node_name[n]) for n in nodes) or "nothing"
    return SolverError(
        f"{system.bricks} bricks held at {names}: discrete elements came to no rest and went "
        "nowhere; certify says whether there is an equilibrium"
    )


def held_nodes(network: Network, system: System, columns: Ints, nodes: Floats) -> Held:
    """Return a system whose gripped nodes (r, 3) stand still."""
    center = centroids(network)
    blocks = [np.eye(6)] * (len(system.load) // 6)
    for body in np.unique(columns // 2):
        arms = nodes[columns // 2 == body] - center[body]
        moved = np.vstack([np.hstack([np.eye(3), -skew(arm)]) for arm in arms])
        blocks[body] = linalg.null_space(moved * system.unit[:6])
    free = sparse.csr_array(sparse.block_diag([sparse.csr_array(block) for block in blocks]))
    return Held(system, free, sparse.csr_array(system.layers.shape))


def pinched(network: Network, system: System, columns: Ints, nodes: Floats, pinch: Pinch) -> Held:
    """Return a system whose gripped bricks are held between pads beside their nodes (r, 3)."""
    blocks = [sparse.csr_array((6, 6))] * (len(system.load) // 6)
    for body, node in zip(columns // 2, nodes, strict=True):
        held = pads(network, body, node, pinch) * np.outer(system.unit[:6], system.unit[:6])
        blocks[body] = blocks[body] + sparse.csr_array(held)
    every = sparse.eye_array(len(system.load), format="csr")
    return Held(system, every, sparse.csr_array(sparse.block_diag(blocks, format="csr")))


def _fields(
    network: Network, held: Held, found: Settled, columns: Ints, nodes: Floats
) -> tuple[Floats, ...]:
    """Return the fields of one grip set, in the order of `Fields`."""
    system = held.system
    size = 6 * system.bricks
    moved = held.free @ found.motion
    wrench = np.zeros((len(network.springs.since), 6))
    wrench[system.acting] = system.bed_wrenches(found.force)
    exerted = -held.reaction(found.motion, found.force, system.load) - held.pads @ moved
    return respond(
        network,
        columns,
        maps=build_statics(network),
        motion=node_motion(network, system.bricks),
        twist=(system.unit * moved)[:size],
        wrench=wrench,
        force=_grip_forces(network, system, columns, nodes, exerted),
    )


def _grip_forces(
    network: Network, system: System, columns: Ints, nodes: Floats, exerted: Floats
) -> Floats:
    """Return the forces (r, 3) of the grips from the wrenches (6n,) they must exert.

    Two grips on one brick share so that their forces are as small as can be; what pads exert
    beside a force, a moment, belongs to no node.
    """
    out = np.zeros((len(columns), 3))
    for body in np.unique(columns // 2):
        mine = np.flatnonzero(columns // 2 == body)
        arms = nodes[mine] - centroids(network)[body]
        maps = np.hstack([np.vstack([np.eye(3), skew(arm)]) for arm in arms])
        rows = slice(6 * body, 6 * body + 6)
        if len(mine) == 1:
            out[mine[0]] = exerted[rows][:3]
        else:
            wrench = exerted[rows] / system.unit[rows]
            out[mine] = np.linalg.lstsq(maps, wrench, rcond=None)[0].reshape(-1, 3)
    return out
