r"""Integer programs that are there to be compared: a formulation decides what a relaxation proves.

**Least sum** with an assignment :math:`x` of a candidate to each move, and :math:`y` for pairs:

.. math::

   \min_{x, y} \; & \sum_k \sum_i c_k(i)\, x_k(i) + \sum_k \sum_{i,j} d_k(i, j)\, y_k(i, j) \\
   \text{s.t.} \; & \sum_i x_k(i) = 1, \qquad x_k(i) \in \{0, 1\}, \qquad y \ge 0, \\
   \text{tight:} \; & \sum_i y_k(i, j) = x_k(j), \qquad \sum_j y_k(i, j) = x_{k-1}(i), \\
   \text{loose:} \; & y_k(i, j) \ge x_{k-1}(i) + x_k(j) - 1, \qquad
   x_{k-1}(i) + x_k(j) \le 1 \quad \text{for every pair that is not allowed.}

The row and column sums of ``assignment_tight`` are the tightest links there are: the bound of the
relaxation is that of the flow (``overlap_mip``), which needs no :math:`x` and so is smaller. In
``assignment_loose`` no pair of fractions adds up to more than one and every :math:`y` is zero: the
relaxation counts no shared step. (A negative least :math:`d` of a move is taken out first.)

**Smallest worst cost** :math:`t` of pairs, :math:`p_k(i, j) = \max \{ c_k(j), d_k(i, j) \}`, by a
flow :math:`y` or an assignment :math:`x`:

.. math::

   \min_{t, \, y} \; & t \quad \text{s.t.} \quad
   \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \qquad
   y_k(i, j) \in \{0, 1\}, \\
   \text{layer:} \; & t \ge \sum_{i,j} p_k(i, j)\, y_k(i, j) \quad \text{for every move,} \\
   \text{arc:} \; & t \ge p_k(i, j)\, y_k(i, j) \quad \text{for every pair of every move;} \\
   \min_{t, \, x} \; & t \quad \text{s.t.} \quad
   \sum_i x_k(i) = 1, \qquad x_k(i) \in \{0, 1\}, \qquad t \ge 0, \\
   \text{big-M:} \; & t \ge p_k(i, j) - M \left( 2 - x_{k-1}(i) - x_k(j) \right), \qquad
   x_{k-1}(i) + x_k(j) \le 1 \quad \text{for every pair that is not allowed.}

A mixture of pairs costs their mean in ``minimax_layer``, whose bound is close to the optimum. In
``minimax_arc`` a unit spread over :math:`n` pairs costs an :math:`n`-th of one. In
``minimax_big_m``, :math:`M` being the largest :math:`p`, fractions switch off everything: the bound
is zero. It has the fewest variables, and proves least.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations._search import Watching
from formulations.flow import ACCURACY, WholeProgram, by_integers, conserved, unit_flow
from formulations.on_graph import Choice, chosen, on_graph
from seqopt.arrays import Floats, Ints
from seqopt.errors import ProblemError
from seqopt.graph.formulation import Formulation, Solution, Watch
from seqopt.graph.graph import Graph, distances
from seqopt.graph.states import States
from seqopt.problem.problem import Aim


class _Assignment(NamedTuple):
    """A candidate for every move: a state on every level but the start.

    ``picks``: 1 for states that are chosen; ``level`` (n,): of every state; ``rules``: one state is
    chosen on every level, and no two that no arc joins.
    """

    picks: cp.Variable
    level: Ints
    rules: list[cp.Constraint]

    def path(self, picks: Floats) -> tuple[int, ...]:
        """Return the path that the largest part of an assignment (n,) takes."""
        levels = range(1, int(self.level.max()) + 1)
        return tuple(int(np.argmax(np.where(self.level == k, picks, -1.0))) for k in levels)


def _assigned(graph: Graph, *, apart: bool) -> _Assignment:
    """Return the assignment of a graph in levels.

    ``apart``: whether pairs that no arc joins are excluded by a constraint each.
    """
    distance = distances(graph, np.ones(len(graph.source)))
    level = np.nan_to_num(distance, posinf=-1).astype(np.int64)
    layered = (level >= 0).all() and (level[graph.target] == level[graph.source] + 1).all()
    if not (layered and (graph.ends == (level == level.max())).all()):
        raise ProblemError(
            "an assignment chooses a state of every level, and paths of this graph pass more or "
            "fewer; take overlap_mip, a flow"
        )
    picks = cp.Variable(graph.states, boolean=True)
    ones = np.ones(graph.states)
    one_each = sparse.csr_array((ones, (level, np.arange(graph.states))))
    rules: list[cp.Constraint] = [cp.Zero(one_each @ picks - np.ones(level.max() + 1))]
    codes = graph.source.astype(np.int64) * graph.states + graph.target
    for k in range(int(level.max()) if apart else 0):
        here, there = np.flatnonzero(level == k), np.flatnonzero(level == k + 1)
        pairs = np.array(np.meshgrid(here, there, indexing="ij")).reshape(2, -1).T
        never = pairs[~np.isin(pairs @ [graph.states, 1], codes)]
        if len(never):
            rules.append(cp.NonNeg(np.ones(len(never)) - _adding(never, graph.states) @ picks))
    return _Assignment(picks, level, rules)


def _adding(pairs: Ints, count: int) -> sparse.csr_array:
    """Return the incidence matrix (p, count) of pairs (p, 2): it sums both ends of each."""
    rows = np.repeat(np.arange(len(pairs)), 2)
    return sparse.csr_array((np.ones(len(rows)), (rows, pairs.ravel())), (len(pairs), count))


def _ends(graph: Graph) -> Ints:
    return np.column_stack([graph.source, graph.target]).astype(np.int64)


def _tight(graph: Graph) -> WholeProgram:
    """Return the assignment whose pairs add up to it in both moves."""
    flow, chosen = unit_flow(graph), _assigned(graph, apart=False)
    pairs = cp.Variable(len(flow.cost), nonneg=True)
    arcs, ones = np.arange(len(flow.cost)), np.ones(len(flow.cost))
    shape = graph.states, len(arcs)
    into = sparse.csr_array((ones, (flow.graph.target, arcs)), shape=shape)
    out = sparse.csr_array((ones, (flow.graph.source, arcs)), shape=shape)
    later, goes_on = np.flatnonzero(chosen.level > 0), np.flatnonzero(~graph.ends)
    rules = [
        *chosen.rules,
        cp.Zero((into @ pairs - chosen.picks)[later]),
        cp.Zero((out @ pairs - chosen.picks)[goes_on]),
    ]
    program = cp.Problem(cp.Minimize(flow.cost @ pairs), rules)
    return WholeProgram(program, chosen.picks, chosen.path, flow.bound)


def _loose(graph: Graph) -> WholeProgram:
    """Return the assignment whose pairs are bounded one by one."""
    chosen = _assigned(graph, apart=True)
    single, extra, least = _split(graph, chosen.level)
    scale = max(float(np.abs(single).max()), float(extra.max(initial=0.0)), 1e-300)
    both = cp.Variable(len(extra), nonneg=True)
    taken = _adding(_ends(graph), graph.states)
    rules = [*chosen.rules, cp.NonNeg(both - taken @ chosen.picks + np.ones(len(extra)))]
    total = single @ chosen.picks / scale + least / scale + extra @ both / scale
    return WholeProgram(
        cp.Problem(cp.Minimize(total), rules), chosen.picks, chosen.path, _below(scale)
    )


def _split(graph: Graph, level: Ints) -> tuple[Floats, Floats, float]:
    """Return costs of states (n,), further costs of arcs (m,) from 0, and the constant term."""
    own = np.zeros(len(graph.source)) if graph.alone is None else graph.alone[:, 0]
    single = np.zeros(graph.states)
    single[graph.target] = own
    extra = graph.amounts[:, 0] - own
    first = graph.source == 0  # the start is no choice: what is shared with it is the state's own
    single[graph.target[first]] += extra[first]
    extra = np.where(first, 0.0, extra)
    least = np.zeros(int(level.max()) + 1)
    np.minimum.at(least, level[graph.target], extra)
    return single, extra - least[level[graph.target]], float(least.sum())


def _epigraph(graph: Graph, *, of_layers: bool) -> WholeProgram:
    """Return the flow with a peak variable above its cost in every layer, or on every arc."""
    flow = unit_flow(graph)
    arcs, peak = cp.Variable(len(flow.cost), boolean=True), cp.Variable(nonneg=True)
    rows = np.arange(len(flow.cost))
    if of_layers:
        rows = _assigned(graph, apart=False).level[flow.graph.source]
    met = sparse.csr_array((flow.cost, (rows, np.arange(len(rows)))))
    rules = [conserved(flow, arcs), cp.NonNeg(peak - met @ arcs)]
    return WholeProgram(cp.Problem(cp.Minimize(peak), rules), arcs, flow.path, flow.bound)


def _big_m(graph: Graph) -> WholeProgram:
    """Return the assignment whose peak is above every pair that is not switched off."""
    chosen, size = _assigned(graph, apart=True), graph.amounts[:, 0]
    scale = float(size.max()) or 1.0
    peak, taken = cp.Variable(nonneg=True), _adding(_ends(graph), graph.states)
    switched_off = np.full(len(size), 2.0) - taken @ chosen.picks
    rules = [*chosen.rules, cp.NonNeg(peak - size / scale + switched_off)]
    program = cp.Problem(cp.Minimize(peak), rules)
    return WholeProgram(program, chosen.picks, chosen.path, _below(scale))


def _below(scale: float) -> Callable[[float], float]:
    """Return the function from a scaled program's value to a lower bound in the unit of costs."""
    return lambda value: scale * (value - ACCURACY * max(abs(value), 1.0))


