"""How large an integer program is as a solver gets it, and what its relaxation proves."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from seqopt.errors import SolverError


@dataclass(frozen=True)
class Size:
    """How large a program is, as it is handed to a solver."""

    rows: int
    columns: int
    nonzeros: int
    binaries: int


def anatomy(program) -> tuple[Size, float]:
    """Return how large a program of cvxpy is, and its relaxation's bound, or a `SolverError`."""
    data, _, inverse = program.get_problem_data("HIGHS")
    matrix, right, equations = data["A"].tocsr(), data["b"], data["dims"].zero
    rows, columns = matrix.shape
    low, high = (data.get(f"{side}_bounds") for side in ("lower", "upper"))
    low = np.full(columns, -np.inf) if low is None else np.array(low, dtype=float)
    high = np.full(columns, np.inf) if high is None else np.array(high, dtype=float)
    whole = data["bool_vars_idx"]
    low[whole], high[whole] = np.maximum(low[whole], 0.0), np.minimum(high[whole], 1.0)
    found = linprog(
        data["c"],
        A_ub=matrix[equations:],
        b_ub=right[equations:],
        A_eq=matrix[:equations],
        b_eq=right[:equations],
        bounds=np.column_stack([low, high]),
    )
    if not found.success:
        raise SolverError(f"the relaxation: {found.message}; rescale the costs")
    size = Size(rows, columns, int(matrix.nnz), len(whole))
    return size, float(found.fun) + float(inverse[-1].get("offset", 0.0))
