r"""Rigid bricks solved with joint wrenches and motions as unknowns side by side.

Stiffness form squares what separates a stiff joint from a soft chain. Kept apart, the deformations
of the joints, the equilibrium of the bricks and the stillness of the grips make one sparse system

.. math:: s + C B u = 0, \qquad -B^T s - H^T \lambda = f, \qquad H u = 0

(wrenches :math:`s`, stiffnesses :math:`C`, twists :math:`u`, grip forces :math:`\lambda`) whose
condition does not grow with the length of a chain as its stiffness does. One factorization per
grip set, corrected until it no longer changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import SuperLU, splu

from seqopt.arrays import Floats, Ints, skew
from seqopt.engines.interface import Fields
from seqopt.engines.rigid.mechanism import require_resistance
from seqopt.engines.rigid.recovery import respond, stack
from seqopt.errors import SolverError
from seqopt.network.kinematics import centroids, node_motion
from seqopt.network.network import GROUND, Network
from seqopt.network.statics import Statics, build_statics

REFINEMENTS = 3
CONVERGED = 1e-10  # largest last correction of forces, moments, shifts and turns, relative to each
EMPTY = 1e-6  # forces this small beside the moments over a brick's length are not looked at alone


@dataclass(frozen=True)
class Ungripped:
    """What the systems of all grip sets of a partial structure have in common, scaled to order one.

    Attributes
    ----------
    network : Network
    bricks : int
    motion : (3N, 6b) sparse
        Displacements of the nodes for unit twists.
    maps : Statics
    deformation : (6s, 6b) sparse
        Scaled deformation of the acting springs, in their own axes, for scaled twists.
    stiffness : (6s,) float
        Over ``unit``.
    matrix : (6s + 6b,) square sparse
        The system without grips.
    load : (6b,) float
        The weight, scaled.
    acting : (s,) int
    twist_unit, wrench_unit : (6b,), (6s,) float
        What turns scaled twists into m and rad, scaled wrenches into N and N m.
    unit : float
        N/m.
    """

    network: Network
    bricks: int
    motion: sparse.csr_array
    maps: Statics
    deformation: sparse.csr_array
    stiffness: Floats
    matrix: sparse.csr_array
    load: Floats
    acting: Ints
    twist_unit: Floats
    wrench_unit: Floats
    unit: float


@dataclass(frozen=True)
class MixedSystem:
    """The system of one grip set.

    Attributes
    ----------
    held : (c, 6b) sparse
        Motions that the grips forbid, of scaled twists.
    matrix : (6s + 6b + c,) square sparse
    hand : (3r, c) float
        Forces of the grips for unit multipliers.
    """

    held: sparse.csr_array
    matrix: sparse.csc_array
    hand: Floats


def ungripped(network: Network, bricks: int) -> Ungripped:
    """Return what all systems of a partial structure have in common."""
    springs = network.springs
    acting = np.flatnonzero(springs.since <= bricks)
    steps = np.diff(network.node_position[network.inner[:bricks]], axis=1)
    length = float(np.linalg.norm(steps, axis=2).max())
    lever = np.array([1.0, 1.0, 1.0, length, length, length])
    raw = np.hstack([springs.translational_stiffness, springs.rotational_stiffness])[acting]
    raw = (raw / lever**2).ravel()
    unit = float(np.median(raw[raw > 0])) if raw.any() else 1.0
    stiffness = raw / unit
    twist_unit = np.tile(1 / lever, bricks)
    deformation = _deformation(network, bricks, acting)
    deformation = sparse.diags_array(np.tile(lever, len(acting))) @ deformation
    deformation = deformation @ sparse.diags_array(twist_unit)
    row = 1 / np.maximum(1.0, stiffness)  # keeps a stiff joint's equation of order one
    blocks = [
        [sparse.diags_array(row), sparse.diags_array(row * stiffness) @ deformation],
        [-deformation.T, None],
    ]
    motion = node_motion(network, bricks)
    weight = np.repeat(0.5 * network.weight[:bricks], 2, axis=0).ravel()
    inner = (3 * network.inner[:bricks].ravel()[:, None] + np.arange(3)).ravel()
    return Ungripped(
        network=network,
        bricks=bricks,
        motion=motion,
        maps=build_statics(network),
        deformation=deformation,
        stiffness=stiffness,
        matrix=sparse.csr_array(sparse.block_array(blocks)),
        load=motion[inner].T @ weight * twist_unit / unit,
        acting=acting,
        twist_unit=twist_unit,
        wrench_unit=unit * np.tile(lever, len(acting)),
        unit=unit,
    )


def mixed_system(parts: Ungripped, grips: Ints, shift: Floats | None = None) -> MixedSystem:
    """Return the system of one grip set, places in ``network.inner.ravel()``.

    Parameters
    ----------
    shift : (6b,) float, optional
        Added to the diagonal of the scaled stiffness, so that a mechanism can be factored.
    """
    rows, hand = _constraints(parts, grips)
    held = sparse.csr_array(rows @ sparse.diags_array(parts.twist_unit))
    matrix, joints = parts.matrix, len(parts.wrench_unit)
    if shift is not None:
        below = sparse.diags_array(np.concatenate([np.zeros(joints), shift]))
        matrix = sparse.csr_array(matrix + below)
    if len(hand):
        of_all = (held.data, held.indices + joints, held.indptr)
        rows = sparse.csr_array(of_all, shape=(held.shape[0], matrix.shape[0]))
        matrix = sparse.block_array([[matrix, -rows.T], [rows, None]], format="csr")
    return MixedSystem(held, sparse.csc_array(matrix), hand)


def factor(system: MixedSystem) -> SuperLU:
    """Return the factors; a `RuntimeError` means that the matrix is exactly singular."""
    return splu(system.matrix)


def solve_mixed(network: Network, bricks: int, columns: Ints) -> Fields:
    """Return the fields of grip sets (S, r), given as places in ``network.inner.ravel()``.

    A mechanism that no load excites passes: `seqopt.engines.rigid.mechanism.require_resistance` finds it.

    Raises
    ------
    MechanismError
        If a motion that the load excites meets no resistance.
    SolverError
        If the answer still changes by more than `CONVERGED`.
    """
    parts = ungripped(network, bricks)
    return stack(network, bricks, columns, [_solve_one(parts, grips) for grips in columns])


def _solve_one(parts: Ungripped, grips: Ints) -> tuple[Floats, ...]:
    network, bricks = parts.network, parts.bricks
    system = mixed_system(parts, grips)
    joints, moves = len(parts.wrench_unit), len(parts.twist_unit)
    load = np.zeros(system.matrix.shape[0])
    load[joints : joints + moves] = parts.load
    try:
        factors = factor(system)
    except RuntimeError as error:
        require_resistance(network, bricks, grips)
        raise SolverError(f"{bricks} bricks: exactly singular in double precision") from error
    result = factors.solve(load)
    for _ in range(REFINEMENTS):
        correction = factors.solve(load - system.matrix @ result)
        result += correction
    kinds = [
        p[:, i].ravel()
        for p in np.split(np.arange(joints + moves).reshape(-1, 2, 3), [joints // 6])
        for i in (0, 1)
    ]
    size = [np.abs(result[kind]).max() for kind in kinds]
    least = [EMPTY * max(size[:2])] * 2 + [EMPTY * max(size[2:])] * 2
    change = [np.abs(correction[kind]).max() for kind in kinds]
    if not all(c <= CONVERGED * max(s, e) for c, s, e in zip(change, size, least, strict=True)):
        require_resistance(network, bricks, grips)
        raise SolverError(
            f"{bricks} bricks: too close to a mechanism for double precision; "
            "add a grip or stiffness"
        )
    wrench = np.zeros((len(network.springs.since), 6))
    own = (result[:joints] * parts.wrench_unit).reshape(-1, 2, 3)
    axes = network.springs.axes[parts.acting]
    wrench[parts.acting] = np.einsum("shi,sij->shj", own, axes).reshape(-1, 6)
    return respond(
        network,
        grips,
        maps=parts.maps,
        motion=parts.motion,
        twist=result[joints : joints + moves] * parts.twist_unit,
        wrench=wrench,
        force=(system.hand @ (result[joints + moves :] * parts.unit)).reshape(-1, 3),
    )


def _deformation(network: Network, bricks: int, acting: Ints) -> sparse.csr_array:
    """Return the deformations of springs in their own axes for unit twists, (6s, 6b)."""
    springs, center = network.springs, centroids(network)
    turn = np.zeros((len(acting), 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = springs.axes[acting]
    row, side = np.nonzero(springs.bodies[acting] != GROUND)
    body = springs.bodies[acting[row], side]
    block = np.tile(np.eye(6), (len(row), 1, 1))
    block[:, :3, 3:] -= skew(springs.position[acting[row]] - center[body])
    block = np.where(side, 1.0, -1.0)[:, None, None] * turn[row] @ block
    rows = np.broadcast_to(6 * row[:, None, None] + np.arange(6)[:, None], block.shape)
    columns = np.broadcast_to(6 * body[:, None, None] + np.arange(6), block.shape)
    return sparse.csr_array(
        (block.ravel(), (rows.ravel(), columns.ravel())), shape=(6 * len(acting), 6 * bricks)
    )


def _constraints(parts: Ungripped, grips: Ints) -> tuple[sparse.csr_array, Floats]:
    """Return independent motions that grips forbid (c, 6b), and their forces (3r, c).

    A second grip on a brick forbids nothing along the line to the first.
    """
    network = parts.network
    inner = network.inner.ravel()[grips]
    held = parts.motion[(3 * inner[:, None] + np.arange(3)).ravel()]
    directions = []
    for i, place in enumerate(grips):
        free = np.eye(3)
        if (grips[:i] // 2 == place // 2).any():
            step = np.diff(network.node_position[network.inner[place // 2]], axis=0)
            free = linalg.null_space(step)
        directions.append(free)
    hand = linalg.block_diag(*directions) if len(grips) else np.zeros((0, 0))
    return sparse.csr_array(sparse.csr_array(hand.T) @ held), hand
