"""The command ``optimize``: choose every open grip of a build, or every step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import pandas as pd

from seqopt._cli import outputs, remarks
from seqopt._cli.answer import Answer, Result
from seqopt._cli.inputs import find_prover, mortar_of_engine
from seqopt._cli.outputs import ALWAYS, Output
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Built, Folder, Sampled, Timed, shown, split_words
from seqopt._files import csv_text
from seqopt._later import Later
from seqopt._showing import PAGE
from seqopt.graph.formulation import End, trace_rows
from seqopt.judge.certificate import TOLERANCE
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import OWN, overloads
from seqopt.responses._tolerance import values_text
from seqopt.responses.table import OUTSIDE
from seqopt.sequence.steps import _idle_note
from seqopt.stability._builds import BuildProver, BuildVerdicts
from seqopt.study.published import paper_models
from seqopt.work.progress import Clock, Tell
from seqopt.workflow import SEARCH, Robust, Search, optimize

PAGES = Later("seqopt.report._pages")  # 200 ms, where files are written
TEXT = Later("seqopt.report.text")  # 40 ms, where there is a plan
ADVICE = Later("seqopt.plan._infeasible")  # 20 ms: it needs all proofs
INTERRUPTED = "seqopt: interrupted; the plan is the best that was met"
VERDICTS = "which steps stand"


@dataclass(frozen=True, eq=False, repr=False)
class Found:
    """A plan with its request, and the evaluations that the time limit allows."""

    plan: Plan
    prover: BuildProver
    clock: Clock
    out: Output
    tell: Tell
    engine: str | None = None  # that is named
    robust: Robust | None = None
    tables: dict[str, bytes | str] = field(
        default_factory=dict
    )  # further files, once they are made

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
            "seconds": dict(plan.seconds),
            "models_paper_count": dict(zip(("cascading", "overlap"), counts, strict=False)) or None,
            "stability": {v.mortar: v.facts() for v in self.verdicts.get(plan.title, ())},
        }
        pictures = sum(name.endswith((".png", ".svg")) for name in self.tables)
        out["spent_on_showing"] = {**self.prover.spent, "pictures": pictures}
        out |= {"left_out": dict(self.clock.left_out)} if self.clock.left_out else {}
        if self.robust is None:
            return out
        drawn = self.robust.draw(plan.engine.network.scene)
        return out | {"robust": str(self.robust.aim), "scenarios": drawn.settings}


def run(
    asked: Annotated[Call, ("call", optimize)],
    *,
    stability: bool = True,
    out: Folder | None = None,
    progress: Tell = shown,
) -> Result[Plan]:
    """Choose where robots hold, over all steps of a sequence, by one formulation.

    With --schedule free, choose every step. The answer is checked from the problem's own data, and
    plan, selection, responses, summary and a page for the browser are written.

    With --aim, --stands, --order search or --schedule free states of the build are chosen: --ranked
    and criteria of ranks do not go with these. --no-proof goes with cascade and rank_search, --lazy
    with exact formulations.

    Parameters
    ----------
    stability : bool
        If not, it is not proven which steps stand, dry and with epoxy (or the mortar of ``stands``
        or ``mortar``): quicker.
    out : pathlib.Path or str
        Folder to write plan, tables, summary and page to.

    Examples
    --------
    $ seqopt optimize arch25 --out best
    $ seqopt optimize arch25 --schedule free --aim minmax,steps --out free
    $ seqopt optimize wall:columns=4,courses=3 --schedule free --stands dry
    $ seqopt optimize my.json --criteria worst-ratio --limit payload --out mine
    """
    found = find(asked, progress, stability=stability, out=out)
    return Result(found.plan, lambda: answered(found))


def posed(asked: Call, *, verdicts: bool) -> Call:
    """Return a call with its scene read, which may get further robots.

    ``verdicts``: whether the mortar may be theirs alone.
    """
    built, words = split_words(asked.words, Timed)
    if isinstance(built.scene, Built):  # with an order beside it
        whole, order = built.scene, built.order
        built = Timed(**{**vars(whole), "order": order or whole.order})
    sought = {"order": SEARCH} if built.order == SEARCH else {}
    robots = words.get("robots")
    scene = replace(built, order=None if sought else built.order).read(robots)
    mortar = mortar_of_engine(words.get("engine"), words.get("mortar"), verdicts=verdicts)
    words |= {"scene": scene, "mortar": mortar, **sought}
    words |= {"robots": None} if isinstance(robots, int) else {}
    return Call(asked.function, words)


def find(
    asked: Call,
    tell: Tell = shown,
    *,
    stability: bool = True,
    out: Path | str | None = None,
    more: Callable[[], Mapping[str, Any]] = dict,
) -> Found:
    """Choose every open grip of a build, or every step; ``more``: returns further words."""
    search, words = split_words(asked.words, Search)
    search = words.pop("search", search)
    clock = Clock(search.time_limit)
    output = Output(out, words.get("scene"), words.get("schedule"))
    output.require(*ALWAYS)
    with clock.needed("posing the problem"):
        call = posed(Call(asked.function, {**words, **more()}), verdicts=stability)
    robust = split_words(words, Sampled)[0].parse()
    plan = call(search=replace(search, clock=clock), progress=tell)
    clock.interrupted |= plan.ended is End.INTERRUPTED
    network, mortar = plan.engine.network, words.get("stands", words.get("mortar"))
    prover = find_prover(network, mortar, tell, asks=stability, stands=plan.standing)
    return Found(plan, prover, clock, output, tell, words.get("engine"), robust)


def answered(found: Found) -> Answer[Plan]:
    """Write a plan, and return its answer, without the parts that exceed the time limit."""
    if found.out.path is not None and found.analyzed and found.summary:  # says most: first
        tables = partial(outputs.plan_files, found.plan)
        found.tables.update(found.clock.spare("its tables", tables, dict[str, bytes | str]()))
    _ = found.verdicts
    return _answer(found, found.out.write(found.tell, lambda: _files(found)))


def _files(found: Found) -> dict[str, bytes | str]:
    """Return the files of a plan by name, at least table, summary and scene."""
    plan, made, tables = found.plan, dict[str, bytes | str](), found.tables
    if found.analyzed:
        shown = partial(PAGES.plan_page, plan, found.prover)
        content = found.clock.spare(PAGE, shown, None)
        made |= {} if content is None else {PAGE: content}
    if rows := trace_rows(plan.trace):
        made["trace.csv"] = csv_text(pd.DataFrame(rows))
    table = plan.responses() if found.analyzed else outputs.steps_table(plan)
    return {**outputs.bare_files(plan, table, found.report), **made, **tables}


def _answer(found: Found, written: tuple[Any, ...]) -> Answer[Plan]:
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
    answer: Answer[Plan] = Answer(
        scene=scene,
        facts={**facts, "plan": plan.responses if found.analyzed else outputs.steps_table(plan)},
        text="\n".join(_lines(found, over)),
        written=written,
        notes=tuple(_notes(found)),
        value=plan,
    )
    answer = remarks.in_time(answer, found.clock, ended)
    unreached = () if plan.arms is None else plan.arms.faults
    left = plan.departures if found.analyzed else ()
    answer = remarks.held_to(answer, over, left, found.verdicts, unreached)
    far = plan.is_far and not _problem(plan).lifts_range
    return remarks.kept_range(answer, plan.beyond if far else None)


def _lines(found: Found, over: Sequence[str]) -> Iterator[str]:
    """Yield lines on grips, objective, search and stability of a plan."""
    plan, scene = found.plan, found.plan.engine.network.scene
    held = ""
    if found.analyzed:
        held = f"{OUTSIDE}: " * bool(plan.outside) + f"{TEXT._headline(scene, plan._columns)}; "
    scenarios = len(_problem(plan).scenarios)
    value = plan._value
    if plan.order:
        value = f"{values_text(plan.objective)}, {plan.status}, {plan.order_bound_said}"
    elif scenarios and plan.graph.candidates:
        value += f" over {scenarios} scenarios ({plan.title})"
    yield held + value
    counts = [f"{len(plan.steps)} steps"]
    if not plan.graph.candidates:
        counts.append(f"{plan.regrips} regrip{'s' * (plan.regrips != 1)}")
    counts.append(f"{plan.models:,} models")
    search = f"{plan.formulation.name} ({plan.formulation.kind.value}): {', '.join(counts)}"
    page = found.analyzed and PAGE not in found.clock.left_out
    yield f"{search}; {outputs.written_to(found.out.path, page=page)}"
    yield from map(wrapped, remarks.waits_said(plan) if plan.certificate is not None else ())
    yield from (f"stability, {each}" for each in found.verdicts.get(plan.title, ()))
    if plan.order:
        yield wrapped(", ".join(map(str, plan.order)), first="order: ")
    yield from (f"payload exceeded: {excess}" for excess in over)
    if over and (loads := overloads(scene, plan._columns)):
        yield ADVICE.payload_advice(plan.engine.network, loads)


def _notes(found: Found) -> Iterator[str]:
    """Yield notes on levels, rules, scales, proof, idle robots and time."""
    plan, problem = found.plan, _problem(found.plan)
    scene, criterion = plan.engine.network.scene, problem.criterion.name
    yield from remarks.level_notes(found.engine, plan.engine)
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


def _problem(plan: Plan) -> Problem:
    assert isinstance(plan.problem, Problem)  # as the command poses it
    return plan.problem


def _proof(plan: Plan) -> str:
    """Describe the proof of optimality, and its limits."""
    proof = plan.certificate
    if proof is None and plan.ended is End.STOPPED:
        return "left out, time is over; values and bounds are claimed"
    if proof is None or plan.gap is None:
        return "none; how much better another plan may be is not known"
    models, states = proof.models or plan.models, proof.states
    looked = f"{models:,} model{'s' * (models != 1)}"
    looked += f" and {states:,} state{'s' * (states != 1)}" if states else ""
    looked += " prove it" + f", {plan.models:,} models were searched" * bool(proof.models)
    other = "no other plan among these" if plan.graph.among else "no other plan"
    other = f"{OUTSIDE}, where {other}" if plan.is_far else other
    better = (
        "is better" if plan.gap <= TOLERANCE else f"is better by more than {100 * plan.gap:.3g} %"
    )
    return f"{looked}; {other} {better if isfinite(plan.gap) else 'is looked at'}"
