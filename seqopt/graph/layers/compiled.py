"""Layers of candidates as a graph: a level for every move, an arc for every allowed pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.graph import Graph
from seqopt.graph.instance import PEAK, SUM, TAIL, Instance, _Cap, _Target
from seqopt.graph.layers.costs import Budget, LayeredCosts, largest_of
from seqopt.graph.layers.layers import Layers
from seqopt.graph.paths import distances, reached
from seqopt.problem.problem import Aim, RobustAim

Blocks = Sequence[Floats]
"""What pairs take, (C_{k-1}, C_k) for every move; infinite where they are not allowed."""


class Compiled(NamedTuple):
    """Layers as an instance.

    ``candidates`` (n,): what every node stands for; ``offset``: what every path takes beside its
    arcs, since costs below zero were raised by as much, level by level.
    """

    instance: Instance
    candidates: Ints
    offset: float

    def choice(self, nodes: Sequence[int]) -> tuple[int, ...]:
        """Return the candidates on a path."""
        return tuple(self.candidates[list(nodes)].tolist())


def compile_layers(
    problem: Layers, aim: Aim | None, name: str = "", *, alone: bool = False
) -> Compiled:
    """Return the graph of choices, of one scene or over scenarios, whose sums or peaks count.

    ``alone``: whether with what a search of one move alone is charged; of peaks, with their parts.
    """
    name, nodes = name or problem.schedule.scene.name, problem.candidates
    if problem.scenes and problem.over.aim is Aim.SUM:
        layers = problem.layered(Aim.SUM)
        largest_of(layers)  # says if no choice is allowed in all scenarios
        return compile_totals(name, layers, problem.over, nodes)
    aim = aim or Aim.SUM
    costs = aim.costs(problem)
    charged = problem.alone if aim is Aim.SUM else costs
    found = compile_costs(name, costs, aim, problem.budgets, charged if alone else None, nodes)
    if not problem.scenes:
        return found
    (goal,) = found.instance.goals
    named = goal._replace(name=f"{goal.name} ({problem.over})")
    return found._replace(instance=replace(found.instance, goals=(named,)))


def compile_costs(
    name: str,
    costs: LayeredCosts,
    aim: Aim,
    budgets: Sequence[Budget] = (),
    alone: LayeredCosts | None = None,
    nodes: Sequence[Sequence[int]] | None = None,
) -> Compiled:
    """Return the graph of choices of which the sum, or the largest cost, is to be least.

    ``alone``: what a search of one move alone is charged: ranks are those among its candidates;
    ``nodes``: what candidates are called. Raises `InfeasibleError`, naming the move, if no choice
    is allowed; `ProblemError` if a budget is for other moves or candidates.
    """
    for budget in budgets:
        if budget.amounts.sizes != costs.sizes:
            raise ProblemError(f"budget {budget.name!r} is for other moves or candidates")
    costs.continuable()
    pairs = zip(costs.shared, costs.single, strict=True)
    join = np.add if aim is Aim.SUM else np.maximum
    said, kind = ("minmax", PEAK) if aim is Aim.PEAK else ("least sum", SUM)
    capped = [budget for budget in budgets if np.isfinite(budget.bound)]
    columns, offset = _raised([[join(shared, single) for shared, single in pairs]], kind)
    caps = []
    for k, budget in enumerate(capped, start=1):
        (taken,), less = _raised([budget.amounts.arcs()], SUM)
        columns.append(taken)
        caps.append(_Cap(budget.name, k, float(budget.bound - less)))
    beside = None
    if alone is not None:
        pairs = zip(alone.single, alone.shared, strict=True)
        beside = [np.broadcast_to(own, both.shape) for own, both in pairs], alone.shared
    names = ["cost", *(budget.name for budget in capped)]
    goal = _Target(said, kind, (0,))
    return _compiled(name, (names, (goal,), tuple(caps)), columns, nodes, beside, offset)


def compile_totals(
    name: str,
    layers: Sequence[LayeredCosts],
    aim: RobustAim,
    nodes: Sequence[Sequence[int]] | None = None,
) -> Compiled:
    """Return the graph of choices with a sum for every scenario, of which an aim makes one value.

    Raises `InfeasibleError` if no choice is allowed in all scenarios.
    """
    columns, offset = _raised([each.arcs() for each in layers], TAIL)
    names = [f"cost {k}" for k in range(len(columns))]
    count = len(columns)
    goal = _Target(str(aim), TAIL, tuple(range(count)), aim.most(count))
    return _compiled(name, (names, (goal,), ()), columns, nodes, None, offset)


def _raised(columns: Sequence[Blocks], kind: str) -> tuple[list[list[Floats]], float]:
    """Return columns with no amount below zero, and what is thereby missing in all of them.

    Sums are raised level by level, since every path has an arc on each; largest amounts all alike.
    """
    least = [min(float(block.min()) for block in level) for level in zip(*columns, strict=True)]
    if kind == PEAK:
        least = [min(least)] * len(least)
    low = np.minimum(least, 0.0)
    offset = float(low[0] if kind == PEAK else low.sum())
    if not offset:
        return [list(blocks) for blocks in columns], 0.0
    return [[b - own for b, own in zip(blocks, low, strict=True)] for blocks in columns], offset


def _compiled(
    name: str,
    asked: tuple[Sequence[str], tuple[_Target, ...], tuple[_Cap, ...]],
    columns: Sequence[Blocks],
    nodes: Sequence[Sequence[int]] | None,
    beside: tuple[Blocks, Blocks] | None,
    offset: float,
) -> Compiled:
    names, goals, caps = asked
    sizes = [block.shape[1] for block in columns[0]]
    firsts = np.cumsum([0, 1, *sizes])
    sources, targets, amounts, alone = [], [], [], []
    for k in range(len(sizes)):
        every = np.stack([column[k] for column in columns])
        before, now = np.nonzero(np.isfinite(every).all(axis=0))
        sources.append(before + firsts[k])
        targets.append(now + firsts[k + 1])
        amounts.append(every[:, before, now].T)
        if beside is not None:
            alone.append(np.column_stack([each[k][before, now] for each in beside]))
    source, target = (np.concatenate(each).astype(np.int32) for each in (sources, targets))
    peaks = tuple(goals[0].kind == PEAK and k == 0 for k in range(len(columns)))
    ends = np.arange(firsts[-1]) >= firsts[-2]
    charged = np.concatenate(alone) if alone else None
    whole = Graph(source, target, np.concatenate(amounts), peaks, ends, (), charged)
    graph, kept = on_paths(whole)
    candidates = np.concatenate([[0], *(np.arange(size) for size in sizes)])
    levels = np.repeat(np.arange(len(sizes) + 1), [1, *sizes])
    called = candidates if nodes is None else np.concatenate([[0], *nodes])
    rows = np.column_stack([levels, called]).astype(np.int64)[kept]
    instance = Instance(
        name,
        graph.source,
        graph.target,
        graph.ends,
        tuple(names),
        graph.amounts,
        goals,
        caps,
        rows,
        alone=graph.alone,
    )
    return Compiled(instance, candidates[kept], offset)


def on_paths(graph: Graph) -> tuple[Graph, Ints]:
    """Return the graph of nodes and arcs on paths from the start to ends, and which nodes."""
    ahead = np.isfinite(distances(graph, np.ones(len(graph.source)), back=True))
    on = reached(graph) & ahead
    if not on[0]:
        raise InfeasibleError("no path leads to an end")
    arcs = on[graph.source] & on[graph.target]
    number = (np.cumsum(on) - 1).astype(np.int32)
    part = graph.only(arcs)
    source, target = number[part.source], number[part.target]
    return replace(part, source=source, target=target, ends=graph.ends[on]), np.flatnonzero(on)
