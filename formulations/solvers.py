"""The one module that talks to solvers: a flow through the layers of a placement problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import cvxpy as cp
import numpy as np
from scipy import sparse

from seqopt.errors import SolverError
from seqopt.network import Floats
from seqopt.placement import Budget, InfeasibleError, Placement, PlacementProblem

ACCURACY = 1e-7  # how far a reported optimum may lie above the true one, relative to it
OPTIONS = {cp.CLARABEL: {}, cp.HIGHS: {"mip_rel_gap": 1e-9}}


class Program(Enum):
    """Whether the flow may be divided."""

    LINEAR = "linear"
    INTEGER = "integer"


@dataclass(frozen=True)
class Flow:
    """A unit flow through the layers.

    Attributes
    ----------
    arcs : tuple of (C_{k-1}, C_k) float
        Flow from every candidate to every candidate of the next move, zero where not allowed.
    bound : float
        Lower bound on the cost, from the solver's optimum.
    prices : mapping of str to float
        Dual value of every budget.
    """

    arcs: tuple[Floats, ...]
    bound: float
    prices: Mapping[str, float]


def solve_flow(problem: PlacementProblem, program: Program) -> Flow:
    """Send one unit through the layers at least cost, within the budgets.

    Raises
    ------
    InfeasibleError
        If the solver proves that no flow is within the budgets.
    SolverError
        If the solver ends in any other way than with an optimum.
    """
    placement = problem.sums
    placement.continuable()
    pairs = zip(placement.shared, placement.single, strict=True)
    costs = [shared + single for shared, single in pairs]
    kept = [np.isfinite(cost) for cost in costs]
    cost = np.concatenate([c[k] for c, k in zip(costs, kept, strict=True)])
    scale = max(float(np.abs(cost).max()), np.finfo(float).tiny)
    balance, source = _balance(placement, kept)
    whole = program is Program.INTEGER
    flow = cp.Variable(len(cost), boolean=whole, nonneg=not whole)
    conserve = cp.Zero(balance @ flow - source)
    caps = [cp.NonNeg(b.bound - _amounts(b, kept) @ flow) for b in problem.budgets]
    posed = cp.Problem(cp.Minimize((cost / scale) @ flow), [conserve, *caps])
    _solve(posed, cp.HIGHS if whole else cp.CLARABEL)
    assert flow.value is not None  # an optimum was reported
    sizes = [int(mask.sum()) for mask in kept]
    arcs = []
    for mask, part in zip(kept, np.split(flow.value, np.cumsum(sizes)[:-1]), strict=True):
        arc = np.zeros(mask.shape)
        arc[mask] = part
        arcs.append(arc)
    value = float(posed.value) * scale
    prices = {}
    if not whole:
        for budget, cap in zip(problem.budgets, caps, strict=True):
            prices[budget.name] = float(scale * cap.dual_value)
    return Flow(tuple(arcs), value - ACCURACY * abs(value), prices)


def follow(arcs: tuple[Floats, ...]) -> tuple[int, ...]:
    """Return the choice that the largest flow takes.

    Where costs tie an interior-point flow is a mixture; every arc it uses lies on an optimal path.
    """
    choice: list[int] = []
    for arc in arcs:
        choice.append(int(arc[choice[-1] if choice else 0].argmax()))
    return tuple(choice)


def _solve(program: cp.Problem, solver: str) -> None:
    try:
        program.solve(solver=solver, **OPTIONS[solver])
    except cp.SolverError as error:
        raise SolverError(f"{solver} failed: {error}; rescale the costs") from error
    if program.status == cp.INFEASIBLE:
        raise InfeasibleError("no choice is within all budgets; raise a bound")
    if program.status != cp.OPTIMAL:
        raise SolverError(f"{solver} ended with status {program.status!r}; rescale the costs")


def _balance(placement: Placement, kept: list[np.ndarray]) -> tuple[sparse.csr_array, Floats]:
    """Return matrix and right side that conserve the unit.

    Row 0 is the source; a row follows for each candidate but those of the last move.
    """
    starts = np.cumsum([0, 1, *placement.sizes])
    rows, columns, values, arc = [], [], [], 0
    for k, mask in enumerate(kept):
        first, second = np.nonzero(mask)
        index = np.arange(arc, arc + len(first))
        ends = [(starts[k] + first, 1.0)]
        if k + 1 < len(kept):
            ends.append((starts[k + 1] + second, -1.0))
        for row, sign in ends:
            rows.append(row)
            columns.append(index)
            values.append(np.full(len(row), sign))
        arc += len(first)
    size = int(starts[len(kept)])
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.csr_array(entries, shape=(size, arc)), np.eye(1, size).ravel()


def _amounts(budget: Budget, kept: list[np.ndarray]) -> Floats:
    parts = [shared + single for shared, single in zip(budget.shared, budget.single, strict=True)]
    return np.concatenate([part[mask] for part, mask in zip(parts, kept, strict=True)])
