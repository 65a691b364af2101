"""Costs and budgets of candidates and pairs as arrays, and the graph of decisions they make.

The graph has a level for every move, and an arc for every pair of candidates that is allowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.graph import Graph, Rows
from seqopt.graph.instance import PEAK, SUM, TAIL, Instance, _Cap, _Target
from seqopt.graph.paths import distances, lexicographic, reached
from seqopt.problem.problem import Aim, RobustAim

TINY = float(np.finfo(float).tiny)


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
            object.__setattr__(self, name, tuple(map(_copied, getattr(self, name))))
        if 0 in self.sizes:
            move = self.sizes.index(0) + 1
            raise ProblemError(f"move {move} has no candidates; widen a reach or free a node")
        some = [*map(_values, (*self.single, *self.shared))]  # the largest that is allowed counts
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
        return [aim.join(shared, single) for shared, single in pairs]

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
        reached, join = np.zeros(1), aim.join
        for k, arcs in enumerate(self.arcs(aim)):
            reached = (join(reached[:, None], arcs) if k else arcs).min(axis=0)
        return float(reached.min())


def _copied(costs: Floats) -> Floats:
    """Return a copy; one number for all choices stays one number."""
    given = np.asarray(costs)
    if given.size and not any(given.strides):
        return np.broadcast_to(np.array(given.flat[0], dtype=float), given.shape)
    return np.array(given, dtype=float)


def _values(costs: Floats) -> Floats:
    """Return the costs, or the one number that they all are, (1,)."""
    return costs if any(costs.strides) or not costs.size else np.array([costs.flat[0]])


@dataclass(frozen=True, eq=False, repr=False)
class Budget(FrozenValue):
    """A cap on a total over the build.

    ``name``: what is capped, with its unit; ``single``, ``shared``: use of each choice and of each
    pair, finite, as of `LayeredCosts`; ``bound``: infinite if there is no cap.
    """

    name: str
    single: tuple[Floats, ...]
    shared: tuple[Floats, ...]
    bound: float

    @property
    def amounts(self) -> LayeredCosts:
        """Uses of the budget as costs of choices; made anew each time, as judges need it."""
        return LayeredCosts(self.single, self.shared)

    def spent(self, choice: Sequence[int]) -> float:
        """Return the use of the budget by a choice, in its unit."""
        return self.amounts.cost(choice)


class ScenarioCosts(NamedTuple):
    """What candidates cost in one scenario, models that were solved, and seconds that took."""

    sums: LayeredCosts
    peaks: LayeredCosts
    models: int
    seconds: float


def largest_of(layers: Sequence[LayeredCosts]) -> LayeredCosts:
    """Return the largest of several costs of the same moves, choice by choice and pair by pair.

    The largest cost that a choice meets in any of them is the largest that it meets in this one.
    """
    # one after the other: all in one array would be a large one
    single, shared = (
        tuple(reduce(np.maximum, each) for each in zip(*arrays, strict=True))
        for arrays in ([own.single for own in layers], [own.shared for own in layers])
    )
    return LayeredCosts(single, shared)


class Joined:
    """The costs of all choices, steps of the same moves joined as they come.

    ``sizes``: how many candidates every move has; ``join``: ``numpy.add`` or ``numpy.maximum``.
    """

    def __init__(self, sizes: Sequence[int], join: np.ufunc) -> None:
        self._sizes, self._join = tuple(sizes), join
        self._found: dict[tuple[int, ...], Floats] = {}
        self._least = np.inf

    def add(self, moves: tuple[int, ...], costs: Floats) -> None:
        """Join the costs, (C,) or (C, D), of a step with one open move, or two neighboring ones."""
        finite = costs[np.isfinite(costs)]
        self._least = min(self._least, float(finite.min(initial=np.inf)))
        before = self._found.get(moves)
        if before is None:
            before = np.zeros(1) if self._join is np.add else costs
        self._found[moves] = self._join(before, costs)

    def add_anyway(self, cost: float) -> None:
        """Join the cost that all choices share, to the costs of the first move."""
        self.add((-1, 0), np.full((1, self._sizes[0]), cost))

    def single(self, move: int) -> Floats:
        """Return the costs of a move's candidates where it alone is open.

        Result (C_k,): nothing where it never is, or no more than any cost.
        """
        return self._of((move,), (self._sizes[move],))

    def layered(self) -> LayeredCosts:
        """Return the costs of choices and pairs; moves that share no step take no memory."""
        pairs = zip([1, *self._sizes[:-1]], self._sizes, strict=True)
        shared = tuple(self._of((k - 1, k), pair) for k, pair in enumerate(pairs))
        return LayeredCosts(tuple(map(self.single, range(len(self._sizes)))), shared)

    def budget(self, name: str, bound: float) -> Budget:
        """Return the budget that caps the joined total."""
        amounts = self.layered()
        return Budget(name, amounts.single, amounts.shared, bound)

    def _of(self, moves: tuple[int, ...], shape: tuple[int, ...]) -> Floats:
        if moves in self._found:
            return self._found[moves]
        nothing = self._join is np.add or np.isinf(self._least)
        return np.broadcast_to(0.0 if nothing else self._least, shape)


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
    """Return columns with no amount below zero, and the total to add to values of paths.

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
