"""Ranks of values: what criteria that compare choices are made of."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats


def scaled_ranks(values: Floats, choices: int) -> Floats:
    """Return mean ranks of values rounded to whole numbers.

    Parameters
    ----------
    values : (C,) or (C, D) float
        In units of their resolution; NaN where a choice is impossible.
    choices : int
        Ranks over pairs are scaled so that they run from 1 to this.

    Returns
    -------
    (C,) or (C, D) float
        NaN stays NaN, except that all ranks are equal where all values are NaN.
    """
    flat = values.ravel()
    known = np.isfinite(flat)
    out = np.full(flat.shape, np.nan)
    if not known.any():
        return np.full(values.shape, 0.5 * (choices + 1))
    ranks = mean_ranks(np.round(flat[known]))
    out[known] = ranks if values.ndim == 1 else (ranks - 0.5) * choices / known.sum() + 0.5
    return out.reshape(values.shape)


def mean_ranks(values: Floats) -> Floats:
    """Return ranks from 1; ties share the mean of theirs.

    As `scipy.stats.rankdata`, in a third of its time for the few values of a step.

    Parameters
    ----------
    values : (n,) float

    Returns
    -------
    (n,) float
    """
    _, index, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - 0.5 * (count - 1))[index])
