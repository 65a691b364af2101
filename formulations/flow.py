r"""A build as a unit flow of least cost, goal by goal and within budgets: linear or whole.

With moves :math:`a = (u, v)` that take :math:`c_a` of a goal and :math:`a_{ba}` of budgets,

.. math::

   \min_y \; & \sum_a c_a y_a \\
   \text{s.t.} \; & \sum_{a \text{ from } s} y_a - \sum_{a \text{ to } s} y_a =
   \begin{cases} 1 & s \text{ the start} \\ 0 & \text{else, but at ends} \end{cases} \\
   & \sum_a a_{ba} \, y_a \le B_b \quad \text{for every budget,} \\
   & y \ge 0 \quad \text{or} \quad y \in \{0, 1\} .

Of the open grips of a schedule a move is a pair of candidates, and costs its later candidate and
the step that the two share; of a free schedule it is a step. HiGHS solves it. ``overlap_lp`` takes
:math:`y \ge 0`. Without budgets the matrix is totally unimodular: the optimum is a path. With the
multipliers :math:`\pi_s` of its rows, 0 at ends, paths of moves with :math:`c_a =
\pi_u - \pi_v` are the best ones, and only these are left for the next goal. The largest amount on a
path is no linear function of :math:`y`. Of a peak therefore the least :math:`t` is found by
bisection for which

.. math::

   y \ge 0, \qquad \text{the rows above}, \qquad y_a = 0 \; \text{ where } \; c_a > t

has a solution. With budgets the value is a bound, the duals of their rows are their multipliers,
and the path that the largest flow follows need not be the best; where it exceeds a budget, one that
took no search is taken.

``overlap_mip`` takes :math:`y \in \{0, 1\}`: exact, with budgets. A peak is

.. math::

   \min_{t, \, y \in \{0, 1\}} \; t \quad\text{s.t.}\quad \text{the rows above}, \qquad
   t \ge \sum_{a \text{ to } s} c_a y_a \; \text{ for every state } s .

After a sum of value :math:`z` the row :math:`\sum_a c_a y_a \le z` stays, after a peak moves that
take more are left out. The epigraph says little where :math:`y` may be fractions, since a flow that
spreads over many states has a small peak. Integers pay where budgets couple all moves;
without these dynamic programming gives the same answer hundreds of times faster.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.on_graph import Choice, Choose, at_hand, on_graph
from formulations.solvers import EXACTLY, minimize_by_highs
from seqopt.arrays import Floats
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError
from seqopt.graph.formulation import FormulationKind, Watch
from seqopt.graph.graph import TIED, Graph, fewest_moves, lexicographic, path_values, tied
from seqopt.problem.problem import Aim

ACCURACY = 1e-8  # how far a reported optimum may lie above the true one, relative to the larger of
# it and the largest cost
MOST_ARCS = 1_000_000  # of a program: more take gigabytes and minutes before a solver begins


@dataclass(frozen=True, eq=False)
class Flow:
    """The unit flow through a graph, its cost and amounts, all of order one.

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
        """Return the path that leaves least of a flow (m,) beside it, of equal ones the shortest.

        Of a whole flow that is its path, without the cycles that cost nothing.
        """
        beside = np.nan_to_num(np.clip(1.0 - flow, 0.0, 1.0), nan=1.0)[:, None]
        own = self.graph
        return lexicographic(Graph(own.source, own.target, beside, (False,), own.ends)).path


def unit_flow(graph: Graph, goal: int = 0) -> Flow:
    """Return the unit flow through a graph whose costs are the amounts of a goal.

    Raises a `ProblemError` if there are more than `MOST_ARCS`.
    """
    graph = graph.only(~graph.ends[graph.source])
    moves, inner = np.arange(len(graph.source)), ~graph.ends[graph.target]
    number = np.cumsum(~graph.ends) - 1
    shape = int(number[-1]) + 1, len(moves)
    if len(moves) > MOST_ARCS:
        raise ProblemError(
            f"a program of {shape[1]:,} moves between {shape[0]:,} states is too large (at most "
            f"{MOST_ARCS:,} moves are written); take overlap_dp, or let fewer candidates in"
        )
    rows = np.concatenate([number[graph.source], number[graph.target[inner]]])
    signs = np.repeat([1.0, -1.0], [len(moves), inner.sum()])
    entries = signs, (rows, np.concatenate([moves, moves[inner]]))
    balance, source = sparse.csr_array(entries, shape=shape), np.eye(1, shape[0])[0]
    cost = graph.amounts[:, goal]
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


