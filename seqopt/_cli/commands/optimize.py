"""The command ``optimize``: choose every open grip of a build, or every step."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import isfinite
from typing import TYPE_CHECKING, Any

import pandas as pd

from seqopt._cli.answer import Answer, Status
from seqopt._cli.asked import (
    WHY,
    _not_done,
    asked_prover,
    asked_scene,
    exceeded,
    idle_notes,
    in_seconds,
    level_notes,
    refused,
    rule_notes,
    scene_facts,
    strictly,
    waits_said,
)
from seqopt._cli.options import (
    BEST,
    BUILT,
    CURING,
    DURATIONS,
    HOLDS,
    LIMIT,
    MOVES,
    PROVES,
    RULE,
    STANDING,
    WHERE,
    WRITTEN,
    criterion_options,
    declare,
    engine_options,
    form_options,
    robots_option,
    scene_options,
)
from seqopt._cli.outputs import (
    ALWAYS,
    TABLES,
    _bare_files,
    _plan_files,
    _steps_table,
    require_out,
    write_outputs,
    written_to,
)
from seqopt._cli.posing import Asked, asked_problem
from seqopt._cli.screens import question
from seqopt._cli.terminal import wrapped
from seqopt._cli.values import parse_options, parse_size, parse_time_limit
from seqopt._cli.words.optimizing import (
    AIM,
    BASES,
    BUDGET,
    FEWEST,
    FORMULATION,
    MEMORY,
    OF_BEST,
    OF_BUILT,
    OF_HOLDS,
    OF_MOVES,
    OF_PROVING,
    OF_SCENARIOS,
    POLICY,
    ROBUST,
    SCHEDULE,
    SEARCH,
    TIME,
    WORKERS,
)
from seqopt._files import csv_text
from seqopt._showing import PAGE
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, TimeUpError
from seqopt.graph.formulation import End, Formulation, On, Run, as_formulation, trace_rows
from seqopt.graph.states.states import States
from seqopt.judge.certificate import TOLERANCE
from seqopt.plan._levels import at_sufficient_level
from seqopt.plan._softer import _payload_advice
from seqopt.plan._status import faults_in_words
from seqopt.plan.plan import Plan
from seqopt.plan.solving import _solve_run, usual
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import LIFTED, LINEAR_RANGE, OWN, overloads
from seqopt.responses._tolerance import value_text
from seqopt.responses.table import OUTSIDE
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import StepKind
from seqopt.stability._builds import BuildProver, BuildVerdicts
from seqopt.study.published import paper_models
from seqopt.work._clock import Clock
from seqopt.work.progress import within

if TYPE_CHECKING:
    from seqopt.arms._bases import FoundBases
    from seqopt.plan._studies.fewest_props import FoundProps
    from seqopt.plan.out_of_sample import Trial

DESCRIPTION = (
    "Choose where robots hold, over all steps of a sequence, by one formulation; or, with "
    "--schedule free, choose every step. The answer is checked from the problem's own data, and "
    "plan, selection, responses, summary and a page for the browser are written."
)
USAGE = (
    "[SCENE] [--formulation NAME] [--out DIR] [other options]",
    "[SCENE] --schedule free [--out DIR] [other options]",
    "[SCENE] --robust AIM [--out DIR] [other options]",
)
EXAMPLES = (
    "seqopt optimize arch25 --out best",
    "seqopt optimize arch25 --schedule free --aim minmax,steps --out free",
    "seqopt optimize wall:columns=4,courses=3 --schedule free --stands dry",
    "seqopt optimize my.json --criteria worst-ratio --limit payload --out mine",
)
INTERRUPTED = "seqopt: interrupted; the plan is the best that was met"
VERDICTS, UNSEEN = "which steps stand", "its values in unseen scenarios"


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``optimize``, those of a first use before those of an expert."""
    built, moves = question(command, BUILT, OF_BUILT), question(command, MOVES, OF_MOVES)
    scene_options(built)
    declare(moves, SCHEDULE)
    robots_option(built, "a loop, or a schedule that is named")
    declare(built, DURATIONS | BASES)
    declare(moves, RULE | WHERE)
    declare(question(command, BEST, OF_BEST), AIM | FEWEST)
    criterion_options(command)
    declare(question(command, HOLDS, OF_HOLDS), LIMIT | BUDGET | STANDING | CURING)
    declare(question(command, "In which scenarios is it good?", OF_SCENARIOS), ROBUST)
    proves = question(command, PROVES, OF_PROVING)
    declare(proves, FORMULATION | SEARCH | TIME)
    declare(proves, WORKERS, default="1")
    declare(proves, MEMORY)
    engine_options(command)
    written = question(command, WRITTEN)
    declare(written, {"--out DIR": "folder to write plan, tables, summary and page to"})
    declare(written, TABLES, choices=("plan", "all"), default="plan")
    declare(written, POLICY)
    form_options(command, strict=True, builds=True)


