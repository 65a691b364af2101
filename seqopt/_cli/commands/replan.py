"""The command ``replan``: the rest of a build, after something has changed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from seqopt._cli.answer import Answer
from seqopt._cli.commands.optimize import answered, find
from seqopt._cli.outputs import ALWAYS, Output
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Built, File, Folder
from seqopt._files import parse_json, read_text
from seqopt.errors import FileError, InfeasibleError, NothingFoundError, StepError
from seqopt.exchange.imports import read_measured
from seqopt.plan.replan import compared
from seqopt.responses._tolerance import values_text
from seqopt.responses.quantities import PROP_EXCESS, length_text
from seqopt.scene.scenarios import SAME, as_built
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE, _usual_grips, with_robots
from seqopt.sequence.schedule_file import read_plan
from seqopt.sequence.steps import Site, Step
from seqopt.study.published import CRITERIA
from seqopt.work.progress import Tell
from seqopt.workflow import _Place, optimize

ASKED = (
    *("criterion", "aim", "limits", "rules", "stands", "friction", "tilt", "curing", "to"),
    *("payload", "grips", "durations", "robots", "lost", "missing", "engine", "mortar"),
    *("formulation", "options", "proof", "time_limit", "workers", "cache", "max_memory"),
)


def replan(
    plan: Annotated[str, ("value", "PLAN_DIR|SCENE")] = "arch25",
    *,
    asked: Annotated[Call, ("call", optimize), ("of", ASKED)],
    stability: bool = True,
    at: Annotated[int, ("least", 0), ("most", 1_000_000)] = 1,
    measured: File = None,
    out: Folder = None,
    progress: Tell,
) -> Answer:
    """Plan the rest of a build from one of its steps, after something has changed.

    A robot is lost, carries less or is new, a brick is missing. Any robot may release, hold or
    place next; aims, criterion, limits and rules are by default those of the plan.

    Parameters
    ----------
    plan : str, optional
        Folder that optimize wrote: its plan, scene and summary; in place of it a scene, for which
        the best free schedule is planned first.
    stability : bool, optional
        As of `optimize`.
    at : int, optional
        Number of the last step that was done (default: {default}).
    measured : pathlib.Path, optional
        Where bricks that stand were measured, m: a CSV file (brick, x, y, z), or an assembly of
        COMPAS.
    out : pathlib.Path, optional
        Folder to write the new plan to.

    Examples
    --------
    $ seqopt replan free --at 12 --lost rob3 --rule least_grips=1
    $ seqopt replan free --at 12 --payload rob1=250 --out weaker
    $ seqopt replan free --at 12 --robots 4 --missing 9
    """
    output, given, words = Output(out), Built(scene=plan), asked.words
    output.require(*ALWAYS)
    scene, steps, summary, notes = _planned(given, words.get("cache"), progress)
    told = _told(summary, lost=bool(words.get("lost")))
    if told.get("direction") and words.get("missing"):
        raise StepError("--missing: bricks are missing in a build; a take-down removes them anyway")
    site, done = Site.after(steps, at), tuple(step for step in steps if step.number <= at)
    built, stand = scene, scene.build_order[: site.bricks]
    if measured is not None:
        found = read_measured(scene, measured)
        if early := [name for name in found if name in scene.build_order and name not in stand]:
            why = f"brick {early[0]} does not stand yet; leave it out"
            raise StepError(f"--measured {measured}: {why}")
        built = as_built(scene, found)
    begin = _Place(site, done) if given.folder is None else f"{plan}:{at}"
    rules = (*told.get("rules", ()), *words.get("rules", ()))
    words = {**told, **words, "scene": built, "schedule": FREE, "begin": begin, "rules": rules}
    again = Call(optimize, words)
    try:
        new, prover = find(again, progress, stability=stability)
    except InfeasibleError as error:
        raise InfeasibleError(f"{error}{_with_one_more(again, scene, progress)}") from None
    changes = compared(new, [step for step in steps if step.number > at])
    if measured is not None:
        planned = {brick.name: brick.position for brick in scene.bricks}
        bricks = new.engine.network.scene.bricks
        off, brick = max((math.dist(b.position, planned[b.name]), b.name) for b in bricks)
        left = float(new.tolerances()["tolerance_mm"].min() / 1000)
        changes |= {"off_m": off, "off_brick": brick, "tolerance_left_m": left}
    answer = answered(new, prover, output, words, progress)
    return replace(
        answer,
        facts={**answer.facts, "replanned": changes},
        text="\n".join([*map(wrapped, _in_words(changes)), answer.text]),
        notes=(*notes, *answer.notes),
    )


def _planned(
    given: Built, cache: Path | None, tell: Tell
) -> tuple[Scene, tuple[Step, ...], object, tuple[str, ...]]:
    """Return scene, steps and summary of a plan's folder, or of the best free schedule."""
    scene, summary = given.parse(), dict[str, object]()
    if given.folder is None:
        plan = Call(optimize, {"scene": scene, "schedule": FREE, "cache": cache})(progress=tell)
        note = f"steps: of the best free schedule, {plan.result}"
        return plan.engine.network.scene, plan.steps, plan.summary(), (note,)
    with suppress(FileError):
        summary = parse_json(read_text(given.folder / "summary.json"), "summary")
    return scene, read_plan(scene, given.folder / "plan.csv"), summary, ()


def _with_one_more(asked: Call, scene: Scene, tell: Tell) -> str:
    """Return whether one more robot makes the rest feasible, in words; empty if not."""
    robots = asked.words.get("robots")
    count = max(len(scene.robots), robots if isinstance(robots, int) else 0) + 1
    with suppress(InfeasibleError, NothingFoundError, StepError):
        with_robots(scene, count)
        found = asked(robots=count, progress=tell)
        return f"; or with one more robot that reaches every node: {found.result}"
    return ""


def _told(summary: Any, *, lost: bool = False) -> dict[str, Any]:
    """Return options of a plan from its summary; ``lost``: with the defaults of fewer robots."""
    if not isinstance(summary, dict) or summary.get("schedule") != FREE:
        return {}
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
        "criterion": criterion if isinstance(criterion, str) and criterion in CRITERIA else None,
        "rules": tuple(f"{name}={rules[name]}" for name in names if name in rules),
        "limits": tuple(
            f"{name}={value}"
            for name, value in limits.items()
            if name != PROP_EXCESS  # which the scene says
        ),
    }


def _in_words(facts: Mapping[str, Any]) -> Sequence[str]:
    """Describe the changes of a new plan, in lines."""
    was = facts["as_planned"]
    if was is None:
        line = f"as planned the build cannot go on: {facts['broken']}"
    else:
        line = f"as planned the rest takes: {values_text(was)}"
    if "off_m" in facts:
        off, left = length_text(facts["off_m"]), length_text(facts["tolerance_left_m"])
        which = "every brick is"
        if facts["off_m"] > SAME:
            which = f"brick {facts['off_brick']} is {off} from"
        line = (
            f"as built, {which} where it was planned; grips of the rest may be {left} off; {line}"
        )
    if facts["differs"] is None:
        return (line, "the new plan is the old one")
    counts = f"{facts['steps']} steps instead of {facts['steps_before']}"
    return (line, f"the new plan: {counts}, the same up to step {facts['differs'] - 1}")
