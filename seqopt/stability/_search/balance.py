"""Equilibrium of blocks under forces between them, and systems of its weighted normal matrix."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from seqopt.arrays import Floats

_REGULAR = 1e-13  # of the largest entry, added to all on the diagonal: blocks may be loose

Solve = Callable[[Floats], Floats]


def apart(maps: Sequence[sparse.csr_array]) -> sparse.csr_array:
    """Return maps that have neither rows nor columns in common."""
    rows, columns = zip(*(each.shape for each in maps), strict=True)
    before = np.cumsum([0, *columns])
    indices = [each.indices + first for each, first in zip(maps, before.tolist(), strict=False)]
    counts = np.concatenate([[0], *(np.diff(each.indptr) for each in maps)])
    entries = np.concatenate([each.data for each in maps]), np.concatenate(indices)
    shape = sum(rows), int(before[-1])
    return sparse.csr_array((*entries, np.cumsum(counts)), shape=shape)


class Balance:
    """The map E from forces to wrenches, and systems E B E^T y = r for weights B (3, 3, N).

    Bodies that touch are numbered close together, so that such a system is a narrow band.
    """

    def __init__(self, maps: Sequence[sparse.csr_array]) -> None:
        self._map = sparse.hstack(maps, format="csr")
        self._transposed = blocks = self._map.T.tobsr((3, 6))
        bodies = blocks.shape[1] // 6
        self._owner = np.repeat(np.arange(blocks.shape[0] // 3), np.diff(blocks.indptr))
        own, each = np.arange(len(self._owner)), np.arange(bodies)
        both = np.flatnonzero(self._owner[1:] == self._owner[:-1])  # where a force has two bodies
        first, second = np.concatenate([[own, own], [both, both + 1]], axis=1)
        meet = np.ones(len(first)), (blocks.indices[first], blocks.indices[second])
        touching = sparse.csr_array(meet, shape=(bodies, bodies))
        self._order = reverse_cuthill_mckee(touching + touching.T, symmetric_mode=True)
        number = np.argsort(self._order)[blocks.indices]
        low = number[first] < number[second]  # of what is symmetric, the lower half counts
        first, second = np.where(low, second, first), np.where(low, first, second)
        place = number[first] * bodies + number[second]
        order = np.argsort(place, kind="stable")
        self._first, self._right = first[order], blocks.data[second[order]]
        # written again and again: new pages cost more
        self._half, self._left = np.empty((len(own), 6, 3)), np.empty((len(order), 6, 3))
        self._products = np.empty((len(order), 6, 6))
        places, starts = np.unique(place[order], return_index=True)
        terms = np.ones(len(order)), np.arange(len(order)), np.append(starts, len(order))
        self._sum = sparse.csr_array(terms, shape=(len(places), len(order)))
        every = np.union1d(places, each * (bodies + 1))  # bodies may be loose
        self._met = np.searchsorted(every, places)
        self._blocks = len(every)
        self._diagonal = np.searchsorted(every, each * (bodies + 1))
        rows, columns = np.divmod(every, bodies)
        line = 6 * (rows - columns)[:, None, None] + np.subtract.outer(np.arange(6), np.arange(6))
        column = np.broadcast_to(6 * columns[:, None, None] + np.arange(6), line.shape)
        self._lower, self._lines = np.flatnonzero(line >= 0), int(line.max()) + 1
        self._band = (column * self._lines + line).ravel()[self._lower]

    def wrench(self, force: Floats) -> Floats:
        """Return the wrenches (6B,) of forces (3, N)."""
        return np.asarray(self._map @ force.T.ravel())

    def parting(self, motion: Floats) -> Floats:
        """Return what a motion (6B,) does where forces act, (3, N)."""
        return np.ascontiguousarray((self._transposed @ motion).reshape(-1, 3).T)

    def solver(self, weight: Floats) -> Solve:
        """Return the solution of systems with weights; raises an error if there is none.

        It is that of a system with a larger diagonal, corrected once.
        """
        across = self._transposed.data.transpose(0, 2, 1)
        np.matmul(across, weight.transpose(2, 0, 1)[self._owner], out=self._half)
        np.take(self._half, self._first, axis=0, out=self._left, mode="clip")
        np.matmul(self._left, self._right, out=self._products)
        block = np.zeros((self._blocks, 6, 6))
        sums = np.asarray(self._sum @ self._products.reshape(-1, 36))
        block[self._met] = sums.reshape(-1, 6, 6)
        regular = _REGULAR * np.abs(block).max()
        block[self._diagonal] += regular * np.eye(6)
        lines, bodies = self._lines, len(self._order)
        flat = np.zeros(6 * bodies * lines)
        flat[self._band] = block.ravel()[self._lower]
        band = flat.reshape(6 * bodies, lines).T
        factor = linalg.cholesky_banded(band, lower=True, check_finite=False), True

        def solution(right: Floats) -> Floats:
            given = right.reshape(-1, 6)[self._order].ravel()
            found = linalg.cho_solve_banded(factor, given, check_finite=False)
            left = given - linalg.blas.dsbmv(lines - 1, 1.0, band, found, lower=1)
            found += linalg.cho_solve_banded(factor, left + regular * found, check_finite=False)
            out = np.empty((bodies, 6))
            out[self._order] = found.reshape(-1, 6)
            return out.ravel()

        return solution
