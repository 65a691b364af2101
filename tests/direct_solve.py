"""Rigid bricks by the assembled stiffness of each grip set: an independent route, and no engine."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from experiments.placement.parts.staged import spring_maps
from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import RIGID, Fields, GripCompliance, _join_sets, no_sets
from seqopt.engines.rigid._mixed import Solution, require_resistance, respond
from seqopt.errors import SolverError
from seqopt.network._mechanics import node_motion
from seqopt.network.network import Network

_ROUNDING = 1e-13  # a smaller eigenvalue of the assembled stiffness may be rounding alone
_BACKWARD = 1e-10  # largest backward error of an accepted solution


@dataclass(frozen=True)
class RigidStructure:
    """The parts of the stiffness of one partial structure."""

    acting: Ints  # (s,); the springs that act
    gap: Floats  # (s, 6, 6b); their deformations for unit twists of the bricks
    stiffness: Floats  # (s, 6, 6); theirs, N/m and N m/rad
    matrix: Floats  # (6b, 6b); stiffness of the structure without grips
    motion: Floats  # (3n, 6b); displacements of the nodes for unit twists
    inner_motion: Floats  # (6b, 6b); of these, the inner nodes in the order of ``network.inner``


def solve_dense(
    network: Network, bricks: int, columns: Ints, compliance: GripCompliance = RIGID
) -> Fields:
    """Return the fields of grip sets from the stiffness matrix of each.

    Raises `MechanismError` if nothing resists a motion; `SolverError` if a motion is resisted too
    little for the assembled stiffness to tell, or the backward error is larger than `_BACKWARD`.
    """
    acting, gap, stiffness = spring_maps(network, bricks)
    matrix = np.einsum("sik,sij,sjl->kl", gap, stiffness, gap, optimize=True)
    motion = node_motion(network, bricks).toarray()
    inner = motion[(3 * network.inner[:bricks].reshape(-1, 1) + np.arange(3)).ravel()]
    parts = RigidStructure(acting, gap, stiffness, matrix, motion, inner)
    if compliance.matrix is not None:
        raise SolverError("direct solve: it holds rigidly; take another engine for soft grips")
    none = np.zeros((*columns.shape, 3))
    far = none if compliance.moved is None else compliance.moved
    each = zip(columns, far, strict=True)
    answers = [_solve_one_dense(network, parts, *one) for one in each]
    return _join_sets([no_sets(network, bricks, columns.shape[1]), *answers])


def _solve_one_dense(network: Network, parts: RigidStructure, grips: Ints, far: Floats) -> Fields:
    """Return the fields of one grip set, whose nodes are moved (r, 3)."""
    bricks = len(parts.matrix) // 6
    pull = parts.inner_motion.T @ network.inner_weight[: 2 * bricks].ravel()
    pull += network.applied(bricks).ravel()
    moved = network.springs.movement[parts.acting]
    pull += np.einsum("sij,sik,sk->j", parts.gap, parts.stiffness, moved)
    forbidden = parts.inner_motion[(3 * grips[:, None] + np.arange(3)).ravel()]  # (3r, 6b)
    values, vectors, motions = resisting_modes(parts.matrix, forbidden)
    if len(values) and not values[0] > _ROUNDING * values[-1]:  # all may be zero
        require_resistance(network, bricks, grips)
        raise SolverError(f"direct solve of {bricks} bricks: too close to a mechanism")
    taken = np.zeros_like(pull)
    if far.any():
        taken = np.asarray(np.linalg.lstsq(forbidden, far.ravel(), rcond=None)[0])
    target = motions.T @ (pull - parts.matrix @ taken)
    answer = vectors @ (vectors.T @ target / values)
    residual = np.abs(motions.T @ (parts.matrix @ (motions @ answer)) - target).max()
    if not residual <= _BACKWARD * (values[-1] * np.abs(answer).max() + np.abs(target).max()):
        raise SolverError(f"direct solve of {bricks} bricks: backward error too large")
    twist = motions @ answer + taken
    wrench = np.zeros((len(network.springs.since), 6))
    wrench[parts.acting] = -np.einsum("sij,sjk,k->si", parts.stiffness, parts.gap, twist)
    wrench[parts.acting] += np.einsum("sij,sj->si", parts.stiffness, moved)
    missing = parts.matrix @ twist - pull
    force = np.asarray(np.linalg.lstsq(forbidden.T, missing, rcond=None)[0].reshape(-1, 3))
    rigid = np.zeros((1, len(grips)), dtype=bool)
    solution = Solution(twist[None], wrench[None], force[None], 0 * force[None], rigid)
    return respond(network, parts.motion, grips[None], solution)


def resisting_modes(matrix: Floats, forbidden: Floats) -> tuple[Floats, Floats, Floats]:
    """Return how a structure of some stiffness resists the motions that its grips do not forbid.

    Results: ``values`` (m,): eigenvalues of the scaled stiffness, ascending; ``vectors`` (m, m):
    its modes; ``motions`` (6b, m): the motions that the modes combine.
    """
    free = linalg.null_space(forbidden) if len(forbidden) else np.eye(len(matrix))
    diagonal = np.diag(free.T @ matrix @ free)
    most = max(diagonal.max(initial=0.0), np.finfo(float).tiny / _ROUNDING)
    motions = free / np.sqrt(np.maximum(diagonal, _ROUNDING * most))
    values, vectors = np.linalg.eigh(motions.T @ matrix @ motions)
    return values, vectors, motions
