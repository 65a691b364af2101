"""What the systems of all grip sets of a partial structure have in common, cut from the whole."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, Ints, frozen
from seqopt.network.mechanics import Statics, build_statics, deformation, node_motion, point_motion
from seqopt.network.network import Network


@dataclass(frozen=True, eq=False, repr=False)
class Shared(FrozenValue):
    """What the systems of all brick counts are cut from.

    ``statics``: of the network; ``gap`` (6S, 6B): deformation of every spring, in its own axes, for
    unit twists; ``inner`` (6B, 6B): displacements of the inner nodes for unit twists, in the order
    of ``network.inner``.
    """

    statics: Statics
    gap: sparse.csr_array
    inner: sparse.csr_array


@dataclass(frozen=True, eq=False, repr=False)
class Ungripped(FrozenValue):
    """What the systems of all grip sets of a partial structure have in common, scaled to order one.

    ``inner`` (6b, 6b): those of the inner nodes for scaled twists, in the order of
    ``network.inner``, m; ``statics``: of the network; ``deformation`` (6s, 6b): scaled deformation
    of the acting springs, in their own axes, for scaled twists; ``stiffness`` (6s,): over ``unit``;
    ``matrix`` (6s + 6b,): the system without grips; ``load`` (6b,): the weight, scaled; ``acting``
    (s,); ``twist_unit``, ``wrench_unit`` (6b,), (6s,): what turns scaled twists into m and rad,
    scaled wrenches into N and N m; ``unit``: N/m.
    """

    network: Network
    bricks: int
    inner: sparse.csr_array
    statics: Statics
    deformation: sparse.csr_array
    stiffness: Floats
    matrix: sparse.csc_array
    load: Floats
    acting: Ints
    twist_unit: Floats
    wrench_unit: Floats
    unit: float

    @cached_property
    def motion(self) -> sparse.csr_array:
        """Displacements of the nodes for unit twists, (3n, 6b)."""
        return frozen(node_motion(self.network, self.bricks))


def share(network: Network) -> Shared:
    """Return what the systems of all brick counts are cut from."""
    springs, size = network.springs, network.inner.size
    brick = np.repeat(np.arange(len(network.inner)), 2)
    arm = network.node_position[network.inner.ravel()] - network.centroid[brick]
    column = np.repeat(6 * brick[:, None] + np.arange(6), 3, axis=0).ravel()
    inner = (point_motion(arm).ravel(), column, np.arange(0, 18 * size + 1, 6))
    return Shared(
        statics=build_statics(network),
        gap=deformation(springs.bodies, springs.position, network.centroid, springs.axes),
        inner=sparse.csr_array(inner, shape=(3 * size, 3 * size)),
    )


def ungripped_system(network: Network, bricks: int, shared: Shared | None = None) -> Ungripped:
    """Return what all systems of a partial structure have in common.

    ``shared``: from `share`; made anew by default.
    """
    shared = share(network) if shared is None else shared
    springs = network.springs
    acting = springs.acting(bricks)
    steps = np.diff(network.node_position[network.inner[:bricks]], axis=1)
    length = float(np.linalg.norm(steps, axis=2).max())
    lever = np.array([1.0, 1.0, 1.0, length, length, length])
    raw = (springs.stiffness[acting] / lever**2).ravel()
    unit = float(np.median(raw[raw > 0])) if raw.any() else 1.0
    stiffness = raw / unit
    twist_unit = np.tile(1 / lever, bricks)
    gap = _scaled_gap(shared, acting, twist_unit, lever)
    inner = _leading(shared.inner, twist_unit)
    weight = network.inner_weight[: 2 * bricks].ravel()
    return Ungripped(
        network=network,
        bricks=bricks,
        inner=inner,
        statics=shared.statics,
        deformation=gap,
        stiffness=stiffness,
        matrix=_side_by_side(gap, stiffness),
        load=inner.T @ weight / unit,
        acting=acting,
        twist_unit=twist_unit,
        wrench_unit=unit * np.tile(lever, len(acting)),
        unit=unit,
    )


def _scaled_gap(
    shared: Shared, acting: Ints, twist_unit: Floats, lever: Floats
) -> sparse.csr_array:
    """Return the deformation (6s, 6b) of the acting springs, all components made lengths."""
    rows = 6 * len(acting)
    if len(acting) == 0 or acting[-1] + 1 == len(acting):  # none beyond them acts
        indptr = shared.gap.indptr[: rows + 1]
        indices, data = shared.gap.indices[: indptr[-1]], shared.gap.data[: indptr[-1]]
    else:
        part = shared.gap[(6 * acting[:, None] + np.arange(6)).ravel()]
        indptr, indices, data = part.indptr, part.indices, part.data
    data = data * np.repeat(np.tile(lever, len(acting)), np.diff(indptr))
    data *= twist_unit[indices]
    return sparse.csr_array((data, indices, indptr), shape=(rows, len(twist_unit)))


def _leading(inner: sparse.csr_array, twist_unit: Floats) -> sparse.csr_array:
    """Return the displacements (6b, 6b) of the first inner nodes for scaled twists, m."""
    size = len(twist_unit)
    column = inner.indices[: 6 * size]
    data = inner.data[: 6 * size] * twist_unit[column]
    return sparse.csr_array((data, column, inner.indptr[: size + 1]), shape=(size, size))


def _side_by_side(gap: sparse.csr_array, stiffness: Floats) -> sparse.csc_array:
    """Return the system without grips, column by column, from the scaled deformation (6s, 6b)."""
    row = 1 / np.maximum(1.0, stiffness)  # keeps a stiff joint's equation of order one
    joints, moves = gap.shape
    first = gap.indptr[:-1] + np.arange(joints)  # of a joint's column, the joint itself
    others = np.arange(gap.nnz) + np.repeat(np.arange(1, joints + 1), np.diff(gap.indptr))
    carried = gap.tocsc()
    data, indices = np.empty(2 * gap.nnz + joints), np.empty(2 * gap.nnz + joints, np.int32)
    data[first], indices[first] = row, np.arange(joints)
    data[others], indices[others] = -gap.data, gap.indices + joints
    data[joints + gap.nnz :] = (row * stiffness)[carried.indices] * carried.data
    indices[joints + gap.nnz :] = carried.indices
    starts = [gap.indptr + np.arange(joints + 1), carried.indptr[1:] + gap.nnz + joints]
    entries = data, indices, np.concatenate(starts).astype(np.int32)
    return sparse.csc_array(entries, shape=(joints + moves, joints + moves))
