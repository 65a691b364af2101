"""The command ``replan``: the rest of a build, after something has changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

from seqopt._cli.answer import Answer
from seqopt._cli.commands.optimize import answered
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Folder
from seqopt.engines.registry import engine_mortar
from seqopt.exchange._files import ALWAYS, Output
from seqopt.exchange.imports import measured_said
from seqopt.plan.plan import Plan
from seqopt.questions import replan
from seqopt.responses._tolerance import values_text
from seqopt.responses.quantities import length_text
from seqopt.scene.scene_file import plan_folder
from seqopt.sequence.rules import FREE
from seqopt.work import Tell
from seqopt.workflow import optimize


def run(
    build: Annotated[str, ("value", "PLAN_DIR|SCENE")] = "arch25",
    *,
    asked: Annotated[Call, ("call", replan)],
    stability: bool = True,
    out: Folder = None,
    details: bool = False,
    progress: Tell,
) -> Answer:
    """Plan the rest of a build from one of its steps, after something has changed.

    A robot is lost, carries less or is new, a brick is missing. Any robot may release, hold or
    place next; aims, criterion, limits and rules are by default those of the plan.

    Parameters
    ----------
    build : str, optional
        Folder that optimize wrote: its plan, scene and summary; in place of it a scene, for which
        the best free schedule is planned first.
    stability : bool, optional
        As of `optimize`.
    out : pathlib.Path, optional
        Folder to write the new plan to.
    details : bool, optional
        As of `optimize`.

    Examples
    --------
    $ seqopt replan free --at 12 --lost rob3 --rule least_grips=1
    $ seqopt replan free --at 12 --payload rob1=250 --out weaker
    $ seqopt replan free --at 12 --robots 4 --missing 9
    """
    output, words, notes = Output(out), asked.words, tuple[str, ...]()
    output.require(*ALWAYS)
    given: Plan | str = build
    if plan_folder(build) is None:
        first = {"scene": build, "schedule": FREE, "cache": words.get("cache")}
        given = plan = Call(optimize, first)(progress=progress)
        notes = (f"steps: of the best free schedule, {plan.result}",)
    mortar = engine_mortar(words.get("engine"), words.get("mortar"), verdicts=stability)
    new: Plan = asked(build=given, mortar=mortar, progress=progress)
    more = {"stability": stability, "details": details}
    answer = answered(new, output, {**words, **more}, progress)
    return replace(
        answer,
        facts={**answer.facts, "replanned": new.changes},
        text="\n".join([*map(wrapped, _in_words(new.changes)), answer.text]),
        notes=(*notes, *answer.notes),
    )


def _in_words(facts: Mapping[str, Any]) -> Sequence[str]:
    """Describe the changes of a new plan, in lines."""
    was = facts["as_planned"]
    if was is None:
        line = f"as planned the build cannot go on: {facts['broken']}"
    else:
        line = f"as planned the rest takes: {values_text(was)}"
    if "off_m" in facts:
        left = length_text(facts["tolerance_left_m"])
        as_built = measured_said(facts["off_m"], facts["off_brick"])
        line = f"{as_built}; grips of the rest may be {left} off; {line}"
    if facts["differs"] is None:
        return (line, "the new plan is the old one")
    counts = f"{facts['steps']} steps instead of {facts['steps_before']}"
    return (line, f"the new plan: {counts}, the same up to step {facts['differs'] - 1}")
