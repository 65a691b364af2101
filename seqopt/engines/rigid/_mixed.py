r"""Rigid bricks solved with joint wrenches and motions as unknowns side by side.

One factorization of the system per grip set, corrected until it no longer changes: slow, sure, and
the last resort of the fast engine. The part of the system that grip sets share (`Ungripped`) also
says whether grips leave a structure a free motion (`require_resistance`).

Stiffness form squares what separates a stiff joint from a soft chain. Kept apart, the deformations
of the joints, the equilibrium of the bricks and the stillness of the grips make one sparse system

.. math:: s + C B u = 0, \qquad -B^T s - H^T \lambda = f, \qquad H u = 0

(wrenches :math:`s`, stiffnesses :math:`C`, twists :math:`u`, grip forces :math:`\lambda`) whose
condition does not grow with the length of a chain as its stiffness does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import SuperLU, splu

from seqopt.arrays import Bools, Floats, FrozenValue, Ints, frozen
from seqopt.engines.interface import RIGID, Fields, GripCompliance, _join_sets, no_sets
from seqopt.errors import MechanismError, SolverError
from seqopt.network._mechanics import (
    Statics,
    build_statics,
    deformation,
    node_motion,
    point_motion,
    spread,
)
from seqopt.network.network import Network
from seqopt.work import _one_thread

LAST_CORRECTION = 1e-10  # of exact answers: of forces, moments, shifts, turns, relative to each
_UNTIED = 1e-13  # share of the largest deformation of ties that is rounding: nothing is tied
_CORRECTIONS = 6  # most of an answer; rounding in what is left does not spoil them
_SENSITIVE = 1e-6  # largest change by last digits of the system; errors are a tenth of it or less
_TRIES = 4  # ways in which last digits are changed
_EMPTY = 1e-6  # forces this small beside the moments over a brick's length are not looked at alone
_LIGHT = 1e-3  # nor what is this small beside the weight, or the motion it makes at a typical joint
_SPLIT = 2.0**27 + 1.0  # halves the 53 digits of a double


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

    ``deformation`` (6s, 6b): scaled, of the acting springs, in their own axes, for scaled twists;
    ``stiffness`` (6s,): over ``unit``; ``weight``, ``load`` (6b,): of the bricks, and with all
    other loads, scaled; ``moved`` (6s,): what the ground's movement adds to the joints' equations;
    ``acting`` (s,); ``twist_unit`` (6b,), ``wrench_unit`` (6s,): scaled twists to m and rad,
    wrenches to N and N m; ``unit``: N/m.
    """

    network: Network
    bricks: int
    deformation: sparse.csr_array
    stiffness: Floats
    weight: Floats
    load: Floats
    moved: Floats
    acting: Ints
    twist_unit: Floats
    wrench_unit: Floats
    unit: float

    @cached_property
    def inner(self) -> sparse.csr_array:
        """Displacements of the inner nodes for scaled twists, (6b, 6b), as `Shared`, m."""
        whole, size = share(self.network).inner, 6 * self.bricks
        own = whole.indices[: 6 * size]
        entries = whole.data[: 6 * size] * self.twist_unit[own], own, whole.indptr[: size + 1]
        return frozen(sparse.csr_array(entries, shape=(size, size)))

    @cached_property
    def row(self) -> Floats:
        """By which equations of joints are multiplied, (6s,): it keeps them of order one."""
        return frozen(1 / np.maximum(1.0, self.stiffness))

    @cached_property
    def borne(self) -> sparse.csc_array:
        """Loads (6b,) that wrenches bear, scaled: of each brick those of its springs."""
        return frozen(self.deformation.T)

    @cached_property
    def matrix(self) -> sparse.csc_array:
        """The system without grips, (6s + 6b,), column by column."""
        gap, row = self.deformation, self.row
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
        wrench, twist = np.split(states, [len(self.stiffness)], axis=1)
        parted, borne = (self.deformation @ twist.T).T, (self.borne @ wrench.T).T
        return np.hstack([self.row * (wrench + self.stiffness * parted), -borne])

    @cached_property
    def motion(self) -> sparse.csr_array:
        """Displacements of the nodes for unit twists, (3n, 6b)."""
        return frozen(node_motion(self.network, self.bricks))


