r"""A build as a unit flow of least cost within budgets: a linear or an integer program in cvxpy.

With moves :math:`a = (u, v)` that cost :math:`c_a` and take :math:`a_{ba}` of budgets,

.. math::

   \min_y \; & \sum_a c_a y_a \\
   \text{s.t.} \; & \sum_{a \text{ from } s} y_a - \sum_{a \text{ to } s} y_a =
   \begin{cases} 1 & s \text{ the start} \\ 0 & \text{else, but at ends} \end{cases} \\
   & \sum_a a_{ba} \, y_a \le B_b \quad \text{for every budget,} \\
   & y \ge 0 \quad \text{or} \quad y \in \{0, 1\} .

Of the open grips of a schedule a move is a pair of candidates, and costs its later candidate and
the step that the two share. ``overlap_lp`` (Clarabel) takes :math:`y \ge 0`. Without budgets the
matrix is totally unimodular and an optimal vertex is a path. An interior-point answer is a mixture
where costs tie: the path follows the largest flow, every move of which lies on a best path. The
duals of the budgets are their multipliers: what one more unit of each would save. With budgets the
value is a bound and the path, if it is within them, need not be the best; if it is not, one that
took no search is taken.

``overlap_mip`` (HiGHS) takes :math:`y \in \{0, 1\}`: exact, with budgets. It earns its price where
these couple all moves: a cap on robot travel, on how often a robot is used, on the count of steps
over a level. Without them dynamic programming gives the same answer hundreds of times faster.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.cascade import at_hand
from formulations.choice import Choice, Choose
from formulations.on_graph import on_graph
from formulations.solvers import minimize, minimize_by_highs
from seqopt.arrays import Floats
from seqopt.errors import NothingFoundError, ProblemError
from seqopt.graph.formulation import FormulationKind, Watch
from seqopt.graph.graph import Graph
from seqopt.graph.paths import fewest_moves
from seqopt.problem.problem import Aim

ACCURACY = 1e-7  # how far a reported optimum may lie above the true one, relative to the larger of
# it and the largest cost


@dataclass(frozen=True, eq=False)
class Flow:
    """The unit flow through a graph, and what it costs and takes, all of order one.

    ``graph``: without moves that go on from an end; ``balance`` ((n, m) sparse): what leaves states
    that are no ends, less what arrives; ``source`` (n,): what must be left over: 1 at the start;
    ``cost`` (m,): over ``scale``; ``takes``, ``caps``: by budget, over ``units``.
    """

    graph: Graph
    balance: sparse.csr_array
    source: Floats
    cost: Floats
    scale: float
    takes: tuple[Floats, ...]
    caps: tuple[float, ...]
    units: tuple[float, ...]

    def bound(self, optimum: float) -> float:
        """Return a lower bound in the unit of the costs for a solver's optimum."""
        value = optimum * self.scale
        return value - ACCURACY * max(abs(value), self.scale)

    def path(self, flow: Floats) -> tuple[int, ...]:
        """Return the path that the largest part of a flow (m,) takes."""
        graph = self.graph
        state, path = 0, list[int]()
        while not graph.ends[state] and len(path) < graph.states:
            moves = graph.moves_from(state)
            state = int(graph.target[moves][np.argmax(flow[moves])])
            path.append(state)
        return tuple(path) if graph.ends[state] else fewest_moves(graph)


def unit_flow(graph: Graph, costs: Floats | None = None) -> Flow:
    """Return the unit flow through a graph whose moves cost (m,), by default the first amount."""
    onward = ~graph.ends[graph.source]
    cost = (graph.amounts[:, 0] if costs is None else costs)[onward]
    graph = graph.only(onward)
    moves, inner = np.arange(len(graph.source)), ~graph.ends[graph.target]
    number = np.cumsum(~graph.ends) - 1
    rows = np.concatenate([number[graph.source], number[graph.target[inner]]])
    signs = np.repeat([1.0, -1.0], [len(moves), inner.sum()])
    shape = int(number[-1]) + 1, len(moves)
    entries = signs, (rows, np.concatenate([moves, moves[inner]]))
    balance, source = sparse.csr_array(entries, shape=shape), np.eye(1, shape[0])[0]
    scale = max(float(np.abs(cost).max(initial=0.0)), float(np.finfo(float).tiny))
    taken = graph.amounts[:, graph.goals :].T
    units = tuple(map(_unit, taken))
    takes = tuple(each / unit for each, unit in zip(taken, units, strict=True))
    caps = tuple(cap / unit for cap, unit in zip(graph.caps, units, strict=True))
    return Flow(graph, balance, source, cost / scale, scale, takes, caps, units)