@dataclass(frozen=True, eq=False, repr=False)
class Found:
    """A plan, what was asked, and what there is time to say of it: from its responses to a page."""

    asked: Asked
    plan: Plan
    assemble: float
    prover: BuildProver
    bases: FoundBases | None = None
    whole: str = ""
    props: FoundProps | None = None
    clock: Clock = field(default_factory=Clock)

    @cached_property
    def trial(self) -> Trial | None:
        """Beside other plans, where candidates were chosen over scenarios."""
        unseen = self.asked.unseen
        if unseen is None or isinstance(self.plan.graph, States):
            return None
        from seqopt.plan.out_of_sample import judge_unseen  # noqa: PLC0415  # few plans are robust

        return self.clock.spare(UNSEEN, lambda: judge_unseen(self.plan, unseen), None)

    @cached_property
    def analyzed(self) -> bool:
        """Whether there was time for the responses of the plan, and for what is said by them."""

        def analyze() -> bool:
            _ = self.plan.departures, self.plan.enough, self.plan.overloads
            return True

        return self.clock.spare("the responses of its steps", analyze, otherwise=False)

    @cached_property
    def summary(self) -> dict[str, object]:
        """The summary of the plan, or what there was time for of it."""
        brief = self.plan.brief()
        if not self.analyzed:
            return brief
        return self.clock.spare("the whole summary", self.plan.summary, brief)

    @cached_property
    def verdicts(self) -> dict[str, tuple[BuildVerdicts, ...]]:
        """Which steps of the plan stand."""
        builds = {self.plan.title: self.plan.steps}
        found = self.clock.spare(VERDICTS, lambda: self.prover.of_builds(builds), None)
        if found is None:  # nobody is to ask again
            self.prover.refusal = WHY[self.clock.left_out.pop(VERDICTS)]
        return found or {}

    def proving(self) -> AbstractContextManager[None]:
        """Let another process begin to prove what stands: a command may start one, no script."""
        return self.prover.begun(self.plan.steps) if self.clock.left else nullcontext()

    @property
    def own(self) -> tuple[BuildVerdicts, ...]:
        """The same, by mortar alone."""
        return self.verdicts.get(self.plan.title, ())

    @cached_property
    def report(self) -> dict[str, object]:
        """The summary, and what the command adds to it."""
        out = self.summary | {
            "seconds": {"assemble": self.assemble, **self.plan.seconds},
            "models_paper_count": _paper_count(self.plan),
            "stability": {each.mortar: each.facts() for each in self.own},
        }
        out |= {"left_out": dict(self.clock.left_out)} if self.clock.left_out else {}
        out |= {} if self.props is None else {"fewest_props": self.props.described()}
        known, unseen = self.asked.known, self.asked.unseen
        if known is None:
            return out
        out |= {"robust": str(self.asked.aim), "scenarios": known.settings}
        if unseen is None:
            return out
        if self.trial is not None:
            return out | {"unseen": unseen.settings, "worth": self.trial.summary()}
        worst = None
        if isinstance(self.plan.graph, States):
            from seqopt.plan.out_of_sample import worst_values  # noqa: PLC0415

            worst = self.clock.spare(UNSEEN, lambda: worst_values(self.plan, unseen), None)
        return out | {"unseen": {**unseen.settings, "worst": worst}}


def run(options: argparse.Namespace) -> Answer:
    """Choose every open grip of a build, or every step, and write the plan."""
    found = find(options)
    with found.proving():
        return answered(options, found)


