"""Decisions of candidates as a graph: a level for every move, an arc for every allowed pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.decision_costs import Budget, LayeredCosts
from seqopt.graph.graph import Graph, Rows
from seqopt.graph.instance import PEAK, SUM, TAIL, Instance, _Cap, _Target
from seqopt.graph.paths import distances, lexicographic, reached
from seqopt.problem.problem import Aim, RobustAim

Blocks = Sequence[Floats]
"""What pairs take, (C_{k-1}, C_k) for every move; infinite where they are not allowed."""


class Compiled(NamedTuple):
    """Decisions as an instance.

    ``candidates`` (n,): what every node stands for; ``offset``: what every path takes beside its
    arcs, since costs below zero were raised by as much, level by level.
    """

    instance: Instance
    candidates: Ints
    offset: float

    def choice(self, nodes: Sequence[int]) -> tuple[int, ...]:
        """Return the candidates on a path."""
        return tuple(self.candidates[list(nodes)].tolist())


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
    said, kind = ("minmax", PEAK) if aim is Aim.PEAK else ("least sum", SUM)
    capped = [budget for budget in budgets if np.isfinite(budget.bound)]
    columns, offset = _raised([costs.arcs(aim)], kind)
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


def best_in_order(goals: Sequence[tuple[LayeredCosts, Aim]]) -> tuple[int, ...]:
    """Return the choice that is best in the first goal, among these in the second, and so on.

    ``goals``: costs of the same moves, and whether their sum or the largest is to be small. Raises
    `InfeasibleError` if no choice is allowed by all.
    """
    columns, targets = list[Blocks](), list[_Target]()
    for k, (costs, aim) in enumerate(goals):
        kind = PEAK if aim is Aim.PEAK else SUM
        columns += _raised([costs.arcs(aim)], kind)[0]
        targets.append(_Target(f"goal {k + 1}", kind, (k,)))
    asked = [goal.name for goal in targets], tuple(targets), ()
    found = _compiled("goals in order", asked, columns, None, None, 0.0)
    return found.choice(lexicographic(found.instance.graph).path)


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
    source, target, amounts, alone = _arcs(columns, beside or ())
    largest = {c for goal in goals if goal.kind == PEAK for c in goal.columns}
    peaks = tuple(k in largest for k in range(len(columns)))
    ends = np.arange(1 + sum(sizes)) >= 1 + sum(sizes[:-1])
    charged = None if beside is None else alone
    graph, kept = on_paths(Graph(source, target, amounts, peaks, ends, (), charged))
    candidates = np.concatenate([[0], *(np.arange(size) for size in sizes)])
    levels = np.repeat(np.arange(len(sizes) + 1), [1, *sizes])
    called = candidates if nodes is None else np.concatenate([[0], *nodes])
    rows = np.column_stack([levels, called]).astype(np.int64)[kept]
    arcs = graph.source, graph.target, graph.ends, tuple(names), graph.amounts
    instance = Instance(name, *arcs, goals, caps, rows, alone=graph.alone)
    return Compiled(instance, candidates[kept], offset)


def _arcs(columns: Sequence[Blocks], beside: Sequence[Blocks]) -> tuple[Rows, Rows, Floats, Floats]:
    """Return the arcs of pairs that all columns allow: source, target, (m, c) and (m, b) amounts.

    Raises `InfeasibleError`, naming the move at which the last allowed choice ends.
    """
    parts, firsts, reached = [], (0, 1), np.ones(1, dtype=bool)
    for k, level in enumerate(zip(*columns, strict=True)):
        every = np.stack(level)
        allowed = np.isfinite(every).all(axis=0)
        reached = allowed[reached].any(axis=0)
        if not reached.any():
            raise InfeasibleError(
                f"move {k + 1}: none of its {len(reached)} candidates is allowed after any choice "
                "before it; relax a limit or widen a reach (--aim F_largest without "
                "limits finds the least that robots must hold)"
            )
        before, now = np.nonzero(allowed)
        own = np.array([each[k][before, now] for each in beside]).reshape(-1, len(now))
        parts.append((before + firsts[0], now + firsts[1], every[:, before, now].T, own.T))
        firsts = firsts[1], firsts[1] + len(reached)
    source, target, amounts, alone = (np.concatenate(each) for each in zip(*parts, strict=True))
    return source.astype(np.int32), target.astype(np.int32), amounts, alone


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
