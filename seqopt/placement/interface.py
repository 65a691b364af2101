"""What a formulation is given: a problem as costs, and which of them are to be least."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np

from seqopt.arrays import Floats, FrozenValue
from seqopt.placement.costs import Budget, LayeredCosts
from seqopt.sequence.steps import Step


class Aim(Enum):
    """What is to be least over the build."""

    SUM = "sum"
    PEAK = "peak"

    @property
    def worth(self) -> Callable[[LayeredCosts, Sequence[int]], float]:
        """What a choice is worth: its total, or its largest cost."""
        return LayeredCosts.cost if self is Aim.SUM else LayeredCosts.worst

    def costs(self, problem: PlacementProblem) -> LayeredCosts:
        """Return the costs of a problem that this aim is about."""
        return problem.sums if self is Aim.SUM else problem.peaks


class PlacementProblem(Protocol):
    """What a formulation is given: costs, and what the choices stand for."""

    @property
    def sums(self) -> LayeredCosts:
        """The costs whose sum over the build is to be least."""

    @property
    def peaks(self) -> LayeredCosts:
        """The costs whose largest over the build is to be least."""

    @property
    def budgets(self) -> tuple[Budget, ...]:
        """Caps on totals over the build."""

    def conditional(self, move: int, before: int) -> Floats:
        """Return the cost (C_k,) of what a move shares with the one before, that being chosen.

        Parameters
        ----------
        move, before : int
            A move, and the candidate chosen for the move before it.
        """

    def nodes(self, choice: Sequence[int]) -> tuple[int, ...]:
        """Return the nodes that one candidate per move stands for."""

    def steps(self, choice: Sequence[int]) -> tuple[Step, ...]:
        """Return the checked steps with one candidate per move; none where costs are all."""

    def seconds(self, aim: Aim) -> Mapping[str, float]:
        """Return what computing the costs of an aim took, by stage."""


@dataclass(frozen=True, eq=False, repr=False)
class CostProblem(FrozenValue):
    """A problem given by its costs alone."""

    sums: LayeredCosts
    budgets: tuple[Budget, ...] = field(default=())

    @property
    def peaks(self) -> LayeredCosts:
        """The same costs."""
        return self.sums

    def conditional(self, move: int, before: int) -> Floats:
        """Return the shared costs of the candidates, the choice before being fixed."""
        return np.asarray(self.sums.shared[move][before])

    def nodes(self, choice: Sequence[int]) -> tuple[int, ...]:
        """Return the choice: candidates are their own names."""
        return tuple(choice)

    def steps(self, choice: Sequence[int]) -> tuple[Step, ...]:
        """Return no steps."""
        return ()

    def seconds(self, aim: Aim) -> Mapping[str, float]:
        """Return nothing: the costs are given."""
        return {}
