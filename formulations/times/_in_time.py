"""How formulations of time are called: with states or an instance, and plans from their paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from formulations.states._search import (
    WIDTH,
    StopError,
    Watching,
    after_margins,
    narrow,
    plan_by_then,
    watched,
)
from formulations.times._stages import Choose, Stages, _Stage
from seqopt.arrays import Terse
from seqopt.errors import InfeasibleError, ProblemError, TimeUpError
from seqopt.graph._explore import Explorer, Visited
from seqopt.graph.instances.instance import PEAK, TIME, Instance
from seqopt.graph.paths import tied
from seqopt.graph.states._visits import FreeStates, steps_of
from seqopt.graph.states.states import States
from seqopt.plan.calling._guard import StatePath
from seqopt.plan.calling.formulation import Formulation, FormulationKind, On, Watch
from seqopt.problem.problem import Goal, Measure
from seqopt.sequence._robot_kinds import node_numbers
from seqopt.sequence._rule_space import FreeSpace
from seqopt.sequence._timing import reassigned_steps, step_times
from seqopt.work.progress import Tell


@dataclass(frozen=True, repr=False)
class _InTime(Terse):
    """The ``solve`` of a formulation of time."""

    choose: Choose = field(repr=False)

    def __call__(
        self,
        problem: States | Instance,
        *,
        seconds: float = np.inf,
        max_memory: float = np.inf,
        progress: Tell = lambda _: None,
    ) -> StatePath:
        """Return the plan of the chosen path; where time or memory ends early, the best so far."""
        watch = Watch(seconds)
        if isinstance(problem, Instance):
            return _of_instance(problem, self.choose, watch)
        tell = watched(problem, watch, max_memory, progress)
        return after_margins(
            problem, lambda rest: _searched(rest, self.choose, watch, tell, progress), tell
        )


def _searched(
    problem: States, choose: Choose, watch: Watch, tell: Watching, progress: Tell
) -> StatePath:
    """Return the best plan of states that stand as is demanded."""
    first = None
    try:
        first = narrow(problem, WIDTH, tell)
        wide = Explorer(FreeStates(problem), tell=tell)
        capped = any(g.measure is Measure.MAKESPAN for g in problem.goals[len(problem.aims) :])
        known = first is not None and problem.goals[0].measure is Measure.PEAK and not capped
        wide.rise(first.objective[0] if first and known else np.inf)
        while wide.whole:
            wide.refine()
            progress("makespan")
            visited = wide.graph()
            stages = Stages(problem, visited, choose, watch)
            found = stages.run()
            if not _fell(problem, wide, visited, found.path):
                return _plan(problem, visited, stages, found)
    except (StopError, KeyboardInterrupt) as stop:
        return _by_then(problem, first, stop)
    raise InfeasibleError("no plan is allowed")


def _fell(problem: States, wide: Explorer, visited: Visited, path: Sequence[int]) -> bool:
    """Leave out states of a path that do not stand as is demanded; return whether some do not."""
    fell = False
    for level, part, state in visited.of(path) if problem.demands else ():
        if not problem.stand(level, state[None])[0]:
            wide.close((level, part), state[None])
            fell = True
    return fell


def _plan(problem: States, visited: Visited, stages: Stages, found: _Stage) -> StatePath:
    """Return a path as a plan, by the robots that are soonest done."""
    states = tuple((level, *state.tolist()) for level, _, state in visited.of(found.path))
    grips, makespan = _soonest(problem, states)
    values = [
        makespan if goal.measure is Measure.MAKESPAN else value
        for goal, value in zip(problem.goals, stages.values(found.path), strict=True)
    ]
    bounds = [min(b, v) for b, v in zip(found.bounds, values, strict=False)]
    bounds += values[len(bounds) :]
    hint = tuple(rows for *_, rows in visited.states)
    late = "time" if found.late else ""
    return StatePath(
        states,
        tuple(values),
        tuple(bounds),
        hint,
        stopped=late,
        grips=grips,
        proofs=(*found.proofs,),
    )


def _soonest(
    problem: States, states: Sequence[Sequence[int]]
) -> tuple[tuple[tuple[int, ...], ...], float]:
    """Return who of a kind acts so that a plan takes least: places held by robots, and how long."""
    space, scene = problem.space, problem.network.scene
    steps = steps_of(space, states)
    if not isinstance(space, FreeSpace):
        return (), step_times(scene, steps)[-1].end
    kind = {robot: k for k, each in enumerate(space.kinds) for robot in each.robots}
    steps = reassigned_steps(scene, steps, lambda r, hold: kind[r] == kind[hold.robot], [*kind])
    place = {node: i for i, node in enumerate(node_numbers(space.network), start=1)}
    grips = tuple(tuple(0 if n is None else place[n] for n in step.grips) for step in steps)
    return grips, step_times(scene, steps)[-1].end


def _by_then(
    problem: States, first: StatePath | None, stop: StopError | KeyboardInterrupt
) -> StatePath:
    """Return a first plan with its makespan; raise an error if there is none that keeps caps."""
    found = plan_by_then(first, stop)
    grips, makespan = _soonest(problem, found.states)
    pairs = zip(problem.goals, found.objective, strict=True)
    values = tuple(makespan if g.measure is Measure.MAKESPAN else v for g, v in pairs)
    for value, cap in zip(values[len(problem.aims) :], problem.budgets, strict=True):
        if value > tied(cap):
            raise TimeUpError("no plan within all budgets was found yet; give more")
    return replace(found, objective=values, grips=grips)


class _Asking(NamedTuple):
    goals: tuple[Goal, ...]
    aims: tuple[Goal, ...]
    budgets: tuple[float, ...]


def _of_instance(instance: Instance, choose: Choose, watch: Watch) -> StatePath:
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
    makespan = stages.makespan(found.path)
    pairs = zip(aims, stages.values(found.path), strict=False)
    values = [makespan if goal.measure is Measure.MAKESPAN else v for goal, v in pairs]
    bounds = [min(b, v) for b, v in zip(found.bounds, values, strict=False)]
    bounds += values[len(bounds) :]
    states, late = tuple((node,) for node in found.path), "time" * found.late
    proofs = tuple(found.proofs)
    return StatePath(states, tuple(values), tuple(bounds), stopped=late, proofs=proofs)


def in_time(name: str, summary: str, kind: FormulationKind, choose: Choose) -> Formulation:
    """Return the formulation of time that chooses a path by a function of an `Asked`."""
    return Formulation(
        name,
        summary,
        kind,
        None,
        _InTime(choose),
        on=On.TIMES,
        also=(On.GRAPHS,),
        takes_budgets=True,
    )
