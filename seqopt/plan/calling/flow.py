"""Support placement as a unit flow through the layers of candidates, as arrays for any solver.

A choice is a path: from a source to one candidate of the first move, on to one of the second, and
so to the last. An arc stands for a pair of neighboring candidates, of which only those exist that
are allowed. Costs and budgets are scaled to order one, since solvers have absolute tolerances.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from seqopt.arrays import Bools, Floats, FrozenValue
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.layers.costs import TINY, Budget, LayeredCosts
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.judge.certificate import TOLERANCE, least_sum

ACCURACY = 1e-7  # how far a reported optimum may lie above the true one, relative to the larger of
# it and the largest cost


@dataclass(frozen=True, eq=False, repr=False)
class LayeredFlow(FrozenValue):
    """A unit flow over the A allowed arcs of a problem.

    ``cost`` (A,): of every arc, its end included, over ``scale``; ``scale``: the largest cost;
    ``balance`` ((R, A) sparse): what leaves the source (row 0) and every candidate except those of
    the last move, less what arrives; ``source`` (R,): what must be left over: 1 at the source;
    ``amounts`` (tuple of (A,) float): what every arc takes of each budget, over the budget's unit;
    ``caps``: how much there is of each budget, in its unit; ``units``: the power of ten by which
    the amounts of each budget are divided; ``names``: of the budgets; ``allowed`` (tuple of
    (C_{k-1}, C_k) bool): which pairs have an arc, move by move; ``feasible``: whether a choice is
    known to be within all budgets.
    """

    cost: Floats
    scale: float
    balance: sparse.csr_array
    source: Floats
    amounts: tuple[Floats, ...]
    caps: tuple[float, ...]
    units: tuple[float, ...]
    names: tuple[str, ...]
    allowed: tuple[Bools, ...]
    feasible: bool

    def choice(self, flow: Floats) -> tuple[int, ...]:
        """Return the choice that the largest part of a flow takes.

        Where costs tie an interior-point flow is a mixture; every arc it uses lies on an optimal
        path.

        ``flow`` (A,): of every arc, from 0 to 1. Result: a candidate for every move.
        """
        ends = np.cumsum([mask.sum() for mask in self.allowed])[:-1]
        now = 0
        out = []
        for mask, part in zip(self.allowed, np.split(flow, ends), strict=True):
            arcs = np.zeros(mask.shape)
            arcs[mask] = part
            now = int(arcs[now].argmax())
            out.append(now)
        return tuple(out)

    def bound(self, optimum: float) -> float:
        """Return a lower bound on the cost of any choice.

        ``optimum``: a solver's, in scaled costs. Result: in the unit of the costs; lower by what
        the solver may be off.
        """
        value = optimum * self.scale
        return value - ACCURACY * max(abs(value), self.scale)

    def prices(self, duals: Sequence[float]) -> dict[str, float]:
        """Return what one more unit of each budget would save.

        ``duals``: of the scaled caps. Result: by budget: cost per unit of the budget.
        """
        pairs = zip(self.names, self.units, duals, strict=True)
        return {name: float(self.scale / unit * dual) for name, unit, dual in pairs}


def layered_flow(problem: PlacementProblem) -> LayeredFlow:
    """Return the flow of a problem.

    ``problem``: its sums and budgets are used. Raises `InfeasibleError` if no choice is allowed, or
    none is within one of the budgets; `ProblemError` if a budget is not for the moves and
    candidates of the problem.
    """
    costs = problem.sums
    costs.continuable()
    feasible = within_each(problem)
    arcs = [shared + single for shared, single in zip(costs.shared, costs.single, strict=True)]
    allowed = tuple(np.isfinite(arc) for arc in arcs)
    cost = np.concatenate([arc[mask] for arc, mask in zip(arcs, allowed, strict=True)])
    scale = max(float(np.abs(cost).max()), TINY)
    balance, source = _balance(costs, allowed)
    amounts = [_amounts(budget, allowed) for budget in problem.budgets]
    units = [_unit(amount) for amount in amounts]
    return LayeredFlow(
        cost=cost / scale,
        scale=scale,
        balance=balance,
        source=source,
        amounts=tuple(a / unit for a, unit in zip(amounts, units, strict=True)),
        caps=tuple(b.bound / unit for b, unit in zip(problem.budgets, units, strict=True)),
        units=tuple(units),
        names=tuple(budget.name for budget in problem.budgets),
        allowed=allowed,
        feasible=feasible,
    )


def within_each(problem: PlacementProblem) -> bool:
    """Return whether a choice is known to be within all budgets; each is tried on its own.

    Raises `InfeasibleError` if no choice is within one of them; `ProblemError` if one is not for
    the moves and candidates of the problem.
    """
    costs = problem.sums
    known = True
    for budget in problem.budgets:
        if LayeredCosts(budget.single, budget.shared).sizes != costs.sizes:
            raise ProblemError(f"budget {budget.name!r} is for other moves or candidates")
        single, shared = (
            tuple(np.where(np.isfinite(cost), amount, np.inf) for amount, cost in part)
            for part in (
                zip(budget.single, costs.single, strict=True),
                zip(budget.shared, costs.shared, strict=True),
            )
        )
        least = least_sum(LayeredCosts(single, shared))
        sizes = sum(float(np.abs(a).max()) for a in (*budget.single, *budget.shared))
        if least > budget.bound + TOLERANCE * sizes:
            raise InfeasibleError(
                f"no choice is within all budgets: every choice uses at least {least:.6g} of "
                f"{budget.name!r}, more than {budget.bound:.6g}; raise that bound"
            )
        known = known and len(problem.budgets) == 1 and least <= budget.bound
    return known


def _balance(costs: LayeredCosts, allowed: Sequence[Bools]) -> tuple[sparse.csr_array, Floats]:
    """Return matrix and right side that conserve the unit."""
    starts = np.cumsum([0, 1, *costs.sizes])
    rows, columns, values, arc = [], [], [], 0
    for k, mask in enumerate(allowed):
        first, second = np.nonzero(mask)
        index = np.arange(arc, arc + len(first))
        ends = [(starts[k] + first, 1.0)]
        if k + 1 < len(allowed):
            ends.append((starts[k + 1] + second, -1.0))
        for row, sign in ends:
            rows.append(row)
            columns.append(index)
            values.append(np.full(len(row), sign))
        arc += len(first)
    size = int(starts[len(allowed)])
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.csr_array(entries, shape=(size, arc)), np.eye(1, size).ravel()


def _amounts(budget: Budget, allowed: Sequence[Bools]) -> Floats:
    parts = [shared + single for shared, single in zip(budget.shared, budget.single, strict=True)]
    return np.concatenate([part[mask] for part, mask in zip(parts, allowed, strict=True)])


def _unit(amounts: Floats) -> float:
    """Return the power of ten just below the largest amount, or 1 if all are zero."""
    largest = float(np.abs(amounts).max())
    return float(10.0 ** math.floor(math.log10(largest))) if largest else 1.0
