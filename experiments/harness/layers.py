"""Costs of candidates of moves as arrays: drawn ones, or those of a problem with open grips.

A graph of them has a level for every move, and an arc for every pair of candidates that is allowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.graph import PEAK, SUM, Graph, Rows, _Target, lexicographic
from seqopt.graph.states import States
from seqopt.instances.compiled import _pruned
from seqopt.instances.model import Instance, _Cap
from seqopt.plan.solve import graph_of
from seqopt.problem.problem import Aim, Problem
from seqopt.sequence.schedule import Move, Schedule

JOIN = {Aim.SUM: np.add, Aim.PEAK: np.maximum}  # how costs go together


@dataclass(frozen=True, eq=False, repr=False)
class LayeredCosts(FrozenValue):
    """Costs of single choices and of neighboring pairs.

    One candidate per move is to be chosen; choices ``o`` cost
    ``sum_k single[k][o[k]] + sum_k shared[k][o[k-1], o[k]]``.

    ``single`` (tuple of (C_k,) float): of each candidate in the steps in which its move alone is
    open; infinite where it is not allowed; ``shared`` (tuple of (C_{k-1}, C_k) float): of each pair
    in the steps that the move shares with the one before; of the first move (1, C_0). Raises
    `ProblemError` if a move has no candidates, a value is no cost, or their sum overflows.
    """

    single: tuple[Floats, ...]
    shared: tuple[Floats, ...]

    def __post_init__(self) -> None:
        for name in ("single", "shared"):
            object.__setattr__(self, name, tuple(np.array(c, float) for c in getattr(self, name)))
        if 0 in self.sizes:
            move = self.sizes.index(0) + 1
            raise ProblemError(f"move {move} has no candidates; widen a reach or free a node")
        some = self.single + self.shared
        if any((np.isnan(values) | (values == -np.inf)).any() for values in some):
            raise ProblemError("a cost is NaN or -inf; mark what is not allowed as inf")
        if sum(float(np.abs(v[np.isfinite(v)]).max(initial=0.0)) for v in some) == np.inf:
            raise ProblemError("the costs are so large that their sum overflows; rescale them")
        super().__post_init__()

    @property
    def sizes(self) -> tuple[int, ...]:
        """How many candidates every move has."""
        return tuple(len(single) for single in self.single)

    def arcs(self, aim: Aim = Aim.SUM) -> list[Floats]:
        """Return the cost of a pair and its later choice, (C_{k-1}, C_k) for every move."""
        pairs = zip(self.shared, self.single, strict=True)
        return [JOIN[aim](shared, single) for shared, single in pairs]

    def parts(self, choice: Sequence[int]) -> list[float]:
        """Return the costs of a choice by move: its own, and that shared with the move before."""
        out, before = [], 0
        for single, shared, now in zip(self.single, self.shared, choice, strict=True):
            out += [float(single[now]), float(shared[before, now])]
            before = now
        return out

    def cost(self, choice: Sequence[int]) -> float:
        """Return the total cost of a choice; infinite if it is not allowed."""
        return sum(self.parts(choice))

    def worst(self, choice: Sequence[int]) -> float:
        """Return the largest cost that a choice meets; infinite if it is not allowed."""
        return max(self.parts(choice))

    def least(self, aim: Aim) -> float:
        """Return the least total, or largest cost, of any choice; infinite if there is none."""
        reached, join = np.zeros(1), JOIN[aim]
        for k, arcs in enumerate(self.arcs(aim)):
            reached = (join(reached[:, None], arcs) if k else arcs).min(axis=0)
        return float(reached.min())


Blocks = Sequence[Floats]
"""What pairs take, (C_{k-1}, C_k) for every move; infinite where they are not allowed."""


Step = tuple[tuple[int, ...], Floats]
"""Moves that are open in a step, and what their choices cost."""


class Compiled(NamedTuple):
    """An instance whose nodes stand for ``candidates`` (n,)."""

    instance: Instance
    candidates: Ints

    def choice(self, nodes: Sequence[int]) -> tuple[int, ...]:
        """Return the candidates on a path."""
        return tuple(self.candidates[list(nodes)].tolist())


def best_in_order(goals: Sequence[tuple[LayeredCosts, Aim]]) -> tuple[int, ...]:
    """Return the choice that is best in the first goal, among these in the second, and so on.

    ``goals``: costs of the same moves, and whether their sum or the largest is to be small. Raises
    `InfeasibleError` if no choice is allowed by all.
    """
    kinds = [PEAK if aim is Aim.PEAK else SUM for _, aim in goals]
    targets = tuple(_Target(f"goal {k + 1}", kind, (k,)) for k, kind in enumerate(kinds))
    asked = [goal.name for goal in targets], targets, ()
    found = compiled("goals in order", asked, [costs.arcs(aim) for costs, aim in goals])
    return found.choice(lexicographic(found.instance.graph).path)


def compiled(
    name: str,
    asked: tuple[Sequence[str], tuple[_Target, ...], tuple[_Cap, ...]],
    columns: Sequence[Blocks],
    beside: tuple[Blocks, Blocks] | None = None,
) -> Compiled:
    names, goals, caps = asked
    sizes = [block.shape[1] for block in columns[0]]
    source, target, amounts, alone = _arcs(columns, beside or ())
    largest = {c for goal in goals if goal.kind == PEAK for c in goal.columns}
    peaks = tuple(k in largest for k in range(len(columns)))
    ends = np.arange(1 + sum(sizes)) >= 1 + sum(sizes[:-1])
    charged = None if beside is None else alone
    graph, kept = _pruned(Graph(source, target, amounts, peaks, ends, (), charged))
    candidates = np.concatenate([[0], *(np.arange(size) for size in sizes)])[kept]
    levels = np.repeat(np.arange(len(sizes) + 1), [1, *sizes])[kept]
    rows = np.column_stack([levels, candidates]).astype(np.int64)
    arcs = graph.source, graph.target, graph.ends, tuple(names), graph.amounts
    return Compiled(Instance(name, *arcs, goals, caps, rows, alone=graph.alone), candidates)


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


@dataclass(frozen=True, eq=False)
class Layers:
    """The costs of the candidates of all moves of a problem with open grips.

    ``moves``: of the schedule; ``steps``: of every open step the moves that are open, and what
    their choices cost, (C,) or (C, D), infinite where they are not allowed; ``charged``: the same
    as a search of one move alone is charged; ``given``: of other steps, before the first move.
    """

    moves: Sequence[Move]
    steps: Sequence[Step]
    charged: Sequence[Step]
    given: Sequence[Step]

    @cached_property
    def sums(self) -> LayeredCosts:
        """The costs whose sum over the build counts."""
        return self.joined(np.add, [*self.steps, *self.given])

    @cached_property
    def peaks(self) -> LayeredCosts:
        """The costs of which the largest counts."""
        return self.joined(np.maximum, [*self.steps, *self.given])

    @cached_property
    def alone(self) -> LayeredCosts:
        """The sums that a search of one move alone is charged."""
        return self.joined(np.add, [*self.charged, *self.given])

    def joined(self, join: np.ufunc, steps: Sequence[Step]) -> LayeredCosts:
        """Return costs of single choices and of pairs from those of steps."""
        sizes = tuple(len(move.candidates) for move in self.moves)
        found = dict[tuple[int, ...], Floats]()
        for moves, costs in steps:
            found[moves] = join(found[moves], costs) if moves in found else costs
        single = tuple(found.get((k,), np.zeros(size)) for k, size in enumerate(sizes))
        pairs = enumerate(pairwise((1, *sizes)))
        shared = tuple(found.get((k - 1, k), np.zeros(pair)) for k, pair in pairs)
        return LayeredCosts(single, shared)


def cost_layers(problem: Problem | States) -> Layers:
    """Return the costs of all candidates of a problem, or of its states, of one scenario."""
    graph = problem if isinstance(problem, States) else graph_of(problem, Aim.SUM)
    assert isinstance(graph.rules, Schedule)
    space, moves = graph.space, graph.rules.moves
    steps, every = list[Step](), list[Step]()
    for level, step in enumerate(graph.rules.steps, start=1):
        if step.moves:
            choices = space.candidates(level)
            costs, within = graph.values(level, choices.states)
            charged = graph.candidates.charges(level, choices.states).sum(axis=1)
            found = [choices.spread(np.where(within, c, np.inf)) for c in (costs[:, 0], charged)]
            own, charged = (np.where(np.isnan(each), np.inf, each) for each in found)
            steps.append((step.moves, own))
            every.append((step.moves, charged))
    first = len(moves[0].candidates)
    given = [graph.values(*each)[0][0, 0] for each in space.without_choice()]
    alike = [((-1, 0), np.full((1, first), cost)) for cost in given]
    return Layers(moves, steps, every, alike)
