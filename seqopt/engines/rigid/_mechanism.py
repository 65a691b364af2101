"""The system of a partial structure without grips, and whether grips leave it a free motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, Ints, frozen
from seqopt.engines._grip_compliance import RIGID, GripCompliance
from seqopt.errors import MechanismError
from seqopt.network._mechanics import (
    Statics,
    build_statics,
    deformation,
    node_motion,
    point_motion,
    spread,
)
from seqopt.network.network import Network
from seqopt.work._workers import one_thread

LAST_CORRECTION = 1e-10  # of exact answers: of forces, moments, shifts, turns, relative to each


@dataclass(frozen=True, eq=False, repr=False)
class Shared(FrozenValue):
    """What the systems of all brick counts are cut from.

    ``statics``: of the network; ``gap`` (6S, 6B): deformation of every spring, in its own axes, for
    unit twists; ``inner`` (6B, 6B): displacements of the inner nodes for unit twists, in the order
    of ``network.inner``; ``moved`` (S, 6): how the ground moves, in the springs' axes.
    """

    statics: Statics
    gap: sparse.csr_array
    inner: sparse.csr_array
    moved: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Ungripped(FrozenValue):
    """What the systems of all grip sets of a partial structure have in common, scaled to order one.

    ``inner`` (6b, 6b): those of the inner nodes for scaled twists, in the order of
    ``network.inner``, m; ``statics``: of the network; ``deformation`` (6s, 6b): scaled deformation
    of the acting springs, in their own axes, for scaled twists; ``stiffness`` (6s,): over ``unit``;
    ``load`` (6b,): weight and loads, scaled;
    ``moved`` (6s,): what the ground's movement adds to the joints' equations; ``acting`` (s,);
    ``twist_unit``, ``wrench_unit`` (6b,), (6s,): what turns scaled twists into m and rad, scaled
    wrenches into N and N m; ``unit``: N/m.
    """

    network: Network
    bricks: int
    inner: sparse.csr_array
    statics: Statics
    deformation: sparse.csr_array
    stiffness: Floats
    load: Floats
    moved: Floats
    acting: Ints
    twist_unit: Floats
    wrench_unit: Floats
    unit: float

    @cached_property
    def matrix(self) -> sparse.csc_array:
        """The system without grips, (6s + 6b,), column by column."""
        gap, row = self.deformation, 1 / np.maximum(1.0, self.stiffness)  # keeps them of order one
        joints, moves = gap.shape
        first = gap.indptr[:-1] + np.arange(joints)  # of a joint's column, the joint itself
        others = np.arange(gap.nnz) + np.repeat(np.arange(1, joints + 1), np.diff(gap.indptr))
        carried = gap.tocsc()
        data, indices = np.empty(2 * gap.nnz + joints), np.empty(2 * gap.nnz + joints, np.int32)
        data[first], indices[first] = row, np.arange(joints)
        data[others], indices[others] = -gap.data, gap.indices + joints
        data[joints + gap.nnz :] = (row * self.stiffness)[carried.indices] * carried.data
        indices[joints + gap.nnz :] = carried.indices
        starts = [gap.indptr + np.arange(joints + 1), carried.indptr[1:] + gap.nnz + joints]
        entries = data, indices, np.concatenate(starts).astype(np.int32)
        return frozen(sparse.csc_array(entries, shape=(joints + moves, joints + moves)))

    def apply(self, states: Floats) -> Floats:
        """Return the products (S, 6s + 6b) of the system without grips with states."""
        joints, row = len(self.stiffness), 1 / np.maximum(1.0, self.stiffness)
        parted = (self.deformation @ states[:, joints:].T).T
        wrench = states[:, :joints]
        borne = (self.deformation.T @ wrench.T).T
        return np.hstack([row * wrench + row * self.stiffness * parted, -borne])

    @cached_property
    def motion(self) -> sparse.csr_array:
        """Displacements of the nodes for unit twists, (3n, 6b)."""
        return frozen(node_motion(self.network, self.bricks))


def share(network: Network) -> Shared:
    """Return the system of the whole scene, of which those of all brick counts are parts."""
    springs, size = network.springs, network.inner.size
    brick = np.repeat(np.arange(len(network.inner)), 2)
    moved = point_motion(network.node_position[network.inner.ravel()] - network.centroid[brick])
    inner = spread(np.arange(size), brick, moved, (size, len(network.inner)))
    gap = deformation(springs.bodies, springs.position, network.centroid, springs.axes)
    shift = np.einsum("sij,shj->shi", springs.axes, springs.movement.reshape(-1, 2, 3))
    return Shared(build_statics(network), gap, inner, shift.reshape(-1, 6))


def ungripped_system(network: Network, bricks: int, shared: Shared | None = None) -> Ungripped:
    """Return the part that all systems of a partial structure share."""
    shared = share(network) if shared is None else shared
    springs = network.springs
    acting = springs.acting(bricks)
    steps = np.diff(network.node_position[network.inner[:bricks]], axis=1)
    length = float(np.linalg.norm(steps, axis=2).max())
    lever = np.array([1.0, 1.0, 1.0, length, length, length])
    raw = (springs.stiffness[acting] / lever**2).ravel()
    unit = float(np.median(raw[raw > 0])) if raw.any() else 1.0
    stiffness, twist_unit = raw / unit, np.tile(1 / lever, bricks)
    gap, rows = shared.gap, 6 * len(acting)
    if rows and acting[-1] + 1 != len(acting):  # those that act are not the first
        gap = gap[(6 * acting[:, None] + np.arange(6)).ravel()]
    starts = gap.indptr[: rows + 1]
    at = gap.indices[: starts[-1]]
    lengths = np.repeat(np.tile(lever, len(acting)), np.diff(starts)) * twist_unit[at]
    scaled = gap.data[: starts[-1]] * lengths, at, starts  # all components made lengths
    size, own = 6 * bricks, shared.inner.indices[: 36 * bricks]
    nodes = shared.inner.data[: 36 * bricks] * twist_unit[own], own, shared.inner.indptr[: size + 1]
    inner: sparse.csr_array = sparse.csr_array(nodes, shape=(size, size))
    weight = network.inner_weight[: 2 * bricks].ravel()
    applied = network.applied(bricks).ravel()
    row = stiffness / np.maximum(1.0, stiffness)
    return Ungripped(
        network=network,
        bricks=bricks,
        inner=inner,
        statics=shared.statics,
        deformation=sparse.csr_array(scaled, shape=(rows, size)),
        stiffness=stiffness,
        load=inner.T @ weight / unit + applied * twist_unit / unit,
        moved=row * (shared.moved[acting] * lever).ravel(),
        acting=acting,
        twist_unit=twist_unit,
        wrench_unit=unit * np.tile(lever, len(acting)),
        unit=unit,
    )


_UNTIED = 1e-13  # share of the largest deformation of ties that is rounding: nothing is tied


def free_motion(
    network: Network, bricks: int, columns: Ints, compliance: GripCompliance = RIGID
) -> Floats | None:
    """Return a motion that deforms no spring with any stiffness and moves no held node.

    How stiff springs are does not count: a soft one ties as well as a stiff one, so that rounding
    has nothing to hide behind.

    Result (b, 6): as `seqopt.engines.diagnosis.Diagnosis.mode`; None if there is no such motion.
    """
    parts = ungripped_system(network, bricks)
    node = 3 * network.inner.ravel()[columns][:, None] + np.arange(3)
    turned = columns[compliance.transmits(1, len(columns))[0]] // 2
    turns = (6 * turned[:, None] + np.arange(3, 6)).ravel()  # that grips resist
    resisted = np.zeros((len(turns), 6 * bricks))
    resisted[np.arange(len(turns)), turns] = 1.0
    held = np.vstack([parts.motion[node.ravel()].toarray(), resisted]) * parts.twist_unit
    ties = np.vstack([parts.deformation[parts.stiffness > 0].toarray(), held])
    with one_thread():
        _, sizes, motions = np.linalg.svd(ties, full_matrices=len(ties) < ties.shape[1])
    if len(sizes) == ties.shape[1] and sizes[-1] > _UNTIED * sizes[0]:
        return None
    motion = motions[-1]
    return np.asarray((motion / motion[np.abs(motion).argmax()]).reshape(-1, 6))


def require_resistance(
    network: Network, bricks: int, columns: Ints, compliance: GripCompliance = RIGID
) -> None:
    """Raise `MechanismError` if one grip set leaves a motion that nothing resists.

    A compliant grip resists as a rigid one does. ``compliance``: of this set.
    """
    motion = free_motion(network, bricks, columns, compliance)
    if motion is not None:
        ends = network.node_position[network.inner[:bricks]]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max()
        raise mechanism_error(network, (motion / np.repeat([1.0, length], 3)).ravel())


def mechanism_error(
    network: Network,
    twist: Floats,
    text: str = "nothing resists a motion of brick {brick}; add a grip, a joint or stiffness",
) -> MechanismError:
    """Return the error that shows an unresisted motion (6b,), its largest component made 1.

    ``text``: what to say of the brick that moves most, ``{brick}``.
    """
    shape = (twist / np.abs(twist).max()).reshape(-1, 6)
    worst = int(np.abs(shape).max(axis=1).argmax())
    names = [brick.name for brick in network.scene.placed[: len(shape)]]
    mode = tuple((name, tuple(row)) for name, row in zip(names, shape.tolist(), strict=True))
    return MechanismError(f"{len(shape)} bricks: {text.format(brick=names[worst])}", mode)
