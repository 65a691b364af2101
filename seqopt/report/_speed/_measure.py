"""The same problem by every engine and formulation: how long each takes, and what it finds.

What an engine computes for all formulations, the costs of all choices, is computed once and its
time is added to each. Everything is done up to `TIMES` times within the limit; the least counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import pandas as pd

from seqopt._interrupts import ending
from seqopt.engines.interface import Engine
from seqopt.engines.registry import ENGINES, LIMITED, make_engine, recipe_of, simplest
from seqopt.errors import ProblemError, SeqoptError, SolverError, TimeUpError
from seqopt.graph.decision_costs import TINY
from seqopt.graph.formulation import QUESTIONS, End, Formulation, FormulationKind, formulations
from seqopt.judge._schedules import plan_values
from seqopt.plan.plan import Plan
from seqopt.plan.pose import chooses_moves, decisions_of, graph_of, states_of
from seqopt.plan.solve import on_the_way, solve
from seqopt.problem.problem import Aim, Problem
from seqopt.report._speed._table import CUT, DONE, FAILED, SpeedTable
from seqopt.responses.quantities import RESPONSES
from seqopt.responses.table import analyze, force_column
from seqopt.sequence.steps import Step
from seqopt.work.progress import Stage, Tell

ROUNDING = 1e-9  # gaps and errors below are none
SHOWN = [RESPONSES[name].column for name in ("M_sup", "T_max", "D_max")]  # beside grip forces
TIMES = 3
UNPROVEN = ("cascade", "schedule_search")  # what needs the fewest models, of costs and of states
Found = TypeVar("Found")
_Way = tuple[Formulation, bool]  # with its proof or without


@dataclass(frozen=True)
class Timer:
    """What tells the time, s, and what ends a block in time by a `TimeoutError`."""

    now: Callable[[], float] = time.perf_counter
    within: Callable[[float], AbstractContextManager[None]] = ending

    def least(self, seconds: float, call: Callable[[], Found]) -> tuple[float, Found]:
        """Return the least time that a call takes, and what it returns; `TimeoutError` if late."""
        start = self.now()
        with self.within(seconds):
            found = call()
        best = spent = self.now() - start
        for _ in range(1, TIMES):
            if spent + best > seconds:
                break
            start = self.now()
            with suppress(TimeoutError), self.within(seconds):
                found = call()
                best = min(best, self.now() - start)
            spent += self.now() - start
        return best, found


WALL = Timer()


@dataclass(frozen=True, eq=False)
class Reference:
    """A problem with the engine that others are compared with."""

    problem: Problem

    def prepare(self) -> None:
        """Compute what gaps are measured by; a `SolverError` says that no optimum was proven."""
        _ = decisions_of(self.problem).sums if self.in_layers else self._best

    @property
    def in_layers(self) -> bool:
        """Whether candidates are chosen in layers, and not states."""
        return chooses_moves(self.problem)

    @cached_property
    def _best(self) -> tuple[float, ...]:
        """The value of every goal in the proven optimum."""
        plan = solve(self.problem)
        if plan.ended is End.INTERRUPTED:
            raise KeyboardInterrupt
        if plan.ended is not End.DONE or plan.certificate is None:
            raise SolverError(f"{plan.formulation.name} ended early: no optimum is proven")
        return plan.certificate.values  # noqa: PD011  # of goals

    def gap(self, plan: Plan) -> float:
        """Return how far a plan is above the optimum, over its size; infinite if not allowed."""
        if self.in_layers:
            costs = decisions_of(self.problem).sums
            size = float(np.abs(costs.parts(plan.choice)).sum())
            if not np.isfinite(size):
                return np.inf
            gap = (costs.cost(plan.choice) - costs.least(Aim.SUM)) / max(size, TINY)
            return 0.0 if gap < ROUNDING else gap
        try:
            values = plan_values(states_of(self.problem), plan.steps)
        except SolverError:  # a limit is exceeded
            return np.inf
        gaps = [(v - b) / (abs(v) or 1.0) for v, b in zip(values, self._best, strict=True)]
        return max(next((gap for gap in gaps if abs(gap) >= ROUNDING), 0.0), 0.0)

    def error(self, engine: Engine, steps: Sequence[Step]) -> float:
        """Return the largest difference of a response of steps, over the largest of its kind."""
        own, known = analyze(engine, steps), analyze(self.problem.engine, steps)
        forces, worst = [force_column(robot) for robot in self.problem.scene.robots], 0.0
        for columns in (forces, *([name] for name in SHOWN)):
            one, other = (table[columns].to_numpy(float) for table in (own, known))
            off = np.nanmax(np.abs(one - other)) / (np.nanmax(np.abs(other)) or 1.0)
            worst = max(worst, float(off))
        return 0.0 if worst < ROUNDING else worst


@dataclass(frozen=True, eq=False)
class _Stage:
    """One engine that solves a problem, made anew for every repetition."""

    name: str
    reference: Reference
    seconds: float
    timer: Timer

    def posed(self) -> Problem:
        """Return the problem with an engine of its own, of which nothing is computed yet."""
        problem = self.reference.problem
        found = recipe_of(problem.engine)
        if found is None:  # an object of one's own
            return problem.but()
        options = found.options if self.name in LIMITED or self.name == found.name else {}
        mortar: object = options.get("mortar")
        made = make_engine(self.name, problem.engine.network, mortar)  # type: ignore[arg-type]
        return problem.but(engine=simplest(made))

    def prepared(self) -> Problem:
        """Return the problem with the costs of all its choices."""
        found = self.posed()
        _ = decisions_of(found).sums
        return found

    def rows(self, ways: list[_Way]) -> Iterator[dict[str, object]]:
        """Yield a row for every way to choose; those with a proof share the costs of choices."""
        before, shared, why = 0.0, None, ""
        if self.reference.in_layers:
            try:
                before, shared = self.timer.least(self.seconds, self.prepared)
            except (SeqoptError, TimeoutError) as error:
                why = _reason(error)
        for formulation, proof in ways:
            exact = proof and formulation.kind is not FormulationKind.HEURISTIC
            row = {"formulation": formulation.name, "proof": proof, "exact": exact}
            own = (shared, before) if proof else (None, 0.0)
            found = self._without(why) if proof and why else self._found(formulation, proof, own)
            yield {"engine": self.name, **row, **found}

    def _without(self, why: str) -> dict[str, object]:
        """Return a row without a plan."""
        spent, status, why = (self.seconds, CUT, "") if why == CUT else (np.nan, FAILED, why)
        return {"seconds": spent, "gap": np.nan, "error": np.nan, "status": status, "why": why}

    def _found(
        self,
        formulation: Formulation,
        proof: bool,  # noqa: FBT001  # of a way
        own: tuple[Problem | None, float],
    ) -> dict[str, object]:
        """Return the row of a formulation; ``own``: a problem with its costs, and their time, s."""
        shared, before = own

        def call() -> Plan:
            return on_the_way(solve(shared or self.posed(), formulation, proof=proof))

        try:
            seconds, plan = self.timer.least(self.seconds, call)
        except (SeqoptError, TimeoutError) as error:
            return self._without(_reason(error))
        off = np.nan
        with suppress(TimeoutError, SeqoptError), self.timer.within(self.seconds):
            off = self.reference.error(plan.engine, plan.steps)
        status = DONE if plan.ended is End.DONE else CUT
        found = {"seconds": before + seconds, "gap": self.reference.gap(plan), "error": off}
        return {**found, "status": status, "why": ""}


def _reason(error: Exception) -> str:
    """Return why there is no plan, in words; the same for all that take too long."""
    return CUT if isinstance(error, TimeoutError | TimeUpError) else str(error)


def _ways(problem: Problem) -> list[_Way]:
    """Return what chooses: formulations that minimize the same, and a search without proof."""
    asked = graph_of(problem).questions[0]
    if asked != "goals":
        raise ProblemError(
            f"speed: it is measured where grips or states are chosen, not {QUESTIONS[asked]}"
        )
    of_costs = chooses_moves(problem)
    known = [
        each
        for each in formulations("goals").values()
        if bool(each.aim) == of_costs and each.aim is not Aim.PEAK
    ]
    return [*((f, True) for f in known), *((f, False) for f in known if f.name in UNPROVEN)]


def speed_accuracy(
    problem: Problem, seconds: float = 10.0, progress: Tell = lambda _: None, timer: Timer = WALL
) -> SpeedTable:
    """Solve a problem by every engine and formulation, each within so many seconds.

    ``problem``: with the engine that the others are compared with; ``timer``: which tells the
    time. Raises `ProblemError` if the problem is of another kind; `TimeUpError` if the reference
    itself takes longer.
    """
    ways, reference = _ways(problem), Reference(problem)
    recipe = recipe_of(problem.engine)
    name = type(problem.engine).__name__ if recipe is None else recipe.name
    try:
        with timer.within(seconds):
            reference.prepare()
    except TimeoutError:
        raise TimeUpError(
            f"speed within {seconds:g} s: {name}, which the others are compared with, needs longer "
            "to prove an optimum; give more seconds, or fewer candidates"
        ) from None
    rows, refused = list[dict[str, object]](), dict[str, str]()
    names = [name, *(each for each in ENGINES if each != name)] if recipe else [name]
    for done, each in enumerate(names):
        progress(Stage(f"speed of {each}", done / len(names)))
        stage = _Stage(each, reference, seconds, timer)
        try:
            stage.posed()
        except SeqoptError as error:
            refused[each] = str(error)
            continue
        rows += stage.rows(ways)
    about = (problem.scene.name, len(problem.scene.bricks), problem.method, name, seconds)
    return SpeedTable(*about, pd.DataFrame(rows), refused)
