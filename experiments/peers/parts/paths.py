"""The placement problem given to general tools: a path for networkx, linear programs for HiGHS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import networkx as nx
import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from seqopt.placement.costs import LayeredCosts
from seqopt.placement.formulation import find_formulation
from seqopt.placement.interface import PlacementProblem

GOAL = "goal"
Node = tuple[int, int] | str


def by_networkx(problem: PlacementProblem) -> float:
    """Return the least cost as a shortest path through the layers (networkx, Dijkstra).

    Every arc is raised by the same amount where costs are negative: all paths are equally long.
    """
    graph: nx.DiGraph[Node] = nx.DiGraph()
    costs = _arcs(problem.sums)
    raised = max(0.0, -min(float(cost.min()) for cost in costs))
    for layer, cost in enumerate(costs):
        for i, j in zip(*np.nonzero(np.isfinite(cost)), strict=True):
            weight = float(cost[i, j]) + raised
            graph.add_edge((layer, int(i)), (layer + 1, int(j)), weight=weight)
    for j in range(costs[-1].shape[1]):
        graph.add_edge((len(costs), j), GOAL, weight=0.0)
    length = nx.dijkstra_path_length(graph, (0, 0), GOAL)
    return float(length) - raised * len(costs)


def by_linprog(method: Literal["highs-ds", "highs-ipm"]) -> Callable[[PlacementProblem], float]:
    """Return a solution of the unit flow of least cost by SciPy's HiGHS, simplex or interior."""

    def solve(problem: PlacementProblem) -> float:
        costs = _arcs(problem.sums)
        masks = [np.isfinite(cost) for cost in costs]
        price = np.concatenate([cost[m] for cost, m in zip(costs, masks, strict=True)])
        starts = np.cumsum([0, *(len(cost) for cost in costs), costs[-1].shape[1]])
        tail = [starts[k] + np.nonzero(m)[0] for k, m in enumerate(masks)]
        head = [starts[k + 1] + np.nonzero(m)[1] for k, m in enumerate(masks)]
        rows = np.concatenate([*tail, *head])
        arcs = np.tile(np.arange(len(price)), 2)
        signs = np.repeat([1.0, -1.0], len(price))
        size = int(starts[-1])
        balance = sparse.csr_array((signs, (rows, arcs)), shape=(size, len(price)))
        keep = slice(0, int(starts[len(costs)]))  # the unit may leave by any last candidate
        source = np.eye(1, size).ravel()
        found = linprog(  # type: ignore[call-overload]  # sparse matrices are allowed
            price, A_eq=balance[keep], b_eq=source[keep], method=method
        )
        return float(found.fun)

    return solve


def by_formulation(name: str) -> Callable[[PlacementProblem], float]:
    """Return a registered formulation as a solver of the same kind."""
    which = find_formulation(name)
    return lambda problem: float(which.solve(problem).objective)


def _arcs(placement: LayeredCosts) -> list[np.ndarray]:
    pairs = zip(placement.shared, placement.single, strict=True)
    return [shared + single for shared, single in pairs]


PATHS: dict[str, Callable[[PlacementProblem], float]] = {
    "NumPy, dynamic programming": by_formulation("overlap_dp"),
    "networkx, Dijkstra": by_networkx,
    "HiGHS, linear program, simplex": by_linprog("highs-ds"),
    "HiGHS, linear program, interior point": by_linprog("highs-ipm"),
    "Clarabel in cvxpy, linear program": by_formulation("overlap_lp"),
    "HiGHS in cvxpy, integer program": by_formulation("overlap_mip"),
}
SLOW = ("HiGHS in cvxpy, integer program",)
