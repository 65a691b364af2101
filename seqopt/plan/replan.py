"""Changes of a plan after changes of the build or of its data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from seqopt._registry import offered
from seqopt.errors import SeqoptError, StepError
from seqopt.graph.states import States
from seqopt.judge._rule_moves import check_free
from seqopt.judge._schedules import plan_values
from seqopt.plan.plan import Plan
from seqopt.problem.requirements import _carrying_excesses, overloads
from seqopt.responses.quantities import PROP_EXCESS
from seqopt.responses.table import analyze
from seqopt.scene.scene import _check_postures
from seqopt.sequence.rules import FREE, Payload, _usual_grips
from seqopt.sequence.steps import Step, _begin_step


def goes_on(states: States, steps: Sequence[Step]) -> dict[str, float]:
    """Return goals' values of steps that go on from a beginning; an error says what they break."""
    rules = states.free_rules
    scene, kept = states.network.scene, rules.payload is Payload.KEPT
    begun = (_begin_step(scene, rules.begin), *steps)
    if kept and (over := _carrying_excesses(scene, begun)):
        raise StepError(f"payload exceeded: {over[0]}")
    check_free(states.network, rules, steps)
    _check_postures(scene, steps)
    if kept and (excess := overloads(scene, analyze(states.engine, steps))):
        raise StepError(f"payload exceeded: {excess[0]}")
    starts: tuple[float, ...] = ()  # s, at the earliest, where steps wait for mortar
    if (waits := offered("mortar_waits")(states.network, states.standing)) is not None:
        starts = tuple(t.start for t in offered("step_times")(scene, steps, waits, rules.begin))
    values = plan_values(states, steps, starts=starts)
    pairs = zip(states.goals, states.names, values, strict=False)
    return {name: goal.shown(value) for goal, name, value in pairs}


def compared(plan: Plan, old: Sequence[Step], broken: str = "") -> dict[str, object]:
    """Return the changes of a new plan: values of the old rest, and the first step that differs.

    ``old``: the steps that were planned from where the new plan begins; ``broken``: why they cannot
    go on, if that is known. Result: ``as_planned``, what goals take of them now, or ``broken``;
    ``differs``, the number of the first step that is another, None if all are the same; ``steps``,
    how many there are now, and ``steps_before``.
    """
    robots = len(plan.states.network.scene.robots)
    old = [replace(s, grips=(*s.grips, *[None] * (robots - len(s.grips)))) for s in old]
    pairs = zip(plan.steps, old, strict=False)
    first = next((new.number for new, was in pairs if new != was), None)
    if first is None and len(plan.steps) != len(old):
        first = plan.steps[0].number + min(len(plan.steps), len(old))
    out: dict[str, object] = {"as_planned": None, "broken": broken}
    try:
        out["as_planned"] = None if broken else goes_on(plan.states, old)
    except SeqoptError as error:
        out["broken"] = str(error)
    return out | {"differs": first, "steps": len(plan.steps), "steps_before": len(old)}


def asked_before(summary: Any, *, lost: bool = False) -> dict[str, Any]:
    """Return what a plan was asked, in words, from its summary; ``lost``: of fewer robots."""
    if not isinstance(summary, dict) or summary.get("schedule") != FREE:
        summary = {}
    given = [
        each if isinstance(each, dict) else {} for each in map(summary.get, ("rules", "limits"))
    ]
    rules, limits = (
        {name: str(value) for name, value in each.items() if isinstance(value, str | int | float)}
        for each in given
    )
    team = given[0].get("robots")
    if lost and isinstance(team, list) and rules.get("least_grips") == str(_usual_grips(len(team))):
        del rules["least_grips"]
    names = ("least_grips", "newest", "payload", "regrips", "ending", "candidates")
    criterion, aims = summary.get("criterion"), summary.get("aims")
    return {
        "direction": rules.get("direction"),
        "aim": ",".join(map(str, aims if isinstance(aims, list) else ())) or None,
        "criterion": criterion if isinstance(criterion, str) else None,
        "rules": tuple(f"{name}={rules[name]}" for name in names if name in rules),
        "limits": tuple(
            f"{name}={value}"
            for name, value in limits.items()
            if name != PROP_EXCESS  # which the scene says
        ),
    }
