"""Costs of candidates as tests draw them, and what formulations answer for them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from seqopt.graph.formulation import Run, as_formulation
from seqopt.graph.layers.compiled import compile_costs
from seqopt.graph.layers.costs import Budget, LayeredCosts
from seqopt.plan._paths import find_path
from seqopt.problem.problem import Aim


@dataclass(frozen=True)
class Costs:
    """Costs of candidates and pairs, whose sum or largest is to be small, and budgets."""

    sums: LayeredCosts
    budgets: tuple[Budget, ...] = ()

    @property
    def peaks(self):
        return self.sums

    def compiled(self, aim=Aim.SUM):
        return compile_costs("drawn", self.sums, aim, self.budgets, alone=self.sums)


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


def answer(costs, formulation="overlap_dp", *, aim=None, proof=True, time_limit=np.inf, **options):
    """The judged answer of a formulation, by name or itself, for costs."""
    formulation = as_formulation(formulation)
    compiled = costs.compiled(aim or formulation.aim or Aim.SUM)
    run = partial(Run, proof=proof, time_limit=time_limit)(options=options)
    found = find_path(compiled.instance, formulation, run, compiled.offset)
    claimed = found.selection
    caps = [cap.name for cap in compiled.instance.caps]
    prices = dict(zip(caps, claimed.prices[0] if claimed.prices else (), strict=False))
    choice = compiled.choice([node for (node,) in claimed.states])
    told = claimed.objective[0], claimed.bound[0], prices, claimed.stopped, claimed.trace
    return Answer(choice, *told, found.certificate)