def _exhibit(
    name: str, summary: str, aim: Aim, write: Callable[[Graph], WholeProgram]
) -> Formulation:
    """Return the formulation of a program that is written for one goal alone, of one kind."""

    def choose(graph: Graph, watch: Watch) -> Choice:
        if graph.peaks != (aim is Aim.PEAK,):
            text = "largest cost" if aim is Aim.PEAK else "sum of costs"
            raise ProblemError(f"{name}: it writes one {text} down alone; take overlap_mip")
        return by_integers(write)(graph, watch)

    def search(problem: States, watch: Watch, tell: Watching) -> Solution:
        if problem.budgets or problem.totals:
            raise ProblemError(f"{name}: it knows neither budgets nor totals; take overlap_mip")
        return chosen(problem, choose, watch, tell, every=True)  # whose levels are whole

    return on_graph(name, summary, choose, aim=aim, search=search)


ASSIGNMENT_TIGHT = _exhibit("assignment_tight", "assignment, tight links", Aim.SUM, _tight)
ASSIGNMENT_LOOSE = _exhibit("assignment_loose", "assignment, loose links", Aim.SUM, _loose)
MINIMAX_LAYER = _exhibit(
    "minimax_layer",
    "worst cost, epigraph per layer",
    Aim.PEAK,
    lambda graph: _epigraph(graph, of_layers=True),
)
MINIMAX_ARC = _exhibit(
    "minimax_arc",
    "worst cost, epigraph per arc",
    Aim.PEAK,
    lambda graph: _epigraph(graph, of_layers=False),
)
MINIMAX_BIG_M = _exhibit("minimax_big_m", "worst cost, big-M", Aim.PEAK, _big_m)
