"""Times of paths through instances: computed act by act, and bounded by shares or labels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph._timed import HELD, NOW, TimedGraph
from seqopt.graph.graph import Graph
from seqopt.graph.instances.instance import Instance
from seqopt.judge._claims import Claim, Labels, Stage, _sum
from seqopt.times._label_proof import Closed, Limits, Team, TimedMoves, limit_below


class _Acts(TimedMoves):
    """The moves of some arcs, (m,) bool, as acts of an instance."""

    def __init__(self, timed: TimedGraph, graph: Graph, kept: Bools) -> None:
        self.graph, self._timed, self._arc = graph, timed, np.flatnonzero(kept)
        columns = timed.free.shape[1]
        self._act = np.full((len(kept), 1 + columns), -1)
        self._act[timed.move, 1 + timed.column] = np.arange(len(timed.move))
        groups = tuple(
            tuple(np.flatnonzero(timed.kinds == kind).tolist()) for kind in np.unique(timed.kinds)
        )
        none = np.zeros((columns, 5))
        self.team = Team(none, none[:, 0], groups, none[:1], parks=False)
        self.rows = _entries(timed)
        self.longest, self.cured = timed.longest, None

    def _acts_of(self, moves: Ints, column: int | None) -> Ints:
        return np.asarray(self._act[self._arc[moves], 0 if column is None else 1 + column])

    def candidates(self, moves: Ints, column: int) -> Bools:
        """Return in which moves (k,) the robot of a column may be the one who takes the grip."""
        return self._acts_of(moves, column) >= 0

    def releases(self, moves: Ints) -> Bools:
        """Return which moves (k,) take no grip."""
        return self._acts_of(moves, None) >= 0

    def work(self, prices: Floats) -> Floats:
        """Return the priced time of moves, (m,): of all and of the robots of columns, (1 + c,)."""
        firsts = [1 + group[0] for group in self.team.groups]
        return np.asarray(self._timed.work[self._arc] @ prices[[0, *firsts]])

    def follow(
        self, moves: Ints, column: int | None, end: Floats, since: Floats, placed: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return labels after moves (k,): when they end (k,), and since when robots are free."""
        arc, act = self._arc[moves], self._acts_of(moves, column)
        ready = end if column is None else since[:, column] + self._timed.prepares[arc]
        ends = np.maximum(end, ready) + self._timed.acts[arc]
        origin = self._timed.origin[act]
        passed = np.take_along_axis(since, origin.clip(min=0), axis=1)
        passed = np.where(origin == NOW, ends[:, None], np.where(origin == HELD, 0.0, passed))
        return ends, self.sorted(self.rows[self.graph.target[moves]], passed), placed


def _entries(timed: TimedGraph) -> Ints:
    """Return numbers (n, c), above 0 where a robot holds, and equal where robots are alike."""
    columns = timed.free.shape[1]
    out = np.zeros(timed.free.shape, dtype=np.int64)
    for c in range(1, columns):
        out[:, c] = np.where(timed.alike[:, c - 1], out[:, c - 1], -c)
    return np.where(timed.free, out, columns - np.arange(columns))


def labels_prove(
    timed: TimedGraph,
    arcs: tuple[Graph, Bools],
    limited: tuple[Ints, Floats],
    claim: tuple[float, Labels, Floats],
) -> bool:
    """Return whether labels prove that no path ends before a value.

    ``arcs``: the graph that is left, and which arcs (m,) it has; ``limited``: columns, and the most
    of their sums; ``claim``: the value, labels, and prices (L, 1 + k).
    """
    (graph, kept), (columns, most), (value, labels, shares) = arcs, limited, claim
    moves = _Acts(timed, graph, kept)
    prices = np.column_stack([shares[:, 0], shares[:, 1:][:, timed.kinds]])
    strict = np.array([True] + [False] * len(columns))
    limits = Limits(limit_below(value), most, strict)
    closed = Closed(moves, graph.amounts[:, columns], prices, limits)
    return closed.is_proof(labels, lambda states: np.zeros(len(states), dtype=bool))