def conserved(flow: Flow, arcs: cp.Variable) -> cp.Constraint:
    """Flow balance: outflow of a state is its inflow, and one unit more at the start."""
    return cp.Zero(flow.balance @ arcs - flow.source)


def within_caps(flow: Flow, arcs: cp.Variable) -> list[cp.Constraint]:
    """Let all moves together take no more of a budget than there is."""
    pairs = zip(flow.caps, flow.takes, strict=True)
    return [cp.NonNeg(tied(cap) - taken @ arcs) for cap, taken in pairs]


class _Least(NamedTuple):
    """The least of one goal by linear programs.

    ``graph``: the moves on paths that attain it; ``bound``: its value, minus infinity where time
    was over before; ``path``: along the flow; ``prices``: multipliers of the budgets; ``seconds``:
    what writing the programs down took.
    """

    graph: Graph
    bound: float
    path: tuple[int, ...]
    prices: tuple[float, ...]
    seconds: float
    stopped: bool = False


def _linear(graph: Graph, watch: Watch) -> Choice:
    """Return the path by linear programs; where time is over, one that is best in the first goals.

    Within budgets it is that of the largest flow, with a bound and multipliers of the first goal. A
    `NothingFoundError` says that no path within these is at hand.
    """
    if graph.ends[0]:
        return Choice((), (0.0,) * len(graph.peaks))
    graph = graph.only(~graph.ends[graph.source])
    bounds, seconds = list[float](), 0.0
    for goal in range(graph.goals):
        found = (_least_peak if graph.peaks[goal] else _least_sum)(graph, goal, watch)
        graph, seconds = found.graph, seconds + found.seconds
        bounds.append(found.bound)
        if goal == 0:
            watch.tell(bound=found.bound)
        if found.stopped or graph.caps:
            break
    else:
        return Choice(fewest_moves(graph), tuple(bounds), compile_seconds=seconds)
    path = at_hand(graph, *([found.path] if found.path else []))
    if not path and not found.stopped:
        raise NothingFoundError(
            "the flow mixes paths, none of which is within all caps; use a formulation that keeps "
            "budgets exactly"
        )
    prices = (found.prices,) if found.prices else ()
    return Choice(path, tuple(bounds), found.stopped, prices, seconds)


def _least_sum(graph: Graph, goal: int, watch: Watch) -> _Least:
    flow = unit_flow(graph, goal)
    arcs = cp.Variable(len(flow.cost), nonneg=True)
    balance, caps = conserved(flow, arcs), within_caps(flow, arcs)
    program = cp.Problem(cp.Minimize(flow.cost @ arcs), [balance, *caps])
    found = minimize_by_highs(program, feasible=not caps, watch=watch, tolerance=EXACTLY)
    if found.stopped:
        return _Least(graph, -np.inf, (), (), found.compile_seconds, stopped=True)
    least = max(flow.bound(found.value), 0.0)  # a sum adds nothing below zero
    if caps:
        duals = [max(float(cap.dual_value), 0.0) for cap in caps]
        prices = tuple(flow.scale / u * d for u, d in zip(flow.units, duals, strict=True))
        path = flow.path(np.asarray(arcs.value))
        return _Least(graph, least, path, prices, found.compile_seconds)
    reduced = flow.cost + flow.balance.T @ np.asarray(balance.dual_value)
    best = flow.graph.only(reduced <= TIED * max(found.value, 1.0))
    return _Least(best, least, (), (), found.compile_seconds)


