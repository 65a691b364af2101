"""What a plan is worth by a reference: its gap to the proven optimum, the error of its responses.

The data are those of the reference engine, whichever engine led to the plan, and so is the bound.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine
from seqopt.errors import SolverError
from seqopt.graph.layers.costs import TINY
from seqopt.plan.calling.formulation import End, On
from seqopt.plan.judge.certificate import least_sum
from seqopt.plan.judge.schedules import plan_values
from seqopt.plan.plan import Plan
from seqopt.plan.solving import layers_of, natural, solve, states_of, usual
from seqopt.problem.problem import Problem
from seqopt.responses.quantities import RESPONSES
from seqopt.responses.table import analyze, force_column
from seqopt.sequence.steps import Step

ROUNDING = 1e-9  # gaps and errors below are none
SHOWN = [RESPONSES[name].column for name in ("M_sup", "T_max", "D_max")]  # beside grip forces


@dataclass(frozen=True, eq=False)
class Reference:
    """A problem with the engine that others are compared with."""

    problem: Problem

    def prepare(self) -> None:
        """Compute what gaps are measured by; a `SolverError` says that no optimum was proven."""
        _ = layers_of(self.problem).sums if self.in_layers else self._best

    @property
    def in_layers(self) -> bool:
        """Whether candidates are chosen in layers, and not states."""
        return natural(self.problem) is On.LAYERS

    @cached_property
    def _best(self) -> tuple[float, ...]:
        """The value of every goal in the proven optimum."""
        plan = solve(self.problem, usual(self.problem))
        if plan.ended is End.INTERRUPTED:
            raise KeyboardInterrupt
        if plan.ended is not End.DONE or plan.certificate is None:
            raise SolverError(f"{plan.formulation.name} ended early: no optimum is proven")
        return plan.certificate.values  # noqa: PD011  # of goals

    def gap(self, plan: Plan) -> float:
        """Return how far a plan is above the optimum, over its size; infinite if not allowed."""
        found = self._layered(plan) if self.in_layers else self._of_states(plan)
        return 0.0 if found < ROUNDING else found

    def _layered(self, plan: Plan) -> float:
        costs = layers_of(self.problem).sums
        parts = np.abs(costs.parts(plan.choice))
        if not np.isfinite(parts).all():
            return np.inf
        return (costs.cost(plan.choice) - least_sum(costs)) / max(float(parts.sum()), TINY)

    def _of_states(self, plan: Plan) -> float:
        """Return the gap in the first goal that is not at its optimum."""
        try:
            values = plan_values(states_of(self.problem), plan.steps)
        except SolverError:  # a limit is exceeded
            return np.inf
        gaps = [(v - b) / (abs(v) or 1.0) for v, b in zip(values, self._best, strict=True)]
        return next((gap for gap in gaps if abs(gap) >= ROUNDING), 0.0)

    def error(self, engine: Engine, steps: Sequence[Step]) -> float:
        """Return the largest difference of a response of steps, over the largest of its kind."""
        pairs = zip(
            self._kinds(engine, steps), self._kinds(self.problem.engine, steps), strict=True
        )
        found = max(
            float(np.nanmax(np.abs(own - known)) / (np.nanmax(np.abs(known)) or 1.0))
            for own, known in pairs
        )
        return 0.0 if found < ROUNDING else found

    def _kinds(self, engine: Engine, steps: Sequence[Step]) -> Iterator[Floats]:
        """Yield the responses of steps, kind by kind: grip forces, moments, tension, motion."""
        table: pd.DataFrame = analyze(engine, steps)
        forces = [force_column(robot) for robot in self.problem.scene.robots]
        for columns in (forces, *([name] for name in SHOWN)):
            yield table[columns].to_numpy(float)
