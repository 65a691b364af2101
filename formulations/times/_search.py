"""Plans in time: states that stand, goals in turn, and waits for mortar.

Labels wait no longer than motions prove that they must. The plan that they find is looked at as it
is, with proven verdicts; where it has to wait longer, motions in which its states fall say why, and
labels are set again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from formulations._search import (
    WIDTH,
    StopError,
    Watching,
    after_margins,
    close_fallen,
    has_scene,
    narrow,
    plan_by_then,
    watched,
)
from formulations.times._labels import Carrying
from formulations.times._stages import ALMOST, Goals, Least, StageFound, Stages, by_labels
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, StepError, TimeUpError
from seqopt.graph._spaces import build_space
from seqopt.graph.formulation import Solution, Watch
from seqopt.graph.graph import PEAK, TIME, tied
from seqopt.graph.space import Explorer, Visited
from seqopt.graph.states import States
from seqopt.problem.amounts import MINMAX, NONE, SUM
from seqopt.problem.requirements import StepArrays
from seqopt.times._curing import CuringBuilds, FallCuts
from seqopt.times._graph import timed_graph
from seqopt.times._steps import StepTime, reassigned_steps, step_times
from seqopt.times._twin import makespan
from seqopt.work import Tell


class Soonest(NamedTuple):
    """Who acts in a plan so that it takes least, and when.

    ``grips``: places held by robots after every step; ``makespan``: s, NaN where time does not
    count; ``starts``: of steps, s, where mortar cures.
    """

    grips: tuple[tuple[int, ...], ...] = ()
    makespan: float = np.nan
    starts: tuple[float, ...] = ()


class Waits:
    """How long plans of a problem wait for mortar, and motions that say how long at least.

    ``cuts``: None where no mortar cures.
    """

    def __init__(self, problem: States) -> None:
        standing = problem.standing
        self._builds: CuringBuilds | None = None
        self.cuts: FallCuts | None = None
        if standing is not None and standing.curing is not None:
            network, mortar = problem.network, standing.mortar
            self._builds = CuringBuilds(network, mortar, standing.curing)
            self.cuts = FallCuts(network, mortar, self._builds.joints)

    def learn(self) -> bool:
        """Add the failure motions of all evaluated states; return whether some are new."""
        if self._builds is None or self.cuts is None:
            return False
        return sum(map(self.cuts.add, self._builds.motions)) > 0

    def soonest(self, problem: States, states: Sequence[Sequence[int]]) -> Soonest | None:
        """Return who of a kind acts so that a plan takes least; None if no wait is enough."""
        space, scene = problem.space, problem.network.scene
        waits = None if self._builds is None else self._builds.waits
        kind = {robot: k for k, each in enumerate(space.kinds) for robot in each.robots}
        place = {node: i for i, node in enumerate(space.network.scene.placed_nodes, start=1)}
        asked = scene, space.steps(states), lambda r, hold: kind[r] == kind[hold.robot]
        begin = problem.rules.begin
        try:
            steps = reassigned_steps(*asked, [*kind], waits, begin=begin)
            times: tuple[StepTime, ...] = step_times(scene, steps, waits, begin)
        except StepError:
            if self.cuts is None:
                raise
            return None
        grips = tuple(tuple(0 if n is None else place[n] for n in step.grips) for step in steps)
        starts = () if waits is None else tuple(time.start for time in times)
        return Soonest(grips, times[-1].end, starts)


def of_instance(instance: Any, least: Least, watch: Watch) -> Solution:
    """Return the best path through an instance, its states the numbers of nodes."""
    timed = instance.timed if instance.asks_time else None
    if timed is None:
        raise ProblemError(f"instance {instance.name}: no times are asked; take overlap_dp")
    own = {PEAK: MINMAX, TIME: makespan}
    aims = tuple(own.get(goal.kind, SUM) for goal in instance.goals)
    caps = [makespan if cap.column is None else SUM for cap in instance.caps]
    asked = Goals((*aims, *caps), aims, tuple(cap.most for cap in instance.caps))
    visited = Visited(timed.graph, ((0, 0, np.arange(instance.nodes)[:, None]),))
    carrying = Carrying(timed.graph, timed.levels, timed)
    stages = Stages(asked, visited, least, watch, carrying)
    try:
        found = stages.run()
    except StopError as stop:
        return plan_by_then(None, stop)
    values = stages.values(found.path, stages.least(found.path))[: len(aims)]
    states, late = tuple((node,) for node in found.path), "time" * found.late
    proofs, bounds = tuple(found.proofs), _no_higher(found.bounds, values)
    return Solution(states, values, bounds, stopped=late, proofs=proofs)


def _no_higher(bounds: Sequence[float], values: tuple[float, ...]) -> tuple[float, ...]:
    """Return bounds that are no higher than values, which stand for those that are missing."""
    return (*map(min, bounds, values), *values[len(bounds) :])


def plan_in_time(
    problem: Any,
    *,
    seconds: float = np.inf,
    max_memory: float = np.inf,
    progress: Tell = lambda _: None,
    least: Least = by_labels,
) -> Solution:
    """Return the plan of least makespan, or the incumbent at the limit of time or memory."""
    watch = Watch(seconds, memory=max_memory)
    if not has_scene(problem):
        return of_instance(problem, least, watch)
    if least is not by_labels and problem.standing is not None and problem.standing.curing:
        raise ProblemError("it does not know mortar that cures; take makespan_labels")
    tell = watched(problem, watch, progress)
    return after_margins(problem, lambda rest: _searched(rest, least, watch, tell, progress), tell)


def _searched(
    problem: States, least: Least, watch: Watch, tell: Watching, progress: Tell
) -> Solution:
    """Return the best plan of states that are proven to stand, where that is demanded."""
    first, waits, best = None, Waits(problem), list[Solution]()
    try:
        first = narrow(problem, WIDTH, tell)
        wide = Explorer(build_space(problem), tell=tell)
        capped = any(g.in_time for g in problem.goals[len(problem.aims) :])
        # budgets of time, or mortar, may make the first plan infeasible
        open_ = first is None or capped or waits.cuts is not None or bool(problem.paths)
        known = None if open_ or not problem.goals[0].is_peak else first
        wide.rise(np.inf if known is None else known.objective[0])
        while wide.whole:
            wide.refine()
            progress("makespan")
            visited, stages, found = _staged(problem, wide, least, watch, waits)
            if close_fallen(wide, visited, found.path):
                continue
            plan = _plan(problem, visited, stages, found, waits)
            best += [] if plan is None else [plan]
            if plan is not None:
                sure = found.late or waits.cuts is None or not problem.is_timed
                if sure or plan.ends <= stages.least(found.path) * (1 + ALMOST):
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
    if wide.whole:
        raise NothingFoundError("no wait for mortar is enough for the plans that were looked at")
    raise wide.without_plan("no plan is allowed")


def _staged(
    problem: States, wide: Explorer, least: Least, watch: Watch, waits: Waits
) -> tuple[Visited, Stages, StageFound]:
    """Return the visited states in time, and the best path through them, goal after goal."""
    visited = wide.graph()
    asked = Goals(problem.goals, problem.aims, problem.budgets)
    graph, timed = visited.graph, None
    if problem.is_timed:
        timed = timed_graph(problem, visited, waits.cuts)
    levels = np.repeat([key for key, *_ in visited.states], [len(s) for *_, s in visited.states])
    seen = _seen_steps(problem, visited) if problem.paths else None
    carrying = Carrying(graph, levels, timed, problem.paths, seen)
    stages = Stages(asked, visited, least, watch, carrying)
    try:
        return visited, stages, stages.run()
    except InfeasibleError as error:
        raise wide.without_plan(str(error)) from None


def _seen_steps(problem: States, visited: Visited) -> StepArrays:
    """Return the moves among visited states as resources see them."""
    space, graph = problem.space, visited.graph
    rows = np.concatenate([own[:, : space.robots] for *_, own in visited.states])
    counts = [len(own) for *_, own in visited.states]
    bricks = np.repeat([space.bricks_at(level) for level, *_ in visited.states], counts)
    nodes = np.full((len(rows), len(problem.network.scene.robots)), NONE)
    numbers = np.array([NONE, *problem.network.scene.placed_nodes])
    nodes[:, problem.robots] = numbers[rows.clip(min=0)]
    return StepArrays(bricks[graph.target], nodes[graph.source], nodes[graph.target])


def _least_of(plans: Sequence[Solution], bound: tuple[float, ...], stopped: str = "") -> Solution:
    """Return the best of the plans, with lower bounds that hold for all."""
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
) -> Solution | None:
    """Return a path as a plan, by the robots that are soonest done; None if mortar forbids it."""
    states = tuple((level, *state.tolist()) for level, _, state in visited.of(found.path))
    soonest = waits.soonest(problem, states) if problem.is_timed else Soonest()
    if soonest is None:
        return None
    values = stages.values(found.path, soonest.makespan)
    return Solution(
        states,
        values,
        _no_higher(found.bounds, values),
        tuple(rows for *_, rows in visited.states),
        stopped="time" * found.late,
        grips=soonest.grips,
        proofs=(*found.proofs,),
        starts=soonest.starts,
        ends=soonest.makespan,
        motions=() if waits.cuts is None else waits.cuts.motions,
    )


def _by_then(
    problem: States, first: Solution | None, stop: StopError | KeyboardInterrupt, waits: Waits
) -> Solution:
    """Return the incumbent with its makespan; raise an error if none is within the budgets."""
    if problem.paths:
        raise TimeUpError("no plan within all resources was found yet; give more time") from None
    found = plan_by_then(first, stop)
    soonest = waits.soonest(problem, found.states)
    if soonest is None:
        raise TimeUpError("no plan that stands while mortar cures was found yet; give more time")
    pairs = zip(problem.goals, found.objective, strict=False)
    values = tuple(soonest.makespan if goal.in_time else value for goal, value in pairs)
    for value, cap in zip(values[len(problem.aims) :], problem.budgets, strict=True):
        if value > tied(cap):
            raise TimeUpError("no plan within all budgets was found yet; give more time")
    return replace(
        found, objective=values, grips=soonest.grips, starts=soonest.starts, ends=soonest.makespan
    )