def _least_peak(graph: Graph, goal: int, watch: Watch) -> _Least:
    """Return the least largest amount, by bisection over all that occur."""
    amounts, path, seconds = graph.amounts[:, goal], tuple[int, ...](), 0.0
    levels = np.unique(amounts)
    low, high = 0, len(levels) - (0 if graph.caps else 1)  # with budgets, none may be enough
    while low < high:
        middle = (low + high) // 2
        flow = unit_flow(graph.only(amounts <= levels[middle]), goal)
        arcs = cp.Variable(len(flow.cost), nonneg=True)
        rules = [conserved(flow, arcs), *within_caps(flow, arcs)]
        program = cp.Problem(cp.Minimize(0), rules)
        try:
            found = minimize_by_highs(program, feasible=False, watch=watch, tolerance=EXACTLY)
        except InfeasibleError:
            low = middle + 1
            continue
        seconds += found.compile_seconds
        if found.stopped:
            return _Least(graph, float(levels[low]), path, (), seconds, stopped=True)
        high, path = middle, flow.path(np.asarray(arcs.value))
    if high == len(levels):
        raise InfeasibleError("no choice is within all budgets; raise a bound")
    least = float(levels[high])
    return _Least(graph.only(amounts <= tied(least)), least, path, (), seconds)


class WholeProgram(NamedTuple):
    """An integer program, and the meaning of its solution.

    ``program``: costs are scaled; ``whole``: those that a path is read from; ``path``: returns the
    one that their values stand for; ``bound``: returns a lower bound in the unit of the costs for
    the value of the program, lower by what the solver may be off.
    """

    program: cp.Problem
    whole: cp.Variable
    path: Callable[[Floats], tuple[int, ...]]
    bound: Callable[[float], float]


def by_integers(write: Callable[[Graph], WholeProgram]) -> Choose:
    """Return the choice of a path by integer programs, one for each goal, with its lower bounds.

    ``write``: returns the program of the first column of a graph; the sums of all others are
    capped. A `SolverError` says that the solver ended without an optimum.
    """

    def choose(graph: Graph, watch: Watch) -> Choice:
        if graph.ends[0]:
            return Choice((), (0.0,) * len(graph.peaks))
        path, bounds, seconds = at_hand(graph), list[float](), 0.0
        sums = dict[int, float]()
        for goal in range(graph.goals):
            columns = [goal, *sums, *range(graph.goals, len(graph.peaks))]
            peaks = (graph.peaks[goal], *[False] * (len(columns) - 1))
            amounts, caps = graph.amounts[:, columns], (*sums.values(), *graph.caps)
            written = write(replace(graph, amounts=amounts, peaks=peaks, caps=caps))
            found = minimize_by_highs(
                written.program,
                feasible=bool(goal) or not graph.caps,
                watch=watch.apart() if goal else watch,
                convert=written.bound,
                tolerance=EXACTLY,
            )
            bound = written.bound(found.bound if found.stopped else found.value)
            low = float(graph.amounts[:, goal].min(initial=0.0))  # no path takes less
            bounds.append(max(bound, low))
            seconds += found.compile_seconds
            if np.isfinite(found.value):
                path = written.path(np.asarray(written.whole.value))
            if found.stopped:
                return Choice(path, tuple(bounds), stopped=True, compile_seconds=seconds)
            least = path_values(graph, path)[goal]
            if graph.peaks[goal]:
                graph = graph.only(graph.amounts[:, goal] <= tied(least))
            else:
                sums[goal] = least
        return Choice(path, tuple(bounds), compile_seconds=seconds)

    return choose


def _whole(graph: Graph) -> WholeProgram:
    """Return the flow through moves that are taken or not, of least sum or least peak."""
    flow = unit_flow(graph)
    arcs, largest = cp.Variable(len(flow.cost), boolean=True), cp.Variable(nonneg=True)
    rules = [conserved(flow, arcs), *within_caps(flow, arcs)]
    least = flow.cost @ arcs
    if graph.peaks[0]:
        least = largest  # no less than the cost of the moves which enter any state
        entries = flow.cost, (flow.graph.target, np.arange(len(flow.cost)))
        entered = sparse.csr_array(entries, shape=(flow.graph.states, len(flow.cost)))
        rules.append(cp.NonNeg(largest - entered @ arcs))
    return WholeProgram(cp.Problem(cp.Minimize(least), rules), arcs, flow.path, flow.bound)


OVERLAP_LP = on_graph(
    "overlap_lp",
    "full overlap, linear program",
    _linear,
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