def find(options: argparse.Namespace) -> Found:
    """Choose every open grip of a build, or every step."""
    clock = Clock(parse_time_limit(options.time_limit))
    if getattr(options, "policy", False) and options.out is None:
        raise ProblemError("--policy: it is written to a folder; give --out DIR")
    require_out(options, *ALWAYS)
    start = time.perf_counter()
    with clock.needed("posing the problem"):
        asked = asked_problem(options)
        formulation = as_formulation(options.formulation or usual(asked.problem))
    how = _how(options, formulation)
    assemble = time.perf_counter() - start
    in_stages = formulation.on in (On.STATES, On.TIMES)
    run = replace(how, progress=options.tell, clock=clock)
    if not in_stages:
        run = replace(run, progress=within(options.tell, clock.left))

    def choose(problem: Problem) -> Plan:
        if clock.interrupted:  # one that came between two plans ends the next
            raise KeyboardInterrupt
        try:
            plan = _solve_run(problem, formulation, run)
        except KeyboardInterrupt:
            clock.interrupted = True
            raise
        clock.interrupted |= plan.ended is End.INTERRUPTED
        return plan

    bases = None if options.bases is None else _bases(options, asked.problem, choose)
    props = None if asked.fewest is None else _props(options, asked, choose)
    outer = bases or props
    plan = choose(asked.problem) if outer is None else outer.plan
    plan = at_sufficient_level(plan, choose, clock)
    prover = asked_prover(options, plan.engine.network)
    whole = _from_empty(asked.whole, plan, choose)
    return Found(asked, plan, assemble, prover, bases, whole, props, clock)


def answered(options: argparse.Namespace, found: Found) -> Answer:
    """Write a plan, and return what it is worth; what there is no time for is left out."""
    made: dict[str, bytes | str] = {}
    if found.analyzed and found.summary and options.out is not None:  # what says most comes first
        choices = getattr(options, "tables", None) == "all"
        tables = partial(_plan_files, found.plan, choices=choices)
        made = found.clock.spare("its tables", tables, made)
    _ = found.verdicts, found.trial
    return _answer(options, found, write_outputs(options, lambda: _files(options, found, made)))


def _files(
    options: argparse.Namespace, found: Found, tables: Mapping[str, bytes | str]
) -> dict[str, bytes | str]:
    """Return the files of a plan by name, with its tables and tasks; at least what it is alone."""
    plan, outer, made = found.plan, found.bases or found.props, dict[str, bytes | str]()
    tasks = {kind: str(tables[f"tasks.{kind}"]) for kind in ("csv", "json") if tables}
    asked: dict[str, Callable[[], str | bytes]] = {}
    if getattr(options, "policy", False):
        from seqopt.plan.policy import FILE, find_policy  # noqa: PLC0415  # few ask for one

        asked[FILE] = lambda: find_policy(found.asked.problem, options.tell).content()
    if found.analyzed:
        from seqopt.report._pages import plan_page  # noqa: PLC0415  # only where files are written

        asked[PAGE] = lambda: plan_page(plan, found.prover, tasks=tasks)
    for name, make in asked.items():
        content = found.clock.spare(name, make, None)
        made |= {} if content is None else {name: content}
    if outer is not None:
        name = "bases.csv" if found.props is None else "fewest_props.csv"
        made[name] = csv_text(outer.tried)
    if found.trial is not None:
        made["scenarios.csv"] = csv_text(found.trial.table)
    if rows := trace_rows(plan.trace):
        made["trace.csv"] = csv_text(pd.DataFrame(rows))
    table = plan.responses() if found.analyzed else _steps_table(plan)
    return {**_bare_files(plan, table, found.report), **made, **tables}


def _from_empty(whole: Problem | None, plan: Plan, choose: Callable[[Problem], Plan]) -> str:
    """Return what the best build from an empty site takes, beside one that goes on; in words."""
    if whole is None or plan.certificate is None:
        return ""
    begin = plan.steps[0].number - 1
    down = any(step.kind is StepKind.REMOVE for step in plan.steps)
    site = "the whole structure" if down else "an empty site"
    done = f"what is left after step {begin}: {_values(plan)}"
    try:
        return f"{done}; from {site} the best is {_values(choose(whole))}"
    except InfeasibleError:
        return f"{done}; from {site} there is no plan"
    except NothingFoundError:
        return f"{done}; from {site} no plan was found"
    except (TimeUpError, KeyboardInterrupt):
        return f"{done}; what the best from {site} takes was not found in time"


def _values(plan: Plan) -> str:
    """Return the values of a plan and how many steps it has, in words."""
    values = [f"{name} {value_text(name, v)}" for name, v in plan.objective.items()]
    steps = [] if "steps" in plan.objective else [f"{len(plan.steps)} steps"]
    return f"{OUTSIDE}: " * plan.is_far + ", ".join([*values, *steps])


