"""A combinatorial lower bound of the makespan: builds by how many grips robots hold.

Who holds which node is forgotten: what is left is how many bricks stand, and how many robots of
every kind hold. Every build is a path through these counts that takes as much of the time of all
and of robots, without travel; so the time of the shortest one, by multipliers, bounds all builds.
There are a few hundred counts where there are millions of states.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy import sparse

from seqopt._later import Later
from seqopt.arrays import Floats
from seqopt.graph.graph import Graph
from seqopt.graph.paths import least_sum
from seqopt.network.network import Network
from seqopt.scene.arm import Durations
from seqopt.sequence.rules import Ending, FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.times._steps import require_durations

optimize = Later("scipy.optimize")  # slow to import

_Counts = tuple[int, tuple[int, ...]]  # bricks that stand, and grips by kind


@dataclass(frozen=True)
class _Counted:
    """A build by counts.

    ``kinds``: how long robots take, and how many take as long; ``least``: grips that are held from
    the second brick on; ``span``: bricks where it begins and ends; ``held``: grips at first;
    ``bare``: whether nobody holds at the end.
    """

    kinds: tuple[tuple[Durations, int], ...]
    least: int
    span: tuple[int, int]
    held: tuple[int, ...]
    bare: bool

    def arcs(self) -> Iterator[tuple[_Counts, _Counts, list[float]]]:
        """Yield moves between counts, more than rules allow, and their work."""
        first, last = self.span
        every = product(range(first, last + 1), product(*(range(n + 1) for _, n in self.kinds)))
        for here in [(first, self.held), *every]:
            bricks, grips = here
            spare = sum(grips) - self.least  # grips that rules do not ask for, from two bricks on
            for k, (own, size) in enumerate(self.kinds):
                up, down = ((*grips[:k], grips[k] + more, *grips[k + 1 :]) for more in (1, -1))
                if grips[k] < size and bricks < last and (not bricks or spare >= -1):
                    yield here, (bricks + 1, up), _work(grips, own.place, own.fetch, k)
                if grips[k] < size and bricks:
                    yield here, (bricks, up), _work(grips, own.grip, own.approach, k)
                if grips[k] and (bricks < 2 or spare >= 1 or (self.bare and bricks == last)):
                    yield here, (bricks, down), _work(grips, own.release)
            if self.bare and bricks == last and any(grips):
                acts = max(d.release for (d, _), n in zip(self.kinds, grips, strict=True) if n)
                yield here, (last, (0,) * len(grips)), _work(grips, acts)


def _work(
    grips: tuple[int, ...], acts: float, prepares: float = 0.0, taker: int | None = None
) -> list[float]:
    """Return how long a move takes of the time of all, and of robots of every kind, s."""
    busy = (acts * (n + (k == taker)) + prepares * (k == taker) for k, n in enumerate(grips))
    return [acts, *busy]


def least_by_counts(network: Network, rules: FreeRules | Schedule) -> float:
    """Return the lower bound of the makespan of all builds by some rules, s.

    Minus infinity of a schedule, whose steps are given.
    """
    if isinstance(rules, Schedule):
        return -np.inf
    scene, team = network.scene, rules.team(network.scene)
    every = require_durations(scene, team)
    kinds = tuple((own, every.count(own)) for own in dict.fromkeys(every))
    holds = () if rules.begin is None else rules.begin.holds(scene)
    holding = [own for own, r in zip(every, team, strict=True) if holds and holds[r] is not None]
    held = tuple(holding.count(own) for own, _ in kinds)
    least, bare = rules.fewest_grips(scene) - len(scene.props), rules.how_it_ends is not Ending.HELD
    counted = _Counted(kinds, least, rules.span(scene), held, bare)
    sources, targets, work = zip(*counted.arcs(), strict=True)
    start = (counted.span[0], counted.held)
    nodes = {each: i for i, each in enumerate(dict.fromkeys([start, *sources, *targets]))}
    source, target = (np.array([nodes[n] for n in own], np.int32) for own in (sources, targets))
    last = counted.span[1]
    ends = [b == last and n > 0 and not (bare and any(held)) for n, (b, held) in enumerate(nodes)]
    peaks = (False,) * (1 + len(counted.kinds))
    graph = Graph(source, target, np.array(work), peaks, np.array(ends))
    sizes = np.array([1.0, *(size for _, size in counted.kinds)])
    return max(least_sum(graph, graph.amounts @ each) for each in _multipliers(graph, sizes))


def _multipliers(graph: Graph, sizes: Floats) -> Iterator[Floats]:
    """Yield multipliers of the time of all and of robots of kinds, at most one together."""
    yield np.eye(1, len(sizes))[0]
    ends, moves = np.flatnonzero(graph.ends), np.arange(len(graph.source))
    rows = np.concatenate([graph.source, ends, graph.target])
    columns = np.concatenate([np.arange(len(moves) + len(ends)), moves])
    signs = np.concatenate([np.ones(len(moves) + len(ends)), -np.ones(len(moves))])
    flow = sparse.csr_array((signs, (rows, columns)), (graph.states, len(moves) + len(ends) + 1))
    shares = np.column_stack([graph.amounts.T, np.zeros((len(sizes), len(ends))), -sizes])
    cost = np.eye(1, flow.shape[1], flow.shape[1] - 1)[0]
    begin = np.eye(1, graph.states)[0]
    solve = optimize.linprog
    found = solve(cost, shares, np.zeros(len(sizes)), flow, begin, method="highs")
    if found.x is not None:
        multipliers = np.maximum(-found.ineqlin.marginals, 0.0)
        yield multipliers / max(1.0, float(multipliers @ sizes))
