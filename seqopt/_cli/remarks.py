"""Notes shared by commands: levels, payloads, arms, waits, verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from seqopt._cli.answer import Answer, Status
from seqopt._cli.terminal import wrapped
from seqopt.engines.interface import Engine
from seqopt.engines.registry import REASONS, USUAL, AutoEngine, _chooser_of
from seqopt.plan.build import ShownBuild
from seqopt.problem.requirements import (
    LIFTED,
    LINEAR_RANGE,
    _carrying_excesses,
    _prop_faults,
    overloads,
)
from seqopt.responses.table import OUTSIDE, REMEDY, _Columns
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import MOST_ROBOTS, FreeRules, _usual_grips
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step
from seqopt.stability._builds import BuildProver, BuildVerdicts, _settlement_said
from seqopt.stability.assessment import Verdict
from seqopt.work.progress import INTERRUPT, TIME, Clock

_Value = TypeVar("_Value")


def size_line(scene: Scene) -> str:
    """Describe name and size of a scene."""
    size = f"{len(scene.bricks)} bricks, {len(scene.joints)} joints"
    return f"{scene.name}: {size}, {len(scene.grounds)} ground ends"


def level_notes(named: str | None, engine: Engine) -> tuple[str, ...]:
    """Describe the levels an ``auto`` engine took, and why; of one not named only discrete."""
    if _chooser_of(engine) is not None:
        return (f"engine: {USUAL}: {REASONS[USUAL]}",) if named else ()
    if not isinstance(engine, AutoEngine):
        return ()
    said = [
        f"engine: {level} for {sets} grip sets: {REASONS[level]}"
        for level, sets in engine.tally.items()
        if named or level == "discrete"
    ]
    return (*said, *([f"engine: {engine.unchecked}"] if engine.unchecked else []))


def exceeded(scene: Scene, *tables: _Columns) -> tuple[str, ...]:
    """Describe the payloads, and capacities of props, that steps exceed."""
    found = ((*overloads(scene, table), *_prop_faults(scene, table)) for table in tables)
    return tuple(str(excess) for each in found for excess in each)


def carrying_notes(scene: Scene, steps: Sequence[Step]) -> tuple[str, ...]:
    """Describe robots that place or remove bricks heavier than their payload."""
    return tuple(f"payload exceeded: {excess}" for excess in _carrying_excesses(scene, steps))


def rule_notes(rules: FreeRules | Schedule, scene: Scene) -> tuple[str, ...]:
    """Describe the default rule that is relaxed because few robots take part, if it is."""
    if not isinstance(rules, FreeRules) or rules.least_grips is not None:
        return ()
    team, least = len(rules.team(scene)), rules.fewest_grips(scene)
    if least == _usual_grips(MOST_ROBOTS):
        return ()
    robots = "1 robot takes" if team == 1 else f"{team} robots take"
    return (f"rules: least_grips={least}, as {robots} part",)


def waits_said(build: ShownBuild) -> Iterator[str]:
    """Yield the total wait for mortar of a judged build, and the joints with the longest waits."""
    if build.standing is None or build.standing.curing is None:
        return
    table = build.times()
    waits = table[table["cures_s"] > 0]
    if len(waits):
        yield (
            f"{waits['cures_s'].sum():.6g} s are waits for mortar, in {len(waits)} "
            f"step{'s' * (len(waits) > 1)}; the longest:"
        )
    else:
        yield "no step waits for mortar"
    for row in waits.nlargest(3, "cures_s").to_dict("records"):
        yield (
            f"  step {row['step']} ({row['type']}) waits {row['cures_s']:.6g} s for joint "
            f"{row['joint']}"
        )
    yield "every state is proven to stand with the bond that its joints have when it begins"


def refused(prover: BuildProver) -> tuple[str, ...]:
    """Return notes on missing verdicts, and on effects that they neglect."""
    said = (f"stability: not proven; {prover.refusal}",) if prover.refusal else ()
    return (*said, *settlement_notes(prover.network.scene)) if prover.mortars else said


def settlement_notes(scene: Scene) -> tuple[str, ...]:
    """Return a note that verdicts neglect movements of the ground, if there are any."""
    said = _settlement_said(scene)
    return (f"stability: {said}",) if said else ()


WHY = {TIME: "time is over", INTERRUPT: "interrupted"}


def in_time(answer: Answer[_Value], clock: Clock, interrupted: str) -> Answer[_Value]:
    """Return an answer with the parts skipped by the time limit, or its interrupt."""
    left = clock.left_out.values()
    each = {why: [what for what, own in clock.left_out.items() if own == why] for why in left}
    said = (f"not done, {WHY[why]}: {', '.join(names)}" for why, names in each.items())
    answer = replace(answer, notes=(*answer.notes, *said))
    if not clock.interrupted or answer.status is Status.INTERRUPTED:
        return answer
    failures = (*answer.failures, interrupted)
    return replace(answer, failures=failures, status=Status.INTERRUPTED)


def marked(answer: Answer[_Value], outside: Sequence[object]) -> Answer[_Value]:
    """Return an answer preceded by exceeded limits of the linear range, and the remedy."""
    left = [str(departure) for departure in outside]
    answer = replace(answer, facts={**answer.facts, "outside_linear_range": left})
    if not left:
        return answer
    lines = (*(f"{OUTSIDE}: {each}" for each in left), REMEDY)
    if not answer.text:
        return replace(answer, notes=(*lines, *answer.notes))
    return replace(answer, text="\n".join([*map(wrapped, lines), answer.text]))


def kept_range(answer: Answer[_Value], beyond: str | None) -> Answer[_Value]:
    """Return an answer whose status reports a plan beyond the limit on the linear range."""
    if beyond is None or answer.status is not Status.DONE:
        return answer
    said = f"seqopt: {OUTSIDE}: {beyond}; --limit {LINEAR_RANGE}={LIFTED} lifts this limit"
    return replace(answer, failures=(*answer.failures, said), status=Status.DOES_NOT_HOLD)


def held_to(
    answer: Answer[_Value],
    over: Sequence[str],
    outside: Sequence[object] = (),
    verdicts: Mapping[str, Sequence[BuildVerdicts]] | None = None,
    unreached: Sequence[str] = (),
) -> Answer[_Value]:
    """Return a `marked` answer with `exceeded` payloads, which --strict turns into its status.

    ``verdicts``: by build, the decisive mortar last; ``unreached``: steps infeasible for arms.
    """
    answer, falls = marked(answer, outside), list[str]()
    facts = {**answer.facts, "payloads_exceeded": list(over)}
    if verdicts is not None:
        found = {n: {each.mortar: each.facts() for each in own} for n, own in verdicts.items()}
        facts["stability"] = found
        last = {name: own[-1] for name, own in verdicts.items()}
        falls = [f"{name}, {own}" for name, own in last.items() if own.count(Verdict.FALLS)]
    if unreached:
        facts["arms_cannot"] = list(unreached)
    notes = (*answer.notes, *(f"arms: {each}" for each in unreached))
    answer = replace(answer, facts=facts, notes=notes)
    wrong = {
        "payload exceeded": over,
        "arms cannot": unreached,
        OUTSIDE: [*map(str, outside)],
        "does not stand": falls,
    }
    faults = (f"seqopt: {name}: {'; '.join(each)}" for name, each in wrong.items() if each)
    return replace(answer, faults=(*faults,))
