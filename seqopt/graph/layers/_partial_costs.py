"""Costs of which some pairs are known, and what these prove.

A pair that was not looked at costs no less than some floor: zero for sizes, one for ranks. With
the floor in its place every choice looks as cheap as it is, or cheaper, so the least over all
choices is a lower bound; what known pairs alone lead to is an upper one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.problem.criteria import Ranked, RankSum, StepCost, WeightedSum, WorstRatio
from seqopt.problem.problem import Aim
from seqopt.problem.requirements import Criterion


def floor_of(criterion: Criterion) -> float | None:
    """Return what a step costs at least, from zero.

    None where costs may be negative, depend on what else is looked at, or are not known.
    """
    match criterion:
        case RankSum(ranked=Ranked.CONDITIONAL):
            weights = [weight for _, weight in (*criterion.before, *criterion.after)]
            return 1.0 if min(weights) >= 0 else None
        case WeightedSum():
            return 0.0 if min(weight for _, weight, _ in criterion.terms) >= 0 else None
        case WorstRatio():
            return 0.0
        case StepCost():
            return criterion.least
        case _:
            return None


@dataclass(frozen=True, eq=False, repr=False)
class PartialCosts(FrozenValue):
    """Costs of single choices, and of those pairs that were looked at.

    ``single`` (tuple of (C_k,) float): as of `LayeredCosts`; ``rows`` (tuple of mapping of int to
    (C_k,) float): for every move, by the candidate of the move before, what its candidates cost in
    the steps that the two share; NaN where that was not looked at. Empty for the first move.
    ``floor``: what any pair costs at least; ``aim``: whether costs add up or the largest counts.
    """

    single: tuple[Floats, ...]
    rows: tuple[Mapping[int, Floats], ...]
    floor: float
    aim: Aim

    @property
    def join(self) -> np.ufunc:
        """How costs go together."""
        return np.add if self.aim is Aim.SUM else np.maximum

    @cached_property
    def to_go(self) -> tuple[Floats, ...]:
        """What the rest of the build costs at least, from every candidate on, (C_k,) each."""
        pairs = [self._pairs(k, self.floor) for k in range(1, len(self.single))]
        shared = (np.zeros((1, len(self.single[0]))), *pairs)
        return tuple(LayeredCosts(self.single, shared).to_go(self.aim))

    @cached_property
    def reached(self) -> tuple[Floats, ...]:
        """What the build costs at least up to every candidate, (C_k,) each."""
        return self._forward(self.floor)

    @cached_property
    def arrived(self) -> tuple[Floats, ...]:
        """What the build costs up to every candidate by pairs that are known, (C_k,) each."""
        return self._forward(np.inf)

    def _forward(self, unknown: float) -> tuple[Floats, ...]:
        """Return the least cost up to every candidate, pairs that are not known costing so much."""
        out = [self.single[0]]
        for k, single in enumerate(self.single[1:], start=1):
            through = self.join(out[-1][:, None], self._pairs(k, unknown))
            out.append(self.join(single, through.min(axis=0)))
        return tuple(out)

    def _pairs(self, move: int, unknown: float) -> Floats:
        """Return what pairs of a move cost (C_{k-1}, C_k), those that are not known so much."""
        out = np.full((len(self.single[move - 1]), len(self.single[move])), unknown)
        for before, row in self.rows[move].items():
            out[before] = np.where(np.isnan(row), unknown, row)
        return out

    @property
    def bound(self) -> float:
        """What any choice costs at least."""
        return float(self.to_go[0].min())

    @property
    def best(self) -> float:
        """The least that a choice costs of which all pairs are known; infinite if there is none."""
        return float(self.arrived[-1].min())

    def promise(self, move: int) -> Floats:
        """Return the least that a choice by each candidate of the move before can cost (C_{k-1},).

        Infinite where its row is known.
        """
        out = self.join(self.reached[move - 1], self.join(self.floor, self.to_go[move].min()))
        out[list(self.rows[move])] = np.inf
        return np.asarray(out)

    def worth_a_look(self, move: int, before: int) -> Bools:
        """Return which candidates (C_k,), after one of the move before, could still be better."""
        least = self.join(self.reached[move - 1][before], self.join(self.floor, self.to_go[move]))
        return np.asarray(least < self.best)

    def known(self) -> tuple[LayeredCosts, tuple[tuple[int, ...], ...]]:
        """Return the costs of choices whose pairs are all known, and which candidates are left."""
        last = tuple(range(len(self.single[-1])))
        left = (*(tuple(sorted(rows)) for rows in self.rows[1:]), last)
        single = tuple(own[list(kept)] for own, kept in zip(self.single, left, strict=True))
        shared = [np.zeros((1, len(left[0])))]
        for rows, before, now in zip(self.rows[1:], left[:-1], left[1:], strict=True):
            found = np.array([rows[b][list(now)] for b in before]).reshape(len(before), len(now))
            shared.append(np.where(np.isnan(found), np.inf, found))
        return LayeredCosts(single, tuple(shared)), left


def least_possible(costs: PartialCosts) -> float:
    """Return a lower bound on the cost of any choice, over all pairs of one move at a time."""
    so_far = costs.single[0]
    for single, rows in zip(costs.single[1:], costs.rows[1:], strict=True):
        pairs = np.full((len(so_far), len(single)), costs.floor)
        for before, row in rows.items():
            pairs[before] = np.where(np.isnan(row), costs.floor, row)
        arrived = costs.join(so_far[:, None], pairs).min(axis=0)
        so_far = costs.join(arrived, single)
    return float(so_far.min())
