r"""Choices as paths whose arcs pay for what they take of budgets, as arrays for any formulation.

At prices :math:`\lambda \ge 0` a choice :math:`o` costs :math:`c(o) + \lambda^T (a(o) - b)`, where
:math:`a` is what it takes of the budgets and :math:`b` what there is. Without the budgets that is a
shortest path, and its length is a bound on what any choice within the budgets costs. Costs and
amounts are scaled to order one, costs by a power of two so that nothing is rounded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from seqopt.arrays import Bools, Floats, FrozenValue
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, SolverError, TimeUpError
from seqopt.graph.formulation import End, Watch
from seqopt.graph.layers.costs import (
    TINY,
    Budget,
    LayeredCosts,
    _least_path,
    _least_to_go,
    _where_allowed,
)
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.judge._budget_proof import too_small
from seqopt.judge.certificate import TOLERANCE, least_sum
from seqopt.problem.problem import Aim

ACCURACY = 1e-7  # how far a reported optimum may lie above the true one, relative to the larger of
# it and the largest cost


@dataclass(frozen=True, eq=False, repr=False)
class LayeredFlow(FrozenValue):
    """A unit flow over the A allowed arcs of a problem.

    ``cost`` (A,): of every arc, its end included, over ``scale``; ``scale``: the largest cost;
    ``balance`` ((R, A) sparse): what leaves the source (row 0) and every candidate except those of
    the last move, less what arrives; ``source`` (R,): what must be left over: 1 at the source;
    ``amounts`` (tuple of (A,) float): what every arc takes of each budget, over the budget's unit;
    ``caps``: how much there is of each budget, in its unit; ``units``: the power of ten by which
    the amounts of each budget are divided; ``names``: of the budgets; ``allowed`` (tuple of
    (C_{k-1}, C_k) bool): which pairs have an arc, move by move; ``feasible``: whether a choice is
    known to be within all budgets.
    """

    cost: Floats
    scale: float
    balance: sparse.csr_array
    source: Floats
    amounts: tuple[Floats, ...]
    caps: tuple[float, ...]
    units: tuple[float, ...]
    names: tuple[str, ...]
    allowed: tuple[Bools, ...]
    feasible: bool

    def choice(self, flow: Floats) -> tuple[int, ...]:
        """Return the choice that the largest part of a flow takes.

        Where costs tie an interior-point flow is a mixture; every arc it uses lies on an optimal
        path.

        ``flow`` (A,): of every arc, from 0 to 1. Result: a candidate for every move.
        """
        ends = np.cumsum([mask.sum() for mask in self.allowed])[:-1]
        now = 0
        out = []
        for mask, part in zip(self.allowed, np.split(flow, ends), strict=True):
            arcs = np.zeros(mask.shape)
            arcs[mask] = part
            now = int(arcs[now].argmax())
            out.append(now)
        return tuple(out)

    def bound(self, optimum: float) -> float:
        """Return a lower bound on the cost of any choice.

        ``optimum``: a solver's, in scaled costs. Result: in the unit of the costs; lower by what
        the solver may be off.
        """
        value = optimum * self.scale
        return value - ACCURACY * max(abs(value), self.scale)

    def prices(self, duals: Sequence[float]) -> dict[str, float]:
        """Return what one more unit of each budget would save, by duals of the scaled caps."""
        pairs = zip(self.names, self.units, duals, strict=True)
        return {name: float(self.scale / unit * dual) for name, unit, dual in pairs}


def layered_flow(problem: PlacementProblem) -> LayeredFlow:
    """Return the flow of a problem.

    ``problem``: its sums and budgets are used. Raises `InfeasibleError` if no choice is allowed, or
    none is within one of the budgets; `ProblemError` if a budget is not for the moves and
    candidates of the problem.
    """
    costs, budgets = problem.sums, problem.budgets
    costs.continuable()
    feasible = _within_each(problem)
    allowed = tuple(np.isfinite(arc) for arc in costs.arcs())
    cost = _of_allowed(costs, allowed)
    scale = max(float(np.abs(cost).max()), TINY)
    balance, source = _balance(costs, allowed)
    amounts = [_of_allowed(budget.amounts, allowed) for budget in budgets]
    units = [_unit_flow(amount) for amount in amounts]
    return LayeredFlow(
        cost=cost / scale,
        scale=scale,
        balance=balance,
        source=source,
        amounts=tuple(a / unit for a, unit in zip(amounts, units, strict=True)),
        caps=tuple(b.bound / unit for b, unit in zip(budgets, units, strict=True)),
        units=tuple(units),
        names=tuple(budget.name for budget in budgets),
        allowed=allowed,
        feasible=feasible,
    )


def _within_each(problem: PlacementProblem) -> bool:
    """Return whether a choice is known to be within all budgets; each is tried on its own.

    Raises `InfeasibleError` if no choice is within one of them; `ProblemError` if one is not for
    the moves and candidates of the problem.
    """
    known = True
    for budget in problem.budgets:
        if budget.amounts.sizes != problem.sums.sizes:
            raise ProblemError(f"budget {budget.name!r} is for other moves or candidates")
        least = least_sum(_where_allowed(problem.sums, budget))
        sizes = sum(float(np.abs(a).max()) for a in (*budget.single, *budget.shared))
        if least > budget.bound + TOLERANCE * sizes:
            raise too_small(budget, least)
        known = known and len(problem.budgets) == 1 and least <= budget.bound
    return known


def _balance(costs: LayeredCosts, allowed: Sequence[Bools]) -> tuple[sparse.csr_array, Floats]:
    """Return matrix and right side that conserve the unit."""
    starts = np.cumsum([0, 1, *costs.sizes])
    ends = [np.nonzero(mask) for mask in allowed]
    out = np.concatenate([at + first for at, (first, _) in zip(starts, ends, strict=False)])
    into = np.concatenate([at + last for at, (_, last) in zip(starts[1:], ends, strict=False)])
    size, arcs = int(starts[len(allowed)]), np.arange(len(out))
    onward = into < size  # nothing is left over at the last move
    rows = np.concatenate([out, into[onward]]), np.concatenate([arcs, arcs[onward]])
    signs = np.repeat([1.0, -1.0], [len(out), onward.sum()])
    return sparse.csr_array((signs, rows), shape=(size, len(out))), np.eye(1, size).ravel()


def _of_allowed(costs: LayeredCosts, allowed: Sequence[Bools]) -> Floats:
    """Return what all arcs that are allowed cost, one after the other."""
    return np.concatenate([arc[mask] for arc, mask in zip(costs.arcs(), allowed, strict=True)])


def _unit_flow(amounts: Floats) -> float:
    """Return the power of ten just below the largest amount, or 1 if all are zero."""
    largest = float(np.abs(amounts).max())
    return float(10.0 ** math.floor(math.log10(largest))) if largest else 1.0


def stopped(
    problem: PlacementProblem, aim: Aim = Aim.SUM, bound: float = -np.inf, why: str = ""
) -> Selection:
    """Return an allowed choice that took no search, with a bound that took none.

    ``aim``: what to minimize; ``bound``: a better one that is known; ``why``: what to say where no
    choice within the budgets is at hand. Result: with the cheapest candidate of each move that
    leads on; where budgets forbid it, with the choice that takes least of one of them. Raises
    `InfeasibleError` if no choice is allowed; `TimeUpError`, or `NothingFoundError` with a reason,
    if none of these is within all budgets.
    """
    costs = aim.costs(problem)
    for choice in _choices(problem, costs):
        if all(budget.slack(choice) >= 0 for budget in problem.budgets):
            value = aim.value_of(costs, choice)
            return Selection(choice, value, max(bound, _at_least(costs, aim)), end=End.STOPPED)
    known = f" (no choice is below {bound:.6g})" if np.isfinite(bound) else ""
    if why:
        raise NothingFoundError(
            f"{why} before any choice within all budgets was found; give it more time"
        )
    raise TimeUpError(f"no choice within all budgets was found yet{known}; give more")


def _at_least(costs: LayeredCosts, aim: Aim) -> float:
    """Return what each move costs at least, together: a bound that takes no search."""
    if aim is Aim.SUM:
        return sum(float(arc.min()) for arc in costs.arcs())
    return max(float(part.min()) for part in (*costs.single, *costs.shared))


def move_by_move(
    costs: LayeredCosts, charged: Callable[[int, int], Floats], watch: Watch
) -> tuple[int, ...] | None:
    """Return the choice that takes what is cheapest now and leads on; None if time is over.

    ``charged``: returns what a move's candidates (C_k,) answer for beside the steps in which it
    alone is open, by move and candidate before, 0 before the first.
    """
    good, choice = costs.continuable(), [0]
    for k, (single, shared) in enumerate(zip(costs.single, costs.shared, strict=True)):
        if watch.over:
            return None
        possible = good[k] & np.isfinite(shared[choice[-1]])
        choice.append(int(np.argmin(np.where(possible, single + charged(k, choice[-1]), np.inf))))
    return tuple(choice[1:])


def conditional(problem: PlacementProblem, move: int, before: int) -> Floats:
    """Return the costs of the steps that a move shares with the one before, if any, (C_k,)."""
    return problem.conditional(move, before) if move else problem.sums.shared[0][0]


def _choices(problem: PlacementProblem, costs: LayeredCosts) -> Iterator[tuple[int, ...]]:
    """Yield the cheapest way on, and the ways that take least of each budget."""
    choice = move_by_move(costs, lambda k, before: costs.shared[k][before], Watch())
    assert choice is not None  # there is no time limit
    yield choice
    for budget in problem.budgets:
        arcs = _where_allowed(costs, budget).arcs()
        yield _least_path(arcs, _least_to_go(arcs))


ROUNDING = 1e-9  # of a budget or a cost: within this, sums are equal; budgets have as much more
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Path:
    """A choice, what it costs and what it takes.

    ``choice``: a candidate for every move; ``cost``: scaled; ``over`` (B,): what it takes of every
    budget, less its cap; scaled.
    """

    choice: tuple[int, ...]
    cost: float
    over: Floats

    @property
    def within(self) -> bool:
        """Whether it keeps all budgets."""
        return bool((self.over <= 0).all())


@dataclass(frozen=True, eq=False)
class PricedPaths:
    """The paths through the candidates of all moves.

    ``arcs`` (tuple of (C_{k-1}, C_k) float): cost of every pair with its end, over ``scale``;
    ``amounts`` (tuple of (B, C_{k-1}, C_k) float): what it takes of every budget that has a bound,
    over the budget's unit; ``caps`` (B,): how much there is of each, in its unit, and what sums may
    be off by; ``scale``: by which costs are divided; ``units`` (B,): by which amounts are;
    ``names``: of the budgets.
    """

    arcs: tuple[Floats, ...]
    amounts: tuple[Floats, ...]
    caps: Floats
    scale: float
    units: Floats
    names: tuple[str, ...]

    def path(self, choice: Sequence[int]) -> Path:
        """Return a choice, a candidate for every move, with what it costs and takes."""
        pairs = list(zip((0, *choice[:-1]), choice, strict=True))
        cost = sum(float(arc[pair]) for arc, pair in zip(self.arcs, pairs, strict=True))
        taken = sum(a[:, i, j] for a, (i, j) in zip(self.amounts, pairs, strict=True))
        return Path(tuple(choice), cost, np.asarray(taken - self.caps))

    def to_go(self, prices: Floats) -> tuple[list[Floats], list[Floats]]:
        """Return the priced arcs, and the least priced cost from every candidate to the end.

        ``prices`` (B,): scaled. Results: ``priced`` (list of (C_{k-1}, C_k) float): the arcs;
        ``rest`` (list of (C_k,) float): from the source, (1,), then for every move; zero at the
        last.
        """
        priced = [
            arc + np.tensordot(prices, a, 1) for arc, a in zip(self.arcs, self.amounts, strict=True)
        ]
        return priced, _least_to_go(priced)

    def cheapest(self, prices: Floats) -> tuple[Path, float]:
        """Return the path that is cheapest at given prices, and the bound that they prove.

        ``prices`` (B,): scaled. Results: ``bound``: scaled; no choice within the budgets costs
        less, however sums are rounded.
        """
        priced, rest = self.to_go(prices)
        bound = float(rest[0][0] - prices @ self.caps)
        size = 1 + float(prices @ (1 + np.abs(self.caps)))  # of what is summed, per move
        path = self.path(_least_path(priced, rest))
        return path, bound - EPS * (len(priced) + 1) ** 2 * size

    def named(self, prices: Floats) -> dict[str, float]:
        """Return prices by budget, in the unit of the criterion per unit of the budget.

        ``prices`` (B,): scaled.
        """
        worth = self.scale * prices / self.units
        return {name: float(price) for name, price in zip(self.names, worth, strict=True)}


def priced_paths(problem: PlacementProblem) -> PricedPaths:
    """Return the paths of a problem.

    ``problem``: its sums and budgets are used. Raises `InfeasibleError` if no choice is allowed, or
    none is within one of the budgets; `ProblemError` if a budget is not for the moves and
    candidates of the problem.
    """
    costs = problem.sums
    costs.continuable()
    _within_each(problem)
    budgets = [budget for budget in problem.budgets if np.isfinite(budget.bound)]
    arcs = costs.arcs()
    largest = max(float(np.abs(arc[np.isfinite(arc)]).max()) for arc in arcs)
    scale = 2.0 ** math.frexp(largest)[1] if largest else 1.0
    units = np.array([_unit(budget) for budget in budgets])
    amounts = tuple(np.empty((len(budgets), *arc.shape)) for arc in arcs)
    for b, (budget, unit) in enumerate(zip(budgets, units, strict=True)):
        for found, taken in zip(amounts, budget.amounts.arcs(), strict=True):
            found[b] = taken / unit
    return PricedPaths(
        arcs=tuple(arc / scale for arc in arcs),
        amounts=amounts,
        caps=np.array([b.bound for b in budgets]) / units + ROUNDING,
        scale=scale,
        units=units,
        names=tuple(budget.name for budget in budgets),
    )


def _unit(budget: Budget) -> float:
    """Return the size of a budget: its bound, or its largest amount."""
    largest = max(float(np.abs(a).max()) for a in (*budget.single, *budget.shared))
    return max(abs(budget.bound), largest) or 1.0


STEPS = 200  # prices that are tried at most
WIDEST = 1e12  # prices that are thought of at most, in scaled units


@dataclass(frozen=True, eq=False)
class Priced:
    """What prices tell of a problem.

    ``prices`` (B,): those with the highest bound, scaled; ``bound``: which they prove; scaled;
    ``paths``: the cheapest at all prices that were tried, different ones.
    """

    prices: Floats
    bound: float
    paths: tuple[Path, ...]

    @property
    def best(self) -> Path | None:
        """The cheapest path within the budgets; None if none was met."""
        found = [path for path in self.paths if path.within]
        return min(found, key=lambda path: path.cost, default=None)


def best_prices(paths: PricedPaths, watch: Watch) -> Priced:
    """Return the prices whose bound is highest, by cutting planes.

    Every path is a plane over the prices; their lowest is a concave roof, of which the highest
    point is asked for next, in turn with the middle between it and the best prices so far.

    ``watch``: is told bounds and choices. Raises `InfeasibleError` if prices prove that no choice,
    and no mixture of choices, keeps the budgets; `SolverError` if the highest point of the roof is
    not found.
    """
    loosest = sum(float(arc[np.isfinite(arc)].max()) for arc in paths.arcs)  # no choice costs more
    ask, reach = np.zeros(len(paths.caps)), 1.0
    best, bound, found = ask, -np.inf, {}
    for step in range(STEPS):
        path, value = paths.cheapest(ask)
        found[path.choice] = path
        if value > bound:
            best, bound = ask, value
        told = path.cost * paths.scale if path.within else np.inf
        watch.tell(told, bound * paths.scale)
        if bound > loosest:
            raise InfeasibleError("no choice is within all budgets; raise a bound")
        if watch.over or not len(ask):
            break
        highest, roof = _highest(list(found.values()), reach)
        if max(best) < reach and roof - bound <= ROUNDING * max(abs(roof), 1.0):
            break
        at_the_edge = bool((highest >= reach * (1 - ROUNDING)).any())
        reach *= 4.0 if at_the_edge and reach < WIDEST else 1.0
        ask = highest if step % 2 == 0 or at_the_edge else 0.5 * (highest + best)
    return Priced(best, bound, tuple(found.values()))


def _highest(paths: Sequence[Path], reach: float) -> tuple[Floats, float]:
    """Return prices up to ``reach`` where the lowest plane of paths is highest, and how high."""
    planes = np.array([[1.0, *-path.over] for path in paths])
    heights = np.array([path.cost for path in paths])
    count = planes.shape[1] - 1
    if count == 1:
        return _highest_of_lines(heights, -planes[:, 1], reach)
    bounds = [(None, None), *([(0.0, reach)] * count)]
    from scipy.optimize import linprog  # noqa: PLC0415  # slow to import, for budgets only

    found = linprog([-1.0, *[0.0] * count], planes, heights, bounds=bounds)
    if found.x is None or found.fun is None or not found.success:
        raise SolverError(f"prices of budgets: {found.message}; rescale the costs")
    return np.asarray(found.x[1:]), float(-found.fun)


def _highest_of_lines(heights: Floats, slopes: Floats, reach: float) -> tuple[Floats, float]:
    """Return where the lowest of few lines is highest: at an end, or where two of them meet."""
    with np.errstate(divide="ignore", invalid="ignore"):
        meet = (heights[:, None] - heights) / (slopes - slopes[:, None])
    inside = np.isfinite(meet) & (meet > 0) & (meet < reach)
    at = np.concatenate([[0.0, reach], np.unique(meet[inside])])
    lowest = (heights[:, None] + slopes[:, None] * at).min(axis=0)
    best = int(np.argmax(lowest))
    return at[best : best + 1], float(lowest[best])
