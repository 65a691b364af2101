"""Rigid bricks solved directly, one grip set at a time: the general case, mechanisms included."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Fields
from seqopt.engines.rigid.mechanism import (
    RigidStructure,
    resisting_modes,
    rigid_structure,
)
from seqopt.engines.rigid.recovery import respond, stack
from seqopt.errors import SolverError
from seqopt.network.network import Network

BACKWARD = 1e-10  # largest backward error of an accepted solution


def solve_dense(network: Network, bricks: int, columns: Ints) -> Fields:
    """Return the fields of grip sets (S, r), given as places in ``network.inner.ravel()``."""
    parts = rigid_structure(network, bricks)
    answers = [_solve_one(network, parts, grips) for grips in columns]
    return stack(network, bricks, columns, answers)


def _solve_one(network: Network, parts: RigidStructure, grips: Ints) -> tuple[Floats, ...]:
    """Return the fields of one grip set, in the order of `Fields`."""
    bricks = len(parts.matrix) // 6
    weight = np.repeat(0.5 * network.weight[:bricks], 2, axis=0)
    pull = parts.held.T @ weight.ravel()
    fixed = parts.held[(3 * grips[:, None] + np.arange(3)).ravel()]
    twist = _constrained(network, parts.matrix, fixed, pull)
    wrench = np.zeros((len(network.springs.since), 6))
    wrench[parts.acting] = -np.einsum("sij,sjk,k->si", parts.stiffness, parts.gap, twist)
    missing = parts.matrix @ twist - pull
    force = np.linalg.lstsq(fixed.T, missing, rcond=None)[0].reshape(-1, 3)
    return respond(
        network,
        grips,
        maps=parts.maps,
        motion=parts.motion,
        twist=twist,
        wrench=wrench,
        force=force,
    )


def _constrained(network: Network, matrix: Floats, fixed: Floats, load: Floats) -> Floats:
    """Return the twists under a load with some motions held still."""
    values, vectors, motions = resisting_modes(network, matrix, fixed)
    target = motions.T @ load
    answer = vectors @ (vectors.T @ target / values)
    residual = np.abs(motions.T @ (matrix @ (motions @ answer)) - target).max()
    if not residual <= BACKWARD * (values[-1] * np.abs(answer).max() + np.abs(target).max()):
        raise SolverError(f"direct solve of {len(matrix) // 6} bricks: backward error too large")
    return np.asarray(motions @ answer)
