"""Rigid bricks solved directly, one grip set at a time: the general case, mechanisms included."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Fields
from seqopt.engines.joined_fields import join_sets, no_sets
from seqopt.engines.rigid.mechanism import (
    RigidStructure,
    lost_to_rounding,
    require_resistance,
    resisting_modes,
    rigid_structure,
)
from seqopt.engines.rigid.recovery import Solution, respond
from seqopt.errors import SolverError
from seqopt.network.network import Network

BACKWARD = 1e-10  # largest backward error of an accepted solution


def solve_dense(network: Network, bricks: int, columns: Ints) -> Fields:
    """Return the fields of grip sets from the stiffness matrix of each.

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    columns : (S, r) int
        Grips as indices into ``network.inner.ravel()``.

    Raises
    ------
    MechanismError
        If nothing resists a motion.
    SolverError
        If a motion is resisted too little for the assembled stiffness to tell, or the backward
        error of an answer is larger than `BACKWARD`.
    """
    parts = rigid_structure(network, bricks)
    answers = [_solve_one(network, parts, grips) for grips in columns]
    return join_sets([no_sets(network, bricks, columns.shape[1]), *answers])


def _solve_one(network: Network, parts: RigidStructure, grips: Ints) -> Fields:
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
    if not residual <= BACKWARD * (values[-1] * np.abs(answer).max() + np.abs(target).max()):
        raise SolverError(f"direct solve of {len(matrix) // 6} bricks: backward error too large")
    return np.asarray(motions @ answer)
