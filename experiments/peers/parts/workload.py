"""What engine and peers are asked: every distinct model of the three-robot loop."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.optimize import linprog

from seqopt import Network, three_robot_loop
from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Fields, Want, grip_columns
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.graph.formulation import find_formulation
from seqopt.graph.layers.compiled import compile_costs
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.layers import Layers, candidate_layers
from seqopt.problem.problem import Aim
from seqopt.study.published import EQUATIONS

SETTINGS = ("reactions", "criterion", "all fields")


class Case(NamedTuple):
    """The models of one brick count and number of grips: node numbers, places, what is asked."""

    bricks: int
    grips: Ints
    columns: Ints
    want: Want

    def asked(self, setting: str) -> Want:
        """Return what a setting asks of these models."""
        return (Want.SUPPORT, self.want, Want.RESPONSES)[SETTINGS.index(setting)]


class Recorder:
    """An engine that remembers what it was asked."""

    def __init__(self, net: Network) -> None:
        self.engine = ComplianceEngine(net)
        self.cases: list[Case] = []

    @property
    def network(self) -> Network:
        """The engine's network."""
        return self.engine.network

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.RESPONSES) -> Fields:
        """Answer and remember."""
        columns = grip_columns(self.network, bricks, grips)
        self.cases.append(Case(bricks, np.asarray(grips), columns, want))
        return self.engine.solve(bricks, grips, want)


def workload(net: Network) -> tuple[Layers, list[Case]]:
    recorder = Recorder(net)
    problem = candidate_layers(recorder, three_robot_loop(net), EQUATIONS)
    assert problem.evaluation.models  # evaluated here, and so recorded
    return problem, recorder.cases


def products(
    net: Network, cases: list[Case], setting: str, *, sparsely: bool = False
) -> tuple[Callable[[], None], float]:
    """Return a call that does only the products of a batch, and how many flops they are."""
    rng = np.random.default_rng(0)
    work: list[tuple[Floats | sparse.csr_array, Floats, Floats]] = []
    flops = 0.0
    for case in cases:
        load = rng.standard_normal((len(case.grips), 6 * case.bricks + 1))
        index = np.hstack([load_index(case), np.full((len(load), 1), load.shape[1] - 1)])
        few = _spread(index, rng.standard_normal(index.shape), load.shape[1])
        each = index.shape[1] if sparsely else load.shape[1]
        for width in _widths(net, case, setting):
            rows = rng.standard_normal((load.shape[1], width))
            work.append((few if sparsely else load, rows, np.empty((len(load), width))))
            flops += 2 * len(load) * each * width

    def call() -> None:
        for load, rows, out in work:
            if isinstance(load, np.ndarray):
                np.matmul(load, rows, out=out)
            else:
                load @ rows

    call()
    return call, flops


def least_flops(net: Network, cases: list[Case], setting: str) -> float:
    """Return how many operations the models of all cases have, nothing multiplied by zero."""
    flops = 0.0
    for case in cases:
        unknowns = 3 * case.columns.shape[1]
        sums = 2 * (unknowns + 1) * sum(_widths(net, case, setting))
        flops += len(case.grips) * (sums + unknowns**3 / 3 + 4 * unknowns**2)
    return flops


def load_index(case: Case) -> Ints:
    """Return the loads (S, 3r) that the grips of a case exert."""
    return np.asarray(3 * case.columns[:, :, None] + np.arange(3)).reshape(len(case.columns), -1)


def _spread(index: Ints, values: Floats, size: int) -> sparse.csr_array:
    starts = np.arange(0, index.size + 1, index.shape[1])
    return sparse.csr_array((values.ravel(), index.ravel(), starts), shape=(len(index), size))


def _widths(net: Network, case: Case, setting: str) -> list[int]:
    """Return the sizes of the fields that a setting asks of a case."""
    sizes = (
        (Want.EDGES, net.count_edges(case.bricks)),
        (Want.DISPLACEMENTS, 3 * net.count_nodes(case.bricks)),
        (Want.SUPPORT, 6 * len(net.springs.support)),
    )
    return [size for flag, size in sizes if case.asked(setting) & flag]


GOAL = "goal"
Node = tuple[int, int] | str


def by_networkx(layers: LayeredCosts) -> float:
    """Return the least cost as a shortest path through the layers (networkx, Dijkstra).

    Every arc is raised by the same amount where costs are negative: all paths are equally long.
    """
    graph: nx.DiGraph[Node] = nx.DiGraph()
    costs = _arcs(layers)
    raised = max(0.0, -min(float(cost.min()) for cost in costs))
    for layer, cost in enumerate(costs):
        for i, j in zip(*np.nonzero(np.isfinite(cost)), strict=True):
            graph.add_edge((layer, int(i)), (layer + 1, int(j)), weight=float(cost[i, j]) + raised)
    for j in range(costs[-1].shape[1]):
        graph.add_edge((len(costs), j), GOAL, weight=0.0)
    return float(nx.dijkstra_path_length(graph, (0, 0), GOAL)) - raised * len(costs)


def by_linprog(method: Literal["highs-ds", "highs-ipm"]) -> Callable[[LayeredCosts], float]:
    """Return a solution of the unit flow of least cost by SciPy's HiGHS, simplex or interior."""

    def solve(layers: LayeredCosts) -> float:
        costs = _arcs(layers)
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


def by_formulation(name: str) -> Callable[[LayeredCosts], float]:
    which = find_formulation(name)

    def solve(layers: LayeredCosts) -> float:
        graph = compile_costs(name, layers, Aim.SUM)
        return float(which.solve(graph.instance).objective[0]) + graph.offset

    return solve


def _arcs(layers: LayeredCosts) -> list[np.ndarray]:
    pairs = zip(layers.shared, layers.single, strict=True)
    return [shared + single for shared, single in pairs]


PATHS: dict[str, Callable[[LayeredCosts], float]] = {
    "seqopt, overlap_dp": by_formulation("overlap_dp"),
    "networkx, Dijkstra": by_networkx,
    "HiGHS, linear program, simplex": by_linprog("highs-ds"),
    "HiGHS, linear program, interior point": by_linprog("highs-ipm"),
    "Clarabel in cvxpy, linear program": by_formulation("overlap_lp"),
    "HiGHS in cvxpy, integer program": by_formulation("overlap_mip"),
}
SLOW = ("HiGHS in cvxpy, integer program",)
