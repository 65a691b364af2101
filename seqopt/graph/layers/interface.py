"""The problem that a formulation gets: costs, and which of them to minimize."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from seqopt.arrays import Floats, FrozenValue
from seqopt.graph.layers.costs import Budget, LayeredCosts
from seqopt.problem.problem import Aim
from seqopt.sequence.steps import Step


class PlacementProblem(Protocol):
    """The problem that a formulation gets: costs, and the meaning of its choices.

    A choice is one candidate per move, each an index from 0.
    """

    @property
    def sums(self) -> LayeredCosts:
        """The costs whose sum over the build is minimized."""

    @property
    def peaks(self) -> LayeredCosts:
        """The costs whose largest over the build is minimized."""

    @property
    def budgets(self) -> tuple[Budget, ...]:
        """Caps on totals over the build."""

    def conditional(self, move: int, before: int) -> Floats:
        """Return the costs of the steps that a move shares with the one before.

        Parameters
        ----------
        move, before : int
            A move, and the candidate chosen for the move before it.

        Returns
        -------
        (C_k,) float
            Ranks, if any, among the candidates of this move alone.
        """

    def nodes(self, choice: Sequence[int]) -> tuple[int, ...]:
        """Return the nodes that a choice stands for.

        Parameters
        ----------
        choice : sequence of int
            A candidate for every move.

        Returns
        -------
        tuple of int
            A node for every move.
        """

    def steps(self, choice: Sequence[int]) -> tuple[Step, ...]:
        """Return the checked steps of the build.

        Parameters
        ----------
        choice : sequence of int
            A candidate for every move.

        Returns
        -------
        tuple of Step
            None where a problem is given by its costs alone.
        """

    def seconds(self, aim: Aim) -> Mapping[str, float]:
        """Return what computing the costs of an aim took.

        Parameters
        ----------
        aim : Aim
            Sums or peaks.

        Returns
        -------
        mapping of str to float
            By stage, s.
        """


@dataclass(frozen=True, eq=False, repr=False)
class CostProblem(FrozenValue):
    """A problem given by its costs alone.

    Attributes
    ----------
    sums : LayeredCosts
        The costs; both their sum and their largest may be asked for.
    budgets : tuple of Budget
        Caps on totals over the build.
    """

    sums: LayeredCosts
    budgets: tuple[Budget, ...] = field(default=())

    @property
    def peaks(self) -> LayeredCosts:
        """The same costs."""
        return self.sums

    def conditional(self, move: int, before: int) -> Floats:
        """Return the shared costs of a move's candidates, the choice before being made.

        ``move``, ``before``: a move, and the candidate chosen for the move before it. Result
        (C_k,).
        """
        return np.asarray(self.sums.shared[move][before])

    def nodes(self, choice: Sequence[int]) -> tuple[int, ...]:
        """Return the choice: candidates are their own names."""
        return tuple(choice)

    def steps(self, choice: Sequence[int]) -> tuple[Step, ...]:
        """Return no steps, whatever the choice."""
        return ()

    def seconds(self, aim: Aim) -> Mapping[str, float]:
        """Return no times: the costs are given."""
        return {}
