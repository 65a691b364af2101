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

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.layers.priced_paths import ACCURACY, LayeredFlow, layered_flow
from formulations.whole_program import WholeProgram, integer_program
from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.interface import CostProblem, PlacementProblem
from seqopt.problem.problem import Aim


def _tight(problem: PlacementProblem) -> WholeProgram:
    """Return the assignment whose pairs add up to it in both moves."""
    flow, sizes = layered_flow(problem), problem.sums.sizes
    picks, rules = _assignment(sizes)
    pairs = cp.Variable(len(flow.cost), nonneg=True)
    out, into = (_adding(ends[None], sum(sizes)).T for ends in _ends(flow.allowed))
    rules.append(cp.Zero(into @ pairs - picks))
    if continued := sum(sizes[:-1]):
        rules.append(cp.Zero(out[:continued] @ pairs - picks[:continued]))
    program = cp.Problem(cp.Minimize(flow.cost @ pairs), rules)
    return WholeProgram(program, picks, _largest_of_each(sizes), flow.bound)


def _loose(problem: PlacementProblem) -> WholeProgram:
    """Return the assignment whose pairs are bounded one by one."""
    costs = problem.sums
    costs.continuable()
    single = np.concatenate([costs.single[0] + costs.shared[0][0], *costs.single[1:]])
    never = ~np.isfinite(single)
    single[never] = 0.0
    allowed = [np.isfinite(part) for part in costs.shared[1:]]
    least = [min(0.0, float(part.min())) for part in costs.shared[1:]]
    pairs = zip(costs.shared[1:], allowed, least, strict=True)
    extra = np.concatenate([np.zeros(0), *(part[mask] - low for part, mask, low in pairs)])
    scale = max(float(np.abs(single).max()), float(extra.max(initial=0.0)), 1e-300)
    picks, rules = _assignment(costs.sizes, allowed, never)
    total = single @ picks / scale + sum(least) / scale
    if len(extra):
        both = cp.Variable(len(extra), nonneg=True)
        taken = _adding(_ends([np.zeros((1, costs.sizes[0]), dtype=bool), *allowed]), len(single))
        rules.append(cp.NonNeg(both - taken @ picks + np.ones(len(extra))))
        total = total + extra @ both / scale
    program = cp.Problem(cp.Minimize(total), rules)
    return WholeProgram(program, picks, _largest_of_each(costs.sizes), below(scale))


def _epigraph(problem: PlacementProblem, *, of_layers: bool) -> WholeProgram:
    """Return the flow whose peak is above what it costs in every layer, or on every arc."""
    flow, bound = _flow_of_peaks(problem)
    arcs, peak = cp.Variable(len(flow.cost), boolean=True), cp.Variable(nonneg=True)
    rows = np.arange(len(flow.cost))
    if of_layers:
        rows = np.repeat(np.arange(len(flow.allowed)), [mask.sum() for mask in flow.allowed])
    met = sparse.csr_array((flow.cost, (rows, np.arange(len(rows)))))
    rules = [cp.Zero(flow.balance @ arcs - flow.source), cp.NonNeg(peak - met @ arcs)]
    return WholeProgram(cp.Problem(cp.Minimize(peak), rules), arcs, flow.choice, bound)


def _big_m(problem: PlacementProblem) -> WholeProgram:
    """Return the assignment whose peak is above every pair that is not switched off."""
    costs = problem.peaks
    costs.continuable()
    worst, least = _worst_pairs(costs)
    allowed = [np.isfinite(part) for part in worst]
    size = np.concatenate([p[mask] for p, mask in zip(worst, allowed, strict=True)]) - least
    scale = float(size.max()) or 1.0
    never = np.zeros(sum(costs.sizes), dtype=bool)
    never[: costs.sizes[0]] = ~allowed[0][0]
    picks, rules = _assignment(costs.sizes, allowed[1:], never)
    peak = cp.Variable(nonneg=True)
    taken = _adding(_ends(allowed), len(never))
    switched_off = taken.sum(axis=1) - taken @ picks  # zero where all of a pair are taken
    rules.append(cp.NonNeg(peak - size / scale + switched_off))
    program = cp.Problem(cp.Minimize(peak), rules)
    return WholeProgram(program, picks, _largest_of_each(costs.sizes), below(scale, least))