def claimed_time(
    instance: Instance, stage: Stage, claim: Claim, limited: Sequence[tuple[float, int, float]]
) -> float:
    """Return when the last act ends at the earliest, by shares of the time of robots."""
    timed = instance.timed
    assert timed is not None  # an instance that asks for a time has it
    kept = np.isin(_codes(instance.graph), _codes(stage.graph))
    if claim.shares is None and claim.potentials is not None:
        raise SolverError("potentials of a time: give the shares that they are for as well")
    shares = _shares(timed.sizes.astype(float), claim.shares)
    if claim.labels is not None and claim.value is not None:
        columns = np.array([c for _, c, _ in stage.limited], dtype=np.int64)
        most = np.array([most for *_, most in stage.limited])
        _require_labels(instance, claim.labels, len(columns))
        said = claim.value, claim.labels, shares
        if labels_prove(timed, (stage.graph, kept), (columns, most), said):
            return claim.value
        raise SolverError(f"labels do not prove that no path ends before {claim.value:.9g}")
    bounds = [_sum(stage, timed.work[kept] @ own, claim, limited) for own in shares]
    return max(bounds) * (1 - 1e-12)


def _require_labels(instance: Instance, labels: Labels, sums: int) -> None:
    """Raise an error unless labels are of nodes, with as many numbers as there should be."""
    assert instance.timed is not None  # labels are asked of times alone
    nodes, values = labels
    width = 1 + len(instance.timed.kinds) + sums
    named = len(nodes) == 0 or (nodes.min() >= 0 and nodes.max() < instance.nodes)
    if values.shape != (len(nodes), width) or not named or not np.isfinite(values).all():
        raise SolverError(f"labels: give nodes, and for each a row of {width} numbers")


def _shares(sizes: Floats, given: Floats | None) -> Floats:
    """Return shares (L, 1 + k) that prove a bound; those of one kind each if none are given."""
    if given is None:
        return np.asarray(np.eye(len(sizes)) / sizes)
    shares = np.atleast_2d(given)
    wrong = shares.shape[1] != len(sizes) or not (shares >= 0).all()
    if wrong or (shares @ sizes > 1 + 1e-9).any():
        raise SolverError(
            f"shares: give {len(sizes)} numbers from 0, that of all and one for a robot of every "
            f"kind; with {', '.join(f'{s:g}' for s in sizes)} of each they add up to 1 at most"
        )
    return shares


def _codes(graph: Graph) -> Ints:
    return graph.source.astype(np.int64) * graph.states + graph.target


def path_makespan(timed: TimedGraph, arcs: Ints, acts: Ints | None = None) -> float:
    """Return when the last act of a path ends, s, whoever acts as is best, or as acts (k,) say."""
    first = np.searchsorted(timed.move, np.arange(len(timed.prepares) + 1))
    labels = {(0.0, *[0.0] * len(timed.kinds))}
    for step, arc in enumerate(arcs.tolist()):
        every = range(first[arc], first[arc + 1]) if acts is None else [int(acts[step])]
        found = {_acted(timed, act, label) for act in every for label in labels}
        labels = {x for x in found if not any(_beats(y, x) for y in found)}
    return min(label[0] for label in labels)


def _acted(timed: TimedGraph, act: int, label: tuple[float, ...]) -> tuple[float, ...]:
    """Return when an act ends, and since when robots of columns are free after it."""
    end, *since = label
    move, column = timed.move[act], int(timed.column[act])
    begins = end if column < 0 else max(end, since[column] + float(timed.prepares[move]))
    ends = begins + float(timed.acts[move])
    where = {HELD: 0.0, NOW: ends}
    return (ends, *(where[o] if o < 0 else since[o] for o in timed.origin[act].tolist()))


def _beats(first: tuple[float, ...], second: tuple[float, ...]) -> bool:
    return first != second and all(a <= b for a, b in zip(first, second, strict=True))
