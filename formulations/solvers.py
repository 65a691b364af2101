"""The one module that talks to solvers: it solves programs that others wrote, and poses none."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple

import clarabel
import cvxpy as cp
import highspy
import numpy as np
from scipy import sparse

from seqopt.arrays import Floats
from seqopt.errors import InfeasibleError, SolverError
from seqopt.plan.calling.formulation import Watch
from seqopt.stability.limit_analysis import Claim

CONE_OPTIONS: tuple[dict[str, object], ...] = (
    {"equilibrate_enable": False, "static_regularization_constant": 1e-7},
    {},
)  # by attempt. A program scaled by its author stalls less without the solver's own scaling: on the
# 98 steps of the two-robot methods with epoxy 0 of 1,174 cases, else 23 of 1,142
SECONDS = 300.0  # a cone program that takes longer has stalled
ENDS = {
    "Solved": Claim.SOLVED,
    "AlmostSolved": Claim.ALMOST,
    "PrimalInfeasible": Claim.INFEASIBLE,
}  # any other end, a limit reached among them, is a stall


def solve_cones(
    cost: Floats, matrix: sparse.csc_array, right: Floats, cones: Sequence[Any], attempt: int
) -> tuple[Claim, Floats, Floats]:
    """Minimize a cost (n,) where right (m,) - matrix (m, n) x is in cones, by Clarabel.

    The attempt is an index into `CONE_OPTIONS`. Returns how it ended, x (n,) and the multipliers
    (m,); a solver that fails has stalled.
    """
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads, settings.time_limit = False, 1, SECONDS
    for name, value in CONE_OPTIONS[attempt].items():
        setattr(settings, name, value)
    none = sparse.csc_matrix((len(cost), len(cost)))
    try:
        solver = clarabel.DefaultSolver(
            none, cost, sparse.csc_matrix(matrix), right, cones, settings
        )
        found = solver.solve()
    except BaseException as error:  # a panic of its kernel is none of Exception
        if isinstance(error, KeyboardInterrupt | SystemExit | MemoryError):
            raise
        return Claim.STALLED, np.full(len(cost), np.nan), np.zeros(len(right))
    return ENDS.get(str(found.status), Claim.STALLED), np.array(found.x), np.array(found.z)


GAPS = {"mip_rel_gap": 1e-9, "mip_abs_gap": 1e-9}  # of integer programs
HIGHS_ENDS = {"kOptimal": cp.OPTIMAL, "kInfeasible": cp.INFEASIBLE}
EXACTLY = 1e-10  # by how much programs given as arrays may be off
STOPS = ("kTimeLimit", "kInterrupt")


@dataclass(frozen=True)
class Optimum:
    """What a solver found.

    ``value``: of the objective; infinite where it was stopped before it had any solution;
    ``compile_seconds``: what cvxpy took to write the program down for the solver, s; ``bound``: on
    the objective, as the solver says; ``nodes``: of its search tree; ``stopped``: whether its time
    was over, or it was interrupted.
    """

    value: float
    compile_seconds: float
    bound: float = -math.inf
    nodes: int = 0
    stopped: bool = False


@dataclass(frozen=True)
class Size:
    """How large a program is, as it is handed to a solver."""

    rows: int
    columns: int
    nonzeros: int
    binaries: int


def minimize(program: cp.Problem, *, feasible: bool, time_limit: float = math.inf) -> Optimum:
    """Solve a linear program by Clarabel.

    ``program``: its variables take the values of the optimum; ``feasible``: whether the program is
    known to have a solution; ``time_limit``: after which it stops with nothing, s. Raises
    `InfeasibleError` if the solver proves that nothing is within all budgets; `SolverError` if it
    ends in any other way than with an optimum or at its limit, or calls a program infeasible that
    is not.
    """
    limit = {"time_limit": time_limit} if math.isfinite(time_limit) else {}
    try:
        with warnings.catch_warnings():  # an inaccurate end is refused below
            warnings.filterwarnings("ignore", "Solution may be inaccurate", UserWarning)
            program.solve(solver=cp.CLARABEL, **limit)
    except cp.SolverError as error:
        raise SolverError(f"{cp.CLARABEL} failed: {error}; rescale the costs") from error
    seconds = float(program.compilation_time or 0.0)
    if program.status == cp.USER_LIMIT and limit:
        return Optimum(math.inf, seconds, stopped=True)
    _require_optimum(program.status, cp.CLARABEL, feasible=feasible)
    value = float(program.value)
    return Optimum(value, seconds, value)


def minimize_whole(
    program: cp.Problem,
    *,
    feasible: bool,
    watch: Watch | None = None,
    told: Callable[[float], float] = float,
) -> Optimum:
    """Solve an integer program by HiGHS.

    ``program``: its variables take the values of the best solution, if there is one; ``feasible``:
    whether the program is known to have a solution; ``watch``: says when to stop, and is told
    values and bounds as they are found; ``told``: turns a value of the program into the unit that
    the watch is told. Raises `InfeasibleError`, `SolverError` as `minimize`.
    """
    watch = watch or Watch()
    start = time.perf_counter()
    try:
        data, chain, inverse = program.get_problem_data(cp.HIGHS)
        solver = _loaded(data, whole=True)
        seconds = time.perf_counter() - start
        offset = float(inverse[-1].get("offset", 0.0))
        _listen(solver, watch, lambda value: told(value + offset))
        status = _end(solver, watch.left)
    except cp.SolverError as error:
        raise SolverError(f"{cp.HIGHS} failed: {error}; rescale the costs") from error
    info = solver.getInfo()
    stopped = status in STOPS
    bound = float(info.mip_dual_bound) + offset
    if stopped and not math.isfinite(info.objective_function_value):
        return Optimum(math.inf, seconds, bound, int(info.mip_node_count), stopped=True)
    if not stopped:
        _require_optimum(HIGHS_ENDS.get(status, status), cp.HIGHS, feasible=feasible)
    results = {"solution": solver.getSolution(), "info": info, "model_status": "kOptimal"}
    program.unpack_results(results | {"run_time": solver.getRunTime()}, chain, inverse)
    return Optimum(float(program.value), seconds, bound, int(info.mip_node_count), stopped)


class Point(NamedTuple):
    """How HiGHS ended, in its words, and with what."""

    end: str
    values: Floats
    multipliers: Floats
    bound: float


def minimize_rows(
    cost: Floats, rows: Any, right: Floats, *, watch: Watch, whole: int = 0, equations: int = -1
) -> Point:
    """Solve a program whose arrays are given, by HiGHS.

    ``cost`` (n,); ``rows`` ((m, n) sparse float); ``right`` (m,): what equations are equal to;
    inequalities, which come after them, are no more; ``watch``: says when to stop; ``whole``: how
    many of the first variables are 0 or 1; all are from 0 on; ``equations``: how many of the rows
    are equations; all by default. Result: its end ``kInfeasible``, ``kOptimal`` or one of `STOPS`;
    its values are none (0,) where nothing was found. Raises `SolverError` if it ends in any other
    way.
    """
    dims = SimpleNamespace(zero=len(right) if equations < 0 else equations)
    data = {"A": rows, "b": right, "c": cost, "dims": dims, "bool_vars_idx": range(whole)}
    solver = _loaded(data | {"lower_bounds": np.zeros(len(cost))}, whole=whole > 0)
    if not whole:
        solver.setOptionValue("solver", "ipm")  # ends in a vertex, on large graphs far sooner
    for name in ("primal_feasibility", "dual_feasibility", "mip_feasibility"):
        solver.setOptionValue(f"{name}_tolerance", EXACTLY)
    _listen(solver, watch, float)
    end = _end(solver, watch.left)
    if end not in (*HIGHS_ENDS, *STOPS):
        _require_optimum(end, cp.HIGHS, feasible=True)
    found, info = solver.getSolution(), solver.getInfo()
    bound, known = float(info.mip_dual_bound), math.isfinite(info.objective_function_value)
    if not whole:
        known = end == "kOptimal"
        bound = float(info.objective_function_value) if known else -math.inf
    values = np.array(found.col_value if known and end != "kInfeasible" else [])
    return Point(end, values, np.array(found.row_dual), bound)


def anatomy(program: cp.Problem) -> tuple[Size, float]:
    """Return how large an integer program is, and the bound of its linear relaxation.

    Raises `SolverError` if the relaxation is not solved.
    """
    data, _, inverse = program.get_problem_data(cp.HIGHS)
    solver = _loaded(data, whole=False)
    _require_optimum(HIGHS_ENDS.get(_end(solver, math.inf), ""), cp.HIGHS, feasible=True)
    matrix = data["A"].tocsc()
    rows, columns = matrix.shape
    size = Size(rows, columns, int(matrix.nnz), len(data["bool_vars_idx"]))
    value = float(solver.getInfo().objective_function_value)
    return size, value + float(inverse[-1].get("offset", 0.0))


def _require_optimum(status: str, solver: str, *, feasible: bool) -> None:
    """Raise an error unless a solver ended with an optimum."""
    if status == cp.INFEASIBLE and feasible:
        raise SolverError(f"{solver} calls a problem infeasible that is not; rescale the costs")
    if status == cp.INFEASIBLE:
        raise InfeasibleError("no choice is within all budgets; raise a bound")
    if status != cp.OPTIMAL:
        raise SolverError(f"{solver} ended with status {status!r}; rescale the costs")


def _loaded(data: dict[str, Any], *, whole: bool) -> highspy.Highs:
    """Return HiGHS with a program: equations first, then inequalities, as cvxpy writes them."""
    model = highspy.HighsModel()
    lp, matrix, right = model.lp_, data["A"].tocsc(), data["b"]
    lp.num_row_, lp.num_col_ = matrix.shape
    lp.col_cost_, lp.row_upper_ = data["c"], right
    lp.row_lower_ = np.where(np.arange(len(right)) < data["dims"].zero, right, -highspy.kHighsInf)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_ = matrix.indptr, matrix.indices
    lp.a_matrix_.value_ = matrix.data
    binary = np.zeros(lp.num_col_, dtype=bool)
    binary[list(data["bool_vars_idx"])] = True
    low, high = data.get("lower_bounds"), data.get("upper_bounds")
    low = np.full(len(binary), -highspy.kHighsInf) if low is None else low
    high = np.full(len(binary), highspy.kHighsInf) if high is None else high
    lp.col_lower_ = np.where(binary, np.maximum(low, 0.0), low)
    lp.col_upper_ = np.where(binary, np.minimum(high, 1.0), high)
    kinds = (highspy.HighsVarType.kContinuous, highspy.HighsVarType.kInteger)
    if whole:
        lp.integrality_ = [kinds[int(is_binary)] for is_binary in binary]
    solver = highspy.Highs()
    for name, value in {"log_to_console": False, **GAPS}.items():
        solver.setOptionValue(name, value)
    solver.passModel(model)
    return solver


def _listen(solver: highspy.Highs, watch: Watch, told: Callable[[float], float]) -> None:
    """Let HiGHS tell a watch every better solution, and its bounds between them.

    It ends when the watch says so, also while it solves linear programs.
    """

    def hear(event: Any) -> None:
        data = event.data_out
        watch.tell(_finite(told(data.mip_primal_bound), math.inf), told(data.mip_dual_bound))
        end(event)

    def end(event: Any) -> None:
        if watch.over:
            event.interrupt()

    solver.cbMipImprovingSolution += hear
    solver.cbMipInterrupt += hear
    solver.cbSimplexInterrupt += end
    solver.cbIpmInterrupt += end


def _finite(value: float, otherwise: float) -> float:
    return value if abs(value) < highspy.kHighsInf else otherwise


def _end(solver: highspy.Highs, seconds: float) -> str:
    """Run HiGHS and return how that ended, in its words."""
    if math.isfinite(seconds):
        solver.setOptionValue("time_limit", seconds)
    solver.run()
    return str(solver.getModelStatus().name)
