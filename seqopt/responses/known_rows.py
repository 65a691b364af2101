"""Values of what was asked for before, found by whole numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from seqopt.arrays import Floats, Ints


class KnownRows:
    """Rows of values by a key and a code, each computed once.

    Attributes
    ----------
    count : int
        How many rows were computed.

    Examples
    --------
    >>> rows = KnownRows()
    >>> codes = np.array([3, 1, 3])
    >>> rows.of("squares", codes, lambda places: codes[places, None] ** 2.0).ravel()
    array([9., 1., 9.])
    >>> rows.count
    2
    """

    def __init__(self) -> None:
        self._known: dict[object, tuple[Ints, Floats]] = {}
        self.count = 0

    @property
    def nbytes(self) -> int:
        """How much memory the rows take."""
        return sum(
            codes.nbytes + (0 if values is None else values.nbytes)
            for codes, values in self._known.values()
        )

    def of(self, key: object, codes: Ints, compute: Callable[[Ints], Floats]) -> Floats:
        """Return the rows of codes, those that are new computed now, all together.

        Parameters
        ----------
        key : object
            Codes of other keys are others.
        codes : (n,) int
        compute : callable
            Returns the rows (m, k) of distinct codes, given the places (m,) where they first stand
            among those asked for.

        Returns
        -------
        (n, k) float
        """
        distinct, first = np.unique(codes, return_index=True)
        known, values = self._known.get(key, (distinct[:0], None))
        fresh = first[~np.isin(distinct, known, assume_unique=True)]
        if values is None or len(fresh):
            computed = compute(fresh)
            known = np.concatenate([known, codes[fresh]])
            values = computed if values is None else np.concatenate([values, computed])
            order = np.argsort(known, kind="stable")
            known, values = known[order], values[order]
            self._known[key] = known, values
            self.count += len(fresh)
        return np.asarray(values[np.searchsorted(known, codes)])
