"""Ranks of values: what criteria that compare choices are made of."""

from __future__ import annotations

from enum import Enum

import numpy as np

from seqopt.arrays import Floats


class Ranked(Enum):
    """What the choices of a step that two moves share are ranked among."""

    PAIRS = "pairs"  # all pairs of the two moves
    CONDITIONAL = "conditional"  # the later move's candidates, the earlier choice being made


class Among(Enum):
    """Which candidates of a move are ranked in the steps in which it alone is open."""

    ALL = "all"
    POSSIBLE = "possible"  # without those that the choice before it makes impossible


def ranks_of(values: Floats, choices: int, ranked: Ranked) -> Floats:
    """Return mean ranks of the choices in a step.

    ``values`` ((C,) or (C, D) float): as in `scaled_ranks`; ``choices``: how many candidates the
    move has that decides the step; ``ranked``: what pairs are ranked among. Result ((C,) or (C, D)
    float).
    """
    if values.ndim == 2 and ranked is Ranked.CONDITIONAL:
        return row_ranks(values, choices)
    return scaled_ranks(values, choices)


def row_ranks(values: Floats, choices: int) -> Floats:
    """Return mean ranks, from 1, of values rounded to whole numbers, every row for itself.

    ``values`` (C, D): in units of their resolution; NaN where a choice is impossible; ``choices``:
    all ranks are the mean of 1 and this where all values are NaN. Result (C, D): as `scaled_ranks`
    of each row; NaN stays NaN where any value is known.
    """
    known = np.isfinite(values)
    if not known.any():
        return np.full(values.shape, 0.5 * (choices + 1))
    rounded = np.where(known, np.round(values), np.inf)  # what is impossible comes last
    order = np.argsort(rounded, axis=1, kind="stable")
    ordered = np.take_along_axis(rounded, order, axis=1)
    place = np.arange(values.shape[1])
    new = np.ones(values.shape, dtype=bool)
    new[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
    last = np.ones(values.shape, dtype=bool)
    last[:, :-1] = new[:, 1:]
    first_of = np.maximum.accumulate(np.where(new, place, 0), axis=1)
    last_of = np.minimum.accumulate(np.where(last, place, len(place))[:, ::-1], axis=1)[:, ::-1]
    ranks = np.empty(values.shape)
    np.put_along_axis(ranks, order, 0.5 * (first_of + last_of) + 1.0, axis=1)
    return np.where(known, ranks, np.nan)


def scaled_ranks(values: Floats, choices: int) -> Floats:
    """Return mean ranks of values rounded to whole numbers.

    ``values`` ((C,) or (C, D) float): in units of their resolution; NaN where a choice is
    impossible; ``choices``: ranks over pairs are scaled so that they run from 1 to this. Result
    ((C,) or (C, D) float): NaN stays NaN, except that all ranks are equal where all values are NaN.
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

    As `scipy.stats.rankdata`, in a fifth of its time for the few values of a step.

    ``values`` (n,). Result (n,).
    """
    order = np.argsort(values)
    ordered = values[order]
    new = np.flatnonzero(ordered[1:] != ordered[:-1]) + 1
    ends = np.concatenate([[0], new, [len(values)]])
    ranks = np.empty(len(values))
    ranks[order] = np.repeat(0.5 * (ends[1:] + ends[:-1] + 1), np.diff(ends))
    return ranks
