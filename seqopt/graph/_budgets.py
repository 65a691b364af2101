r"""Best paths within budgets: sums of some amounts are capped, with multipliers that bound them.

A multiplier of every budget turns its amounts into costs; the cheapest path then bounds what any
path within the budgets takes, by weak duality. The best ones are found by cutting planes. What
none decides stays open as a gap between a path and its bound, except that one budget alone is
decided exactly for worst amounts.

A path within the budgets is sought first, at no cost: whether there is one, one budget alone
decides exactly. Several can leave it open, where mixtures of paths keep them and no path was met
that does. Then it is sought by labels, vectors of what beginnings of paths take; these also
close the gap of a sum, where they are asked to.

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

By labels, exactly, or with a bound on what is left: a label is a partial path from the start with a
vector :math:`z` of values: costs, capped sums, totals of scenarios, when robots are free. Labels
are extended by all arcs from their states, level by level, and pruned

- if they are dominated: another label of the same state is no larger in any value,
- if a lower bound of all their completions exceeds a limit; for the objective the limit is the
  incumbent.

The bounds depend on the objective. For a sum within budgets :math:`B`, with multipliers
:math:`\lambda`, the cost :math:`C`, the capped sums :math:`S`, and :math:`V_\lambda(v)` and
:math:`D_b(v)`, the least Lagrangian cost and the least sum from a state :math:`v` to an end,

.. math::

   C + \lambda^T (S - B) + V_\lambda(v) \qquad\text{and}\qquad S_b + D_b(v) \le B_b .

At first a beam of few labels a level is kept, those with the least bounds, which gives an
incumbent. The beam is widened until no pruned label could lead to a better path. If there are too
many labels, or time is over, the least bound of the pruned ones bounds all paths.

Every value belongs to a resource (`Carried`): sums, when robots are free and how old mortar is
(`formulations.times`), and what problems ask for (`Resource`). One search serves all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.csgraph import dijkstra

from seqopt._registry import Later
from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, TimeUpError
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import ROUNDING, Graph, distances, least_sum, strictly_below, tied
from seqopt.problem.requirements import Resource, StepArrays

optimize = Later("scipy.optimize")  # slow to import

ROUNDS = 60  # of cutting planes
CLOSED = 1e-9  # share of a bound to which multipliers are the best
DEAREST = 1e6  # largest multiplier, over what a path takes per unit of the budget
LABELS = 20_000  # that are kept at a time at most
CYCLES = 300  # times that the states of a level are gone through again, where that pays
NARROW, WIDER = 256, 16  # labels of a level kept at first, and how many times as many then
CHUNK = 2_000_000  # arcs of labels that are looked at together
MARGIN = 1e-10  # over a limit: what is pruned is beyond it however sums are rounded


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
        none = LabelSearch(None, np.inf, -np.inf)
        met = widening(Joint(graph, [sums]), most, none, until, LABELS, any_path=True)
        path = _path(graph, met.arcs)
        if path is None and until.over:
            raise TimeUpError("no path within all caps was found yet; give more time")
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


class LateError(Exception):
    """Time is over, or there are too many labels."""


class Labels(NamedTuple):
    """Labels: state (N,), values (N, k), last arc (N,) and number of the predecessor (N,).

    Of the start's label the last two are -1.
    """

    state: Ints
    taken: Floats
    arc: Ints
    back: Ints

    def only(self, rows: Ints | Bools) -> Labels:
        """Select rows."""
        return Labels._make(each[rows] for each in self)

    @property
    def size(self) -> int:
        """How many there are."""
        return len(self.state)


def _joined(parts: Sequence[Labels]) -> Labels:
    return Labels(*map(np.concatenate, zip(*parts, strict=True)))


class Carried:
    """A resource on the arcs of a graph; here one that limits nothing beyond its extension.

    ``first`` (k,): values at the start; ``limits`` (b,): upper limits of its limited values.
    """

    first: Floats
    limits: Floats = np.zeros(0)

    def extend(self, arc: Ints, values: Floats) -> Floats:
        """Return values (N, k) after arcs (N,); infinite where they may not be taken."""
        raise NotImplementedError

    def totals(self, values: Floats) -> Floats:
        """Return the limited values (N, b) of paths that end with labels."""
        return values[:, :0]

    def bounds(self, state: Ints, values: Floats) -> Floats:
        """Return lower bounds (N, b), over all completions of labels, of the limited values."""
        return self.totals(values)

    def dominated(self, first: Floats, other: Floats) -> Bools:
        """Return where the first values (N, k) dominate the others."""
        return np.asarray((first <= other).all(axis=1))

    def ends(self, values: Floats) -> Bools:
        """Return with which values a path may end, (N,)."""
        return np.ones(len(values), dtype=bool)


class Asked(Carried):
    """A resource of a problem on the arcs of a graph, ``steps`` (a,)."""

    def __init__(self, resource: Resource, steps: StepArrays) -> None:
        self._resource, self._steps = resource, steps
        self.first = np.array(resource.start, dtype=float)
        self.dominated, self.ends = resource.dominated, resource.ends  # type: ignore[method-assign]

    def extend(self, arc: Ints, values: Floats) -> Floats:
        return self._resource.extended(self._steps.only(arc), values)


class Sums(Carried):
    """Sums of amounts of arcs (a, q) within limits (q,); ``left`` (n, q): least from a state on."""

    def __init__(self, amounts: Floats, limits: Floats, left: Floats) -> None:
        self._amounts, self.limits, self._left = amounts, limits, left
        self.first = np.zeros(amounts.shape[1])

    def extend(self, arc: Ints, values: Floats) -> Floats:
        return np.asarray(values + self._amounts[arc])

    def totals(self, values: Floats) -> Floats:
        return values

    def bounds(self, state: Ints, values: Floats) -> Floats:
        return np.asarray(values + self._left[state])


class CappedSums(Sums):
    """Costs (m,) and capped amounts (m, B) of moves; ``multipliers`` (B,): of the caps, from 0.

    Costs are bounded by their Lagrangian, capped sums by the least of each alone.
    """

    def __init__(
        self, graph: Graph, costs: Floats, amounts: Floats, caps: Floats, multipliers: Floats
    ) -> None:
        least = (costs + amounts @ multipliers, *amounts.T)
        left = np.column_stack([distances(graph, each, back=True) for each in least])
        super().__init__(np.column_stack([costs, amounts]), np.array([np.inf, *caps]), left)
        self._multipliers, self._paid_back = multipliers, float(multipliers @ caps)

    def bounds(self, state: Ints, values: Floats) -> Floats:
        priced = values[:, 0] + values[:, 1:] @ self._multipliers - self._paid_back
        return np.asarray(np.column_stack([priced, values[:, 1:]]) + self._left[state])


class Joint:
    """Labels of several resources side by side, over arcs that are sorted by their sources.

    ``graph``: has the ends; ``levels`` (n,): no arc leads to a lower one; ``arcs``: sources and
    targets (a,), which may stand there several times, by default the moves of the graph;
    ``look_back``: with how many labels of its state one is compared.
    """

    def __init__(
        self,
        graph: Graph,
        carried: Sequence[Carried],
        levels: Ints | None = None,
        arcs: tuple[Ints, Ints] | None = None,
        look_back: int = 32,
    ) -> None:
        source, target = (graph.source, graph.target.astype(np.int64)) if arcs is None else arcs
        self.ends, self.target, self.look_back = graph.ends, target, look_back
        self.levels = np.zeros(graph.states, dtype=np.int64) if levels is None else levels
        self.starts = np.searchsorted(source, np.arange(graph.states + 1))
        self.first = np.concatenate([each.first for each in carried])[None]
        self.limits = np.concatenate([each.limits for each in carried])
        cuts = np.cumsum([0, *(len(each.first) for each in carried)]).tolist()
        self._own = [(c, slice(*cut)) for c, cut in zip(carried, pairwise(cuts), strict=True)]

    def follow(self, labels: Labels, arc: Ints) -> Floats:
        """Return the values of labels after an arc each, (N, k); infinite if infeasible."""
        return np.hstack([each.extend(arc, labels.taken[:, own]) for each, own in self._own])

    def bounds(self, state: Ints, taken: Floats) -> Floats:
        """Return lower bounds (N, b), over all completions of labels, of limited values."""
        return np.hstack([each.bounds(state, taken[:, own]) for each, own in self._own])

    def values(self, taken: Floats, aim: int) -> Floats:
        """Return a limited value of paths that end with labels; infinite if none may end so."""
        found = np.hstack([each.totals(taken[:, own]) for each, own in self._own])[:, aim]
        may = np.all([each.ends(taken[:, own]) for each, own in self._own], axis=0)
        return np.where(may, found, np.inf)

    def dominated(self, first: Floats, other: Floats) -> Bools:
        """Return where the first labels (N, k) dominate the others in every resource."""
        parts = [each.dominated(first[:, own], other[:, own]) for each, own in self._own]
        return np.asarray(np.all(parts, axis=0))


@dataclass
class Swept:
    """Result of a sweep: the best path, all labels that were kept, and the bound of the others.

    ``best``: infinite without a path; ``arcs``: of the path; ``left_out``: least bound of the
    objective in pruned labels; ``narrow``: whether the width pruned any.
    """

    best: float = np.inf
    path: tuple[int, ...] = ()
    arcs: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    kept: list[Labels] = field(default_factory=list)
    left_out: float = np.inf
    narrow: bool = False


class Sweep:
    """Labels within limits (b,), level by level.

    ``aim``: column of the limited values that is the objective; ``width``: how many labels of a
    level are extended, all by default.
    """

    def __init__(
        self, growth: Joint, limits: Floats, *, aim: int = 0, width: int | None = None
    ) -> None:
        self._growth, self._limits = growth, np.array(limits, dtype=float)
        self._aim, self._width, self._found = aim, width, Swept()

    def run(self, watch: Watch, most: int = 0) -> Swept:
        """Return the best path and labels; ``most``: labels that may be kept, 0 for any number.

        Raises `LateError` if there are more, or time is over; `ProblemError` if cycles of arcs pay
        without end.
        """
        growth, found, count, best = self._growth, self._found, 0, -1
        zero = np.zeros(1, dtype=np.int64)
        start = self._within(Labels(zero, growth.first, zero - 1, zero - 1))
        pending: dict[int, list[Labels]] = {int(growth.levels[0]): [start]}
        for level, states in enumerate(np.bincount(growth.levels).tolist()):
            here: list[Labels] = []
            while level in pending:
                if len(here) > states + CYCLES:
                    raise ProblemError(
                        "a resource falls whenever the same steps are repeated, so that no search "
                        "for the best path ends; let it fall to a least value at most"
                    )
                met = self._narrowed(_joined(pending.pop(level)), 4)
                fresh = self._narrowed(_undominated(met, here, growth), 1)
                here.append(fresh)
                found.kept.append(fresh)
                values = growth.values(fresh.taken, self._aim)
                values = np.where(growth.ends[fresh.state], values, np.inf)
                value = float(values.min(initial=np.inf))
                if value < found.best:
                    found.best, best = value, count + int(np.argmin(values))
                    self._limits[self._aim] = min(self._limits[self._aim], value * (1 - MARGIN))
                if watch.over or 0 < most < count + fresh.size:
                    raise LateError
                for after in self._continued(fresh, count):
                    to = growth.levels[after.state]
                    for further in np.unique(to).tolist():
                        pending.setdefault(further, []).append(after.only(to == further))
                count += fresh.size
        self._trace(best)
        return found

    def _narrowed(self, labels: Labels, times: int) -> Labels:
        """Return the labels with the least bounds, a number of times the width, in their order."""
        width = labels.size if self._width is None else times * self._width
        if labels.size <= width:
            return labels
        bounds = self._growth.bounds(labels.state, labels.taken)[:, self._aim]
        order = np.argsort(bounds, kind="stable")
        self._found.narrow = True
        self._found.left_out = min(self._found.left_out, float(bounds[order[width]]))
        return labels.only(np.sort(order[:width]))

    def _within(self, labels: Labels) -> Labels:
        """Return labels within the limits; note the least bound of those that are not."""
        bounds = self._growth.bounds(labels.state, labels.taken)
        most = self._limits + MARGIN * np.abs(self._limits)
        fits = np.isfinite(bounds) & (bounds <= most)
        others = np.delete(fits, self._aim, axis=1).all(axis=1)
        late = bounds[others & ~fits[:, self._aim], self._aim]
        self._found.left_out = min(self._found.left_out, float(late.min(initial=np.inf)))
        return labels.only(np.flatnonzero(fits.all(axis=1)))

    def _continued(self, labels: Labels, first: int) -> Iterator[Labels]:
        """Yield the successors of labels, numbered from ``first``, by one arc each, in chunks."""
        starts = self._growth.starts
        counts = np.diff(starts)[labels.state]
        cuts = np.searchsorted(np.cumsum(counts), np.arange(0, counts.sum() + CHUNK, CHUNK)[1:])
        for rows in np.split(np.arange(labels.size), np.unique(cuts)):
            own = counts[rows]
            if not own.any():
                continue
            row = np.repeat(rows, own)
            arc = np.repeat(starts[labels.state[rows]] - np.cumsum(own) + own, own)
            arc = arc + np.arange(len(row))
            taken = self._growth.follow(labels.only(row), arc)
            after = Labels(self._growth.target[arc], taken, arc, first + row)
            yield self._within(after.only(np.flatnonzero(np.isfinite(taken).all(axis=1))))

    def _trace(self, number: int) -> None:
        """Note the path of a label, its start left out."""
        if number < 0:
            return
        arc, back = (np.concatenate([own[k] for own in self._found.kept]) for k in (2, 3))
        arcs = list[int]()
        while back[number] >= 0:
            arcs.append(int(arc[number]))
            number = int(back[number])
        self._found.arcs = np.array(arcs[::-1], dtype=np.int64)
        self._found.path = tuple(self._growth.target[self._found.arcs].tolist())


def _undominated(fresh: Labels, known: Sequence[Labels], growth: Joint) -> Labels:
    """Return the new labels that no known or new one is found to dominate."""
    states = np.zeros(len(growth.ends), dtype=bool)
    states[fresh.state] = True
    old = [labels.only(states[labels.state]) for labels in known]
    every = _joined([*old, fresh])
    new = np.arange(every.size) >= every.size - fresh.size  # of equal ones the known one is first
    order = np.lexsort((new, *every.taken.T[::-1], every.state))
    state, taken, dominated = every.state[order], every.taken[order], np.zeros(every.size, bool)
    rows, back = np.flatnonzero(new[order]), 0
    while len(rows) and back < growth.look_back:
        back += 1
        rows = rows[rows >= back]
        rows = rows[state[rows] == state[rows - back]]
        worse = growth.dominated(taken[rows - back], taken[rows])
        dominated[rows[worse]] = True
        rows = rows[~worse]
    return every.only(np.sort(order[~dominated & new[order]]))


class LabelSearch(NamedTuple):
    """The incumbent by its arcs, None without one, its cost, and a lower bound of all paths."""

    arcs: Ints | None
    cost: float
    bound: float


def widening(
    growth: Joint,
    caps: Floats,
    best: LabelSearch,
    watch: Watch,
    most: int,
    *,
    any_path: bool = False,
) -> LabelSearch:
    """Return the best path within caps by labels, in beams of growing width.

    ``caps``: of the limited values after the objective; ``best``: incumbent and bound before;
    ``most``: the largest width; ``any_path``: whether the first path that is found is enough.
    """
    width = min(NARROW, most)
    while not watch.over and best.bound < best.cost:
        limit = strictly_below(best.cost) if np.isfinite(best.cost) else np.inf
        try:
            found = Sweep(growth, np.array([limit, *caps]), width=width).run(watch)
        except LateError:
            break
        if found.best < best.cost:
            best = LabelSearch(found.arcs, found.best, best.bound)
        closed = found.left_out >= strictly_below(best.cost)
        best = best._replace(bound=best.cost if closed else max(best.bound, found.left_out))
        watch.tell(best.cost, best.bound)
        if width >= most or (any_path and best.arcs is not None):
            break
        width = min(width * WIDER, most)
    return best
