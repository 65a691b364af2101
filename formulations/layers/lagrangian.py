r"""The full overlap formulation with budgets, relaxed: every budget has a price (Lagrangian bound).

.. math::

   \max_{\lambda \ge 0} \; L(\lambda), \qquad
   L(\lambda) = \min_{o_1, \dots, o_K} \; \sum_{k=1}^{K} c_k(o_k) + \sum_{k=2}^{K} d_k(o_{k-1}, o_k)
   + \sum_b \lambda_b \Bigl( \sum_k a_{bk}(o_{k-1}, o_k) - B_b \Bigr)

with the amounts :math:`a` that pairs take of budgets of :math:`B`. At fixed prices :math:`\lambda`
this is a shortest path, which dynamic programming finds. :math:`L` is concave and made of planes,
one for every choice; cutting planes find its highest point,

.. math::

   \max_{\lambda \ge 0, \, \theta} \; \theta \quad \text{s.t.} \quad
   \theta \le c(o) + \sum_b \lambda_b \left( a_b(o) - B_b \right)
   \quad \text{for every choice } o \text{ met so far.}

Its height is a bound on what any choice within the budgets costs, the same as that of the linear
program, and the prices are its duals. The choice is the cheapest within the budgets among those met
and those that follow one of them up to some move and another one from there on; it need not be the
best. Without budgets it is the optimum.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from formulations.layers.priced_paths import Path, PricedPaths, best_prices, priced_paths, stopped
from seqopt.arrays import Floats
from seqopt.graph.formulation import End, Formulation, FormulationKind, Watch
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim

MIXED = 12  # choices that are followed by turns: those that cost least at the best prices
ROUNDS = 3  # of doing so


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return the best choice that was met, with bound and prices.

    Raises `InfeasibleError` if no choice is allowed, or prices prove that none is within all
    budgets; `NothingFoundError` if no choice within the budgets was met; there may be one.
    """
    watch = watch or Watch()
    paths = priced_paths(problem)
    priced = best_prices(paths, watch)
    best = priced.best
    if len(paths.caps):
        met = _mixed(paths, priced.paths, priced.prices, watch)
        best = min((p for p in met if p.within), key=lambda path: path.cost, default=None)
    bound = priced.bound * paths.scale
    if best is None:
        said = f"lagrangian looked at few choices (none is below {bound:.6g}); labels looks at all;"
        return stopped(problem, bound=bound, why=f"{said} it ended")
    value = problem.sums.cost(best.choice)
    watch.tell(value, bound)
    end = End.STOPPED if watch.over else End.DONE
    return Selection(best.choice, value, min(bound, value), paths.named(priced.prices), end=end)


def _mixed(paths: PricedPaths, met: Sequence[Path], prices: Floats, watch: Watch) -> list[Path]:
    """Return choices with those that follow one of them first and another one then."""

    def worth(path: Path) -> tuple[bool, float]:
        fine = 0.0 if path.within else 10 * float(prices @ np.maximum(path.over, 0.0))
        return not path.within, path.cost + fine

    pool = {path.choice: path for path in met}
    for _ in range(ROUNDS):
        chosen = sorted(pool.values(), key=worth)[:MIXED]
        for first, second in permutations(chosen, 2):
            if watch.over:
                return list(pool.values())
            pool |= {path.choice: path for path in _followed(paths, first, second)}
    return list(pool.values())


def _followed(paths: PricedPaths, first: Path, second: Path) -> Iterator[Path]:
    """Yield the best way to follow one choice up to a move and another one from there on, if any.

    That is the cheapest within the budgets, or else the one that exceeds them least.
    """
    begun, ended = _totals(paths, first.choice), _totals(paths, second.choice)
    moves = range(1, len(first.choice))
    link = np.array([_taken(paths, k, first.choice[k - 1], second.choice[k]) for k in moves])
    if not len(link):
        return
    total = begun[:-1] + link + (ended[-1] - ended[1:])
    over = np.maximum(total[:, 1:] - paths.caps, 0.0).sum(axis=1)
    over[~np.isfinite(total[:, 0])] = np.inf
    within = over <= 0
    best = np.argmin(np.where(within, total[:, 0], np.inf) if within.any() else over)
    if np.isfinite(over[best]):
        yield paths.path((*first.choice[: best + 1], *second.choice[best + 1 :]))


def _totals(paths: PricedPaths, choice: Sequence[int]) -> Floats:
    """Return cost and amounts up to every move, (K, 1 + B)."""
    pairs = zip((0, *choice[:-1]), choice, strict=True)
    return np.cumsum([_taken(paths, k, i, j) for k, (i, j) in enumerate(pairs)], axis=0)


def _taken(paths: PricedPaths, k: int, i: int, j: int) -> list[float]:
    """Return what a pair costs and takes."""
    return [paths.arcs[k][i, j], *paths.amounts[k][:, i, j]]


FORMULATION = Formulation(
    "lagrangian",
    "full overlap, prices for budgets",
    FormulationKind.BOUND,
    Aim.SUM,
    solve,
    takes_budgets=True,
)
