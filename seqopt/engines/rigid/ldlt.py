"""Many small positive definite systems at once."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats


def solve_positive(system: Floats, negative: int = 0, scale: float = 1.0) -> tuple[Floats, Floats]:
    """Solve S positive definite systems of k unknowns in place, the batch along the last axis.

    The last unknowns may be those of a saddle: then only what is left of their equations, when the
    others are eliminated, is definite, and negative.

    Up to three times as fast as ``numpy.linalg.solve`` for a thousand 9 x 9 systems, which calls
    LAPACK once for each.

    Parameters
    ----------
    system : (k + 1, k, S) float
        The matrices, of which only the lower triangles are read, and the loads as a last row.
        Overwritten.
    negative : int, optional
        How many unknowns at the end belong to the negative definite part.
    scale : float, optional
        What their pivots are measured against.

    Returns
    -------
    answer : (k, S) float
        Not finite where a matrix is not positive definite.
    pivot : (k, S) float
        Pivots over their diagonal entries: small where equations nearly repeat those before them.
    """
    size = system.shape[1]
    every = np.arange(size)
    diagonal = np.abs(system[every, every])  # a negative pivot stays negative beside it
    diagonal[size - negative :] = -scale
    pivots = np.empty_like(diagonal)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for j in range(size):
            column = system[j:, j]
            if j:
                column -= np.einsum("ips,ps->is", system[j:, :j], system[j, :j] * pivots[:j])
            pivots[j] = column[0]
            column[1:] /= pivots[j]
        answer = system[size]
        for j in range(size - 1, 0, -1):
            answer[:j] -= system[j, :j] * answer[j]
        pivots /= diagonal
    return answer, pivots
