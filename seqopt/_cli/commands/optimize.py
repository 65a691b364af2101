"""The command ``optimize``: choose every open grip of a build, or every step."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import isfinite
from typing import Any

import pandas as pd

from seqopt._cli import grammar, inputs, options, outputs, remarks
from seqopt._cli.answer import Answer, Result
from seqopt._cli.posing import Change, PosedProblem, pose_problem
from seqopt._cli.terminal import wrapped
from seqopt._files import csv_text
from seqopt._later import Later
from seqopt._showing import PAGE
from seqopt.graph.formulation import End, Run, as_formulation, trace_rows
from seqopt.judge.certificate import TOLERANCE
from seqopt.plan.plan import Plan
from seqopt.plan.pose import graph_of
from seqopt.plan.solve import _solve_run
from seqopt.problem.requirements import OWN, overloads
from seqopt.responses._tolerance import values_text
from seqopt.responses.table import OUTSIDE
from seqopt.sequence.steps import _idle_note
from seqopt.stability._builds import BuildProver, BuildVerdicts
from seqopt.study.published import paper_models
from seqopt.work.progress import Clock, within

PAGES = Later("seqopt.report._pages")  # 200 ms, where files are written
TEXT = Later("seqopt.report.text")  # 40 ms, where there is a plan
ADVICE = Later("seqopt.plan._infeasible")  # 20 ms: it needs all proofs
INTERRUPTED = "seqopt: interrupted; the plan is the best that was met"
VERDICTS = "which steps stand"


class Optimize(options.Written, options.Strict, options.Limited, options.Cured, options.Chosen):
    """What counts as best?

    With --aim, --stands, --order search or --schedule free states of the build are chosen:
    --ranked and criteria of ranks do not go with these.

    What must hold?
    --friction, --tilt and --curing go with --stands. Budgets on steps, regrips, makespan and sums
    go with --aim or --schedule free, those on steps_over and robot_use without.

    Who chooses and proves, and how long?
    --no-proof goes with cascade and rank_search, --lazy with exact formulations.

    option : NAME=VALUE
        option of the formulation, as horizon=2 or width=10
    proof :
        with cascade or rank_search: compute only the responses that the search meets, about a
        fifth; how far the choice is from the optimum stays unknown
    lazy :
        with an exact formulation: compute only the responses that the proof needs; stopped before
        it is done, it leaves its best choice and a bound; with --aim or --schedule free it is done
        at any rate

    What is written and printed?
    out : DIR
        folder to write plan, tables, summary and page to
    """

    option: options.Words = options.word((), shell=True)
    proof: bool = options.word(default=True, shell=True)
    lazy: bool = options.word(default=False, shell=True)


@dataclass(frozen=True, eq=False, repr=False)
class Found:
    """A plan with its request, and the evaluations that the time limit allows."""

    posed: PosedProblem
    plan: Plan
    assemble: float
    prover: BuildProver
    clock: Clock = field(default_factory=Clock)

    @cached_property
    def analyzed(self) -> bool:
        """Whether responses, linear range and overloads of the plan were computed in time."""

        def analyze() -> bool:
            _ = self.plan.departures, self.plan.enough, self.plan.overloads
            return True

        return self.clock.spare("the responses of its steps", analyze, otherwise=False)

    @cached_property
    def summary(self) -> dict[str, object]:
        """The summary of the plan, as far as computed in time."""
        brief = self.plan.brief()
        if not self.analyzed:
            return brief
        return self.clock.spare("the whole summary", self.plan.summary, brief)

    @cached_property
    def verdicts(self) -> dict[str, tuple[BuildVerdicts, ...]]:
        """Stability verdicts of the steps of the plan."""
        builds = {self.plan.title: self.plan.steps}
        found = self.clock.spare(VERDICTS, lambda: self.prover.of_builds(builds), None)
        if found is None:  # nobody is to ask again
            self.prover.refusal = remarks.WHY[self.clock.left_out.pop(VERDICTS)]
        return found or {}

    @cached_property
    def report(self) -> dict[str, object]:
        """The summary with the entries that the command adds."""
        plan = self.plan
        loop = plan.method == "three-robot" and plan.graph.candidates
        counts = paper_models(plan.decisions.schedule) if loop else ()
        out = self.summary | {
            "seconds": {"assemble": self.assemble, **plan.seconds},
            "models_paper_count": dict(zip(("cascading", "overlap"), counts, strict=False)) or None,
            "stability": {v.mortar: v.facts() for v in self.verdicts.get(plan.title, ())},
        }
        out |= {"left_out": dict(self.clock.left_out)} if self.clock.left_out else {}
        if self.posed.known is None:
            return out
        assert self.posed.robust is not None
        return out | {"robust": str(self.posed.robust.aim), "scenarios": self.posed.known.settings}


def run(asked: Optimize) -> Result:
    """Choose where robots hold, over all steps of a sequence, by one formulation.

    With --schedule free, choose every step. The answer is checked from the problem's own data, and
    plan, selection, responses, summary and a page for the browser are written.

    Usage
    [SCENE] [--formulation NAME] [--out DIR] [other options]
    [SCENE] --schedule free [--out DIR] [other options]
    [SCENE] --robust AIM [--out DIR] [other options]

    Examples
    --------
    seqopt optimize arch25 --out best
    seqopt optimize arch25 --schedule free --aim minmax,steps --out free
    seqopt optimize wall:columns=4,courses=3 --schedule free --stands dry
    seqopt optimize my.json --criteria worst-ratio --limit payload --out mine
    """
    found = find(asked)
    return Result(found.plan, lambda: answered(asked, found))


def find(asked: Optimize, change: Change | None = None) -> Found:
    """Choose every open grip of a build, or every step; ``change``: applied to scene and start."""
    clock = Clock(asked.time_limit)
    outputs.require_out(asked, *outputs.ALWAYS)
    start = time.perf_counter()
    with clock.needed("posing the problem"):
        posed = pose_problem(asked, change)
        usual = graph_of(posed.problem).default_formulation
        formulation = as_formulation(asked.formulation or usual)
    how: dict[str, Any] = grammar.parse_options(formulation, asked.option)
    if asked.max_memory is not None and "max_memory" in formulation.options:
        how["max_memory"] = grammar.parse_size(str(asked.max_memory))
    tell = asked.tell if formulation.of_states else within(asked.tell, clock.left)
    run = Run(proof=asked.proof, lazy=asked.lazy, options=how, progress=tell, clock=clock)
    assemble = time.perf_counter() - start

    try:
        plan = _solve_run(posed.problem, formulation, run)
    except KeyboardInterrupt:
        clock.interrupted = True
        raise
    clock.interrupted |= plan.ended is End.INTERRUPTED
    prover = inputs.find_prover(asked, plan.engine.network)
    return Found(posed, plan, assemble, prover, clock)


def answered(asked: Optimize, found: Found) -> Answer:
    """Write a plan, and return its answer, without the parts that exceed the time limit."""
    made: dict[str, bytes | str] = {}
    proving = found.prover.begun(found.plan.steps) if found.clock.left else nullcontext()
    with proving:  # in another process, as commands may, unlike scripts
        if asked.path is not None and found.analyzed and found.summary:  # what says most is first
            tables = partial(outputs.plan_files, found.plan)
            made = found.clock.spare("its tables", tables, made)
        _ = found.verdicts
        return _answer(asked, found, outputs.write_outputs(asked, lambda: _files(found, made)))


def _files(found: Found, tables: Mapping[str, bytes | str]) -> dict[str, bytes | str]:
    """Return the files of a plan by name, at least table, summary and scene."""
    plan, made = found.plan, dict[str, bytes | str]()
    tasks = {kind: str(tables[f"tasks.{kind}"]) for kind in ("csv", "json") if tables}
    if found.analyzed:
        shown = partial(PAGES.plan_page, plan, found.prover, tasks=tasks)
        content = found.clock.spare(PAGE, shown, None)
        made |= {} if content is None else {PAGE: content}
    if rows := trace_rows(plan.trace):
        made["trace.csv"] = csv_text(pd.DataFrame(rows))
    table = plan.responses() if found.analyzed else outputs.steps_table(plan)
    return {**outputs.bare_files(plan, table, found.report), **made, **tables}


def _answer(asked: Optimize, found: Found, written: tuple[Any, ...]) -> Answer:
    """Build the answer of a written plan."""
    plan = found.plan
    scene, early = plan.engine.network.scene, plan.ended is End.INTERRUPTED
    over = remarks.exceeded(scene, plan._columns) if found.analyzed and not early else ()
    facts: dict[str, object] = {
        "summary": lambda: found.report,
        "proof": _proof(plan),
        **({"order": plan.order} if plan.order else {}),
    }
    ended = INTERRUPTED if early else "seqopt: interrupted; the plan was chosen by then"
    answer = Answer(
        scene=scene,
        facts={**facts, "plan": plan.responses if found.analyzed else outputs.steps_table(plan)},
        text="\n".join(_lines(asked, found, over)),
        written=written,
        notes=tuple(_notes(asked, found)),
    )
    answer = remarks.in_time(answer, found.clock, ended)
    unreached = () if plan.arms is None else plan.arms.faults
    left = plan.departures if found.analyzed else ()
    answer = remarks.held_to(answer, over, left, found.verdicts, unreached)
    far = plan.is_far and not found.posed.problem.lifts_range
    return remarks.kept_range(answer, plan.beyond if far else None)


def _lines(asked: Optimize, found: Found, over: Sequence[str]) -> Iterator[str]:
    """Yield lines on grips, objective, search and stability of a plan."""
    plan, scene = found.plan, found.plan.engine.network.scene
    held = ""
    if found.analyzed:
        held = f"{OUTSIDE}: " * bool(plan.outside) + f"{TEXT._headline(scene, plan._columns)}; "
    yield f"{held}{_value(found)}"
    counts = [f"{len(plan.steps)} steps"]
    if not plan.graph.candidates:
        counts.append(f"{plan.regrips} regrip{'s' * (plan.regrips != 1)}")
    counts.append(f"{plan.models:,} models")
    search = f"{plan.formulation.name} ({plan.formulation.kind.value}): {', '.join(counts)}"
    page = found.analyzed and PAGE not in found.clock.left_out
    yield f"{search}; {outputs.written_to(asked.path, page=page)}"
    yield from map(wrapped, remarks.waits_said(plan) if plan.certificate is not None else ())
    yield from (f"stability, {each}" for each in found.verdicts.get(plan.title, ()))
    if plan.order:
        yield wrapped(", ".join(map(str, plan.order)), first="order: ")
    yield from (f"payload exceeded: {excess}" for excess in over)
    if over and (loads := overloads(scene, plan._columns)):
        yield ADVICE.payload_advice(plan.engine, plan.steps, loads)


def _notes(asked: Optimize, found: Found) -> Iterator[str]:
    """Yield notes on levels, rules, scales, proof, idle robots and time."""
    plan, problem = found.plan, found.posed.problem
    scene, criterion = plan.engine.network.scene, problem.criterion.name
    yield from remarks.level_notes(asked, plan.engine)
    if criterion.endswith(OWN):
        yield f"criterion: {criterion}: no fixed method builds this scene to take scales from"
    yield from remarks.rule_notes(problem.moves, scene)
    if plan.arms is not None:
        yield f"arms: {plan.arms}"
    if plan.ended is not End.INTERRUPTED:
        yield from plan.enough.lines if found.analyzed else ()
        yield f"proof: {_proof(plan)}"
    yield from _idle_note(scene, "robots", plan.steps)
    if plan.makespan is not None and "makespan" not in plan.goals:
        what = "the build" if plan.steps[0].number == 1 else "what is left"
        yield f"time: {what} takes {plan.makespan:.6g} s; --aim makespan makes it short"
    yield from remarks.refused(found.prover)


def _value(found: Found) -> str:
    """Describe objective, bound and gap of a plan."""
    plan = found.plan
    if plan.order:
        return f"{values_text(plan.objective)}, {plan.status}, {plan.order_bound_said}"
    known = found.posed.known
    if known is None or not plan.graph.candidates:
        return plan._value
    return f"{plan._value} over {len(known.scenes)} scenarios ({plan.title})"


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}{'s' * (count != 1)}"


def _proof(plan: Plan) -> str:
    """Describe the proof of optimality, and its limits."""
    proof = plan.certificate
    if proof is None and plan.ended is End.STOPPED:
        return "left out, time is over; values and bounds are claimed"
    if proof is None or plan.gap is None:
        return "none; how much better another plan may be is not known"
    looked = _counted(proof.models or plan.models, "model")
    looked += f" and {_counted(proof.states, 'state')}" if proof.states else ""
    looked += " prove it" + f", {plan.models:,} models were searched" * bool(proof.models)
    other = "no other plan among these" if plan.among else "no other plan"
    other = f"{OUTSIDE}, where {other}" if plan.is_far else other
    better = (
        "is better" if plan.gap <= TOLERANCE else f"is better by more than {100 * plan.gap:.3g} %"
    )
    return f"{looked}; {other} {better if isfinite(plan.gap) else 'is looked at'}"
