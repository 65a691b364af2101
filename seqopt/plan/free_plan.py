"""The plan of a free schedule: solved, judged and summarized."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any

import pandas as pd

from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import provenance
from seqopt.errors import InfeasibleError
from seqopt.graph.states.states import States
from seqopt.graph.states.steps import steps_of
from seqopt.plan.build import ShownBuild
from seqopt.plan.calling.formulation import Formulation, FormulationKind
from seqopt.plan.calling.guard import called
from seqopt.plan.calling.schedule_formulation import ScheduleFormulation, find_schedule_formulation
from seqopt.plan.calling.schedule_selection import StatePath, with_numbers
from seqopt.plan.judge.infeasible import confirmed
from seqopt.plan.judge.schedules import TOLERANCE, ScheduleCertificate, judge_schedule
from seqopt.plan.judge.standing_proof import certified
from seqopt.problem.goals import judged_by
from seqopt.problem.overloads import Excess, overloads
from seqopt.responses.resources import HERE
from seqopt.responses.table import analyze
from seqopt.sequence.free_rules import FREE, Ending
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step, StepKind, idle_robots
from seqopt.stability.assessment import stability_table
from seqopt.work.workers import keep

COUNTED = ("each", "sets", "screened", "stability")  # of a problem: they know what was computed


@dataclass(frozen=True, repr=False)
class FreePlan(ShownBuild):
    """A free schedule: every step of the build, and the values of its goals.

    ``problem``: what was solved; ``formulation``: what solved it; ``selection``: the states, and
    what the formulation claims of them; ``certificate``: their checked values; None without a
    proof; ``steps``: checked; ``seconds``: by stage, s: solve (responses among it), verify.
    """

    problem: States
    formulation: ScheduleFormulation
    selection: StatePath
    certificate: ScheduleCertificate | None
    steps: tuple[Step, ...]
    seconds: Mapping[str, float] = field(compare=False, hash=False)

    def __repr__(self) -> str:
        name = self.problem.network.scene.name
        return f"FreePlan({name!r}, {len(self.steps)} steps, {self.worth})"

    @property
    def engine(self) -> Engine:
        """What computes the responses."""
        return self.problem.engine

    @property
    def title(self) -> str:
        """The name of the plan where it is shown next to others."""
        return self.problem.title

    @property
    def worth(self) -> str:
        """The value of the plan, and what is proven about it, in words."""
        values = ", ".join(f"{name} {value:.6g}" for name, value in self.objective.items())
        gap = 0.0 if self.certificate is None else self.certificate.gap
        left = f" within {gap:.2g}" if TOLERANCE < gap < float("inf") else ""
        among = self.problem.among
        return f"{values}, {self.status}{left}{among and f' among candidates {among}'}"

    @property
    def status(self) -> str:
        """``optimal``, ``unproven``, or ``feasible``.

        The last where the search ended early, or it is not proven that no plan is better, as of
        heuristics or where prices of budgets leave something open.
        A margin of stability is optimal within the gap, which ``worth`` and the summary name.
        """
        if self.selection.stopped:
            return "feasible"
        if self.certificate is None:
            return "unproven"
        exact = self.formulation.kind is FormulationKind.EXACT and not self.problem.budgets
        return "optimal" if exact or self.certificate.gap <= TOLERANCE else "feasible"

    @property
    def objective(self) -> dict[str, float]:
        """The value of every goal by its name; of a tilt, what is survived, in degrees."""
        pairs = zip(self.problem.goals, self.selection.objective, strict=True)
        return {str(goal): goal.shown(value) for goal, value in pairs}

    @property
    def regrips(self) -> int:
        """How many grips are taken beside those that place a brick."""
        return sum(step.kind is StepKind.REPOSITION for step in self.steps)

    @cached_property
    def overloads(self) -> tuple[Excess, ...]:
        """The payloads that steps exceed, where rules ignore them."""
        return overloads(self.problem.network.scene, self._responses)

    def table(self) -> pd.DataFrame:
        """Return what was chosen: every grip.

        Result: as of `grips`.
        """
        return self.grips()

    def responses(self) -> pd.DataFrame:
        """Return the responses of every step.

        Result: as of `seqopt.analyze`.
        """
        return self._responses.copy()

    @cached_property
    def _responses(self) -> pd.DataFrame:
        return analyze(self.problem.engine, self.steps)

    def stability(self, mortar: Mortar | str | None = None) -> pd.DataFrame:
        """Return whether every step stands and by which margins, by the cone program.

        ``mortar``: of all joints; by default that which was demanded, or dry. Result: as of
        `seqopt.stability.assessment.stability_table`.
        """
        if mortar is not None:
            return super().stability(mortar)
        return stability_table(self.steps, certified(self.problem, self.steps))

    def summary(self) -> dict[str, object]:
        """Return the summary of the plan, ready for JSON.

        Result: ``aims`` with ``objective`` and ``bound`` by name and the ``gap``; the rules; how
        many ``steps`` there are, ``steps_before_release`` without those that let all go at the end,
        ``regrips``; ``models_evaluated`` (grip sets solved), ``seconds`` and more, as of
        `Plan.summary`.
        """
        problem, chosen = self.problem, self.selection
        goals = [str(goal) for goal in problem.aims]
        budgets = zip(problem.goals[len(goals) :], problem.budgets, strict=True)
        proof = self.certificate
        bound = chosen.bound if proof is None else proof.bound
        if chosen.stopped:
            bound = chosen.bound
        finite = (
            None if abs(value) == float("inf") else goal.shown(value)
            for goal, value in zip(problem.aims, bound, strict=False)
        )
        return {
            "scene": problem.network.scene.name,
            "schedule": _named(problem),
            "formulation": self.formulation.name,
            "kind": self.formulation.kind.value,
            "aims": goals,
            **judged_by(problem.goals, problem.criterion),
            "scenarios": len(problem.scenarios),
            "budgets": {str(goal): cap for goal, cap in budgets},
            "limits": {limit.response: limit.bound for limit in problem.limits},
            "rules": _rules(problem),
            "status": self.status,
            "stopped": chosen.stopped,
            "objective": self.objective,
            "bound": dict(zip(goals, finite, strict=True)),
            "gap": None if proof is None or chosen.stopped else proof.gap,
            "stands": self._standing,
            "steps": len(self.steps),
            "steps_before_release": len(self.steps) - self._letting_go,
            "regrips": self.regrips,
            "idle_robots": list(idle_robots(problem.network.scene, self.steps)),
            "outside_linear_range": [str(departure) for departure in self.departures],
            "payload_exceeded": [str(excess) for excess in self.overloads],
            "models_evaluated": problem.models,
            "states_in_proof": 0 if proof is None else proof.states,
            "seconds": dict(self.seconds),
            **provenance(self.engine),
        }

    @property
    def _standing(self) -> dict[str, object] | None:
        """What was demanded of the stability of states, and what it took to know."""
        if self.problem.standing is None:
            return None
        sets = self.problem.stability
        counts = {"looked_at": sets.looked_at, "programs": sets.programs}
        return {**self.problem.standing.described(), **counts, "undecided": sets.undecided}

    @property
    def _letting_go(self) -> int:
        """How many steps at the end only let go."""
        rules = self.problem.rules
        if isinstance(rules, Schedule) or rules.ending is Ending.HELD:
            return 0
        kinds = [step.kind is StepKind.RELEASE for step in reversed(self.steps)]
        least = rules.least_grips
        count = 0
        while kinds[count] and len(self.steps[-1 - count].held) < least:
            count += 1
        return count


def _named(problem: States) -> str:
    return problem.rules.method if isinstance(problem.rules, Schedule) else FREE


def _rules(problem: States) -> dict[str, object]:
    rules = problem.rules
    return {} if isinstance(rules, Schedule) else rules.described(problem.network.scene)


def solve_free(
    problem: States,
    formulation: ScheduleFormulation | Formulation | str = "schedule_search",
    *,
    proof: bool = True,
    **options: Any,
) -> FreePlan:
    """Solve the problem of a free schedule, and judge the answer.

    ``formulation``: one of another kind is refused; ``proof``: False leaves out the proof that no
    plan is better; the plan's own values are not checked; ``**options``: of the formulation;
    ``progress`` is told in a few words how far it is. Raises `InfeasibleError`, naming the brick at
    which it stops, and the rule or limit whose loosening opens a way; `ProblemError` if there is no
    such formulation or option; `SolverError` if the answer is not what its formulation claims.
    """
    formulation = find_schedule_formulation(formulation)
    formulation.require_options(options)
    with keep(problem.resources.executor, problem.resources.workers):
        return _solved(problem, formulation, options, proof=proof)


def _solved(
    problem: States,
    formulation: ScheduleFormulation,
    options: Mapping[str, Any],
    *,
    proof: bool,
) -> FreePlan:
    """Return the plan of a formulation, judged."""
    start, twin = time.perf_counter(), replace(problem)  # which no formulation can reach
    selection = _selected(formulation, problem, twin, options)
    solved = time.perf_counter()
    if proof and "progress" in options:
        options["progress"]("proving that no plan is better")
    steps = steps_of(twin.space, selection.states)
    hint = dict(enumerate(selection.visited))
    exact = formulation.kind is FormulationKind.EXACT
    certificate = judge_schedule(twin, selection, steps, hint, exact=exact) if proof else None
    problem.certified.update(twin.certified)
    seconds = {"solve": solved - start, "verify": time.perf_counter() - solved}
    return FreePlan(problem, formulation, selection, certificate, steps, seconds)


def _judged(problem: States) -> States:
    """Return what a formulation must not change; who works for it may."""
    return replace(problem, resources=HERE)


def _selected(
    formulation: ScheduleFormulation,
    problem: States,
    twin: States,
    options: Mapping[str, Any],
) -> StatePath:
    """Return what a formulation says, with numbers where numbers belong; or why there is none."""
    start, name = time.perf_counter(), formulation.name
    solve = partial(formulation.solve, problem, **options)
    try:
        selection = called(name, partial(_judged, problem), StatePath, solve)
    except InfeasibleError:
        left = float(options.get("seconds", math.inf)) - (time.perf_counter() - start)
        raise confirmed(twin, name, left) from None
    for kept in [*vars(problem)]:  # whatever it left behind, but counts of what was computed
        if kept not in (*(f.name for f in fields(problem)), *COUNTED):
            del vars(problem)[kept]
    return with_numbers(name, selection, len(problem.goals))