def share(network: Network) -> Shared:
    """Return the system of the whole scene, of which those of all brick counts are parts."""
    known: Shared | None = network.derived.get("mixed")
    if known is not None:
        return known
    springs, size = network.springs, network.inner.size
    brick = np.repeat(np.arange(len(network.inner)), 2)
    moved = point_motion(network.node_position[network.inner.ravel()] - network.centroid[brick])
    inner = spread(np.arange(size), brick, moved, (size, len(network.inner)))
    gap = deformation(springs.bodies, springs.position, network.centroid, springs.axes)
    shift = np.einsum("sij,shj->shi", springs.axes, springs.movement.reshape(-1, 2, 3))
    network.derived["mixed"] = found = Shared(
        build_statics(network), gap, inner, shift.reshape(-1, 6)
    )
    return found


def ungripped_system(network: Network, bricks: int) -> Ungripped:
    """Return the part that all systems of a partial structure share."""
    shared, springs = share(network), network.springs
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
    inner = shared.inner.data[: 36 * bricks].reshape(bricks, 6, 6)
    weight = np.einsum("bij,bi->bj", inner, network.inner_weight[: 2 * bricks].reshape(bricks, 6))
    weight = weight.ravel() * twist_unit / unit
    row = stiffness / np.maximum(1.0, stiffness)
    return Ungripped(
        network=network,
        bricks=bricks,
        deformation=sparse.csr_array(scaled, shape=(rows, 6 * bricks)),
        stiffness=stiffness,
        weight=weight,
        load=weight + network.applied(bricks).ravel() * twist_unit / unit,
        moved=row * (shared.moved[acting] * lever).ravel(),
        acting=acting,
        twist_unit=twist_unit,
        wrench_unit=unit * np.tile(lever, len(acting)),
        unit=unit,
    )


def free_motion(
    network: Network, bricks: int, columns: Ints, compliance: GripCompliance = RIGID
) -> Floats | None:
    """Return a motion that deforms no spring with any stiffness and moves no held node.

    A soft spring ties as well as a stiff one, so that rounding has nothing to hide behind. Result
    (b, 6): as `seqopt.engines.diagnosis.Diagnosis.mode`; None if there is no such motion.
    """
    parts = ungripped_system(network, bricks)
    node = 3 * network.inner.ravel()[columns][:, None] + np.arange(3)
    turned = columns[compliance.transmits(len(columns))] // 2
    turns = (6 * turned[:, None] + np.arange(3, 6)).ravel()  # that grips resist
    resisted = np.zeros((len(turns), 6 * bricks))
    resisted[np.arange(len(turns)), turns] = 1.0
    held = np.vstack([parts.motion[node.ravel()].toarray(), resisted]) * parts.twist_unit
    ties = np.vstack([parts.deformation[parts.stiffness > 0].toarray(), held])
    with _one_thread():
        _, sizes, motions = np.linalg.svd(ties, full_matrices=len(ties) < ties.shape[1])
    if len(sizes) == ties.shape[1] and sizes[-1] > _UNTIED * sizes[0]:
        return None
    motion = motions[-1]
    return np.asarray((motion / motion[np.abs(motion).argmax()]).reshape(-1, 6))


def require_resistance(
    network: Network, bricks: int, columns: Ints, compliance: GripCompliance = RIGID
) -> None:
    """Raise `MechanismError` if a grip set, rigid or compliant, leaves a motion unresisted."""
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


@dataclass(frozen=True, eq=False, repr=False)
class Solution(FrozenValue):
    """What determines all fields of S grip sets.

    ``twist`` (S, 6b): of the bricks, m and rad. ``wrench`` (S, J, 6): of every spring of the
    network on its second body, N and N m; zero where it does not act. ``force`` (S, r, 3): of the
    grips, N; two rigid ones on one brick may share theirs in any way. ``moment`` (S, r, 3): of the
    grips, N m. ``compliant`` (S, r): which grips are.
    """

    twist: Floats
    wrench: Floats
    force: Floats
    moment: Floats
    compliant: Bools