def _assignment(
    sizes: Sequence[int], allowed: Sequence[Bools] = (), never: Bools | None = None
) -> tuple[cp.Variable, list[cp.Constraint]]:
    """Return an assignment, one candidate for every move, and what it keeps.

    ``allowed``: which pairs are, from the second move on; ``never`` (n,): candidates that are not.
    """
    count = sum(sizes)
    picks = cp.Variable(count, boolean=True)
    moves = np.repeat(np.arange(len(sizes)), sizes)
    one_each = sparse.csr_array((np.ones(count), (moves, np.arange(count))))
    rules = [cp.Zero(one_each @ picks - np.ones(len(sizes)))]
    first = np.zeros((1, sizes[0]), dtype=bool)
    apart = _adding(_ends([first, *(~mask for mask in allowed)]), count)
    if apart.shape[0]:
        rules.append(cp.NonNeg(np.ones(apart.shape[0]) - apart @ picks))
    if never is not None and never.any():
        rules.append(cp.Zero(picks[np.flatnonzero(never)]))
    return picks, rules


def _ends(masks: Sequence[Bools]) -> Ints:
    """Return the candidates of every pair in masks of all moves (2, P), numbered through.

    Pairs of the first move begin at -1, the source.
    """
    starts = np.cumsum([0, *(mask.shape[1] for mask in masks)])
    after = pairwise([-1, *starts[:-1]])
    found = [
        np.add(np.nonzero(mask), np.reshape(at, (2, 1)))
        for mask, at in zip(masks, after, strict=True)
    ]
    return np.concatenate(found, axis=1)


def _adding(ends: Ints, count: int) -> sparse.csr_array:
    """Return what adds up the assignments at the ends of pairs (P, count); the source has none."""
    end, pair = np.nonzero(ends >= 0)
    shape = (ends.shape[1], count)
    return sparse.csr_array((np.ones(len(pair)), (pair, ends[end, pair])), shape=shape)


def _largest_of_each(sizes: Sequence[int]) -> Callable[[Floats], tuple[int, ...]]:
    """Return what reads a choice from assignments of so many candidates of every move."""
    ends = np.cumsum(sizes)[:-1]
    return lambda picks: tuple(int(np.argmax(part)) for part in np.split(picks, ends))


def below(scale: float, least: float = 0.0) -> Callable[[float], float]:
    """Return what makes a bound of a program's value, ``least`` off and divided by a scale."""
    return lambda value: least + scale * (value - ACCURACY * max(abs(value), 1.0))


def _worst_pairs(costs: LayeredCosts) -> tuple[list[Floats], float]:
    """Return the worst cost of every pair of every move (C_k-1, C_k), and their least below 0."""
    worst = [np.maximum(d, c) for d, c in zip(costs.shared, costs.single, strict=True)]
    return worst, min(0.0, *(float(part.min()) for part in worst))


def _flow_of_peaks(problem: PlacementProblem) -> tuple[LayeredFlow, Callable[[float], float]]:
    """Return the flow whose arcs cost the worst of every pair, none below zero, and its bound."""
    worst, least = _worst_pairs(problem.peaks)
    nothing = tuple(np.zeros(size) for size in problem.peaks.sizes)
    flow = layered_flow(CostProblem(LayeredCosts(nothing, tuple(p - least for p in worst))))
    return flow, lambda value: least + flow.bound(value)


ASSIGNMENT_TIGHT = integer_program("assignment_tight", "assignment, tight links", Aim.SUM, _tight)
ASSIGNMENT_LOOSE = integer_program("assignment_loose", "assignment, loose links", Aim.SUM, _loose)
MINIMAX_LAYER = integer_program(
    "minimax_layer", "worst cost, epigraph per layer", Aim.PEAK, partial(_epigraph, of_layers=True)
)
MINIMAX_ARC = integer_program(
    "minimax_arc", "worst cost, epigraph per arc", Aim.PEAK, partial(_epigraph, of_layers=False)
)
MINIMAX_BIG_M = integer_program("minimax_big_m", "worst cost, big-M", Aim.PEAK, _big_m)
