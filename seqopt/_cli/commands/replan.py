"""The command ``replan``: the rest of a build, after something has changed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from seqopt._cli import inputs, options, outputs
from seqopt._cli.answer import Answer, Result
from seqopt._cli.commands import optimize
from seqopt._cli.terminal import wrapped
from seqopt._files import parse_json, read_text
from seqopt.errors import FileError, InfeasibleError, NothingFoundError, StepError
from seqopt.exchange.exports import read_folder
from seqopt.exchange.imports import read_measured
from seqopt.plan.replan import compared, without
from seqopt.responses._tolerance import is_tolerance, values_text
from seqopt.responses.quantities import PROP_EXCESS, TOLERANCE, length_text
from seqopt.scene.scenarios import SAME, as_built
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.rules import FREE, _usual_grips, with_robots
from seqopt.study.published import CRITERIA


class Replan(
    options.Strict,
    options.Written,
    options.Postures,
    options.Judged,
    options.Limited,
    options.Ranks,
    options.Cured,
    options.Timed,
    options.Aimed,
):
    """Which plan, and where does it stand?

    plan : PLAN_DIR|SCENE
        folder that optimize wrote: its plan, scene and summary; in place of it a scene, for which
        the best free schedule is planned first
    at : STEP
        number of the last step that was done (default: {default})

    What has changed?
    lost : ROBOT
        robot that lets go and takes no further part
    payload : NEWTON
        what every robot may carry from now on, or as rob1=250 one
    grips : STIFFNESS
        how stiff grips are, as of optimize
    robots : N
        how many robots there are from now on; new ones reach every node
    missing : BRICK
        brick that is not there: one that stood is placed again next, one that was still to come
        waits until all are placed that do not hang on it
    measured : FILE
        where bricks that stand were measured, m: a CSV file (brick, x, y, z), or an assembly of
        COMPAS
    to : PLAN:STEP|STATE|N
        where the build ends, as of optimize

    What counts as best?
    As before, by default.

    What is written and printed?
    out : DIR
        folder to write the new plan to

    What must hold?
    --friction, --tilt and --curing go with --stands.
    """

    plan: options.BuiltFrom = field(default="arch25", kw_only=False, metadata={"place": True})
    at: int | str = field(default=1, kw_only=False)
    lost: options.Words = ()
    payload: float | options.Numbers = ()
    grips: options.Number | None = None
    robots: int | str | None = None
    missing: options.Bricks = ()
    measured: options.File | None = None
    to: int | str | None = None


def run(asked: Replan) -> Result:
    """Plan the rest of a build from one of its steps, after something has changed.

    A robot is lost, carries less or is new, a brick is missing. Any robot may release, hold or
    place next; aims, criterion and rules are by default those of the plan.

    Usage
    PLAN_DIR [--at STEP] [changes] [--out DIR] [other options]

    Examples
    --------
    seqopt replan free --at 12 --lost rob3 --rule least_grips=1
    seqopt replan free --at 12 --payload rob1=250 --out weaker
    seqopt replan free --at 12 --robots 4 --missing 9
    """
    for name, text in (("at", asked.at), ("robots", asked.robots or "0")):
        if not str(text).isdecimal():
            raise StepError(f"--{name} {text}: give a number")
    outputs.require_out(asked, *outputs.ALWAYS)
    folder, notes = inputs.plan_folder(asked, asked.plan, free=True)
    base, change = _as_optimize(asked, folder), partial(_changed, asked)
    try:
        new = optimize.find(base, change)
    except InfeasibleError as error:
        more, scene = "", load_scene(folder / "scene.json")
        count = max(len(scene.robots), int(asked.robots or 0)) + 1
        with suppress(InfeasibleError, NothingFoundError, StepError):
            with_robots(scene, count)
            another = optimize.find(replace(base, robots=str(count)), change).plan
            more = f"; or with one more robot that reaches every node: {another.result}"
        raise InfeasibleError(f"{error}{more}") from None

    def answer() -> Answer:
        found = _answer(asked, folder, base, new)
        return replace(found, notes=(*notes, *found.notes))

    return Result(new.plan, answer)


def _answer(asked: Replan, folder: Path, base: optimize.Optimize, new: optimize.Found) -> Answer:
    """Write the new plan, and return its changes."""
    scene, steps = read_folder(folder)
    old = [step for step in steps if step.number > int(asked.at)]

    def differs() -> dict[str, object]:
        changes = compared(new.plan, old)
        if asked.measured is None:
            return changes
        planned = {brick.name: brick.position for brick in scene.bricks}
        built = new.plan.engine.network.scene.bricks
        off, brick = max((math.dist(b.position, planned[b.name]), b.name) for b in built)
        left = float(new.plan.tolerances()["tolerance_mm"].min() / 1000)
        return changes | {"off_m": off, "off_brick": brick, "tolerance_left_m": left}

    facts = new.clock.spare("what the new plan changes", differs, None)
    answer = optimize.answered(base, new)
    if facts is None:
        return answer
    return replace(
        answer,
        facts={**answer.facts, "replanned": facts},
        text="\n".join([*map(wrapped, _in_words(facts)), answer.text]),
    )


def _as_optimize(asked: Replan, folder: Path) -> optimize.Optimize:
    """Return the request to ``optimize`` that continues from the step."""
    shared = {each.name for each in fields(asked)} & {e.name for e in fields(optimize.Optimize)}
    given = {name: getattr(asked, name) for name in shared}
    told = _told(folder, lost=bool(asked.lost))
    kept = ("aim", "criterion", "limits")
    given |= {name: told[name] for name in kept if told and not given[name]}
    given |= {"scene": str(folder / "scene.json"), "schedule": FREE}
    given |= {"begin": f"{folder}:{asked.at}", "direction": told.get("direction")}
    given["rules"] = (*told.get("rules", ()), *options.listed(asked.rules))
    if given["direction"] and asked.missing:
        raise StepError("--missing: bricks are missing in a build; a take-down removes them anyway")
    return optimize.Optimize(**given)


def _told(folder: Path, *, lost: bool = False) -> dict[str, Any]:
    """Return options of a plan from its summary; ``lost``: with the defaults of fewer robots."""
    try:
        told = parse_json(read_text(folder / "summary.json"), "summary")
    except FileError:
        return {}
    if not isinstance(told, dict) or told.get("schedule") != FREE:
        return {}
    given = [each if isinstance(each, dict) else {} for each in map(told.get, ("rules", "limits"))]
    rules, limits = (
        {name: str(value) for name, value in each.items() if isinstance(value, str | int | float)}
        for each in given
    )
    team = given[0].get("robots")
    if lost and isinstance(team, list) and rules.get("least_grips") == str(_usual_grips(len(team))):
        del rules["least_grips"]
    names = ("least_grips", "newest", "payload", "regrips", "ending", "candidates")
    criterion, aims = told.get("criterion"), told.get("aims")
    return {
        "direction": rules.get("direction"),
        "aim": ",".join(map(str, aims if isinstance(aims, list) else ())),
        "criterion": criterion if isinstance(criterion, str) and criterion in CRITERIA else None,
        "rules": tuple(f"{name}={rules[name]}" for name in names if name in rules),
        "limits": tuple(
            f"{TOLERANCE if is_tolerance(name) else name}={value}"  # beside which limits follows
            for name, value in limits.items()
            if name != PROP_EXCESS  # which the scene says
        ),
    }


def _changed(asked: Replan, scene: Scene, begin: inputs.Place) -> tuple[Scene, inputs.Place, str]:
    """Return scene and place after the changes, and the names of participating robots."""
    assert begin.site is not None
    missing = options.listed(asked.missing)
    if wrong := [text for text in missing if not text.isdecimal()]:
        raise StepError(f"--missing {wrong[0]}: give the number of a brick")
    if asked.measured is not None:
        found = read_measured(scene, Path(asked.measured))
        stand = scene.build_order[: begin.site.bricks]
        if early := [name for name in found if name in scene.build_order and name not in stand]:
            why = f"brick {early[0]} does not stand yet; leave it out"
            raise StepError(f"--measured {asked.measured}: {why}")
        scene = as_built(scene, found)
    scene, site = without(scene, begin.site, asked.lost, [*map(int, missing)])
    left = [robot.name for robot in scene.robots if robot.name not in asked.lost]
    return scene, inputs.Place(site, None), ",".join(left) if asked.lost else ""


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
