"""Plans of formulations of time: states that stand, goals in turn, and waits for mortar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
from formulations.times._curing import Waits, require_cured
from formulations.times._instances import of_instance
from formulations.times._stages import ALMOST, Choose, StageFound, Stages
from seqopt.arrays import Terse
from seqopt.errors import InfeasibleError, TimeUpError
from seqopt.graph._explore import Explorer, Visited
from seqopt.graph._timed import timed_graph
from seqopt.graph.instances.instance import Instance
from seqopt.graph.paths import tied
from seqopt.graph.states._visits import FreeStates
from seqopt.graph.states.states import States
from seqopt.plan.calling._guard import StatePath
from seqopt.plan.calling.formulation import Formulation, FormulationKind, On, Watch
from seqopt.problem.problem import Measure
from seqopt.work.progress import Tell


@dataclass(frozen=True, repr=False)
class _InTime(Terse):
    """The ``solve`` of a formulation of time."""

    choose: Choose = field(repr=False)
    name: str
    cures: bool

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
            return of_instance(problem, self.choose, watch)
        require_cured(problem, self.name, cures=self.cures)
        tell = watched(problem, watch, max_memory, progress)
        return after_margins(
            problem, lambda rest: _searched(rest, self.choose, watch, tell, progress), tell
        )


def _searched(
    problem: States, choose: Choose, watch: Watch, tell: Watching, progress: Tell
) -> StatePath:
    """Return the best plan of states that stand as is demanded."""
    first, waits, best = None, Waits(problem), list[StatePath]()
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
            timed = timed_graph(problem, visited, waits.cuts)
            stages = Stages(problem, visited, choose, watch, timed)
            found = stages.run()
            if _fell(problem, wide, visited, found.path):
                continue
            plan = _plan(problem, visited, stages, found, waits)
            best += [] if plan is None else [plan]
            if plan is not None and (found.late or _is_known(stages, found, plan, waits)):
                return _least_of(best, plan.bound, plan.stopped)
            if not waits.learn():
                break
        if best:
            return _least_of(best, best[-1].bound)
    except (StopError, KeyboardInterrupt) as stop:
        if best:
            ended = "interrupt" if isinstance(stop, KeyboardInterrupt) else str(stop)
            return _least_of(best, best[-1].bound, ended)
        return _by_then(problem, first, stop, waits)
    raise InfeasibleError("no plan is allowed")


def _fell(problem: States, wide: Explorer, visited: Visited, path: Sequence[int]) -> bool:
    """Leave out states of a path that do not stand as is demanded; return whether some do not."""
    fell = False
    for level, part, state in visited.of(path) if problem.demands else ():
        if not problem.stand(level, state[None])[0]:
            wide.close((level, part), state[None])
            fell = True
    return fell


def _is_known(stages: Stages, found: StageFound, plan: StatePath, waits: Waits) -> bool:
    """Return whether a plan takes no longer than is known of its path."""
    return waits.cuts is None or plan.ends <= stages.least(found.path) * (1 + ALMOST)


def _least_of(plans: Sequence[StatePath], bound: tuple[float, ...], stopped: str = "") -> StatePath:
    """Return the best of some plans with bounds that hold for all."""
    best = min(plans, key=lambda plan: plan.objective)
    bounds, open_ = list[float](), True
    for value, least in zip(best.objective, bound, strict=True):
        bounds.append(min(value, least) if open_ else -np.inf)
        open_ &= least >= value * (1 - ALMOST)
    last = plans[-1]
    return replace(
        best, bound=tuple(bounds), stopped=stopped, proofs=last.proofs, motions=last.motions
    )


def _plan(
    problem: States, visited: Visited, stages: Stages, found: StageFound, waits: Waits
) -> StatePath | None:
    """Return a path as a plan, by the robots that are soonest done; None if mortar forbids it."""
    states = tuple((level, *state.tolist()) for level, _, state in visited.of(found.path))
    soonest = waits.try_soonest(problem, states)
    if soonest is None:
        return None
    values = [
        soonest.makespan if goal.measure is Measure.MAKESPAN else value
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
        grips=soonest.grips,
        proofs=(*found.proofs,),
        starts=soonest.starts,
        ends=soonest.makespan,
        motions=() if waits.cuts is None else waits.cuts.motions,
    )


def _by_then(
    problem: States, first: StatePath | None, stop: StopError | KeyboardInterrupt, waits: Waits
) -> StatePath:
    """Return a first plan with its makespan; raise an error if there is none that keeps caps."""
    found = plan_by_then(first, stop)
    soonest = waits.try_soonest(problem, found.states)
    if soonest is None:
        raise TimeUpError("no plan that stands while mortar cures was found yet; give more")
    pairs = zip(problem.goals, found.objective, strict=True)
    values = tuple(soonest.makespan if g.measure is Measure.MAKESPAN else v for g, v in pairs)
    for value, cap in zip(values[len(problem.aims) :], problem.budgets, strict=True):
        if value > tied(cap):
            raise TimeUpError("no plan within all budgets was found yet; give more")
    return replace(
        found, objective=values, grips=soonest.grips, starts=soonest.starts, ends=soonest.makespan
    )


def in_time(
    name: str, summary: str, kind: FormulationKind, choose: Choose, *, cures: bool = False
) -> Formulation:
    """Return the formulation of time that chooses a path by a function of an `Asked`.

    ``cures``: whether it knows mortar that cures.
    """
    solve = _InTime(choose, name, cures)
    also = (On.GRAPHS,)
    return Formulation(name, summary, kind, None, solve, on=On.TIMES, also=also, takes_budgets=True)
