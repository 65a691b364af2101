"""The one module that talks to solvers: it solves programs that others wrote, and poses none."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import cvxpy as cp

from seqopt.errors import InfeasibleError, SolverError
from seqopt.stability.limit_analysis import Claim

OPTIONS = {cp.CLARABEL: {}, cp.HIGHS: {"mip_rel_gap": 1e-9, "mip_abs_gap": 1e-9}}
CONE_OPTIONS: tuple[dict[str, object], ...] = (
    {"equilibrate_enable": False, "static_regularization_constant": 1e-7},
    {"warm_start": False},  # a solver that is kept keeps its options
)  # by attempt. A program scaled by its author stalls less without the solver's own scaling: on the
# 98 steps of the two-robot methods with epoxy 0 of 1,174 cases, else 23 of 1,142
SECONDS = 300.0  # a cone program that takes longer has stalled
ENDS = {
    cp.OPTIMAL: Claim.SOLVED,
    cp.OPTIMAL_INACCURATE: Claim.ALMOST,
    cp.INFEASIBLE: Claim.INFEASIBLE,
}  # any other end, a limit reached among them, is a stall


@dataclass(frozen=True)
class Optimum:
    """What a solver found.

    Attributes
    ----------
    value : float
        Of the objective.
    compile_seconds : float
        What cvxpy took to write the program down for the solver, s.
    """

    value: float
    compile_seconds: float


def minimize(program: cp.Problem, solver: str, *, feasible: bool) -> Optimum:
    """Solve a linear or integer program.

    Parameters
    ----------
    program : cvxpy.Problem
        Its variables take the values of the optimum.
    solver : str
        ``cvxpy.CLARABEL`` or ``cvxpy.HIGHS``.
    feasible : bool
        Whether the program is known to have a solution.

    Returns
    -------
    Optimum

    Raises
    ------
    InfeasibleError
        If the solver proves that nothing is within all budgets.
    SolverError
        If it ends in any other way than with an optimum, or calls a program infeasible that is not.
    """
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
    return Optimum(float(program.value), float(program.compilation_time or 0.0))


def end_of(program: cp.Problem, attempt: int) -> Claim:
    """Solve a cone program by Clarabel.

    Parameters
    ----------
    program : cvxpy.Problem
        Its variables and multipliers take the values of the answer, if there is one.
    attempt : int
        Index into `CONE_OPTIONS`.

    Returns
    -------
    Claim
        How that ended; a solver that fails has stalled.
    """
    with warnings.catch_warnings():  # an inaccurate end is claimed, counted and put to the proof
        warnings.filterwarnings("ignore", "Solution may be inaccurate", UserWarning)
        try:
            program.solve(
                solver=cp.CLARABEL, time_limit=SECONDS, max_threads=1, **CONE_OPTIONS[attempt]
            )
        except cp.SolverError:
            return Claim.STALLED
    return ENDS.get(program.status, Claim.STALLED)
