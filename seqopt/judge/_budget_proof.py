"""How little any choice within budgets can cost: the certificate's own proof.

It shares nothing with the formulations that it judges. Prices are climbed by subgradients from
those that are claimed, if any; each proves a bound, the least priced cost of any choice, found
forward. Then choices are laid down from the last move back to the first. One is dropped that cannot
cost less than the answer, or exceeds a budget, or is beaten in everything by another from the same
candidate on. If none is left the answer is the best; if too many are, the least bound of those left
aside holds for all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import InfeasibleError
from seqopt.graph.layers.costs import TINY, Budget
from seqopt.graph.layers.interface import PlacementProblem

CLIMBS = 80  # prices that are tried
PATIENCE = 4  # tries without a better bound after which steps are halved
MOST = 5_000  # partial choices that are kept at a move
SLACK = 1e-9  # of a budget or a cost: what sums are off by; budgets have as much more
EPS = float(np.finfo(float).eps)
PAIRS = 1_000_000  # that are looked at together
NEIGHBORS = (1, 2, 3, 5, 8, 13, 21, 34)  # with which a partial choice is compared


@dataclass(frozen=True, eq=False)
class _Case:
    """What is judged: costs and amounts of pairs by move, what there is, what counts as equal."""

    arcs: list[Floats]
    takes: list[Floats]  # (B, C_{k-1}, C_k), over what there is
    caps: Floats
    value: float
    scale: float

    def priced(self, prices: Floats) -> list[Floats]:
        """Return what pairs cost with what they pay."""
        return [
            arc + np.einsum("b,bij->ij", prices, takes)
            for arc, takes in zip(self.arcs, self.takes, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class _Parts:
    """Choices of the last moves: their first candidate, priced and plain cost, what they take.

    And a bound on what any choice that ends so costs.
    """

    at: Ints
    behind: Floats
    cost: Floats
    taken: Floats
    bound: Floats

    def of(self, rows: Ints | Bools) -> _Parts:
        """Return some of them."""
        return _Parts(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def too_small(budget: Budget, least: float) -> InfeasibleError:
    """Return the error that says that every choice takes more of a budget than there is."""
    return InfeasibleError(
        f"no choice is within all budgets: every choice uses at least {least:.6g} of "
        f"{budget.name!r}, more than {budget.bound:.6g}; raise that bound"
    )


def least_within(
    problem: PlacementProblem, value: float, claimed: Mapping[str, float], scale: float
) -> float:
    """Return a bound on what any choice within the budgets costs.

    ``problem``: its sums and budgets are used; ``value``: of a choice within the budgets; no higher
    bound is looked for; ``claimed``: prices of budgets from which the search for better ones
    starts; it need not name any; ``scale``: the size of the costs that the choice meets. Result: at
    most ``value``.
    """
    case, given = _case(problem, value, claimed, scale)
    prices, bound = _climbed(case, given)
    if value - bound > SLACK * scale:
        bound = max(bound, _laid_down(case, prices)[0])
    return value if value - bound <= SLACK * scale else bound


def is_kept(problem: PlacementProblem) -> bool:
    """Return whether a choice is found that keeps all budgets; costs say which are allowed."""
    case, prices = _case(problem, 1.0, {}, 1.0)
    return _laid_down(case, np.zeros_like(prices))[1]


def _case(
    problem: PlacementProblem, value: float, claimed: Mapping[str, float], scale: float
) -> tuple[_Case, Floats]:
    """Return what is judged, and the claimed prices in its units."""
    budgets = [budget for budget in problem.budgets if np.isfinite(budget.bound)]
    sizes = np.array([_size(budget) for budget in budgets])
    arcs, amounts = problem.sums.arcs(), [budget.amounts.arcs() for budget in budgets]
    takes = []
    for k, arc in enumerate(arcs):
        parts = [each[k] / size for each, size in zip(amounts, sizes, strict=True)]
        takes.append(np.array(parts).reshape(len(parts), *arc.shape))
    caps = np.array([budget.bound for budget in budgets]) / sizes + SLACK
    prices = np.array([claimed.get(budget.name, 0.0) for budget in budgets]) * sizes
    usable = np.where(np.isfinite(prices), np.maximum(prices, 0.0), 0.0)
    return _Case(arcs, takes, caps, value, scale), usable


def _size(budget: Budget) -> float:
    """Return by what the amounts of a budget are divided: its bound, or the largest of them."""
    parts = (*budget.single, *budget.shared)
    return max(abs(budget.bound), TINY, *(float(np.abs(part).max()) for part in parts))


def _climbed(case: _Case, prices: Floats) -> tuple[Floats, float]:
    """Return the best prices that were met on the way up, and the bound that they prove."""
    best, bound, pace, waited = prices, -np.inf, 1.0, 0
    now = prices
    for _ in range(CLIMBS):
        found, slope = _least(case, now)
        if found > bound:
            best, bound, waited = now, found, 0
        else:
            waited += 1
        if waited >= PATIENCE:
            now, pace, waited = best, 0.5 * pace, 0
            found, slope = _least(case, now)
        uphill = np.where((now <= 0) & (slope < 0), 0.0, slope)
        if case.value - bound <= SLACK * case.scale or not uphill.any():
            break
        now = np.maximum(now + pace * (case.value - found) / (uphill @ uphill) * uphill, 0.0)
    return best, bound - SLACK**1.5 * case.scale


def _least(case: _Case, prices: Floats) -> tuple[float, Floats]:
    """Return the least priced cost of any choice, and by how much that choice exceeds budgets."""
    reached, came = np.zeros(1), []
    for arc in case.priced(prices):
        through = reached[:, None] + arc
        came.append(through.argmin(axis=0))
        reached = through.min(axis=0)
    at = int(reached.argmin())
    rounding = EPS * (len(came) + 1) ** 2 * prices @ (1 + np.abs(case.caps))
    least = float(reached[at] - prices @ case.caps - rounding)
    over = -case.caps.copy()
    for takes, best in zip(reversed(case.takes), reversed(came), strict=True):
        over += takes[:, best[at], at]
        at = int(best[at])
    return least, over


def _laid_down(case: _Case, prices: Floats) -> tuple[float, bool]:
    """Return the least that a choice within the budgets costs, or bounds it, from the end back.

    And whether one was found that costs less than the answer.
    """
    arcs = case.priced(prices)
    begun = [np.array([-float(prices @ case.caps)])]
    for arc in arcs:
        begun.append((begun[-1][:, None] + arc).min(axis=0))
    ends = np.arange(len(begun[-1]))
    zero = np.zeros(len(ends))
    now = _Parts(ends, zero, zero, np.zeros((len(ends), len(case.caps))), zero)
    spared, aside = _spared(case), np.inf
    for k in range(len(arcs) - 1, -1, -1):
        row, to, bound = _kept(case, arcs[k], begun[k], now)
        end = now.at[row]
        taken = now.taken[row] + case.takes[k][:, to, end].T
        behind = now.behind[row] + arcs[k][to, end]
        now = _Parts(to, behind, now.cost[row] + case.arcs[k][to, end], taken, bound)
        fits = taken + spared[k][:, to].T <= case.caps
        now = now.of(np.asarray(fits.all(axis=1)))
        now = now.of(_unbeaten(now.at, now.cost, now.taken))
        if len(now.at) > MOST:
            order = np.argsort(now.bound, kind="stable")
            aside = min(aside, float(now.bound[order[MOST]]))
            now = now.of(order[:MOST])
    return min(aside, float(now.cost.min(initial=case.value))), len(now.at) > 0


def _kept(case: _Case, arc: Floats, begun: Floats, now: _Parts) -> tuple[Ints, Ints, Floats]:
    """Return which partial choices go on to which candidate before them, and their bounds."""
    rows, tos, bounds = [], [], []
    size = max(1, PAIRS // len(begun))
    for start in range(0, max(len(now.at), 1), size):
        part = slice(start, start + size)
        whole = now.behind[part, None] + arc[:, now.at[part]].T + begun
        row, to = np.nonzero(whole < case.value - SLACK * case.scale)
        rows.append(row + start)
        tos.append(to)
        bounds.append(whole[row, to])
    return np.concatenate(rows), np.concatenate(tos), np.concatenate(bounds)


def _spared(case: _Case) -> list[Floats]:
    """Return the least that is taken of each budget up to every candidate, move by move."""
    out = [np.zeros((len(case.caps), 1))]
    for arc, takes in zip(case.arcs, case.takes, strict=True):
        possible = np.where(np.isfinite(arc), takes, np.inf)
        out.append((out[-1][:, :, None] + possible).min(axis=1))
    return out


def _unbeaten(at: Ints, cost: Floats, taken: Floats) -> Bools:
    """Return which partial choices none is found to beat in cost and in all budgets."""
    order = np.lexsort((taken.sum(axis=1), cost, at))
    at, cost, taken = at[order], cost[order], taken[order]
    good = np.ones(len(at), dtype=bool)
    for n in NEIGHBORS:
        if n < len(at):
            beats = (taken[:-n] <= taken[n:]).all(axis=1) & (cost[:-n] <= cost[n:])
            good[n:] &= ~(beats & (at[:-n] == at[n:]))
    out = np.zeros(len(at), dtype=bool)
    out[order] = good
    return out
