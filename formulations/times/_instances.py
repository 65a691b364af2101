"""Instances with times, by the same stages as states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from formulations.states._search import StopError, plan_by_then
from formulations.times._stages import Choose, Stages
from seqopt.errors import ProblemError
from seqopt.graph._explore import Visited
from seqopt.graph.instances.instance import PEAK, TIME, Instance
from seqopt.plan.calling._guard import StatePath
from seqopt.plan.calling.formulation import Watch
from seqopt.problem.problem import Goal, Measure


class _Asking(NamedTuple):
    goals: tuple[Goal, ...]
    aims: tuple[Goal, ...]
    budgets: tuple[float, ...]


def of_instance(instance: Instance, choose: Choose, watch: Watch) -> StatePath:
    """Return the best path through an instance, its states the numbers of nodes."""
    timed = instance.timed
    if timed is None:
        raise ProblemError(f"instance {instance.name}: no times are asked; take path_dp")
    own = {PEAK: Measure.PEAK, TIME: Measure.MAKESPAN}
    aims = tuple(Goal(own.get(goal.kind, Measure.SUM)) for goal in instance.goals)
    caps = [Measure.MAKESPAN if c.column is None else Measure.SUM for c in instance.caps]
    asked = _Asking((*aims, *map(Goal, caps)), aims, tuple(cap.most for cap in instance.caps))
    stages = Stages(
        asked,
        Visited(timed.graph, ((0, 0, np.arange(instance.nodes)[:, None]),)),
        choose,
        watch,
        timed,
    )
    try:
        found = stages.run()
    except StopError as stop:
        return plan_by_then(None, stop)
    makespan = stages.least(found.path)
    pairs = zip(aims, stages.values(found.path), strict=False)
    values = [makespan if goal.measure is Measure.MAKESPAN else v for goal, v in pairs]
    bounds = [min(b, v) for b, v in zip(found.bounds, values, strict=False)]
    bounds += values[len(bounds) :]
    states, late = tuple((node,) for node in found.path), "time" * found.late
    proofs = tuple(found.proofs)
    return StatePath(states, tuple(values), tuple(bounds), stopped=late, proofs=proofs)