def _props(
    options: argparse.Namespace, asked: Asked, choose: Callable[[Problem], Plan]
) -> FoundProps:
    """Return the best plan of the fewest props."""
    if options.no_proof:
        raise ProblemError("--no-proof: props are compared by proven plans; leave it out")
    from seqopt.plan._studies.fewest_props import fewest_props  # noqa: PLC0415  # few ask for it

    assert asked.fewest is not None
    return fewest_props(asked.problem, asked.fewest, choose, options.tell)


def _bases(
    options: argparse.Namespace, problem: Problem, choose: Callable[[Problem], Plan]
) -> FoundBases:
    """Return the best plan over the bases that are asked for."""
    if options.no_proof:
        raise ProblemError("--no-proof: bases are compared by proven plans; leave it out")
    from seqopt._cli.words.bases import asked_places  # noqa: PLC0415  # few ask for it
    from seqopt.arms._bases import choose_bases  # noqa: PLC0415

    scene = in_seconds(options, asked_scene(options))
    places = asked_places(scene, options.bases)
    return choose_bases(problem, scene, places, choose, options.tell)


def _how(options: argparse.Namespace, formulation: Formulation) -> Run:
    """Return how a formulation is to be run, its own options among it."""
    how: dict[str, Any] = parse_options(formulation, options.option)
    if options.max_memory is not None and formulation.on is On.ORDERS:
        raise ProblemError(
            "--max-memory: the search of orders has none; leave it out, or give --option most=N"
        )
    if options.max_memory is not None and "max_memory" in formulation.options:
        how["max_memory"] = parse_size(options.max_memory)
    return Run(proof=not options.no_proof, lazy=options.lazy, options=how)


def _answer(options: argparse.Namespace, found: Found, written: tuple[Any, ...]) -> Answer:
    """Return what a plan is worth, once it is written."""
    plan, clock = found.plan, found.clock
    scene = plan.engine.network.scene
    early = plan.ended is End.INTERRUPTED
    over = exceeded(scene, plan._columns) if found.analyzed and not early else ()
    enough = _enough_payload(plan) if over else ()
    page = found.analyzed and PAGE not in clock.left_out
    lines = [_value(found) if not found.analyzed else f"{_held(plan)}; {_value(found)}"]
    lines += [f"{_search(plan)}; {written_to(options.out, page=page)}"]
    lines += map(wrapped, waits_said(plan) if plan.certificate is not None else ())
    lines += [f"stability, {each}" for each in found.own]
    lines += [wrapped(each.said) for each in (found.bases, found.props) if each is not None]
    lines += [wrapped(found.whole)] if found.whole else []
    facts: dict[str, object] = {
        "scene": scene_facts(scene),
        "summary": lambda: found.report,
        "proof": _proof(plan),
    }
    if found.bases is not None:
        facts["bases"] = found.bases.tried
    if found.props is not None:
        facts["fewest_props"] = found.props.tried
    if plan.order is not None:
        order = plan.order.selection.order
        facts["order"] = order
        lines.append(wrapped(", ".join(map(str, order)), first="order: "))
    said = (*(plan.enough.lines if found.analyzed else ()), f"proof: {_proof(plan)}")
    answer = Answer(
        facts={**facts, "plan": plan.responses if found.analyzed else _steps_table(plan)},
        text="\n".join([*lines, *(f"payload exceeded: {excess}" for excess in over), *enough]),
        written=written,
        notes=(
            *level_notes(options, plan.engine),
            *_posed_notes(found.asked.problem),
            *rule_notes(found.asked.problem.moves, scene),
            *(() if plan.arms is None else (f"arms: {plan.arms}",)),
            *(() if early else said),
            *idle_notes(scene, plan.steps),
            *_time_notes(plan),
            *refused(found.prover),
            *_not_done(clock),
        ),
        failures=_interrupted(clock, early=early),
        status=Status.INTERRUPTED if clock.interrupted else Status.DONE,
    )
    unreached = () if plan.arms is None else faults_in_words(plan.arms.postures)
    left = plan.departures if found.analyzed else ()
    answer = strictly(answer, options, over, left, found.verdicts, unreached)
    return answer if found.asked.problem.lifts_range else _in_range(answer, plan)