def _unit(amounts: Floats) -> float:
    """Return the power of ten just below the largest amount, or 1 if all are zero."""
    largest = float(np.abs(amounts).max(initial=0.0))
    return float(10.0 ** math.floor(math.log10(largest))) if largest else 1.0


def _written(flow: Flow, arcs: cp.Variable) -> tuple[cp.Problem, list[cp.Constraint]]:
    """Return the program, and the constraints of its budgets."""
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    caps = [cp.NonNeg(cap - a @ arcs) for cap, a in zip(flow.caps, flow.takes, strict=True)]
    return cp.Problem(cp.Minimize(flow.cost @ arcs), [conserve, *caps]), caps


def _relaxed(graph: Graph, watch: Watch) -> Choice:
    """Return the path that the largest flow follows, with a bound and the duals of the budgets.

    A `SolverError` says that the solver ended without an optimum, a `NothingFoundError` that no
    path within the budgets is at hand.
    """
    require_sum(graph, "overlap_lp")
    flow = unit_flow(graph)
    arcs = cp.Variable(len(flow.cost), nonneg=True)
    program, caps = _written(flow, arcs)
    optimum = minimize(program, feasible=not graph.caps, time_limit=watch.left)
    if optimum.stopped:
        return Choice(at_hand(graph), stopped=True)
    duals = [float(cap.dual_value) for cap in caps]
    prices = tuple(flow.scale / u * d for u, d in zip(flow.units, duals, strict=True))
    path, bound = at_hand(graph, flow.path(np.asarray(arcs.value))), flow.bound(optimum.value)
    watch.tell(bound=bound)
    if not path:
        raise NothingFoundError(
            "the flow mixes paths, none of which is within all caps; use a formulation that keeps "
            "budgets exactly"
        )
    return Choice(path, (bound,), prices=(prices,), compile_seconds=optimum.compile_seconds)


def require_sum(graph: Graph, name: str) -> None:
    """Raise a `ProblemError` if the first goal is a largest amount, which is linear in no flow."""
    if graph.peaks[0]:
        raise ProblemError(f"{name}: a largest cost is no sum; take minimax, path_dp or flow_lp")


class WholeProgram(NamedTuple):
    """A program with whole variables, and what its solution means.

    ``program``: costs are scaled; ``whole``: those that a path is read from; ``path``: returns the
    one that their values stand for; ``bound``: returns a lower bound in the unit of the costs for
    the value of the program, lower by what the solver may be off.
    """

    program: cp.Problem
    whole: cp.Variable
    path: Callable[[Floats], tuple[int, ...]]
    bound: Callable[[float], float]


def by_integers(write: Callable[[Graph], WholeProgram]) -> Choose:
    """Return the choice of a path by an integer program, with its lower bound.

    ``write``: returns the program of a graph. A `SolverError` says that the solver ended without an
    optimum.
    """

    def choose(graph: Graph, watch: Watch) -> Choice:
        written = write(graph)
        optimum = minimize_by_highs(
            written.program, feasible=not graph.caps, watch=watch, told=written.bound
        )
        seconds = optimum.compile_seconds
        if not np.isfinite(optimum.value):
            bound = (written.bound(optimum.bound),)
            return Choice(at_hand(graph), bound, stopped=True, compile_seconds=seconds)
        bound = (written.bound(optimum.bound if optimum.stopped else optimum.value),)
        path = written.path(np.asarray(written.whole.value))
        return Choice(path, bound, optimum.stopped, compile_seconds=seconds)

    return choose


def _whole(graph: Graph) -> WholeProgram:
    require_sum(graph, "overlap_mip")
    flow = unit_flow(graph)
    arcs = cp.Variable(len(flow.cost), boolean=True)
    return WholeProgram(_written(flow, arcs)[0], arcs, flow.path, flow.bound)


OVERLAP_LP = on_graph(
    "overlap_lp",
    "full overlap, linear program",
    _relaxed,
    FormulationKind.BOUND,
    aim=Aim.SUM,
    takes_budgets=True,
)
OVERLAP_MIP = on_graph(
    "overlap_mip",
    "full overlap, integer program with budgets",
    by_integers(_whole),
    aim=Aim.SUM,
    takes_budgets=True,
)
