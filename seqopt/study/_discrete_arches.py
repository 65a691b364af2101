"""The partial arches that Bruun et al. put to discrete elements, and how nodes of them move."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Want
from seqopt.network.network import Network
from seqopt.sequence.steps import Step

STEPS = {17: 33, 18: 35, 23: 45, 24: 47}
"""Steps of the sequential method, by bricks (table 3)."""


def inner_nodes(network: Network, step: Step) -> list[int]:
    """Return the inner nodes that no robot holds: as many as the paper compares (table 3)."""
    inner = network.inner[: step.bricks].ravel()
    return [int(i) for i in inner if network.node_name[i] not in step.held]


def moved(engine: Engine, step: Step) -> Floats:
    """Return how far the inner nodes move by an engine, m."""
    fields = engine.solve(step.bricks, [list(step.held)], Want.DISPLACEMENTS)
    inner = fields.displacement[0][inner_nodes(engine.network, step)]
    return np.asarray(np.linalg.norm(inner, axis=1))


def error(own: Floats, other: Floats) -> float:
    """Return the mean difference of displacements from others, as the paper's, %."""
    return 100 * float(np.mean((own - other) / other))