def _in_range(answer: Answer, plan: Plan) -> Answer:
    """Return an answer whose status says it if a plan leaves the limit of the linear range."""
    if not plan.is_far or answer.status is not Status.DONE:
        return answer
    said = f"seqopt: {OUTSIDE}: {plan.beyond}; --limit {LINEAR_RANGE}={LIFTED} lifts this limit"
    return replace(answer, failures=(*answer.failures, said), status=Status.DOES_NOT_HOLD)


def _held(plan: Plan) -> str:
    """Return how much robots hold and nodes move at most, and whether that is to be relied on."""
    from seqopt.report.text import _headline  # noqa: PLC0415  # where there is a plan

    first = f"{OUTSIDE}: " if plan.outside else ""
    return f"{first}{_headline(plan.engine.network.scene, plan._columns)}"


def _interrupted(clock: Clock, *, early: bool) -> tuple[str, ...]:
    """Return what an interrupt ended, in a line. ``early``: whether choosing or its proof."""
    if early:
        return (INTERRUPTED,)
    return ("seqopt: interrupted; the plan was chosen by then",) if clock.interrupted else ()


def _enough_payload(plan: Plan) -> tuple[str, ...]:
    """Return what is enough for a plan in which a payload is exceeded: one, or softer grips."""
    over = overloads(plan.engine.network.scene, plan._columns)
    return (_payload_advice(plan.engine, plan.steps, over),) if over else ()


def _time_notes(plan: Plan) -> tuple[str, ...]:
    """Return how long a plan takes where that is known, and no aim."""
    if plan.makespan is None or "makespan" in plan.goals:
        return ()
    what = "the build" if plan.steps[0].number == 1 else "what is left"
    return (f"time: {what} takes {plan.makespan:.6g} s; --aim makespan makes it short",)


def _value(found: Found) -> str:
    """Return what a plan was chosen by, and what is proven of that."""
    plan = found.plan
    if plan.order is not None:
        values = ", ".join(f"{name} {value_text(name, v)}" for name, v in plan.objective.items())
        return f"{values}, {plan.status}, {plan.order.bound_said}"
    known = found.asked.known
    if known is None or isinstance(plan.graph, States):
        return plan._value
    value = f"{plan._value} over {len(known.scenes)} scenarios ({plan.title})"
    if found.trial is None:
        return value
    unseen = found.trial.summary()["unseen"]
    others = f"{unseen['robust']:.6g}, the nominal plan {unseen['nominal']:.6g}"
    return f"{value}; over unseen ones {others}"


def _search(plan: Plan) -> str:
    """Return which formulation found a plan, what it is, and how many models that took."""
    counts = [f"{len(plan.steps)} steps"]
    if isinstance(plan.graph, States):
        counts.append(f"{plan.regrips} regrip{'s' * (plan.regrips != 1)}")
    counts += [] if plan.order is not None else [f"{plan.models:,} models"]
    return f"{plan.formulation.name} ({plan.formulation.kind.value}): {', '.join(counts)}"


def _posed_notes(problem: Problem) -> tuple[str, ...]:
    """Return whether scales are not those of fixed methods."""
    name = problem.criterion.name
    if not name.endswith(OWN):
        return ()
    return (f"criterion: {name}: no fixed method builds this scene to take scales from",)


def _proof(plan: Plan) -> str:
    """Return which proof was enough, and what another could still change."""
    proof, looked = plan.certificate, f"{plan.models:,} models"
    if proof is None and plan.ended is End.STOPPED:
        return "left out, time is over; values and bounds are claimed"
    if proof is None or plan.gap is None:
        return "none; how much better another plan may be is not known"
    if proof.states:
        looked += f" and {proof.states:,} state{'s' * (proof.states > 1)}"
    other = "no other plan among these" if plan.among else "no other plan"
    other = f"{OUTSIDE}, where {other}" if plan.is_far else other
    better = (
        "is better" if plan.gap <= TOLERANCE else f"is better by more than {100 * plan.gap:.3g} %"
    )
    return f"{looked} were enough; {other} {better if isfinite(plan.gap) else 'is looked at'}"


def _paper_count(plan: Plan) -> dict[str, int] | None:
    """Return how many models the paper counts for the loop of three robots; none for others."""
    if plan.method != "three-robot" or isinstance(plan.graph, States):
        return None
    schedule: Schedule = plan.layers.schedule
    return dict(zip(("cascading", "overlap"), paper_models(schedule), strict=True))
