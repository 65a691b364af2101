"""Certificates of optimality: a selection checked from the problem's data alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import isfinite

from seqopt.arrays import FrozenValue

TOLERANCE = 1e-6  # of the costs that a choice meets: how far a claim may be from what the data say


def _known_gap(gap: float) -> float:
    """Return a gap, or zero if it is within the tolerance of proofs."""
    return 0.0 if gap <= TOLERANCE else gap


class Basis(StrEnum):
    """What a lower bound rests on."""

    REBUILT = "rebuilt"  # states and their responses, which the judge computed again
    GIVEN = "given"  # costs: of an instance, or of all choices of open grips
    CLAIMED = "claimed"  # by the formulation; nothing is proven


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(FrozenValue):
    """The values of a plan and bounds on all others, from the problem's data alone.

    Attributes
    ----------
    values : tuple of float
        The value of every goal, recomputed; of candidates one, in the unit of the criterion.
    bounds : tuple of float
        Lexicographic lower bounds of the goals, recomputed from the data; minus infinity where
        nothing is proven.
    gap : float
        Largest difference of value and bound, relative to the size of the values: of the costs
        that a choice of candidates meets, their sum or the largest. Infinite where nothing is
        proven; margins of stability are proven to `seqopt.stability.standing.NARROW`.
    claimed_gap : float
        Gap to the formulation's own bound, if that is higher; it is not proven.
    spent : mapping of str to float
        The amount that the plan uses of each budget.
    states : int
        Number of states in the proof, where it is about states.
    models : int
        Number of models that the judge solved for the proof; none where costs are given.
    basis : Basis
        What proven bounds rest on.

    Examples
    --------
    >>> import seqopt
    >>> proof = seqopt.optimize("arch25", criterion="worst-ratio-published").certificate
    >>> round(proof.objective, 3), round(proof.bound, 3), proof.gap
    (57.941, 57.941, 0.0)
    """

    values: tuple[float, ...]
    bounds: tuple[float, ...]
    gap: float
    claimed_gap: float
    spent: Mapping[str, float] = field(default_factory=dict)
    states: int = 0
    models: int = 0
    basis: Basis = Basis.GIVEN

    def __repr__(self) -> str:
        values = f"objective {self.objective:.6g}, no choice below {self.bound:.6g}"
        return f"<Certificate: {values}, gap {100 * _known_gap(self.gap):.3g} %>"

    @property
    def objective(self) -> float:
        """The value of the first goal."""
        return self.values[0]

    @property
    def bound(self) -> float:
        """Lower bound of the first goal."""
        return self.bounds[0]

    @property
    def rests_on(self) -> tuple[Basis, ...]:
        """What the bound of each goal rests on: a claim where nothing is proven."""
        return tuple(self.basis if isfinite(bound) else Basis.CLAIMED for bound in self.bounds)
