"""Costs of candidates as tests draw them, and what formulations answer for them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from experiments.harness.layers import Compiled, LayeredCosts, compiled, cost_layers
from seqopt.arrays import Floats, FrozenValue
from seqopt.errors import ProblemError
from seqopt.graph.formulation import Formulation, FormulationKind, Run, Solution, as_formulation
from seqopt.graph.graph import PEAK, SUM, TAIL, _Target
from seqopt.instances._solve import find_path
from seqopt.instances.model import _Cap
from seqopt.problem.problem import Aim, RobustAim


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


def largest_of(layers: Sequence[LayeredCosts]) -> LayeredCosts:
    """Return the largest of several costs of the same moves, choice by choice and pair by pair.

    The largest cost that a choice meets in any of them is the largest that it meets in this one.
    """

    def largest(every: Iterable[tuple[Floats, ...]]) -> tuple[Floats, ...]:
        return tuple(np.max(each, axis=0) for each in zip(*every, strict=True))

    return LayeredCosts(largest(c.single for c in layers), largest(c.shared for c in layers))


def compile_costs(
    name: str,
    costs: LayeredCosts,
    aim: Aim,
    budgets: Sequence[Budget] = (),
    alone: LayeredCosts | None = None,
) -> Compiled:
    """Return the graph of choices of which the sum, or the largest cost, is to be least.

    ``alone``: what a search of one move alone is charged: ranks are those among its candidates.
    Raises `InfeasibleError`, naming the move, if no choice is allowed; `ProblemError` if a budget
    is for other moves or candidates.
    """
    for budget in budgets:
        if budget.amounts.sizes != costs.sizes:
            raise ProblemError(f"budget {budget.name!r} is for other moves or candidates")
    said, kind = ("minmax", PEAK) if aim is Aim.PEAK else ("least sum", SUM)
    capped = [budget for budget in budgets if np.isfinite(budget.bound)]
    columns = [costs.arcs(aim), *(budget.amounts.arcs() for budget in capped)]
    caps = [_Cap(b.name, k, float(b.bound)) for k, b in enumerate(capped, start=1)]
    beside = None
    if alone is not None:
        pairs = zip(alone.single, alone.shared, strict=True)
        beside = [np.broadcast_to(own, both.shape) for own, both in pairs], alone.shared
    names = ["cost", *(budget.name for budget in capped)]
    return compiled(name, (names, (_Target(said, kind, (0,)),), tuple(caps)), columns, beside)


def compile_totals(name: str, layers: Sequence[LayeredCosts], aim: RobustAim) -> Compiled:
    """Return the graph of choices with a sum for every scenario, of which an aim makes one value.

    Raises `InfeasibleError` if no choice is allowed in all scenarios.
    """
    count = len(layers)
    goal = _Target(str(aim), TAIL, tuple(range(count)), aim.most(count))
    asked = [f"cost {k}" for k in range(count)], (goal,), ()
    return compiled(name, asked, [each.arcs() for each in layers])


@dataclass(frozen=True)
class Costs:
    """Costs of candidates and pairs, whose sum or largest is to be small, and budgets."""

    sums: LayeredCosts
    budgets: tuple[Budget, ...] = ()
    alone: LayeredCosts | None = None  # as a search of one move sees them; by default the same
    largest: LayeredCosts | None = None  # those whose largest counts; by default the same

    @property
    def peaks(self):
        return self.largest or self.sums

    def compiled(self, aim=Aim.SUM):
        costs = self.sums if aim is Aim.SUM else self.peaks
        return compile_costs("drawn", costs, aim, self.budgets, self.alone or self.sums)

    def worth(self, choice, aim=Aim.SUM):
        return (self.sums.cost if aim is Aim.SUM else self.peaks.worst)(choice)

    def within(self, aim=Aim.SUM):
        """What every choice within limits and budgets is worth."""
        worths = {c: self.worth(c, aim) for c in product(*map(range, self.sums.sizes))}
        return {
            choice: worth
            for choice, worth in worths.items()
            if np.isfinite(worth) and all(b.spent(choice) <= b.bound for b in self.budgets)
        }

    def best(self, aim=Aim.SUM):
        """The least value within budgets, infinite if there is none."""
        return min(self.within(aim).values(), default=np.inf)


def of_layers(problem):
    """The costs of candidates that were computed for a problem."""
    found = cost_layers(problem)
    return Costs(found.sums, (), found.alone, found.peaks)


@dataclass(frozen=True)
class Answer:
    """What a formulation claims of costs, and what is proven of it."""

    choice: tuple[int, ...]
    objective: float
    bound: float
    prices: dict[str, float] = field(default_factory=dict)
    stopped: str = ""
    trace: tuple = ()
    certificate: object = None
    compile_seconds: float = 0.0


def answer(
    costs,
    formulation="overlap_dp",
    *,
    aim=None,
    proof=True,
    time_limit=np.inf,
    progress=None,
    **options,
):
    """The judged answer of a formulation, by name or itself, for costs."""
    formulation = as_formulation(formulation)
    compiled = costs.compiled(aim or formulation.aim or Aim.SUM)
    run = Run(time_limit, progress, proof, options=options)
    found = find_path(compiled.instance, formulation, run)
    claimed = found.selection
    caps = [cap.name for cap in compiled.instance.caps]
    prices = dict(zip(caps, claimed.prices[0] if claimed.prices else (), strict=False))
    choice = compiled.choice([node for (node,) in claimed.states])
    told = claimed.objective[0], claimed.bound[0], prices, claimed.stopped, claimed.trace
    return Answer(choice, *told, found.certificate, claimed.compile_seconds)


def changed(formulation, change):
    """A formulation of whose answers, paths through an instance, something is changed."""
    formulation = as_formulation(formulation)

    def solve(problem, *, watch=None):
        return change(formulation.solve(problem, watch=watch))

    return replace(formulation, solve=solve)


def path_of(compiled, choice):
    """The nodes that a choice stands for; a candidate that no path passes has none."""
    levels, nodes = compiled.instance.levels, []
    for level, candidate in enumerate(choice, start=1):
        nodes += np.flatnonzero((levels == level) & (compiled.candidates == candidate)).tolist()
    return tuple(nodes)


def told(
    costs,
    choice,
    objective,
    bound=-np.inf,
    *,
    prices=(),
    kind=FormulationKind.HEURISTIC,
    aim=Aim.SUM,
    stopped="",
):
    """A formulation that answers as it is told, whatever is true."""

    def solve(instance):
        states = tuple((node,) for node in path_of(costs.compiled(aim), choice))
        values = (objective,), (bound,)
        return Solution(states, *values, prices=(tuple(prices),), stopped=stopped)

    return Formulation("told", "", kind, aim, solve, takes_budgets=True)
