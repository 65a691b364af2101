"""Notes shared by commands: levels, payloads, waits, what departs from the linear range."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from seqopt._cli.answer import Answer, Status
from seqopt._cli.terminal import wrapped
from seqopt.contact.mortar import EPOXY, _mortar_name, _with_mortar, find_mortar
from seqopt.engines.interface import Engine, OpeningEngine
from seqopt.engines.registry import AutoEngine, _chooser_of
from seqopt.problem.requirements import LIFTED, LINEAR_RANGE, _prop_faults, overloads
from seqopt.responses.table import OUTSIDE, REMEDY, _Columns
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step
from seqopt.stability.failure_map import BuildProver, BuildVerdicts

CUT = "interrupted"  # why no verdict is known


def exceeded(scene: Scene, *tables: _Columns) -> tuple[str, ...]:
    """Describe the payloads, and capacities of props, that steps exceed."""
    found = ((*overloads(scene, table), *_prop_faults(scene, table)) for table in tables)
    return tuple(str(excess) for each in found for excess in each)


def spent_said(
    spent: Mapping[str, Mapping[str, Any]], showing: Mapping[str, int] | None = None
) -> str:
    """Say in a line what a run computed beside what had to be, as of `seqopt.plan._spent`."""
    models, parts = spent["models"], list[str]()
    if "searched" in models:
        digits = f"{models['six_digits']:,} in six digits, {models['again']:,} again in full"
        parts.append(f"{models['searched']:,} models searched ({digits})")
        parts.append("no proof" if models["proof"] is None else f"{models['proof']:,} prove it")
    parts.append(f"at least {models['needed']:,} had to be")
    if models["answered"] >= models.get("searched", 0):  # engines of other orders are not counted
        parts.append(f"{models['answered']:,} solved in all, {models['corrected']:,} corrected")
    if "responses" in spent:
        names, asked = (spent["responses"][name] for name in ("computed", "asked"))
        more = ", ".join(sorted({*names} - {*asked}))
        parts.append(f"{spent['responses']['values']:,} responses ({', '.join(names) or 'forces'}")
        parts[-1] += f"; nobody asked for {more})" if more else ", all asked for)"
    if asked := spent.get("verdicts", {}).get("asked"):
        parts.append(f"{asked:,} verdicts by {spent['verdicts']['programs']:,} programs")
    if showing is not None:
        shown = f"{showing['verdicts']:,} verdicts shown, {showing['proven']:,} proven for them"
        parts += [shown, f"{showing['pictures']} picture{'s' * (showing['pictures'] != 1)}"]
    return f"spent: {'; '.join(parts)}"


def verdicts_of(
    prover: BuildProver, builds: Mapping[str, Sequence[Step]], words: Mapping[str, Any]
) -> dict[str, tuple[BuildVerdicts, ...]]:
    """Return the verdicts of builds, none after an interrupt: it ends no more than their proofs."""
    try:
        return prover.of_builds(builds, words.get("workers", 1))
    except KeyboardInterrupt:
        prover.refusal = CUT
        return {}


def bonded(engine: Engine, mortar: str | None) -> Iterator[str]:
    """Yield that joints hold another mortar in an engine than the one that verdicts are of."""
    chooser = engine if isinstance(engine, AutoEngine) else _chooser_of(engine)
    held = EPOXY if chooser is None else chooser.mortar
    asked = held if mortar is None else find_mortar(mortar)
    if asked != held and not isinstance(engine, OpeningEngine):
        text = f"bonded {_with_mortar(_mortar_name(held))} in this engine"
        yield f"joints: {text}; of steps {_with_mortar(_mortar_name(asked))} verdicts alone speak"


def marked(
    answer: Answer,
    outside: Sequence[object],
    over: Sequence[str] | None = None,
    verdicts: Mapping[str, Sequence[BuildVerdicts]] | None = None,
    unreached: Sequence[str] = (),
    beyond: str | None = None,
) -> Answer:
    """Return an answer that says, and begins with it, how plans leave the linear range.

    Its facts have that, `exceeded` payloads, verdicts by build, and steps that arms cannot do; its
    status reports a plan that is ``beyond`` the limit on the range.
    """
    lines = [*(f"{OUTSIDE}: {each}" for each in outside), *[REMEDY] * bool(outside)]
    facts = {**answer.facts, "outside_linear_range": [*map(str, outside)]}
    facts |= {} if over is None else {"payloads_exceeded": [*over]}
    if verdicts is not None:
        facts["stability"] = {n: {v.mortar: v.facts() for v in own} for n, own in verdicts.items()}
    facts |= {"arms_cannot": [*unreached]} if unreached else {}
    notes = (*answer.notes, *(f"arms: {each}" for each in unreached))
    text = "\n".join([*map(wrapped, lines), answer.text]) if answer.text else ""
    answer = replace(answer, facts=facts, text=text, notes=notes if text else (*lines, *notes))
    if not beyond or answer.status is not Status.DONE:
        return answer
    line = f"seqopt: {OUTSIDE}: {beyond}; --limit {LINEAR_RANGE}={LIFTED} lifts this limit"
    return replace(answer, failures=(*answer.failures, line), status=Status.DOES_NOT_HOLD)
