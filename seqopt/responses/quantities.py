"""Each response, defined once: from the fields of grip sets to scalars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Fields

SLACK = 1e-6  # an edge is in tension above this share of the mean weight of a brick


@dataclass(frozen=True)
class Responses:
    """Scalar responses of S grip sets on one partial structure, SI units.

    Attributes
    ----------
    F_rob : (S, r) float
        Size of every grip force with the sign of its part against gravity, N.
    F_sup, M_sup : (S,) float
        Size of the support's force, signed like F_rob, N, and of its moment, N m.
    F_min, F_max, F_avg : (S,) float
        Over the axial forces of all edges, tension positive, N; the study's T_max is F_max.
    T_pct : (S,) float
        Share of edges in tension, percent.
    D_max, D_avg, D_std : (S,) float
        Over the displacements of all nodes, m.
    """

    F_rob: Floats
    F_sup: Floats
    M_sup: Floats
    F_min: Floats
    F_max: Floats
    F_avg: Floats
    T_pct: Floats
    D_max: Floats
    D_avg: Floats
    D_std: Floats


def step_responses(engine: Engine, fields: Fields) -> Responses:
    """Return the scalar responses of full fields."""
    network = engine.network
    up = np.array(network.scene.up)
    weight = float(np.linalg.norm(network.weight, axis=1).mean())
    force = fields.edge_force
    size = np.linalg.norm(fields.displacement, axis=2)
    return Responses(
        F_rob=_signed(fields.grip_force, up),
        F_sup=_signed(fields.support[:, :3], up),
        M_sup=np.linalg.norm(fields.support[:, 3:], axis=1),
        F_min=force.min(axis=1),
        F_max=force.max(axis=1),
        F_avg=force.mean(axis=1),
        T_pct=100 * (force > SLACK * weight).mean(axis=1),
        D_max=size.max(axis=1),
        D_avg=size.mean(axis=1),
        D_std=size.std(axis=1),
    )


def _signed(vectors: Floats, up: Floats) -> Floats:
    """Return the lengths of vectors (..., 3), negative where they point down."""
    return np.asarray(np.copysign(np.linalg.norm(vectors, axis=-1), vectors @ up))
