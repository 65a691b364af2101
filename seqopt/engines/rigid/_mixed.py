r"""Rigid bricks solved with joint wrenches and motions as unknowns side by side.

One factorization of the system per grip set, corrected until
it no longer changes: slow, sure, and the last resort of the fast engine.

Stiffness form squares what separates a stiff joint from a soft chain. Kept apart, the deformations
of the joints, the equilibrium of the bricks and the stillness of the grips make one sparse system

.. math:: s + C B u = 0, \qquad -B^T s - H^T \lambda = f, \qquad H u = 0

(wrenches :math:`s`, stiffnesses :math:`C`, twists :math:`u`, grip forces :math:`\lambda`) whose
condition does not grow with the length of a chain as its stiffness does.

`solve_dense` solves directly, one grip set at a time: the general case, mechanisms included.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import SuperLU, splu

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.engines.interface import Fields, join_sets, no_sets
from seqopt.engines.rigid._mechanism import (
    RigidStructure,
    Ungripped,
    lost_to_rounding,
    require_resistance,
    resisting_modes,
    rigid_structure,
    ungripped_system,
)
from seqopt.errors import SolverError
from seqopt.network._mechanics import Statics
from seqopt.network.network import Network


@dataclass(frozen=True, eq=False, repr=False)
class Solution(FrozenValue):
    """What determines all fields of S grip sets.

    ``twist`` (S, 6b): of the bricks, m and rad. ``wrench`` (S, J, 6): of every spring of the
    network on its second body, N and N m; zero where it does not act. ``force`` (S, r, 3): of the
    grips, N; two on one brick may share theirs in any way.
    """

    twist: Floats
    wrench: Floats
    force: Floats


def respond(
    network: Network,
    statics: Statics,
    motion: Floats | sparse.csr_array,
    columns: Ints,
    solution: Solution,
) -> Fields:
    """Return the fields of grip sets.

    ``statics``: of the network. ``motion`` (3n, 6b): displacements of the nodes for unit twists;
    see `seqopt.network._mechanics.node_motion`. ``columns`` (S, r): grips as indices into
    ``network.inner.ravel()``.
    """
    twist, wrench, force = solution.twist, solution.wrench, solution.force.copy()
    sets, bricks = len(twist), twist.shape[1] // 6
    load = np.tile(network.inner_weight[: 2 * bricks], (sets, 1, 1))
    load[np.arange(sets)[:, None], columns] += force
    carried = edge_forces(network, statics, wrench, load)
    split_pairs(network, columns, force, carried)
    return Fields(
        edge_force=carried,
        displacement=(motion @ twist.T).T.reshape(sets, motion.shape[0] // 3, 3),
        grip_force=force,
        support=reactions(network, statics, wrench),
        joint_wrench=wrench,
        brick_twist=twist.reshape(sets, bricks, 6),
    )


def edge_forces(network: Network, statics: Statics, wrench: Floats, load: Floats) -> Floats:
    """Return what the edges carry.

    ``statics``: of the network; ``wrench`` (S, J, 6): of every spring of the network on its second
    body, N and N m; ``load`` (S, 2b, 3): forces at the inner nodes, those of grips among them, N.
    Result (S, E): tension positive, N.
    """
    sets, bricks = len(load), load.shape[1] // 2
    edges = network.count_edges(bricks)
    through = wrench[:, :, :3].reshape(sets, 3 * wrench.shape[1])
    carried = (statics.edge_of_spring[:edges] @ through.T).T
    carried += (statics.edge_of_load[:edges, : 6 * bricks] @ load.reshape(sets, 6 * bricks).T).T
    return np.asarray(carried)


def reactions(network: Network, statics: Statics, wrench: Floats) -> Floats:
    """Return force and moment of every ground end about its fixed point.

    ``statics``: of the network; ``wrench`` (S, J, 6): of every spring of the network on its second
    body, N and N m. Result (S, G, 6): N and N m.
    """
    at_spring = wrench[:, network.springs.support]
    return np.asarray(np.einsum("gij,sgj->sgi", statics.support_of_spring, at_spring))


def split_pairs(network: Network, columns: Ints, force: Floats, carried: Floats) -> None:
    """Let each of two grips on one brick take what reaches its own node, in place.

    ``columns`` (S, r): grips as indices into ``network.inner.ravel()``; ``force`` (S, r, 3): of the
    grips, N; ``carried`` (S, E): by the edges, N.
    """
    inner = np.flatnonzero(network.edge_spring < 0)
    edge_of = np.empty(len(network.inner), dtype=np.int64)
    edge_of[network.edge_brick[inner]] = inner
    for i, j in permutations(range(columns.shape[1]), 2):
        sets = np.flatnonzero((columns[:, i] % 2 == 0) & (columns[:, j] == columns[:, i] + 1))
        edge = edge_of[columns[sets, i] // 2]
        shift = carried[sets, edge][:, None] * network.edge_axis[edge]
        force[sets, i] += shift
        force[sets, j] -= shift
        carried[sets, edge] = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class MixedSystem(FrozenValue):
    """The system of one grip set."""

    forbidden: sparse.csr_array  # (c, 6b); scaled twists that the grips forbid
    matrix: sparse.csc_array  # (6s + 6b + c,)
    force: Floats  # (3r, c); forces of the grips for unit multipliers


def mixed_system(parts: Ungripped, grips: Ints, shift: Floats | None = None) -> MixedSystem:
    """Return the system of one grip set.

    ``grips`` (r,): indices into ``network.inner.ravel()``; ``shift`` (6b,): added to the diagonal
    of the scaled stiffness, so that a mechanism can be factored.
    """
    rows, force = _constraints(parts, grips)
    forbidden = sparse.csr_array(rows @ sparse.diags_array(parts.twist_unit))
    matrix, joints = parts.matrix, len(parts.wrench_unit)
    if shift is not None:
        below = sparse.diags_array(np.concatenate([np.zeros(joints), shift]))
        matrix = sparse.csc_array(matrix + below)
    if len(force):
        of_all = (forbidden.data, forbidden.indices + joints, forbidden.indptr)
        rows = sparse.csr_array(of_all, shape=(forbidden.shape[0], matrix.shape[0]))
        matrix = sparse.block_array([[matrix, -rows.T], [rows, None]], format="csc")
    return MixedSystem(forbidden, sparse.csc_array(matrix), force)


def factorize(system: MixedSystem) -> SuperLU:
    """Return the factors of a system. Raises `RuntimeError` if the matrix is exactly singular."""
    return splu(system.matrix)


def _constraints(parts: Ungripped, grips: Ints) -> tuple[sparse.csr_array, Floats]:
    """Return independent motions that grips forbid (c, 6b), and their forces (3r, c).

    A second grip on a brick forbids nothing along the line to the first.
    """
    network = parts.network
    inner = network.inner.ravel()[grips]
    motion = parts.motion[(3 * inner[:, None] + np.arange(3)).ravel()]
    directions = []
    for i, brick in enumerate(grips // 2):
        free = np.eye(3)
        if (grips[:i] // 2 == brick).any():
            step = np.diff(network.node_position[network.inner[brick]], axis=0)
            free = linalg.null_space(step)
        directions.append(free)
    force = linalg.block_diag(*directions) if len(grips) else np.zeros((0, 0))
    return sparse.csr_array(sparse.csr_array(force.T) @ motion), force


def unscaled(parts: Ungripped, states: Floats) -> tuple[Floats, Floats]:
    """Return the wrenches and twists that scaled unknowns stand for.

    ``states`` (S, 6s + 6b). Results: ``wrench`` (S, J, 6): of every spring of the network on its
    second body, N and N m; zero where it does not act. ``twist`` (S, 6b): of the bricks, m and rad.
    """
    springs, sets = parts.network.springs, len(states)
    joints = len(parts.wrench_unit)
    own = (states[:, :joints] * parts.wrench_unit).reshape(sets, len(parts.acting), 2, 3)
    wrench = np.zeros((sets, len(springs.since), 6))
    turned = np.einsum("nshi,sij->nshj", own, springs.axes[parts.acting])
    wrench[:, parts.acting] = turned.reshape(sets, len(parts.acting), 6)
    return wrench, states[:, joints:] * parts.twist_unit


def rescaled(parts: Ungripped, wrench: Floats, twist: Floats) -> Floats:
    """Return the scaled unknowns that stand for wrenches and twists.

    ``wrench`` (S, J, 6): of every spring of the network on its second body, N and N m; ``twist``
    (S, 6b): of the bricks, m and rad. Result (S, 6s + 6b).
    """
    joints = len(parts.wrench_unit)
    acting = wrench[:, parts.acting].reshape(len(wrench), len(parts.acting), 2, 3)
    own = np.einsum("nshj,sij->nshi", acting, parts.network.springs.axes[parts.acting])
    return np.hstack(
        [own.reshape(len(wrench), joints) / parts.wrench_unit, twist / parts.twist_unit]
    )


_CORRECTIONS = 3  # after which an answer is judged
LAST_CORRECTION = 1e-10  # the largest of forces, moments, shifts and turns, relative to each
_EMPTY = 1e-6  # forces this small beside the moments over a brick's length are not looked at alone
_LIGHT = 1e-3  # nor what is this small beside the weight, or the motion it makes at a typical joint


def solve_mixed(network: Network, bricks: int, columns: Ints) -> Fields:
    """Return the fields of grip sets, one factorization for each.

    A mechanism that no load excites passes:
    `seqopt.engines.rigid._mechanism.require_resistance` finds it.

    ``columns`` (S, r): grips as indices into ``network.inner.ravel()``. Raises `MechanismError` if
    a motion that the load excites meets no resistance; `SolverError` if the answer still changes by
    more than `LAST_CORRECTION`.
    """
    parts = ungripped_system(network, bricks)
    answers = [_solve_one(parts, grips) for grips in columns]
    return join_sets([no_sets(network, bricks, columns.shape[1]), *answers])


def _solve_one(parts: Ungripped, grips: Ints) -> Fields:
    """Return the fields of one grip set."""
    network = parts.network
    solution = solve_load(parts, grips, parts.load)
    return respond(network, parts.statics, parts.motion, grips[None], solution)


def solve_load(parts: Ungripped, grips: Ints, pull: Floats) -> Solution:
    """Return how a partial structure answers to a load while a grip set holds its nodes still.

    ``grips`` (r,): indices into ``network.inner.ravel()``; ``pull`` (6b,): the load, scaled as
    ``parts.load``. Raises `MechanismError` if a motion that the load excites meets no resistance;
    `SolverError` if the answer still changes by more than `LAST_CORRECTION`.
    """
    network, bricks = parts.network, parts.bricks
    system = mixed_system(parts, grips)
    joints, moves = len(parts.wrench_unit), len(parts.twist_unit)
    load = np.zeros(system.matrix.shape[0])
    load[joints : joints + moves] = pull
    try:
        factors = factorize(system)
    except RuntimeError as error:
        require_resistance(network, bricks, grips)
        raise SolverError(f"{bricks} bricks: exactly singular in double precision") from error
    result = factors.solve(load)
    for _ in range(_CORRECTIONS):
        correction = factors.solve(load - system.matrix @ result)
        result += correction
    both = np.stack([result, correction])[:, None, : joints + moves]
    if not unchanged(parts, *both)[0]:
        require_resistance(network, bricks, grips)
        raise SolverError(
            f"{bricks} bricks: too close to a mechanism for double precision; "
            "add a grip or stiffness"
        )
    wrench, twist = unscaled(parts, result[None, : joints + moves])
    force = (system.force @ (result[joints + moves :] * parts.unit)).reshape(1, -1, 3)
    return Solution(twist, wrench, force)


def unchanged(
    parts: Ungripped, states: Floats, corrections: Floats, largest: float = LAST_CORRECTION
) -> Bools:
    """Return whether corrections are small beside forces, moments, shifts and turns each.

    Where nothing moves, as where robots hold every brick at both nodes, what is left is rounding:
    it is measured against the weight.

    ``states``, ``corrections`` (S, 6s + 6b): scaled wrenches and twists; ``largest``: that counts
    as small. Result (S,).
    """
    size, change = _sizes(parts, states), _sizes(parts, corrections)
    other = size.reshape(-1, 2, 2).max(axis=2).repeat(2, axis=1)
    least = np.maximum(_EMPTY * other, _LIGHT * np.abs(parts.load).max())
    return np.asarray((change <= largest * np.maximum(size, least)).all(axis=1))


def _sizes(parts: Ungripped, states: Floats) -> Floats:
    """Return the largest force, moment, shift and turn of each state, (S, 4)."""
    ends = [len(parts.wrench_unit)]
    kinds = [
        part.reshape(len(states), part.shape[1] // 6, 2, 3)
        for part in np.split(states, ends, axis=1)
    ]
    return np.hstack([np.abs(part).max(axis=(1, 3), initial=0.0) for part in kinds])


_BACKWARD = 1e-10  # largest backward error of an accepted solution


def solve_dense(network: Network, bricks: int, columns: Ints) -> Fields:
    """Return the fields of grip sets from the stiffness matrix of each.

    ``columns`` (S, r): grips as indices into ``network.inner.ravel()``. Raises `MechanismError` if
    nothing resists a motion; `SolverError` if a motion is resisted too little for the assembled
    stiffness to tell, or the backward error of an answer is larger than `_BACKWARD`.
    """
    parts = rigid_structure(network, bricks)
    answers = [_solve_one_dense(network, parts, grips) for grips in columns]
    return join_sets([no_sets(network, bricks, columns.shape[1]), *answers])


def _solve_one_dense(network: Network, parts: RigidStructure, grips: Ints) -> Fields:
    """Return the fields of one grip set."""
    bricks = len(parts.matrix) // 6
    pull = parts.inner_motion.T @ network.inner_weight[: 2 * bricks].ravel()
    forbidden = parts.forbidden(grips)
    modes = resisting_modes(parts.matrix, forbidden)
    if lost_to_rounding(modes[0]):
        require_resistance(network, bricks, grips)
        raise SolverError(f"direct solve of {bricks} bricks: too close to a mechanism")
    twist = _constrained(parts.matrix, modes, pull)
    wrench = np.zeros((len(network.springs.since), 6))
    wrench[parts.acting] = -np.einsum("sij,sjk,k->si", parts.stiffness, parts.gap, twist)
    missing = parts.matrix @ twist - pull
    force = np.asarray(np.linalg.lstsq(forbidden.T, missing, rcond=None)[0].reshape(-1, 3))
    solution = Solution(twist[None], wrench[None], force[None])
    return respond(network, parts.statics, parts.motion, grips[None], solution)


def _constrained(matrix: Floats, modes: tuple[Floats, Floats, Floats], load: Floats) -> Floats:
    """Return the twists under a load that modes of the stiffness resist."""
    values, vectors, motions = modes
    target = motions.T @ load
    answer = vectors @ (vectors.T @ target / values)
    residual = np.abs(motions.T @ (matrix @ (motions @ answer)) - target).max()
    if not residual <= _BACKWARD * (values[-1] * np.abs(answer).max() + np.abs(target).max()):
        raise SolverError(f"direct solve of {len(matrix) // 6} bricks: backward error too large")
    return np.asarray(motions @ answer)
