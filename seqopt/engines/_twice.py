"""Sums of products as if they were computed with twice the digits of a double, then rounded.

What is left of equations is small beside what cancels in it. Computed in plain doubles it is mostly
rounding, which differs between processors; so corrections by it end where rounding lets them. Here
every product and every sum comes with its rounding error, and these errors are summed too
(algorithm ``Dot2`` of Ogita, Rump and Oishi, Accurate sum and dot product, SIAM Journal on
Scientific Computing 26 (2005) 1955-1988). Each step is one operation on doubles, which every
processor rounds alike.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats

_SPLIT = 2.0**27 + 1.0  # halves the 53 digits of a double


def add_products(start: Floats, matrix: sparse.csr_array, factors: Floats) -> Floats:
    """Return ``start + matrix @ factors``, of vectors, with twice the digits before it is rounded.

    Residuals of a solution ``x`` are those of a load with the factors ``-x``.
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
