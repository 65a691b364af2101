r"""The regret of every way to a plan: what it costs in the most detailed model of the scene.

A *way* is an engine with a schedule, a formulation and what it leaves out. With :math:`p_w` the
plan that it returns and :math:`v(p)` the worst step of a plan in the *reference*, the most detailed
model that the scene has data for,

.. math::

   \text{regret}_w = \frac{v(p_w)}{\min_u v(p_u)} - 1 .

So what a search missed and what a model got wrong are one number, as a builder meets them. The end
counts for all: a loop leaves its robots where they are, and what then bears itself is asked of it
as of a free schedule. Its parts are the *gap* of the plan to the bound that the way proves, in its
own model, and the *error* of the worst step that its own model promised.

All ways share the time limit. Each is repeated up to `TIMES` times where that takes little.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field, replace
from typing import TypeAlias, TypeVar

import numpy as np
import pandas as pd

from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import ENGINES, LIMITED, make_engine, recipe_of, simplest
from seqopt.engines.registry import USUAL as USUAL_ENGINE
from seqopt.errors import MechanismError, NothingFoundError, ProblemError, SeqoptError, TimeUpError
from seqopt.graph.formulation import End, Finding, FormulationKind, Run, formulations
from seqopt.judge._schedules import plan_values
from seqopt.network.network import build_network
from seqopt.plan.plan import Plan
from seqopt.plan.solve import _solve_run, graph_of, on_the_way, pose
from seqopt.problem.criteria import WORST_OVER_METHODS, Criterion, RankSum
from seqopt.problem.problem import Problem
from seqopt.report._regret._table import CUT, DONE, FAILED, FALLS, RegretTable, with_regrets
from seqopt.sequence.part import find_schedule
from seqopt.sequence.rules import FREE, FreeRules
from seqopt.sequence.schedule import Schedule, thin
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability._steps import step_verdicts
from seqopt.stability.verdict import Verdict
from seqopt.work import GRACE, Clock, Stage, Tell, _ending

TIMES = 3
SHARE = 4  # times its part of what is left that a way may take
REPEAT = 0.1  # share of what it may take up to which a way is repeated
LOOP = "loop"
RIGID_GRIPS = "rigid grips"  # exactly rigid bricks, and grips too, though their stiffness is given
USUAL = {LOOP: "overlap_dp", FREE: "schedule_search"}
USUAL_RULES = FreeRules()
NEAR = "near:6"
FEW = ("cascade", "path_beam", "schedule_search")  # formulations that need not look at all
SLOW = ("frame", "discrete")  # engines that come last
KEPT, ALL = 0.7, 0.95  # shares of its time after which a search, and a proof, ends
Found = TypeVar("Found")
Row: TypeAlias = tuple[dict[str, object], Sequence[Finding], tuple[Step, ...]]  # curve, steps
Valued: TypeAlias = tuple[float, float, str, str]  # with the end, without, status, why it falls


@dataclass(frozen=True)
class Timer:
    """A clock, s, a guard that ends a block by a `TimeoutError`, and the number of repeats."""

    now: Callable[[], float] = time.perf_counter
    within: Callable[[float], AbstractContextManager[None]] = _ending
    times: int = TIMES

    def least(self, seconds: float, call: Callable[[], Found]) -> tuple[float, Found]:
        """Return the least time that a call takes, and its result; `TimeoutError` if late."""
        start = self.now()
        with self.within(seconds):
            found = call()
        best = spent = self.now() - start
        for _ in range(1, self.times):
            if spent + best > REPEAT * seconds:
                break
            start = self.now()
            with suppress(TimeoutError), self.within(seconds):
                found = call()
                best = min(best, self.now() - start)
            spent += self.now() - start
        return best, found


WALL = Timer()


@dataclass(frozen=True)
class Way:
    """One way to a plan; what it leaves out, or adds, is the last word.

    That is ``no proof``, ``near:6``, ``ranks`` or ``stands`` (states are proven to stand).
    """

    engine: str
    schedule: str
    formulation: str
    without: str = ""


@dataclass(frozen=True, eq=False)
class _Course:
    """What all ways have in common.

    ``reference``: the problem that values plans; ``criterion``: the objective of ways by ranks;
    ``loop``: the schedule with open grips, if there is one; ``rules``: of the free one; ``mortar``:
    whose joints every step is asked to stand with; None where joints do not open.
    """

    reference: Problem
    criterion: Criterion
    loop: Schedule | None
    rules: FreeRules
    mortar: Mortar | None
    timer: Timer
    known: dict[Sequence[Step], Valued] = field(default_factory=dict)

    def engine(self, name: str) -> Engine:
        """Return an engine of a way, of which nothing is computed yet."""
        network = self.reference.engine.network
        if name == RIGID_GRIPS:
            rigid = build_network(network.scene.with_grips(None))
            return simplest(make_engine("auto", rigid))
        mortar = self.mortar if name in LIMITED else None
        return make_engine(name, network, mortar) if name in ENGINES else self.reference.engine

    def problem(self, way: Way) -> Problem:
        """Return the problem that a way solves, with an engine of its own."""
        engine, near = self.engine(way.engine), way.without if way.without == NEAR else ""
        if way.without == "ranks":
            return pose(engine, self._schedule(engine, ""), self.criterion)
        free = replace(self.rules, candidates=near or self.rules.candidates)
        moves = free if way.schedule == FREE else self._schedule(engine, near)
        stands = self.mortar if way.without == "stands" else None
        worst = graph_of(self.reference).criterion
        return pose(engine, moves, worst, "minmax", stands=stands)

    def _schedule(self, engine: Engine, near: str) -> Schedule:
        assert self.loop is not None  # else no way asks for it
        other = engine.network.scene != self.loop.scene
        found = find_schedule(engine.network) if other else self.loop
        return thin(found, near) if near else found

    def row(self, way: Way, seconds: float) -> Row:
        """Return the row of a way, which may take so long."""
        seconds = max(seconds, 0.0)  # of none nothing begins
        proof, found = way.without != "no proof", list[Finding]()

        def call() -> Plan:
            found.clear()
            clock = Clock(max(KEPT * seconds, ALL * seconds - GRACE))  # of search and proof
            run = Run(KEPT * seconds, found.append, proof, clock=clock)
            return on_the_way(_solve_run(self.problem(way), way.formulation, run))

        about = {"engine": way.engine, "schedule": way.schedule, "formulation": way.formulation}
        row = {**about, "without": way.without, "exact": False, "models": 0, "why": ""}
        row |= dict.fromkeys(("seconds", "value", "own", "gap", "error"), np.nan)
        try:
            took, plan = self.timer.least(seconds, call)
        except (SeqoptError, TimeoutError) as error:
            late = isinstance(error, TimeoutError | TimeUpError)
            lost = {"status": CUT} if late else {"status": FAILED, "why": str(error)}
            return row | lost, (), ()
        if plan.steps not in self.known:
            self.known[plan.steps] = self._value(plan.steps)
        value, along, status, why = self.known[plan.steps]
        if plan.ended is not End.DONE and status == DONE:
            status = CUT
        gap = plan.certificate.gap if plan.certificate is not None else np.nan
        own = plan.objective.get("minmax", np.nan)
        exact = gap == 0 and way.without not in (NEAR, "ranks")
        row |= {"seconds": took, "value": value, "gap": gap, "exact": exact}
        row |= {"own": own, "error": abs(own - along) / (abs(along) or 1.0)}
        row |= {"models": plan.models, "status": status, "why": why}
        return row, [each for each in found if isinstance(each, Finding)], plan.steps

    def rows(self, ways: Sequence[Way], seconds: float, progress: Tell) -> Iterator[Row]:
        """Yield the rows of ways, which share the time."""
        late = set[tuple[str, str]]()  # engines and schedules that need too long to look at all
        end = self.timer.now() + seconds
        for done, way in enumerate(ways):
            progress(Stage(f"regret: {way.engine}, {way.schedule}", done / len(ways)))
            left, others = end - self.timer.now(), len(ways) - done
            most = left / 4 if way.formulation in FEW else min(left / 2, SHARE * left / others)
            skips = (way.engine, way.schedule) in late and way.formulation not in FEW
            found = self.row(way, 0.0 if skips else max(left / others, most))
            if found[0]["status"] == CUT and way.formulation not in FEW:
                late.add((way.engine, way.schedule))
            yield found

    def _value(self, steps: Sequence[Step]) -> Valued:
        """Return the worst step of a plan in the reference; infinite, and why, where it falls."""
        last, bare = steps[-1], (None,) * len(steps[-1].grips)
        end = [replace(last, grips=bare, kind=StepKind.RELEASE)] if last.held else []
        try:
            problem = graph_of(self.reference)
            along, *after = (plan_values(problem, part)[0] for part in (steps, end) if part)
        except MechanismError as error:
            return np.inf, np.nan, FALLS, str(error)
        except SeqoptError as error:  # a limit is exceeded
            return np.inf, np.nan, FAILED, str(error)
        if self.mortar is not None and _name_of(self.reference.engine) != "discrete":
            verdicts = step_verdicts(self.reference.engine.network, [*steps, *end], self.mortar)
            for step, verdict in zip([*steps, *end], verdicts, strict=True):
                if verdict is not Verdict.STANDS:
                    status = FALLS if verdict is Verdict.FALLS else FAILED
                    return np.inf, along, status, f"step {step.number} {verdict.value}"
        return max([along, *after]), along, DONE, ""


def measure_regret(
    engine: Engine,
    criterion: Criterion,
    *,
    rules: FreeRules = USUAL_RULES,
    seconds: float = 60.0,
    reference: str = "",
    mortar: Mortar | None = None,
    progress: Tell = lambda _: None,
    timer: Timer = WALL,
) -> RegretTable:
    """Return the cost of every way's plan in the most detailed model of a scene.

    Of a criterion that ranks candidates the worst ratio counts; the sum is an objective of the
    loop. ``mortar``: with which every step is proven to stand, by default that of the engine; with
    a ``reference`` that is ``discrete`` joints open and slip instead. Raises `ProblemError` if
    there is no such reference, `NothingFoundError` if no way finds a plan that stands in it.
    """
    start = timer.now()
    check_reference(reference)
    recipe, named = recipe_of(engine), engine
    joints = None if recipe is None else dict(recipe.options).get("mortar")
    mortar = mortar or (joints if isinstance(joints, Mortar) else None)
    if reference or recipe is not None:  # else an object of one's own
        own = mortar if reference in LIMITED else None
        named = make_engine(reference or USUAL_ENGINE, engine.network, own)
    worst = WORST_OVER_METHODS if isinstance(criterion, RankSum) else criterion
    problem = pose(named, rules, worst, "minmax")
    loop = None
    with suppress(SeqoptError):
        loop = find_schedule(engine.network)
    course = _Course(problem, criterion, loop, rules, mortar, timer)
    name = _name_of(named)
    ways, refused = _ways(course, name)
    each = course.rows(ways, seconds - timer.now() + start, progress)
    rows, curves, plans = zip(*each, strict=True)
    table = pd.DataFrame(rows)
    if not np.isfinite(table["value"].min()):
        why = next((f": {row['engine']}, {row['why']}" for row in rows if row["why"]), "")
        more = "; give more seconds" * bool((table["status"] == CUT).any())
        raise NothingFoundError(f"regret: no plan holds in the reference{why}{more}")
    scene = engine.network.scene
    soft = ", soft grips" * bool(np.any(engine.network.compliances.compliance))
    stands = ", where every step stands" * (mortar is not None and name != "discrete")
    about = scene.name, len(scene.bricks), name, f"{name}{soft}{stands}", worst.name, seconds
    return RegretTable(*about, with_regrets(table), refused, curves, plans)


def _name_of(engine: Engine) -> str:
    recipe = recipe_of(engine)
    return type(engine).__name__ if recipe is None else recipe.name


def check_reference(name: str) -> None:
    """Raise a `ProblemError` if no engine that can value plans has a name; the empty one may."""
    known = [each for each in ENGINES if each != "auto"]
    if name and name not in known:
        raise ProblemError(f"reference {name!r} does not exist; give one of {', '.join(known)}")


def _ways(course: _Course, reference: str) -> tuple[list[Way], dict[str, str]]:
    """Return all ways, the usual ones first, and engines that cannot model the scene, and why."""
    refused, engines = dict[str, str](), list[str]()
    soft = bool(np.any(course.reference.engine.network.compliances.compliance))
    for name in ("compliance", *([RIGID_GRIPS] if soft else []), "frame", "discrete"):
        if name == "discrete" != reference and course.mortar is None:
            continue  # where joints do not open it says what rigid bricks say
        try:
            course.engine(name)
        except SeqoptError as error:
            refused[name] = str(error)
        else:
            engines.append(name)
    if reference not in engines and reference not in refused:
        engines.append(reference)
    kinds = [*([LOOP] if course.loop else []), FREE]
    base = "compliance" if reference in ("discrete", *engines[:1]) else reference
    usual = [
        Way(engine, *more)
        for engine in sorted({base, *engines}, key=lambda e: (e in SLOW, e != base))
        for more in [*[(LOOP, "cascade", "no proof")][: len(kinds) - 1], *USUAL.items()]
        if more[0] in kinds
    ]
    every = list[Way]()
    for kind in kinds:  # integer programs and bounds last
        known = formulations("costs" if kind == LOOP else "goals").values()
        bounds = {f.name for f in known if f.kind is FormulationKind.BOUND}
        slow = bounds | {f.name for f in known if f.name.endswith("_mip")}
        names = sorted((f.name for f in known), key=lambda n: (n in slow, n != "overlap_dp"))
        every += [Way(base, kind, name) for name in names]
    quick = [way for way in usual if way.engine not in SLOW]
    out = [*quick, *(Way(base, *more) for more in _variants(course)), *every, *usual]
    return [*dict.fromkeys(out)], refused


def _variants(course: _Course) -> Iterator[tuple[str, str, str]]:
    """Yield schedule, formulation and the options of ways with the default engine."""
    if course.loop:
        yield LOOP, USUAL[LOOP], NEAR
        if isinstance(course.criterion, RankSum):
            yield LOOP, "cascade", "ranks"
            yield LOOP, USUAL[LOOP], "ranks"
    yield FREE, USUAL[FREE], "no proof"
    yield FREE, USUAL[FREE], NEAR
    if course.mortar is not None:
        yield from [(LOOP, USUAL[FREE], "stands")] if course.loop else []
        yield FREE, USUAL[FREE], "stands"
