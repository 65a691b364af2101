"""What formulations of time share: states, goals one after the other, and plans from paths.

A formulation of time is a function from a build in time to a `Chosen`: a path, its makespan and
what no path stays below. Goals before the makespan leave moves out, as without time; where there
are budgets, and after the makespan, they are sought by labels that keep all caps at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple, Protocol, cast

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
from formulations.times._labels import STEPS, Caps, Labels, LateError, Sweep, Swept
from formulations.times._prices import Prices, best_prices
from seqopt.arrays import Bools, Terse
from seqopt.errors import InfeasibleError, ProblemError, TimeUpError
from seqopt.graph._explore import Explorer, Visited
from seqopt.graph._timed import LabelProof, TimedGraph, timed_graph
from seqopt.graph.graph import Graph
from seqopt.graph.instances.instance import PEAK, TIME, Instance
from seqopt.graph.paths import distances, keep_best, reached, tied
from seqopt.graph.states._visits import FreeStates, steps_of
from seqopt.graph.states.states import States
from seqopt.plan.calling._guard import StatePath
from seqopt.plan.calling.formulation import Formulation, FormulationKind, On, Watch
from seqopt.problem.problem import Goal, Measure
from seqopt.sequence._reassign import reassigned_steps
from seqopt.sequence._rule_space import FreeSpace, node_numbers
from seqopt.sequence._timing import step_times
from seqopt.work.progress import Tell

BEAMS = (100, 1000, 5000)  # widths of the searches for a first path
ALMOST = 1e-9  # over a value: a path must be better by more than this to be better


class Chosen(NamedTuple):
    """A path through states, its start left out, and what is known of its makespan.

    ``value``, ``bound``: s; ``labels``: that prove the bound, if there are any; ``late``: whether
    time was over.
    """

    path: tuple[int, ...]
    value: float
    bound: float
    labels: tuple[Labels, ...] = ()
    late: bool = False


@dataclass(frozen=True, eq=False)
class Asked:
    """A build in time of which the least makespan is sought.

    ``timed``: states, moves and acts; ``kept`` (m,): the moves that may be taken; ``caps``: what
    paths must keep to; ``prices``: bound builds; ``first``: a first path, of no states if none was
    found; ``watch``: says when to stop.
    """

    timed: TimedGraph
    kept: Bools
    caps: Caps
    prices: Prices
    first: Chosen
    watch: Watch


Choose = Callable[[Asked], Chosen]


@dataclass
class _Stage:
    """How far goals are: what is still allowed, and what was found of those before."""

    kept: Bools
    caps: Caps
    filtered: bool  # whether moves alone say what is allowed
    path: tuple[int, ...] = ()
    bounds: list[float] = field(default_factory=list)
    proofs: list[LabelProof] = field(default_factory=list)
    late: bool = False


def beams(
    timed: TimedGraph,
    kept: Bools,
    caps: Caps,
    prices: Prices,
    watch: Watch,
    goal: int | None = None,
) -> Swept:
    """Return a good path within caps, by ever wider searches; none of it where none is found."""
    best = Swept()
    for width in BEAMS:
        try:
            found = Sweep(timed, prices, kept, caps).run(watch, width=width, goal=goal)
        except LateError:
            break
        if found.best < best.best:
            best = found
            limit = found.best * (1 - ALMOST)
            if goal is None:
                caps = replace(caps, time=limit)
        if best.path and (not found.narrow or best.best <= prices.bound * (1 + ALMOST)):
            break
    return best


class _Goals(Protocol):
    """What is asked: by goals, of which the last ones are capped."""

    @property
    def goals(self) -> tuple[Goal, ...]: ...

    @property
    def aims(self) -> tuple[Goal, ...]: ...

    @property
    def budgets(self) -> tuple[float, ...]: ...


class Stages:
    """Goals of a problem one after the other, on a graph in time."""

    def __init__(
        self,
        problem: _Goals,
        visited: Visited,
        choose: Choose,
        watch: Watch,
        timed: TimedGraph | None = None,
    ) -> None:
        self._problem, self._choose, self._watch = problem, choose, watch
        self._visited = visited
        self._timed = timed or timed_graph(cast(States, problem), visited)
        graph = self._timed.graph
        budgets = dict(enumerate(problem.budgets, start=len(problem.aims)))
        is_time = {k: problem.goals[k].measure is Measure.MAKESPAN for k in budgets}
        time = min((tied(cap) for k, cap in budgets.items() if is_time[k]), default=np.inf)
        sums = tuple((k, tied(cap)) for k, cap in budgets.items() if not is_time[k])
        kept = _on_paths(graph, np.ones(len(graph.source), dtype=bool))
        self._stage = _Stage(kept, Caps(time, sums), filtered=not budgets)

    def run(self) -> _Stage:
        """Return what is found; raise an `InfeasibleError` if no path is within all caps."""
        for k, goal in enumerate(self._problem.aims):
            if self._stage.late:
                self._stage.bounds.append(-np.inf)
            elif goal.measure is Measure.MAKESPAN:
                self._makespan()
            elif self._stage.filtered:
                self._filter(k)
            elif goal.measure is Measure.PEAK:
                self._peak(k)
            else:
                self._sum(k)
        if not self._stage.path:
            self._makespan()
        self._shorten()
        return self._stage

    def _filter(self, k: int) -> None:
        """Leave out moves that are on no path which is best in a goal."""
        stage, graph = self._stage, self._timed.graph
        _, least = keep_best(graph.only(stage.kept), k)
        amounts = graph.amounts[:, k]
        if graph.peaks[k]:
            kept = stage.kept & (amounts <= tied(least))
        else:
            some = graph.only(stage.kept)
            before = distances(some, some.amounts[:, k])
            after = distances(some, some.amounts[:, k], back=True)
            with np.errstate(invalid="ignore"):
                sums = before[graph.source] + amounts + after[graph.target]
            kept = stage.kept & (sums <= tied(least))
        stage.kept = _on_paths(graph, kept)
        stage.bounds.append(least)

    def _makespan(self) -> None:
        """Find the least makespan; from then on it is a cap."""
        stage, timed = self._stage, self._timed
        prices = best_prices(timed, stage.kept, self._watch)
        swept = beams(timed, stage.kept, stage.caps, prices, self._watch)
        first = Chosen(swept.path, swept.best, prices.bound)
        if first.value > prices.bound * (1 + ALMOST):
            asked = Asked(timed, stage.kept, stage.caps, prices, first, self._watch)
            found = self._choose(asked)
        else:
            found = first
        if not found.path:
            if found.late:
                raise StopError("time")
            raise InfeasibleError("no plan is within all budgets")
        stage.path, stage.late = found.path, found.late
        stage.bounds.append(min(found.bound, found.value))
        stage.proofs.append(self._proof(found.labels, prices))
        stage.caps = replace(stage.caps, time=tied(found.value))
        stage.filtered = False

    def _peak(self, k: int) -> None:
        """Find the least worst amount of paths within caps, by bisection."""
        stage, amounts = self._stage, self._timed.graph.amounts[:, k]
        levels = np.unique(amounts[stage.kept])
        low, high, labels = 0, len(levels), tuple[Labels, ...]()
        prices = best_prices(self._timed, stage.kept, self._watch)
        if stage.path:
            high = int(np.searchsorted(levels, self._taken(stage.path, k)))
        try:
            while low < high:
                middle = (low + high) // 2
                kept = _on_paths(self._timed.graph, stage.kept & (amounts <= levels[middle]))
                swept = self._reach(kept, prices)
                if swept.path:
                    stage.path = swept.path
                    high = int(np.searchsorted(levels, self._taken(swept.path, k)))
                else:
                    low, labels = middle + 1, tuple(swept.kept)
        except LateError:
            stage.late = True
        if not stage.path:
            if stage.late:
                raise StopError("time")
            raise InfeasibleError("no plan is within all budgets")
        stage.bounds.append(float(levels[min(low, high)]))
        stage.proofs.append(self._proof(labels, prices))
        stage.kept = stage.kept & (amounts <= tied(float(levels[high])))

    def _reach(self, kept: Bools, prices: Prices) -> Swept:
        """Return a path within caps, or none and the labels that show that there is none."""
        if not kept.any():
            return Swept()
        found = beams(self._timed, kept, self._stage.caps, prices, self._watch)
        if found.path:
            return found
        return Sweep(self._timed, prices, kept, self._stage.caps).run(self._watch)

    def _sum(self, k: int) -> None:
        """Find the least sum of paths within caps; from then on it is a cap."""
        stage = self._stage
        goal = len(stage.caps.sums)
        value = self._taken(stage.path, k) if stage.path else np.inf
        caps = replace(stage.caps, sums=(*stage.caps.sums, (k, value * (1 - ALMOST))))
        prices = best_prices(self._timed, stage.kept, self._watch)
        labels: tuple[Labels, ...] = ()
        bound = -np.inf
        try:
            swept = beams(self._timed, stage.kept, caps, prices, self._watch, goal)
            if swept.path:
                stage.path, value = swept.path, swept.best
                caps = replace(caps, sums=(*stage.caps.sums, (k, value * (1 - ALMOST))))
            swept = Sweep(self._timed, prices, stage.kept, caps).run(self._watch, goal=goal)
            if swept.path:
                stage.path, value = swept.path, swept.best
            bound, labels = value, tuple(swept.kept)
        except LateError:
            stage.late = True
        if not stage.path:
            if stage.late:
                raise StopError("time")
            raise InfeasibleError("no plan is within all budgets")
        stage.bounds.append(bound)
        stage.proofs.append(self._proof(labels, prices))
        stage.caps = replace(stage.caps, sums=(*stage.caps.sums, (k, tied(value))))

    def _shorten(self) -> None:
        """Take a path of fewer steps that is as good, if a narrow search finds one."""
        stage = self._stage
        most = float(len(stage.path) - 1)
        caps = replace(stage.caps, sums=(*stage.caps.sums, (STEPS, most)))
        prices = best_prices(self._timed, stage.kept, Watch(0.0))
        try:
            goal = len(stage.caps.sums)
            swept = Sweep(self._timed, prices, stage.kept, caps).run(
                self._watch, width=BEAMS[1], goal=goal
            )
        except LateError:
            return
        stage.path = swept.path or stage.path

    def _taken(self, path: Sequence[int], k: int) -> float:
        """Return what a goal that is no makespan takes of a path."""
        graph = self._timed.graph
        codes = graph.source.astype(np.int64) * graph.states + graph.target
        wanted = [a * graph.states + b for a, b in pairwise((0, *path))]
        amounts = graph.amounts[np.searchsorted(codes, wanted), k]
        return float(amounts.max(initial=0.0) if graph.peaks[k] else amounts.sum())

    def values(self, path: Sequence[int]) -> list[float]:
        """Return what goals take of a path, that of makespans left at zero."""
        return [self._taken(path, k) for k in range(len(self._problem.goals))]

    def makespan(self, path: Sequence[int]) -> float:
        """Return when a path ends if those act who are soonest ready."""
        graph, kept = self._timed.graph, np.zeros(len(self._timed.prepares), dtype=bool)
        codes = graph.source.astype(np.int64) * graph.states + graph.target
        kept[np.searchsorted(codes, [a * graph.states + b for a, b in pairwise((0, *path))])] = True
        prices = best_prices(self._timed, kept, Watch(0.0))
        return Sweep(self._timed, prices, kept, Caps()).run(Watch()).best

    def _proof(self, labels: Sequence[Labels], prices: Prices) -> LabelProof:
        """Return labels with the states that they are of."""
        columns = self._timed.free.shape[1]
        kinds = self._timed.kinds
        each = np.column_stack([prices.each[:, :1], prices.each[:, 1:][:, kinds]])
        rows = np.concatenate([part for *_, part in self._visited.states]).astype(np.int64)
        if not labels:
            none = np.zeros((0, 1 + columns))
            return LabelProof(np.zeros((0, 1 + rows.shape[1]), dtype=np.int64), none, each)
        parts = [np.column_stack([own.end, own.since, own.sums]) for own in labels]
        state = np.concatenate([own.state for own in labels])
        states = np.column_stack([self._timed.levels[state], rows[state]])
        return LabelProof(states, np.concatenate(parts), each)


def _on_paths(graph: Graph, kept: Bools) -> Bools:
    """Return which moves (m,) bool, of some, are on paths from the start to an end."""
    some = graph.only(kept)
    to_end = np.isfinite(distances(some, np.ones(len(some.source)), back=True))
    return kept & reached(graph, kept)[graph.source] & to_end[graph.target]


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
