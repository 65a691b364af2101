r"""Best paths within limits by setting labels: exact, or a bound on what is left.

A label is a partial path from the start with a vector :math:`z` of values: costs, capped sums,
totals of scenarios, when robots are free. Labels are extended by all arcs from their states, level
by level, and pruned

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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph, distances, strictly_below
from seqopt.problem.requirements import Resource, StepArrays

NARROW, WIDER = 256, 16  # labels of a level kept at first, and how many times as many then
CHUNK = 2_000_000  # arcs of labels that are looked at together
MARGIN = 1e-10  # over a limit: what is pruned is beyond it however sums are rounded


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

        Raises `LateError` if there are more, or time is over.
        """
        growth, found, count, best = self._growth, self._found, 0, -1
        zero = np.zeros(1, dtype=np.int64)
        start = self._within(Labels(zero, growth.first, zero - 1, zero - 1))
        pending: dict[int, list[Labels]] = {int(growth.levels[0]): [start]}
        for level in range(int(growth.levels.max()) + 1):
            here: list[Labels] = []
            while level in pending:
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
