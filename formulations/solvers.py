"""The one module that talks to solvers: it solves programs that others wrote, and poses none."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import highspy
import numpy as np

from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph.formulation import Watch

GAPS = {"mip_rel_gap": 1e-9, "mip_abs_gap": 1e-9}  # of integer programs
EXACTLY = 1e-10  # by how much constraints may be off where ties are kept
STOPS = ("kTimeLimit", "kInterrupt")


@dataclass(frozen=True)
class Optimum:
    """Result of a solver: value, infinite where it was stopped without an incumbent, and bound.

    ``compile_seconds``: what cvxpy took to write the program down for the solver, s; ``nodes``: of
    its search tree; ``stopped``: whether its time was over, or it was interrupted.
    """

    value: float
    compile_seconds: float
    bound: float = -math.inf
    nodes: int = 0
    stopped: bool = False


def minimize_by_highs(
    program: cp.Problem,
    *,
    feasible: bool,
    watch: Watch | None = None,
    convert: Callable[[float], float] = float,
    tolerance: float | None = None,
) -> Optimum:
    """Solve a linear or an integer program by HiGHS; its variables take the best values.

    ``feasible``: whether it is known to have a solution; ``watch``: deadline, which records
    incumbents and bounds of integer programs, in its unit by ``convert``; ``tolerance``: of
    constraints, by default that of HiGHS. Raises `InfeasibleError` if the solver proves that
    nothing is within all budgets; `SolverError` if it ends otherwise than with an optimum or at its
    limit, or calls a program infeasible that is not.
    """
    watch = watch or Watch()
    start = time.perf_counter()
    try:
        data, chain, inverse = program.get_problem_data(cp.HIGHS)
        whole = len(data["bool_vars_idx"]) > 0
        solver = _loaded(data, whole=whole)
        seconds = time.perf_counter() - start
        offset = float(inverse[-1].get("offset", 0.0))
        _listen(solver, watch, lambda value: convert(value + offset))
        if tolerance is not None:
            for name in ("primal", "dual", "mip"):
                solver.setOptionValue(f"{name}_feasibility_tolerance", tolerance)
        if not whole:
            solver.setOptionValue("solver", "ipm")  # ends in a vertex, on large graphs far sooner
        status = _end(solver, watch.left)
    except cp.SolverError as error:
        raise SolverError(f"{cp.HIGHS} failed: {error}; rescale the costs") from error
    info, stopped = solver.getInfo(), status in STOPS
    bound = float(info.mip_dual_bound) + offset if whole else -math.inf
    nodes = max(0, int(info.mip_node_count))
    if stopped and not (whole and math.isfinite(info.objective_function_value)):
        return Optimum(math.inf, seconds, bound, nodes, stopped=True)
    if not stopped:
        _require_optimum(status, feasible=feasible)
    results = {"solution": solver.getSolution(), "info": info, "model_status": "kOptimal"}
    program.unpack_results(results | {"run_time": solver.getRunTime()}, chain, inverse)
    value = float(program.value)
    return Optimum(value, seconds, bound if whole else value, nodes, stopped)


def _require_optimum(status: str, *, feasible: bool) -> None:
    """Raise an error unless the solver ended with an optimum."""
    if status == "kInfeasible" and feasible:
        raise SolverError(f"{cp.HIGHS} calls a problem infeasible that is not; rescale the costs")
    if status == "kInfeasible":
        raise InfeasibleError("no choice is within all budgets; raise a bound")
    if status != "kOptimal":
        raise SolverError(f"{cp.HIGHS} ended with status {status!r}; rescale the costs")


def _loaded(data: dict[str, Any], *, whole: bool) -> highspy.Highs:
    """Return HiGHS with a program: equations first, then inequalities, as cvxpy writes them."""
    matrix, right = data["A"].tocsc(), data["b"]
    rows, columns = matrix.shape
    binary = np.isin(np.arange(columns), data["bool_vars_idx"])
    low, high = data.get("lower_bounds"), data.get("upper_bounds")
    low = np.full(columns, -highspy.kHighsInf) if low is None else low
    high = np.full(columns, highspy.kHighsInf) if high is None else high
    low = np.where(binary, np.maximum(low, 0.0), low)
    high = np.where(binary, np.minimum(high, 1.0), high)
    solver = highspy.Highs()
    for name, value in {"log_to_console": False, **GAPS}.items():
        solver.setOptionValue(name, value)
    least = np.where(np.arange(rows) < data["dims"].zero, right, -highspy.kHighsInf)
    solver.addRows(rows, least, right, 0, [], [], [])
    starts, which = matrix.indptr[:-1].astype(np.int32), matrix.indices.astype(np.int32)
    solver.addCols(columns, data["c"], low, high, matrix.nnz, starts, which, matrix.data)
    if whole:
        every, kinds = np.arange(columns, dtype=np.int32), binary.astype(np.uint8)  # whole: 1
        solver.changeColsIntegrality(columns, every, kinds)
    return solver


def _listen(solver: highspy.Highs, watch: Watch, convert: Callable[[float], float]) -> None:
    """Let HiGHS report every incumbent to a watch, and its bounds between them.

    It ends when the watch says so, also while it solves linear programs.
    """

    def hear(event: Any) -> None:
        data = event.data_out
        value = convert(data.mip_primal_bound)
        watch.tell(value if math.isfinite(value) else math.inf, convert(data.mip_dual_bound))
        end(event)

    def end(event: Any) -> None:
        if watch.over:
            event.interrupt()

    solver.cbMipImprovingSolution += hear
    solver.cbMipInterrupt += hear
    solver.cbSimplexInterrupt += end
    solver.cbIpmInterrupt += end


def _end(solver: highspy.Highs, seconds: float) -> str:
    """Run HiGHS and return how that ended, in its words."""
    if math.isfinite(seconds):
        solver.setOptionValue("time_limit", seconds)
    solver.run()
    return str(solver.getModelStatus().name)


def _solve_file(path: str, seconds: float) -> tuple[str, float, float, list[float]]:
    """Solve a program in a file by HiGHS as it comes; return its end, value, bound and values."""
    solver = highspy.Highs()
    for name, value in {"log_to_console": False, "time_limit": float(seconds)}.items():
        solver.setOptionValue(name, value)
    solver.readModel(path)
    end = _end(solver, seconds)
    info = solver.getInfo()
    found = list(solver.getSolution().col_value)
    return end, float(info.objective_function_value), float(info.mip_dual_bound), found
