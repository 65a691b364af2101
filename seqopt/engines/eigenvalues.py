"""The smallest eigenvalue of a held structure's stiffness: whether it can move freely."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh

from seqopt.arrays import Floats, Ints
from seqopt.engines.rigid.mixed_system import MixedSystem, factorize, mixed_system
from seqopt.engines.rigid.ungripped import ungripped_system
from seqopt.network.network import Network

UNRESISTED = 1e-17  # a scaled eigenvalue below this is found by a shift
LEAST_DIAGONAL = 1e-13  # over the largest: by it a motion without stiffness is scaled
SHIFT = 1e-15  # added to the scaled stiffness of a mechanism to find its mode
EIGENVALUE_TOLERANCE = 1e-6  # relative


def spectrum(network: Network, bricks: int, columns: Ints) -> tuple[float, float, Floats]:
    """Return how the constrained stiffness, scaled by its diagonal, resists motions.

    The inverse is applied by the mixed system, which keeps small eigenvalues that the stiffness
    matrix has lost to rounding; a mechanism is shifted.

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    columns : (r,) int
        Grips as indices into ``network.inner.ravel()``.

    Returns
    -------
    lowest : float
        Smallest eigenvalue, without unit.
    condition : float
        Largest eigenvalue over smallest.
    mode : (b, 6) float
        The motion that is resisted least, its largest component 1, as in
        `seqopt.engines.diagnosis.Diagnosis`.
    """
    parts = ungripped_system(network, bricks)
    root = np.sqrt(parts.stiffness)[:, None]
    diagonal = np.asarray((parts.deformation * root).power(2).sum(axis=0)).ravel()
    most = max(diagonal.max(), 1.0 if not diagonal.any() else 0.0)
    scale = np.sqrt(np.maximum(diagonal, LEAST_DIAGONAL * most))
    try:
        lowest, motion = _lowest(mixed_system(parts, columns), scale, len(root))
    except RuntimeError:  # exactly singular, or the iteration broke down
        lowest = 0.0
    if not lowest > UNRESISTED:
        shifted = mixed_system(parts, columns, shift=SHIFT * scale**2)
        lowest, motion = _lowest(shifted, scale, len(root))
        lowest = max(lowest - SHIFT, 0.0)
    scaled = sparse.diags_array(root.ravel()) @ parts.deformation @ sparse.diags_array(1 / scale)
    condition = _highest(scaled) / lowest if lowest else np.inf
    return lowest, condition, (motion / motion[np.abs(motion).argmax()]).reshape(-1, 6)


def _highest(scaled: sparse.csr_array) -> float:
    """Return the largest eigenvalue of the unconstrained scaled stiffness."""
    value = eigsh(scaled.T @ scaled, k=1, tol=1e-3, return_eigenvectors=False, v0=_start(scaled))
    return float(value[0])


def _lowest(system: MixedSystem, scale: Floats, before: int) -> tuple[float, Floats]:
    """Return the smallest eigenvalue and its motion in scaled twists, which stand after others."""
    factors = factorize(system)
    moves = len(scale)
    load = np.zeros(system.matrix.shape[0])

    def inverse(vector: Floats) -> Floats:
        load[before : before + moves] = scale * vector.ravel()
        answer = factors.solve(load)
        answer += factors.solve(load - system.matrix @ answer)
        return np.asarray(scale * answer[before : before + moves])

    operator = LinearOperator((moves, moves), matvec=inverse, dtype=np.float64)
    values, vectors = eigsh(operator, k=1, tol=EIGENVALUE_TOLERANCE, v0=_start(scale))
    return float(1 / values[0]), vectors[:, 0] / scale


def _start(like: Floats | sparse.csr_array) -> Floats:
    return np.asarray(np.random.default_rng(0).standard_normal(like.shape[-1]))
