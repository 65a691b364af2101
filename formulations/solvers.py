"""The one module that talks to solvers: a flow through the layers of a placement problem."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import cvxpy as cp
import numpy as np
from scipy import sparse

from seqopt.arrays import Floats
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.placement.certificate import TOLERANCE, least_sum
from seqopt.placement.costs import TINY, Budget, LayeredCosts, PlacementProblem
from seqopt.stability.limit_analysis import Claim

ACCURACY = 1e-7  # how far a reported optimum may lie above the true one, relative to the larger of
# it and the largest cost
OPTIONS = {cp.CLARABEL: {}, cp.HIGHS: {"mip_rel_gap": 1e-9, "mip_abs_gap": 1e-9}}


CONE_OPTIONS: tuple[dict[str, object], ...] = (
    {"equilibrate_enable": False, "static_regularization_constant": 1e-7},
    {"warm_start": False},  # a solver that is kept keeps its options
)  # by attempt. A program scaled by its author stalls less without the solver's own scaling: on the
# 98 steps of the two-robot methods with the study's epoxy 0 of 1,174 cases, else 23 of 1,142
SECONDS = 300.0  # a cone program that takes longer has stalled
ENDS = {
    cp.OPTIMAL: Claim.SOLVED,
    cp.OPTIMAL_INACCURATE: Claim.ALMOST,
    cp.INFEASIBLE: Claim.INFEASIBLE,
}  # any other end, a limit reached among them, is a stall


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
    compile_seconds : float
        What cvxpy took to write the program down for the solver.
    """

    arcs: tuple[Floats, ...]
    bound: float
    prices: Mapping[str, float]
    compile_seconds: float


def solve_flow(problem: PlacementProblem, program: Program) -> Flow:
    """Send one unit through the layers at least cost, within the budgets.

    Costs and budgets are scaled, since solvers have absolute tolerances.

    Raises
    ------
    InfeasibleError
        If no choice is within one of the budgets, or the solver proves that no flow is within all.
    ProblemError
        If a budget is not for the moves and candidates of the problem.
    SolverError
        If the solver ends in any other way than with an optimum, or calls a problem infeasible that
        is not.
    """
    placement = problem.sums
    placement.continuable()
    feasible = _within_each(problem)
    pairs = zip(placement.shared, placement.single, strict=True)
    costs = [shared + single for shared, single in pairs]
    kept = [np.isfinite(cost) for cost in costs]
    cost = np.concatenate([c[k] for c, k in zip(costs, kept, strict=True)])
    scale = max(float(np.abs(cost).max()), TINY)
    balance, source = _balance(placement, kept)
    whole = program is Program.INTEGER
    flow = cp.Variable(len(cost), boolean=whole, nonneg=not whole)
    conserve = cp.Zero(balance @ flow - source)
    amounts = [_amounts(b, kept) for b in problem.budgets]
    units = [_unit(a) for a in amounts]
    caps = [
        cp.NonNeg(b.bound / unit - (a / unit) @ flow)
        for b, a, unit in zip(problem.budgets, amounts, units, strict=True)
    ]
    posed = cp.Problem(cp.Minimize((cost / scale) @ flow), [conserve, *caps])
    _solve(posed, cp.HIGHS if whole else cp.CLARABEL, feasible=feasible)
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
        for budget, cap, unit in zip(problem.budgets, caps, units, strict=True):
            prices[budget.name] = float(scale / unit * cap.dual_value)
    bound = value - ACCURACY * max(abs(value), scale)
    return Flow(tuple(arcs), bound, prices, float(posed.compilation_time or 0.0))


def follow(arcs: tuple[Floats, ...]) -> tuple[int, ...]:
    """Return the choice that the largest flow takes.

    Where costs tie an interior-point flow is a mixture; every arc it uses lies on an optimal path.
    """
    choice: list[int] = []
    for arc in arcs:
        choice.append(int(arc[choice[-1] if choice else 0].argmax()))
    return tuple(choice)


def _within_each(problem: PlacementProblem) -> bool:
    """Return whether a choice is known to be within all budgets; each is tried on its own."""
    allowed = problem.sums
    known = True
    for budget in problem.budgets:
        if LayeredCosts(budget.single, budget.shared).sizes != allowed.sizes:
            raise ProblemError(f"budget {budget.name!r} is for other moves or candidates")
        pairs = [*zip(budget.single, allowed.single, strict=True)]
        coupled = [*zip(budget.shared, allowed.shared, strict=True)]
        single, shared = (
            tuple(np.where(np.isfinite(cost), amount, np.inf) for amount, cost in part)
            for part in (pairs, coupled)
        )
        least = least_sum(LayeredCosts(single, shared))
        sizes = sum(float(np.abs(a).max()) for a in (*budget.single, *budget.shared))
        if least > budget.bound + TOLERANCE * max(abs(budget.bound), sizes):
            raise InfeasibleError(
                f"no choice is within all budgets: any takes at least {least:.6g} of "
                f"{budget.name!r}, more than {budget.bound:.6g}; raise that bound"
            )
        known = known and len(problem.budgets) == 1 and least <= budget.bound
    return known


def _solve(program: cp.Problem, solver: str, *, feasible: bool) -> None:
    """Solve a program, known to be feasible or not."""
    try:
        with warnings.catch_warnings():  # an inaccurate end is refused below
            warnings.filterwarnings("ignore", "Solution may be inaccurate", UserWarning)
            program.solve(solver=solver, **OPTIONS[solver])
    except cp.SolverError as error:
        raise SolverError(f"{solver} failed: {error}; rescale the costs") from error
    if program.status == cp.INFEASIBLE and feasible:
        raise SolverError(f"{solver} calls a problem infeasible that is not; rescale the costs")
    if program.status == cp.INFEASIBLE:
        raise InfeasibleError("no choice is within all budgets; raise a bound")
    if program.status != cp.OPTIMAL:
        raise SolverError(f"{solver} ended with status {program.status!r}; rescale the costs")


def end_of(program: cp.Problem, attempt: int) -> Claim:
    """Solve a cone program by Clarabel, with the options of an attempt; return how that ended."""
    with warnings.catch_warnings():  # an inaccurate end is claimed, counted and put to the proof
        warnings.filterwarnings("ignore", "Solution may be inaccurate", UserWarning)
        try:
            program.solve(
                solver=cp.CLARABEL, time_limit=SECONDS, max_threads=1, **CONE_OPTIONS[attempt]
            )
        except cp.SolverError:
            return Claim.STALLED
    return ENDS.get(program.status, Claim.STALLED)


def _balance(placement: LayeredCosts, kept: list[np.ndarray]) -> tuple[sparse.csr_array, Floats]:
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


def _unit(amounts: Floats) -> float:
    """Return the power of ten just below the largest amount, or 1 if all are zero."""
    largest = float(np.abs(amounts).max())
    return float(10.0 ** math.floor(math.log10(largest))) if largest else 1.0


def _amounts(budget: Budget, kept: list[np.ndarray]) -> Floats:
    parts = [shared + single for shared, single in zip(budget.shared, budget.single, strict=True)]
    return np.concatenate([part[mask] for part, mask in zip(parts, kept, strict=True)])