def respond(
    network: Network, motion: Floats | sparse.csr_array, columns: Ints, solution: Solution
) -> Fields:
    """Return the fields of grip sets, of which ``motion`` is as `node_motion` returns it."""
    twist, wrench, force = solution.twist, solution.wrench, solution.force.copy()
    sets, bricks = len(twist), twist.shape[1] // 6
    load = np.tile(network.inner_load(bricks), (sets, 1, 1))
    load[np.arange(sets)[:, None], columns] += force
    carried = edge_forces(network, wrench, load)
    split_pairs(network, columns, force, carried, solution.compliant)
    moved = (motion @ twist.T).T.reshape(sets, motion.shape[0] // 3, 3)
    return Fields(
        edge_force=carried,
        displacement=moved + network.ground_motion(bricks),
        grip_force=force,
        support=reactions(network, wrench),
        joint_wrench=wrench,
        brick_twist=twist.reshape(sets, bricks, 6),
        grip_moment=solution.moment,
    )


def edge_forces(network: Network, wrench: Floats, load: Floats) -> Floats:
    """Return the edge forces (S, E), tension positive.

    ``wrench``: as of `Solution`; ``load`` (S, 2b, 3): at the inner nodes, forces of grips included.
    """
    sets, bricks = len(load), load.shape[1] // 2
    statics, edges = share(network).statics, network.count_edges(bricks)
    through = wrench[:, :, :3].reshape(sets, 3 * wrench.shape[1])
    pull = np.zeros((sets, statics.edge_of_load.shape[1]))  # to cut the matrix takes longer
    pull[:, : 6 * bricks] = load.reshape(sets, 6 * bricks)
    carried = statics.edge_of_spring @ through.T + statics.edge_of_load @ pull.T
    return np.asarray(carried[:edges].T)


def reactions(network: Network, wrench: Floats) -> Floats:
    """Return force and moment (S, G, 6) of every ground end about its fixed point."""
    at_spring = wrench[:, network.springs.support]
    moment = share(network).statics.support_of_spring
    return np.asarray(np.einsum("gij,sgj->sgi", moment, at_spring))


def split_pairs(
    network: Network, columns: Ints, force: Floats, carried: Floats, compliant: Bools
) -> None:
    """Let each of two rigid grips on one brick take the force at its own node, in place.

    ``force`` (S, r, 3), ``carried`` (S, E): of grips and edges; ``compliant`` (S, r): soft grips.
    """
    inner = np.flatnonzero(network.edge_spring < 0)
    edge_of = np.empty(len(network.inner), dtype=np.int64)
    edge_of[network.edge_brick[inner]] = inner
    for i, j in permutations(range(columns.shape[1]), 2):
        pair = (columns[:, i] % 2 == 0) & (columns[:, j] == columns[:, i] + 1)
        sets = np.flatnonzero(pair & ~compliant[:, i] & ~compliant[:, j])
        edge = edge_of[columns[sets, i] // 2]
        shift = carried[sets, edge][:, None] * network.edge_axis[edge]
        force[sets, i] += shift
        force[sets, j] -= shift
        carried[sets, edge] = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class MixedSystem(FrozenValue):
    """The system of one grip set."""

    matrix: sparse.csc_array  # (6s + 6b + c,)
    force: Floats  # (rw, c); forces of each grip, then its moments, for unit multipliers
    weight: Floats  # (c,); by which the grips' equations are multiplied


class HeldRows(NamedTuple):
    """What one grip set forbids, by scaled multipliers."""

    rows: Floats  # (c, 6b); scaled twists
    force: Floats  # (rw, c); forces of each grip, then its moments, for unit multipliers
    corner: Floats  # (c, c); by how much grips give way all the same


def held_rows(parts: Ungripped, grips: Ints, compliance: GripCompliance = RIGID) -> HeldRows:
    """Return what one grip set, of this compliance, forbids."""
    network, brick = parts.network, grips // 2
    arm = network.node_position[network.inner.ravel()[grips]] - network.centroid[brick]
    motion = np.zeros((len(grips), 3, parts.bricks, 6))
    motion[np.arange(len(grips)), :, brick] = point_motion(arm)
    rows, force = motion.reshape(3 * len(grips), 6 * parts.bricks), np.eye(3 * len(grips))
    ends = network.node_position[network.inner[brick]]
    doubles = [i for i in range(len(grips)) if (brick[:i] == brick[i]).any()]
    if doubles:  # they forbid nothing along the line to the other grip on their brick
        own = {i: linalg.null_space(np.diff(ends[i], axis=0)) for i in doubles}
        force = linalg.block_diag(*(own.get(i, np.eye(3)) for i in range(len(grips))))
        rows = force.T @ rows
    corner = np.zeros((force.shape[1], force.shape[1]))
    if compliance.matrix is not None:
        rows, force, flexibility = _with_flexibility(parts, grips, rows, force, compliance)
        corner = parts.unit * flexibility
    return HeldRows(rows * parts.twist_unit, force, corner)


def mixed_system(
    parts: Ungripped, grips: Ints, shift: Floats | None = None, compliance: GripCompliance = RIGID
) -> MixedSystem:
    """Return the system of one grip set.

    ``shift`` (6b,): added to the diagonal of the scaled stiffness, to factor a mechanism.
    """
    rows, force, corner = held_rows(parts, grips, compliance)
    weight = 1 / np.maximum(1.0, np.diag(corner))
    matrix = parts.matrix
    if shift is not None:
        added = sparse.diags_array(np.concatenate([np.zeros(len(parts.wrench_unit)), shift]))
        matrix = sparse.csc_array(matrix + added)
    below = None if compliance.matrix is None else weight[:, None] * corner
    return MixedSystem(bordered(matrix, sparse.csr_array(rows), below, weight), force, weight)


def _with_flexibility(
    parts: Ungripped, grips: Ints, rows: Floats, force: Floats, compliance: GripCompliance
) -> tuple[Floats, Floats, Floats]:
    """Return rows of motions (n, 6b), forces (rw, n) and flexibilities (n, n) of compliant grips.

    After the multipliers of rigid grips, ``rows`` (c, 6b) and ``force`` (3r, c), there is one for
    the force between two grips on one brick of which one is compliant, which moves no brick, and
    those of moments, over the lever.
    """
    network, count = parts.network, len(grips)
    yields, turns = compliance.compliant(1, count)[0], compliance.transmits(count)
    own = compliance.transmitted[0]
    width = own.shape[2]
    between = []
    for i, j in permutations(range(count), 2):
        if i < j and grips[i] // 2 == grips[j] // 2 and (yields[i] or yields[j]):
            step = np.diff(network.node_position[network.inner[grips[i] // 2]], axis=0)[0]
            pull = np.zeros((count, 3))
            pull[i], pull[j] = -step / np.linalg.norm(step), step / np.linalg.norm(step)
            between.append(pull.ravel())
    shifts = np.column_stack([force, *between])
    turned = np.zeros((3 * int(turns.sum()), 6 * parts.bricks))
    out = np.zeros((count, width, shifts.shape[1] + len(turned)))
    out[:, :3, : shifts.shape[1]] = shifts.reshape(count, 3, shifts.shape[1])
    for n, grip in enumerate(np.flatnonzero(turns)):
        brick, mine = grips[grip] // 2, slice(3 * n, 3 * n + 3)
        turned[mine, 6 * brick + 3 : 6 * brick + 6] = compliance.lever * np.eye(3)
        out[grip, 3:, shifts.shape[1] + 3 * n : shifts.shape[1] + 3 * n + 3] = np.eye(3)
    still = np.zeros((len(between), 6 * parts.bricks))
    flexibility = np.einsum("gim,gij,gjn->mn", out, own, out)
    return np.vstack([rows, still, turned]), out.reshape(count * width, out.shape[2]), flexibility


def bordered(
    matrix: sparse.csc_array,
    rows: sparse.csr_array,
    corner: Floats | None = None,
    weight: Floats | None = None,
) -> sparse.csc_array:
    """Return a system (6s + 6b,) in which products of rows (c, 6b) with twists are zero too.

    ``corner`` (c, c): what multipliers add; ``weight`` (c,): of these equations but the corner.
    """
    if not rows.shape[0]:
        return sparse.csc_array(matrix)
    entries = rows.data, rows.indices + matrix.shape[0] - rows.shape[1], rows.indptr
    wide = sparse.csr_array(entries, shape=(rows.shape[0], matrix.shape[0]))
    last, below = wide, None
    if corner is not None and weight is not None:
        last = sparse.csr_array(sparse.diags_array(weight) @ wide)
        below = sparse.csr_array(corner)
    return sparse.csc_array(sparse.block_array([[matrix, -wide.T], [last, below]], format="csc"))


def unscaled(parts: Ungripped, states: Floats) -> tuple[Floats, Floats]:
    """Return the wrenches and twists, as of `Solution`, of scaled unknowns (S, 6s + 6b)."""
    springs, sets, joints = parts.network.springs, len(states), len(parts.wrench_unit)
    own = (states[:, :joints] * parts.wrench_unit).reshape(sets, len(parts.acting), 2, 3)
    wrench = np.zeros((sets, len(springs.since), 6))
    turned = np.einsum("nshi,sij->nshj", own, springs.axes[parts.acting])
    wrench[:, parts.acting] = turned.reshape(sets, len(parts.acting), 6)
    return wrench, states[:, joints:] * parts.twist_unit


def rescaled(parts: Ungripped, wrench: Floats, twist: Floats) -> Floats:
    """Return the scaled unknowns (S, 6s + 6b) of wrenches and twists, as of `Solution`."""
    acting = wrench[:, parts.acting].reshape(len(wrench), len(parts.acting), 2, 3)
    own = np.einsum("nshj,sij->nshi", acting, parts.network.springs.axes[parts.acting])
    own = own.reshape(len(wrench), len(parts.wrench_unit))
    return np.hstack([own / parts.wrench_unit, twist / parts.twist_unit])


def solve_mixed(
    network: Network, bricks: int, columns: Ints, compliance: GripCompliance = RIGID
) -> Fields:
    """Return the fields of grip sets, one factorization for each; raises as `solve_load`.

    A mechanism that no load excites passes: `require_resistance` finds it.
    """
    parts = ungripped_system(network, bricks)
    answers = [no_sets(network, bricks, columns.shape[1])]
    for i, grips in enumerate(columns):
        own = compliance.select(slice(i, i + 1))
        solution = solve_load(parts, grips, parts.load, parts.moved, own)
        answers.append(respond(network, parts.motion, grips[None], solution))
    return _join_sets(answers)


def solve_load(
    parts: Ungripped,
    grips: Ints,
    pull: Floats,
    moved: Floats | float = 0.0,
    compliance: GripCompliance = RIGID,
) -> Solution:
    """Return how a partial structure answers to a load while a grip set holds its nodes still.

    ``pull`` (6b,), ``moved`` (6s,): as ``load`` and ``moved`` of the parts; ``compliance``: of this
    set. Raises `MechanismError` if a motion that the load excites meets no resistance;
    `SolverError` if the last digits of the system decide more than `_SENSITIVE` of the answer. That
    is a matter of its condition, not of how a processor rounds.
    """
    network, bricks = parts.network, parts.bricks
    system = mixed_system(parts, grips, compliance=compliance)
    joints, last = len(parts.wrench_unit), len(parts.wrench_unit) + len(parts.twist_unit)
    load = np.zeros(system.matrix.shape[0])
    load[:joints], load[joints:last] = moved, pull
    if compliance.moved is not None:
        width = len(system.force) // len(grips) if len(grips) else 3
        moved = np.pad(compliance.moved[0], ((0, 0), (0, width - 3)))
        load[last:] = system.weight * (system.force.T @ moved.ravel())
    try:
        factors = splu(system.matrix)
    except RuntimeError as error:
        require_resistance(network, bricks, grips, compliance)
        raise SolverError(f"{bricks} bricks: exactly singular in double precision") from error
    result, settled = _corrected(parts, factors, system.matrix.tocsr(), load)
    if not settled:
        require_resistance(network, bricks, grips, compliance)
        raise SolverError(
            f"{bricks} bricks: too close to a mechanism for double precision; "
            "add a grip or stiffness"
        )
    wrench, twist = unscaled(parts, result[None, :last])
    force = system.force @ (result[last:] * parts.unit)
    return Solution(twist, wrench, *borne(force[None], len(grips), compliance))


def _corrected(
    parts: Ungripped, factors: SuperLU, matrix: sparse.csr_array, load: Floats
) -> tuple[Floats, bool]:
    """Return the solution (6s + 6b + c,) of a factored system, and whether it is determined.

    It is if corrections end, and random changes of the last digits of loads and entries change it
    hardly.
    """
    last = len(parts.wrench_unit) + len(parts.twist_unit)
    result = factors.solve(load)
    for _ in range(_CORRECTIONS):
        correction = factors.solve(add_products(load, matrix, -result))
        result += correction
        if unchanged(parts, result[None, :last], correction[None, :last])[0]:
            break
    else:
        return result, False
    digits = np.finfo(float).eps * (abs(matrix) @ np.abs(result) + np.abs(load))
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(len(load), _TRIES))
    changes = factors.solve(digits[:, None] * signs)[:last].T
    state = np.broadcast_to(result[:last], changes.shape)
    return result, bool(unchanged(parts, state, changes, _SENSITIVE).all())


def borne(force: Floats, grips: int, compliance: GripCompliance) -> tuple[Floats, Floats, Bools]:
    """Return forces, N, and moments, N m, of grips (S, r, 3), and which are compliant.

    ``force`` (S, rw): of each grip, then its moments over the lever if grips transmit any.
    """
    sets, width = len(force), force.shape[1] // grips if grips else 3
    each = force.reshape(sets, grips, width)
    moment = compliance.lever * each[..., 3:] if width > 3 else np.zeros((sets, grips, 3))
    return each[..., :3], moment, compliance.compliant(sets, grips)


def unchanged(
    parts: Ungripped, states: Floats, corrections: Floats, largest: float = LAST_CORRECTION
) -> Bools:
    """Return whether corrections (S, 6s + 6b) of forces, moments, shifts and turns are small."""
    return are_small(parts, sizes(parts, states), sizes(parts, corrections), largest)


def are_small(parts: Ungripped, size: Floats, change: Floats, largest: float) -> Bools:
    """Return whether changes (S, 4) are small beside what changes (S, 4), both as of `sizes`.

    Where nothing moves, as where robots hold every brick at both nodes, what is left is rounding:
    it is measured against the weight.
    """
    other = size.reshape(-1, 2, 2).max(axis=2).repeat(2, axis=1)
    least = np.maximum(_EMPTY * other, _LIGHT * np.abs(parts.load).max())
    return np.asarray((change <= largest * np.maximum(size, least)).all(axis=1))


def sizes(parts: Ungripped, states: Floats) -> Floats:
    """Return the largest force, moment, shift and turn of each state, (S, 4)."""
    both = np.split(np.abs(states), [len(parts.wrench_unit)], axis=1)
    ways = [e.reshape(len(e), e.shape[1] // 6, 6).max(axis=1, initial=0.0) for e in both]
    return np.asarray(np.hstack(ways).reshape(len(states), 4, 3).max(axis=2))


def add_products(start: Floats, matrix: sparse.csr_array, factors: Floats) -> Floats:
    """Return ``start + matrix @ factors``, of vectors, with twice the digits before it is rounded.

    Residuals of a solution ``x``, with the factors ``-x``, are mostly rounding in plain doubles,
    which differs between processors. Here the rounding errors of products and sums are summed too,
    by operations that every processor rounds alike (``Dot2`` of Ogita, Rump and Oishi, SIAM Journal
    on Scientific Computing 26 (2005) 1955-1988).
    """
    count = np.diff(matrix.indptr)
    total, lost = start.copy(), np.zeros_like(start)
    for place in range(int(count.max(initial=0))):
        rows = np.flatnonzero(count > place)
        at = matrix.indptr[rows] + place
        a, b = matrix.data[at], factors[matrix.indices[at]]
        product, (a1, a2), (b1, b2) = a * b, _halves(a), _halves(b)
        rounded = a2 * b2 - (((product - a1 * b1) - a2 * b1) - a1 * b2)  # exact (Dekker)
        before = total[rows]
        total[rows] = after = before + product
        part = after - before
        lost[rows] += (before - (after - part)) + (product - part) + rounded  # exact (Knuth)
    return total + lost


def _halves(a: Floats) -> tuple[Floats, Floats]:
    """Return two parts of 26 digits that add up to doubles (Veltkamp)."""
    wide = _SPLIT * a
    first = wide - (wide - a)
    return first, a - first
