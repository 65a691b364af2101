"""How long builds take at least, by how many grips robots hold: a bound without their states.

Who holds which node is forgotten: what is left is how many bricks stand, and how many robots of
every kind hold. Every build is a path through these counts that takes as much of the time of all
and of robots, ways aside; so the priced time of the shortest one bounds all builds. There are a few
hundred counts where there are millions of states.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats
from seqopt.graph.duality import least_sum
from seqopt.graph.graph import Graph
from seqopt.network.network import Network
from seqopt.scene._durations import Durations
from seqopt.sequence._durations import require_durations
from seqopt.sequence.rules import Ending, FreeRules
from seqopt.sequence.schedule import Schedule

_Counts = tuple[int, tuple[int, ...]]  # bricks that stand, and grips by kind


@dataclass
class _Arcs:
    """Moves between counts: from, to, and what they take of the time of all and of kinds, s."""

    source: list[_Counts] = field(default_factory=list)
    target: list[_Counts] = field(default_factory=list)
    work: list[list[float]] = field(default_factory=list)


@dataclass(frozen=True)
class _Counted:
    """A build by counts.

    ``kinds``: how long robots take, and how many take as long; ``least``: grips that are held from
    the second brick on; ``span``: bricks where it begins and ends; ``held``: grips at first.
    """

    kinds: tuple[tuple[Durations, int], ...]
    least: int
    span: tuple[int, int]
    held: tuple[int, ...]
    bare: bool

    def arcs(self) -> _Arcs:
        """Return all moves, more of them than rules allow."""
        out, (first, last) = _Arcs(), self.span
        every = product(range(first, last + 1), product(*(range(n + 1) for _, n in self.kinds)))
        for here in [(first, self.held), *every]:
            for k, (own, size) in enumerate(self.kinds):
                bricks, grips = here
                up, down = self._moved(grips, k, 1), self._moved(grips, k, -1)
                if grips[k] < size and bricks < last and self._holds(bricks + 1, up):
                    self._add(out, here, (bricks + 1, up), (own.place, k, own.fetch))
                if grips[k] < size and bricks:
                    self._add(out, here, (bricks, up), (own.grip, k, own.approach))
                if grips[k] and (self._holds(bricks, down) or (self.bare and bricks == last)):
                    self._add(out, here, (bricks, down), (own.release, None, 0.0))
            if self.bare and here[0] == last and any(here[1]):
                acts = max(d.release for (d, _), n in zip(self.kinds, here[1], strict=True) if n)
                self._add(out, here, (last, (0,) * len(self.kinds)), (acts, None, 0.0))
        return out

    def _moved(self, grips: tuple[int, ...], kind: int, more: int) -> tuple[int, ...]:
        return tuple(n + more * (k == kind) for k, n in enumerate(grips))

    def _holds(self, bricks: int, grips: tuple[int, ...]) -> bool:
        """Return whether rules may be kept with so many grips."""
        return bricks < 2 or sum(grips) >= self.least

    def _add(
        self, out: _Arcs, here: _Counts, to: _Counts, what: tuple[float, int | None, float]
    ) -> None:
        acts, kind, prepares = what
        out.source.append(here)
        out.target.append(to)
        busy = [acts * (n + (k == kind)) for k, n in enumerate(here[1])]
        out.work.append([acts, *(b + prepares * (k == kind) for k, b in enumerate(busy))])


def least_by_counts(network: Network, rules: FreeRules | Schedule) -> float:
    """Return what no build by some rules takes less than, s; it holds whatever else is asked.

    Of a schedule nothing is said: minus infinity.
    """
    if isinstance(rules, Schedule):
        return -np.inf
    counted = _counted(network, rules)
    arcs = counted.arcs()
    start = (counted.span[0], counted.held)
    nodes = {each: i for i, each in enumerate(dict.fromkeys([start, *arcs.source, *arcs.target]))}
    source = np.array([nodes[each] for each in arcs.source], dtype=np.int32)
    target = np.array([nodes[each] for each in arcs.target], dtype=np.int32)
    work = np.array(arcs.work)
    last = counted.span[1]
    ends = [b == last and n > 0 and not (counted.bare and any(h)) for n, (b, h) in enumerate(nodes)]
    graph = Graph(source, target, work, (False,) * work.shape[1], np.array(ends))
    sizes = np.array([1.0, *(size for _, size in counted.kinds)])
    return max(least_sum(graph, graph.amounts @ each) for each in _prices(graph, sizes))


def _counted(network: Network, rules: FreeRules) -> _Counted:
    """Return a build by counts: robots are of one kind if they take as long."""
    scene, team = network.scene, rules.team(network.scene)
    every = require_durations(scene, team)
    kinds = tuple((own, every.count(own)) for own in dict.fromkeys(every))
    holds = () if rules.begin is None else rules.begin.holds(scene)
    holding = [own for own, r in zip(every, team, strict=True) if holds and holds[r] is not None]
    held = tuple(holding.count(own) for own, _ in kinds)
    least = rules.fewest_grips(scene) - len(scene.props)
    return _Counted(kinds, least, rules.span(scene), held, rules.how_it_ends is not Ending.HELD)


def _prices(graph: Graph, sizes: Floats) -> Iterator[Floats]:
    """Yield prices of the time of all and of robots of kinds, at most one together over all."""
    from scipy.optimize import linprog  # noqa: PLC0415  # it takes long to load

    yield np.eye(1, len(sizes))[0]
    ends, moves = np.flatnonzero(graph.ends), np.arange(len(graph.source))
    rows = np.concatenate([graph.source, ends, graph.target])
    columns = np.concatenate([np.arange(len(moves) + len(ends)), moves])
    signs = np.concatenate([np.ones(len(moves) + len(ends)), -np.ones(len(moves))])
    flow = sparse.csr_array((signs, (rows, columns)), (graph.states, len(moves) + len(ends) + 1))
    shares = np.column_stack([graph.amounts.T, np.zeros((len(sizes), len(ends))), -sizes])
    cost = np.eye(1, flow.shape[1], flow.shape[1] - 1)[0]
    begin = np.eye(1, graph.states)[0]
    solve: Any = linprog  # its stubs know no sparse rows
    found = solve(cost, shares, np.zeros(len(sizes)), flow, begin, method="highs")
    if found.x is not None:
        prices = np.maximum(-found.ineqlin.marginals, 0.0)
        yield prices / max(1.0, float(prices @ sizes))
