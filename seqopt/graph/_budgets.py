r"""Best paths within budgets: sums of some amounts are capped, with multipliers that bound them.

A multiplier of every budget turns its amounts into costs; the cheapest path then bounds what any
path within the budgets takes, by weak duality. The best ones are found by cutting planes. What
none decides stays open as a gap between a path and its bound, except that one budget alone is
decided exactly for worst amounts.

A path within the budgets is sought first, at no cost: whether there is one, one budget alone
decides exactly. Several can leave it open, where mixtures of paths keep them and no path was met
that does. Then it is sought by labels, vectors of what beginnings of paths take (`_labels`); these
also close the gap of a sum, where they are asked to.

By cutting planes: every path :math:`p` is a plane over the multipliers :math:`\lambda`, and the
least of all planes is a bound on what is sought, concave and piecewise linear:

.. math::

   \max_{\lambda \in \Lambda} \; L(\lambda), \qquad
   L(\lambda) = \min_p \; \bigl( c(p) + \lambda^T s(p) \bigr) .

An oracle finds a shortest path at given multipliers. The next ones are the highest point of the
planes found so far (Kelley, The cutting-plane method, 1960),

.. math::

   \max_{\lambda \in \Lambda, \, \theta} \; \theta \quad\text{s.t.}\quad
   \theta \le c(p) + \lambda^T s(p) \quad \text{for every path } p \text{ found so far,}

until :math:`\theta`, which is above :math:`L` everywhere, is no higher than the best bound. What
the multipliers are of differs:

- budgets :math:`B`: :math:`s = a(p) - B`, from 0 up to a largest, over what a path costs per unit;
- scenarios: :math:`c = 0` and :math:`s` the totals; weights up to a largest, which add up to one;
- robots' time: :math:`c = 0` and :math:`s` the work of all and of a robot of every kind; shares of
  which, times the number of robots, :math:`n^T \lambda = 1`.

Where they add up to one, every second ones are halfway to the best known: at corners planes say
little of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.csgraph import dijkstra

from seqopt._registry import Later
from seqopt.arrays import Floats, Ints
from seqopt.errors import InfeasibleError, NothingFoundError, TimeUpError
from seqopt.graph._labels import CappedSums, Joint, LabelSearch, widening
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import ROUNDING, Graph, least_sum, tied

optimize = Later("scipy.optimize")  # slow to import

ROUNDS = 60  # of cutting planes
CLOSED = 1e-9  # share of a bound to which multipliers are the best
DEAREST = 1e6  # largest multiplier, over what a path takes per unit of the budget
LABELS = 20_000  # that are kept at a time at most
NONE = LabelSearch(None, np.inf, -np.inf)


class Within(NamedTuple):
    """A path within budgets.

    ``path``: its states, the start left out; ``values``: of every column, the budgets' last;
    ``bounds``: lexicographic lower bounds within the budgets; ``prices``: by goal, multipliers of
    the budgets and of the sums before it, that prove its bound.
    """

    path: tuple[int, ...]
    values: tuple[float, ...]
    bounds: tuple[float, ...]
    prices: tuple[tuple[float, ...], ...]


class _Found(NamedTuple):
    moves: Ints | None  # of the best path within all caps
    bound: float
    prices: Floats


class _Path(NamedTuple):
    states: tuple[int, ...]
    amounts: Floats  # of its moves


def within_budgets(
    graph: Graph, caps: Sequence[float], watch: Watch | None = None, most: int = 0
) -> Within:
    """Return a path within caps on its last columns, good in goal after goal, with its bounds.

    ``most``: how many labels may be kept to close the duality gap of a sum; ``watch``: deadline,
    which records incumbents and bounds of the first goal.

    Raises `InfeasibleError` if multipliers prove that no path is within all caps;
    `NothingFoundError` if that is open, and none was found.
    """
    watch, goals = watch or Watch(), len(graph.peaks) - len(caps)
    limited = [*enumerate(caps, start=goals)]
    bounds, prices, best = [], [], _some_path(graph, caps, watch)
    for goal in range(goals):
        if graph.peaks[goal]:
            bound, price, way = _least_worst(graph, goal, limited)
        else:
            told = watch if not goal else None
            found = _least_sum(graph, graph.amounts[:, goal], limited, told)
            bound, price, moves = found.bound, found.prices, found.moves
            if most:  # labels close the duality gap
                columns, costs = [c for c, _ in limited], graph.amounts[:, goal]
                within = np.array([tied(cap) for _, cap in limited])
                sums = CappedSums(graph, costs, graph.amounts[:, columns], within, price)
                known = np.inf if moves is None else float(costs[moves].sum())
                met = LabelSearch(moves, known, bound)
                met = widening(Joint(graph, [sums]), within, met, told or watch.apart(), most)
                bound, moves = met.bound, met.arcs
            way = _path(graph, moves)
        best = _better(graph, goal, way, best)
        taken = _taken(graph, best)[goal]
        if graph.peaks[goal]:
            graph = graph.only(graph.amounts[:, goal] <= tied(taken))
        else:
            limited.append((goal, taken))
        bounds.append(bound)
        prices.append(tuple(price.tolist()))
    short = _path(graph, _least_sum(graph, np.ones(len(graph.source)), limited).moves)
    best = _better(graph, None, short, best)
    values = _taken(graph, best)
    least = [min(b, v) for b, v in zip(bounds, values, strict=False)]
    return Within(best.states, values, (*least, *values[goals:]), tuple(prices))


def _some_path(graph: Graph, caps: Sequence[float], watch: Watch) -> _Path:
    """Return a path whose last columns are within caps."""
    goals = len(graph.peaks) - len(caps)
    nothing = np.zeros(len(graph.source))
    found = _least_sum(graph, nothing, [*enumerate(caps, start=goals)])
    path = _path(graph, found.moves)
    if path is not None:
        return path
    if found.bound <= _rounding(graph, found.prices, caps):
        most = np.array([tied(cap) for cap in caps])
        sums = CappedSums(graph, nothing, graph.amounts[:, goals:], most, found.prices)
        until = watch.apart()  # costs of zero are no incumbent's
        met = widening(Joint(graph, [sums]), most, NONE, until, LABELS, any_path=True)
        path = _path(graph, met.arcs)
        if path is None and until.over:
            raise TimeUpError("no path within all caps was found yet; give more")
        if path is None and np.isfinite(met.bound):
            raise NothingFoundError(
                "mixtures of plans are within all budgets, and no plan was found that is; raise one"
            )
    if path is None:
        raise InfeasibleError("no path is within all budgets")
    return path


def _rounding(graph: Graph, prices: Floats, caps: Floats | Sequence[float]) -> float:
    """Return the rounding error of a Lagrangian value on the longest path."""
    return ROUNDING * graph.states * float(prices @ np.abs(caps))


def _path(graph: Graph, moves: Ints | None) -> _Path | None:
    if moves is None:
        return None
    return _Path(tuple(graph.target[moves].tolist()), graph.amounts[moves])


def _taken(graph: Graph, path: _Path) -> tuple[float, ...]:
    worst, total = path.amounts.max(axis=0, initial=0.0), path.amounts.sum(axis=0)
    return tuple(np.where(graph.peaks, worst, total).tolist())


def _better(graph: Graph, goal: int | None, first: _Path | None, other: _Path) -> _Path:
    """Return the path with less of a goal, or with fewer moves; the first one of ties."""

    def taken(path: _Path) -> float:
        return len(path.states) if goal is None else _taken(graph, path)[goal]

    return min((path for path in (first, other) if path is not None), key=taken)


def _least_worst(
    graph: Graph, goal: int, limited: Sequence[tuple[int, float]]
) -> tuple[float, Floats, _Path | None]:
    """Return a bound on the worst amount of paths within caps, multipliers, and the best path."""
    amounts = graph.amounts[:, goal]
    levels = np.unique(amounts)
    low, high, proven, prices = 0, len(levels), 0, np.ones(len(limited))
    way: _Path | None = None
    while low < high:
        middle = (low + high) // 2
        part = graph.only(amounts <= levels[middle])
        found = _least_sum(part, np.zeros(len(part.source)), limited)
        if found.moves is not None:
            high, way = middle, _path(part, found.moves)
            continue
        low = middle + 1
        if found.bound > 0:
            proven, prices = low, found.prices
    return float(levels[min(proven, len(levels) - 1)]), prices, way


def _least_sum(
    graph: Graph, costs: Floats, limited: Sequence[tuple[int, float]], watch: Watch | None = None
) -> _Found:
    """Return the best path within caps met on the way to the dual optimum, and that bound.

    Where no path is within them, a bound above that of any path says so: infinite, or positive
    where costs are zero.
    """
    columns, caps = [c for c, _ in limited], np.array([tied(cap) for _, cap in limited])
    amounts, watch = graph.amounts[:, columns], watch or Watch()
    best, moves = np.inf, None

    def cheapest(prices: Floats) -> Plane | None:
        nonlocal best, moves
        path = _cheapest(graph, costs + amounts @ prices)
        if path is None:
            return None
        cost, over = float(costs[path].sum()), amounts[path].sum(axis=0) - caps
        if (over <= 0).all() and cost < best:
            best, moves = cost, path
        return Plane(cost, over, cost + float(prices @ over))

    def ended(bound: float) -> bool:
        watch.tell(best, bound)
        return watch.over or best <= tied(bound)

    region = Polyhedron(DEAREST, units=np.abs(caps))
    start = np.zeros(len(caps))
    found = highest_bound(cheapest, start, region, ended, rounds=ROUNDS, closed=CLOSED)
    return _Found(None if found.bound == np.inf else moves, found.bound, found.multipliers)


def _cheapest(graph: Graph, costs: Floats) -> Ints | None:
    """Return the moves of a cheapest path to an end; None if no path leads to any."""
    matrix: Any = graph.matrix(costs)
    (least,), (before,) = dijkstra(matrix, indices=[0], return_predecessors=True)
    ends = np.flatnonzero(graph.ends)
    if not len(ends) or not np.isfinite(least[ends]).any():
        return None
    state, moves = int(ends[np.argmin(least[ends])]), list[int]()
    while state != 0:
        out = graph.moves_from(int(before[state]))
        own = out.start + np.flatnonzero(graph.target[out] == state)
        moves.append(int(own[np.argmin(costs[own])]))
        state = int(before[state])
    return np.array(moves[::-1], dtype=np.int64)


def is_beyond(graph: Graph, caps: Sequence[float]) -> bool:
    """Return whether potentials prove that no path is within all caps on the last columns."""
    goals, most = len(graph.peaks) - len(caps), np.array([tied(cap) for cap in caps])
    amounts = graph.amounts[:, goals:]
    if any(least_sum(graph, costs) > cap for costs, cap in zip(amounts.T, most, strict=True)):
        return True
    limited = [*enumerate(caps, start=goals)]
    prices = _least_sum(graph, np.zeros(len(graph.source)), limited).prices  # of all together
    together = float(prices @ most) + _rounding(graph, prices, caps)
    return least_sum(graph, amounts @ prices) > together


class Plane(NamedTuple):
    """The plane of the best path at given multipliers, and a lower bound of the dual there."""

    constant: float
    slope: Floats
    bound: float


class Highest(NamedTuple):
    """The best multipliers so far, and their Lagrangian bound: infinite if there is no path."""

    multipliers: Floats
    bound: float


class Polyhedron(NamedTuple):
    """Multipliers from 0 on.

    ``most``: the largest; of budgets, over what a path costs per unit; ``units`` (d,): of budgets,
    their size; ``counts`` (d,): of shares, with which they add up to one.
    """

    most: float
    units: Floats | None = None
    counts: Floats | None = None

    def highest(self, planes: Sequence[Plane]) -> Highest | None:
        """Return the highest point under all planes; None where the program has no solution."""
        constant, slope = (
            np.array([p.constant for p in planes]),
            np.array([p.slope for p in planes]),
        )
        size = np.abs(slope).max(axis=0, initial=0.0)
        scale = float(np.abs(constant).max() or (1.0 if self.counts is None else size.max() or 1.0))
        if self.units is None:
            size = np.full_like(size, scale)
        else:
            size = np.maximum(size, self.units)
            size[size == 0] = 1.0
        found = optimize.linprog(
            [*[0.0] * len(size), -1.0],
            A_ub=np.column_stack([-slope / size, np.ones(len(planes))]),
            b_ub=constant / scale,
            A_eq=None if self.counts is None else [[*self.counts, 0.0]],
            b_eq=None if self.counts is None else [1.0],
            bounds=[*[(0.0, self.most)] * len(size), (None, None)],
            method="highs",
        )
        if found.x is None or found.fun is None:
            return None
        multipliers = np.clip(found.x[:-1], 0.0, self.most) * scale / size
        if self.counts is not None:
            multipliers /= multipliers @ self.counts
        return Highest(multipliers, float(-found.fun) * scale)


def highest_bound(
    oracle: Callable[[Floats], Plane | None],
    start: Floats,
    polyhedron: Polyhedron,
    ended: Callable[[float], bool],
    *,
    rounds: int,
    closed: float,
) -> Highest:
    """Return the multipliers with the highest bound.

    ``oracle``: finds a shortest path at multipliers, None if there is no path; ``start``: asked
    first; ``ended``: called with the best bound after every plane; ``closed``: share of a bound to
    which it is the highest.
    """
    planes, ask, best = list[Plane](), start, Highest(start, -np.inf)
    for step in range(rounds):
        plane = oracle(ask)
        if plane is None:
            return Highest(ask, np.inf)
        planes.append(plane)
        if plane.bound > best.bound:
            best = Highest(ask, plane.bound)
        if ended(best.bound):
            break
        top = polyhedron.highest(planes)
        if top is None or top.bound - best.bound <= closed * max(abs(top.bound), abs(best.bound)):
            break
        halfway = polyhedron.counts is not None and step % 2 == 1
        ask = 0.5 * (top.multipliers + best.multipliers) if halfway else top.multipliers
    return best
