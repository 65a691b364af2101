r"""The full overlap formulation with budgets by label setting: exact, a path with resources.

.. math::

   \min_{o_1, \dots, o_K} \; \sum_{k=1}^{K} c_k(o_k) + \sum_{k=2}^{K} d_k(o_{k-1}, o_k)
   \quad \text{s.t.} \quad \sum_k a_{bk}(o_{k-1}, o_k) \le B_b \quad \text{for every budget } b.

A label is a choice of the first moves, with what it costs, :math:`C`, and what it takes of the
budgets, :math:`S`. Move by move every label is extended by every candidate :math:`j`, and dropped

- if a label at the same candidate costs no more and takes no more of any budget,
- if what it has taken and the least that the rest takes exceed a budget,
- if it cannot lead to less than the best choice :math:`U` that is known: with the prices
  :math:`\lambda` of the Lagrangian bound and :math:`V_\lambda(j)`, the least priced cost from
  :math:`j` to the end,

.. math::

   C + \lambda^T (S - B) + V_\lambda(j) \ge U .

First few labels are kept at each move, those with the least such bound; that gives a good
:math:`U`. Then more, until none is left out that could lead to less. If there are too many, or time
is over, the least bound of those left out bounds all choices. Without budgets one label per
candidate is left, and this is dynamic programming.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from formulations.layers.priced_paths import (
    ROUNDING,
    Path,
    Priced,
    PricedPaths,
    best_prices,
    priced_paths,
    stopped,
)
from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.formulation import End, Formulation, FormulationKind, Watch
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim

NARROW, WIDER = 256, 16  # labels kept at first, and how many times as many then
AT_ONCE = 2_000_000  # pairs of a label and a candidate that are looked at together
LOOK_BACK = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)  # earlier labels that one is compared with


class _Labels(NamedTuple):
    """Choices of the first moves.

    ``at`` is their last candidate, ``priced`` what they cost with prices, ``cost`` without,
    ``taken`` (n, B), ``back`` the label each came from.
    """

    at: Ints
    priced: Floats
    cost: Floats
    taken: Floats
    back: Ints

    def of(self, rows: Ints | Bools | slice) -> _Labels:
        return _Labels._make(each[rows] for each in self)


class _Ground(NamedTuple):
    """What a pass needs: priced arcs, and the least cost and amounts to the end."""

    paths: PricedPaths
    arcs: list[Floats]
    rest: list[Floats]
    least: list[Floats]
    start: float


def solve(
    problem: PlacementProblem, *, watch: Watch | None = None, most: int = 20_000
) -> Selection:
    """Return the exact optimum within the budgets, or the best choice that was met.

    ``most``: how many labels are kept at a move, from 1; it has stopped early if more were needed.
    Result: with bound and prices. Raises `InfeasibleError` if no choice is allowed, or none is
    within all budgets; `ProblemError`, `NothingFoundError` if ``most`` is below 1, or it had to
    stop before it met any choice within the budgets.
    """
    if most < 1:
        raise ProblemError(f"labels: most is {most}; give a whole number from 1")
    watch = watch or Watch()
    paths = priced_paths(problem)
    priced = best_prices(paths, watch)
    best, bound = _search(paths, priced, most, watch)
    if best is None and bound == np.inf:
        raise InfeasibleError("no choice is within all budgets; raise a bound")
    if best is None:
        said = f"labels was stopped (no choice is below {bound * paths.scale:.6g})"
        return stopped(problem, bound=bound * paths.scale, why=said)
    value = problem.sums.cost(best.choice)
    proven = bound >= best.cost
    bound = value if proven else min(bound * paths.scale, value)
    watch.tell(value, bound)
    end = End.DONE if proven else End.STOPPED
    return Selection(best.choice, value, bound, paths.named(priced.prices), end=end)


def _search(
    paths: PricedPaths, priced: Priced, most: int, watch: Watch
) -> tuple[Path | None, float]:
    """Return the best choice within the budgets, and a bound: infinite where there is none."""
    ground = _ground(paths, priced.prices)
    best, bound = priced.best, priced.bound
    cost = best.cost if best else np.inf
    width = min(NARROW, most)
    while not watch.over:
        met, left = _pass(ground, cost, width, watch)
        if met is not None and met.cost < cost:
            best, cost = met, met.cost
        bound = max(bound, min(left, cost))
        watch.tell(cost * paths.scale, bound * paths.scale)
        if width >= most or bound >= cost:
            break
        width = min(width * WIDER, most)
    return best, bound


def _ground(paths: PricedPaths, prices: Floats) -> _Ground:
    arcs, rest = paths.to_go(prices)
    least = [np.zeros((len(paths.caps), paths.arcs[-1].shape[1]))]
    for arc, amounts in zip(paths.arcs[::-1], paths.amounts[::-1], strict=True):
        takes = np.where(np.isfinite(arc), amounts + least[0][:, None, :], np.inf)
        least.insert(0, takes.min(axis=2))
    return _Ground(paths, arcs, rest, least, -float(prices @ paths.caps))


def _pass(ground: _Ground, limit: float, width: int, watch: Watch) -> tuple[Path | None, float]:
    """Return the best choice that a number of labels leads to, and the least bound left out."""
    paths = ground.paths
    none = np.zeros(1, dtype=np.int64)
    now = _Labels(none, np.array([ground.start]), np.zeros(1), np.zeros((1, len(paths.caps))), none)
    kept: list[_Labels] = []
    left = np.inf
    for k in range(len(paths.arcs)):
        if watch.over:
            return None, -np.inf
        now, out = _narrowed(ground, k, _extended(ground, k, now, limit), 4 * width)
        now, more = _narrowed(ground, k, _undominated(now), width)
        left = min(left, out, more)
        if not len(now.at):
            return None, left
        kept.append(now)
    choice, row = [], int(np.argmin(now.cost))
    for labels in reversed(kept):
        choice.append(int(labels.at[row]))
        row = int(labels.back[row])
    return paths.path(choice[::-1]), left


def _extended(ground: _Ground, k: int, now: _Labels, limit: float) -> _Labels:
    """Return the labels of the next move that may lead to less than a limit, within the budgets."""
    parts = zip(*_extensions(ground, k, now, limit), strict=True)
    return _Labels._make(map(np.concatenate, parts))


def _extensions(ground: _Ground, k: int, now: _Labels, limit: float) -> Iterator[_Labels]:
    paths = ground.paths
    arc, amounts, priced = paths.arcs[k], paths.amounts[k], ground.arcs[k]
    tight = limit - ROUNDING * max(abs(limit), 1.0) if np.isfinite(limit) else limit
    size = max(1, AT_ONCE // arc.shape[1])
    for start in range(0, len(now.at), size):
        part = now.of(slice(start, start + size))
        whole = part.priced[:, None] + priced[part.at]
        row, to = np.nonzero(whole + ground.rest[k + 1] < tight)
        at = part.at[row]
        taken = part.taken[row] + amounts[:, at, to].T
        fits = (taken + ground.least[k + 1][:, to].T <= paths.caps).all(axis=1)
        row, to, at, taken = row[fits], to[fits], at[fits], taken[fits]
        yield _Labels(to, whole[row, to], part.cost[row] + arc[at, to], taken, row + start)


def _narrowed(ground: _Ground, k: int, labels: _Labels, width: int) -> tuple[_Labels, float]:
    """Return the labels with the least bounds, and the least bound of the others."""
    if len(labels.at) <= width:
        return labels, np.inf
    bounds = labels.priced + ground.rest[k + 1][labels.at]
    order = np.argpartition(bounds, width)
    return labels.of(np.sort(order[:width])), float(bounds[order[width]])


def _undominated(labels: _Labels) -> _Labels:
    """Return labels without those that another at the same candidate beats in everything.

    Not every such label is found; with one budget all are.
    """
    ordered = labels.of(np.lexsort((*labels.taken.T[::-1], labels.cost, labels.at)))
    at, taken = ordered.at, ordered.taken
    if taken.shape[1] == 1:
        return ordered.of(~_beaten(at, taken[:, 0]))
    beaten = np.zeros(len(at), dtype=bool)
    for back in LOOK_BACK:
        beaten[back:] |= (at[back:] == at[:-back]) & (taken[:-back] <= taken[back:]).all(axis=1)
    return ordered.of(~beaten)


def _beaten(at: Ints, taken: Floats) -> Bools:
    """Return where an earlier label at the same candidate takes no more of the one budget."""
    new = np.ones(len(at), dtype=bool)
    new[1:] = at[1:] != at[:-1]
    apart = (taken.max(initial=0.0) - taken.min(initial=0.0) + 1.0) * (np.cumsum(new) - 1)
    lowest = np.minimum.accumulate(taken - apart)  # every candidate lies below the one before
    out = np.zeros(len(at), dtype=bool)
    out[1:] = ~new[1:] & (taken[1:] - apart[1:] >= lowest[:-1])
    return out


FORMULATION = Formulation(
    "labels",
    "full overlap, labels within budgets",
    FormulationKind.EXACT,
    Aim.SUM,
    solve,
    takes_budgets=True,
)
