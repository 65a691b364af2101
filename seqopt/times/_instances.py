"""Times of paths through instances: computed act by act, and bounded by shares or labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph.graph import Graph, TimedGraph
from seqopt.graph.instance import Instance
from seqopt.judge._bounds import Book, Closed, SumBook, limit_below
from seqopt.judge.arithmetic import Claim, Labels, Stage, _sum
from seqopt.times._acts import acts_of_instance
from seqopt.times._clock import Clock


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
        acts = acts_of_instance(timed, stage.graph, kept)
        multipliers = np.column_stack([shares[:, 0], shares[:, 1:][:, timed.kinds]])
        clock = Clock(acts, multipliers, limit_below(claim.value), strict=True)
        books: list[Book] = [clock]
        if len(columns):
            limits = most, np.zeros(len(columns), dtype=bool)
            amounts = stage.graph.amounts[:, columns]
            books.append(SumBook(stage.graph, acts.move, amounts, limits))
        closed = Closed(stage.graph, acts.move, books)
        state, values = claim.labels
        since = acts.sorted(acts.entries[state], values[:, 1 : 1 + acts.count])
        values = np.column_stack([values[:, 0], since, values[:, 1 + acts.count :]])
        if closed.is_proof((state, values), lambda states: np.zeros(len(states), dtype=bool)):
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
    """Return the makespan of a path, s, under the given or the best assignment of robots.

    ``acts`` (k,): given ones.
    """
    every = acts_of_instance(timed, timed.graph, np.ones(len(timed.prepares), dtype=bool))
    every = replace(every, groups=())  # acts name columns: robots that are alike stay apart
    first = np.searchsorted(timed.move, np.arange(len(timed.prepares) + 1))
    labels = np.zeros((1, 1 + len(timed.kinds)))
    for step, arc in enumerate(arcs.tolist()):
        own = np.arange(first[arc], first[arc + 1]) if acts is None else acts[[step]]
        act, label = np.repeat(own, len(labels)), np.tile(labels, (len(own), 1))
        end, since, _ = every.follow(act, label[:, 0], label[:, 1:], label[:, :0])
        labels = np.unique(np.column_stack([end, since]), axis=0)
        dominated = (labels[:, None] <= labels).all(axis=2)
        labels = labels[dominated.sum(axis=0) == 1]  # by itself alone
    return float(labels[:, 0].min())
