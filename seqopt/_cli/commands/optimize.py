"""The command ``optimize``: choose every open grip of a build, or every step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

from seqopt._cli import remarks
from seqopt._cli.answer import Answer, Status
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Folder
from seqopt._registry import Later
from seqopt.engines.registry import engine_mortar, level_notes
from seqopt.exchange._files import ALWAYS, Output
from seqopt.graph.formulation import End
from seqopt.judge.certificate import TOLERANCE
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import overloads
from seqopt.responses._tolerance import values_text
from seqopt.responses.scales import OWN
from seqopt.responses.table import OUTSIDE
from seqopt.sequence.steps import _idle_note
from seqopt.stability.failure_map import BuildProver, BuildVerdicts, find_prover
from seqopt.study import paper_models
from seqopt.work import Tell
from seqopt.workflow import Robust, optimize

FOLDERS = Later("seqopt.report._folders")  # 200 ms, where files are written
TIMES = Later("seqopt.times._tables")  # where mortar cures
TEXT = Later("seqopt.report.text")  # 40 ms, where there is a plan
ADVICE = Later("seqopt.plan._infeasible")  # 20 ms: it needs all proofs
SAMPLED = ("measure", "count", "seed", "vary")
INTERRUPTED = "seqopt: interrupted; the plan is the best that was met"


def run(
    asked: Annotated[Call, ("call", optimize)],
    *,
    stability: bool = True,
    out: Folder = None,
    details: bool = False,
    progress: Tell,
) -> Answer:
    """Choose where robots hold, over all steps of a sequence, by one formulation.

    With --schedule free, choose every step. The answer is checked from the problem's own data, and
    plan, selection, responses, summary and a page for the browser are written.

    Criteria of ranks do not go with --schedule free, whose moves have no candidates to rank. With
    --no-proof, cascade and rank_search solve only the models that they look at.

    Parameters
    ----------
    stability : bool
        If not, it is not proven which steps stand, dry and with epoxy (or the mortar of ``stands``
        or ``mortar``): quicker.
    out : pathlib.Path
        Folder to write plan, tables, summary and page to.
    details : bool
        Say in one line what was computed, beside what had to be.

    Examples
    --------
    $ seqopt optimize arch25 --out best
    $ seqopt optimize arch25 --schedule free --aim minmax,steps --out free
    $ seqopt optimize wall:columns=4,courses=3 --schedule free --stands dry
    $ seqopt optimize my.json --criterion worst-ratio --limit payload --out mine
    """
    output = Output(out, asked.words.get("scene"), asked.words.get("schedule"))
    output.require(*ALWAYS)
    words = {**asked.words, "stability": stability, "details": details}
    mortar = engine_mortar(words.get("engine"), words.get("mortar"), verdicts=stability)
    plan: Plan = asked(mortar=mortar, progress=progress)
    return answered(plan, output, words, progress)


def answered(plan: Plan, output: Output, words: Mapping[str, Any], tell: Tell) -> Answer:
    """Write a plan, and return its answer; ``words``: that asked for it."""
    shown, standing = words.get("stands", words.get("mortar")), plan.standing
    held = None if standing is None else standing.mortar
    network, scene = plan.engine.network, plan.engine.network.scene
    prover = find_prover(network, shown, tell, asks=words["stability"], own=held)
    tables = FOLDERS.plan_files(plan) if output.path is not None else {}
    verdicts = remarks.verdicts_of(prover, {plan.title: plan.steps}, words)
    report = partial(_report, plan, prover, tables, words)
    written = output.write(tell, lambda: FOLDERS.plan_pages(plan, prover, report) | tables)
    showing = {**prover.spent, "pictures": _pictures(tables)}
    early, over = plan.ended is End.INTERRUPTED, remarks.exceeded(scene, plan._columns)
    order = {"order": plan.order} if plan.order else {}
    answer = Answer(
        {"summary": report, "proof": _proof(plan), **order, "plan": plan.responses},
        "\n".join(_lines(plan, verdicts, over, output)),
        written=written,
        notes=(
            *(*_notes(plan, words.get("engine"), words.get("mortar")), *prover.notes),
            *([remarks.spent_said(plan.spent, showing)] if words["details"] else []),
        ),
        failures=(INTERRUPTED,) if early else (),
        status=Status.INTERRUPTED if early or prover.refusal == remarks.CUT else Status.DONE,
        scene=scene,
    )
    unreached = () if plan.arms is None else plan.arms.faults
    beyond = plan.beyond if plan.is_far and not _problem(plan).lifts_range else None
    return remarks.marked(answer, plan.departures, over, verdicts, unreached, beyond)


def _report(
    plan: Plan, prover: BuildProver, tables: Mapping[str, object], words: Mapping[str, Any]
) -> dict[str, object]:
    """Return the summary with the entries that the command adds."""
    drawn = dict[str, object]()
    if sampled := {name: words[name] for name in SAMPLED if name in words}:
        robust = Robust(**sampled)
        settings = robust.draw(plan.engine.network.scene).settings
        drawn = {"robust": str(robust.measure), "scenarios": settings}
    verdicts = prover.of_builds({plan.title: plan.steps}).get(plan.title, ())
    counts = paper_models(_problem(plan).schedule) if plan.method == "three-robot" else ()
    return plan.summary() | {
        "models_paper_count": dict(zip(("cascading", "overlap"), counts, strict=False)) or None,
        "stability": {v.mortar: v.facts() for v in verdicts},
        "spent_on_showing": {**prover.spent, "pictures": _pictures(tables)},
        **drawn,
    }


def _pictures(tables: Mapping[str, object]) -> int:
    """Return how many pictures there are among files, in all formats."""
    return len({Path(name).stem for name in tables if name.endswith((".png", ".svg"))})


def _lines(
    plan: Plan, verdicts: Mapping[str, Sequence[BuildVerdicts]], over: Sequence[str], output: Output
) -> Iterator[str]:
    """Yield lines on grips, objective, search and stability of a plan."""
    scene, value = plan.engine.network.scene, plan._value
    scenarios = len(_problem(plan).scenarios)
    if plan.order:
        value = f"{values_text(plan.objective)}, {plan.status}, {plan.order_bound_said}"
    elif scenarios:
        value += f" over {scenarios} scenarios ({_problem(plan).over})"
    outside = f"{OUTSIDE}: " * bool(plan.outside)
    yield f"{outside}{TEXT._headline(scene, plan._columns)}; {value}"
    counts = [f"{len(plan.steps)} steps"]
    if not plan.states.rules.moves:
        counts.append(f"{plan.regrips} regrip{'s' * (plan.regrips != 1)}")
    counts.append(f"{plan.models:,} models")
    search = f"{plan.formulation.name} ({plan.formulation.kind.value}): {', '.join(counts)}"
    yield f"{search}; {output.said()}"
    if plan.certificate is not None and plan.standing is not None:
        yield from map(wrapped, TIMES.waits_said(plan))
    yield from (f"stability, {each}" for each in verdicts.get(plan.title, ()))
    if plan.order:
        yield wrapped(", ".join(map(str, plan.order)), first="order: ")
    yield from (f"payload exceeded: {excess}" for excess in over)
    if over and (loads := overloads(scene, plan._columns)):
        yield ADVICE.payload_advice(plan.engine.network, loads)


def _notes(plan: Plan, engine: str | None, mortar: str | None) -> Iterator[str]:
    """Yield notes on levels, rules, scales, proof, idle robots and time."""
    problem = _problem(plan)
    scene, criterion = plan.engine.network.scene, problem.criterion.name
    yield from level_notes(engine, plan.engine)
    if criterion.endswith(OWN):
        yield f"criterion: {criterion}: no fixed method builds this scene to take scales from"
    yield from (f"rules: {each}" for each in problem.moves.relaxed(scene))
    if plan.arms is not None:
        yield f"arms: {plan.arms}"
    if plan.ended is not End.INTERRUPTED:
        yield from plan.enough.lines
        yield from remarks.bonded(plan.engine, mortar)
        yield f"proof: {_proof(plan)}"
    yield from _idle_note(scene, "robots", plan.steps)
    if plan.makespan is not None and "makespan" not in plan.goals:
        what = "the build" if plan.steps[0].number == 1 else "what is left"
        yield f"time: {what} takes {plan.makespan:.6g} s; --aim makespan makes it short"


def _problem(plan: Plan) -> Problem:
    assert isinstance(plan.problem, Problem)  # as the command poses it
    return plan.problem


def _proof(plan: Plan) -> str:
    """Describe the proof of optimality, and its limits."""
    proof = plan.certificate
    if proof is None and plan.ended is End.STOPPED:
        return "left out, time is over; values and bounds are claimed"
    if proof is None or plan.gap is None:
        goal, bound = next(iter(plan.bound.items()), ("", None))
        if bound is None:
            return "none; how much better another plan may be is not known"
        return f"none; the search claims that {goal} is {bound:.6g} at least"
    models, states = proof.models or plan.models, proof.states
    looked = f"{models:,} model{'s' * (models != 1)}"
    looked += f" and {states:,} state{'s' * (states != 1)}" if states else ""
    looked += " prove it" + f", {plan.models:,} models were searched" * bool(proof.models)
    other = "no other plan among these" if plan.graph.among else "no other plan"
    other = f"{OUTSIDE}, where {other}" if plan.is_far else other
    better = "is better" + f" by more than {100 * plan.gap:.3g} %" * (plan.gap > TOLERANCE)
    return f"{looked}; {other} {better if isfinite(plan.gap) else 'is looked at'}"
