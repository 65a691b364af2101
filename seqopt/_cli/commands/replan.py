"""The command ``replan``: the rest of a build, after something has changed."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from seqopt._cli.answer import Answer
from seqopt._cli.arguments import parser
from seqopt._cli.commands import optimize
from seqopt._cli.options import (
    BEST,
    CURING,
    DURATIONS,
    HOLDS,
    LIMIT,
    MOVES,
    POSTURES,
    PROVES,
    RULE,
    STANDING,
    WRITTEN,
    criterion_options,
    declare,
    engine_options,
    form_options,
)
from seqopt._cli.screens import question
from seqopt._cli.terminal import wrapped
from seqopt._cli.words.given import plan_folder
from seqopt._cli.words.optimizing import AIM, TIME
from seqopt._cli.words.where import Place
from seqopt._files import parse_json, read_text
from seqopt.errors import FileError, InfeasibleError, NothingFoundError, StepError
from seqopt.exchange._measured import read_measured
from seqopt.plan._studies.replan import compared, without
from seqopt.plan.plan import Plan
from seqopt.responses._tolerance import is_tolerance, value_text
from seqopt.responses.quantities import PROP_EXCESS, TOLERANCE, length_text
from seqopt.scene.scenarios import as_built
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence._parts import SAME
from seqopt.sequence.rules import FREE, _usual_grips, with_robots
from seqopt.sequence.schedule_file import read_plan
from seqopt.study.published import CRITERIA

DESCRIPTION = (
    "Plan the rest of a build from one of its steps, after something has changed: a robot is lost, "
    "carries less or is new, a brick is missing. Any robot may release, hold or place next; aims, "
    "criterion and rules are those of the plan, if nothing else is said."
)
USAGE = ("PLAN_DIR [--at STEP] [changes] [--out DIR] [other options]",)
EXAMPLES = (
    "seqopt replan free --at 12 --lost rob3 --rule least_grips=1",
    "seqopt replan free --at 12 --payload rob1=250 --out weaker",
    "seqopt replan free --at 12 --robots 4 --missing 9",
)
PLACE = {
    "plan PLAN_DIR|SCENE": "folder that optimize wrote: its plan, scene and summary; in "
    "place of it a scene, for which the best free schedule is planned first"
}
CHANGES = {
    "--lost ROBOT ...": "robot that lets go and takes no further part",
    "--payload NEWTON ...": "what every robot may carry from now on, or as rob1=250 one",
    "--grips STIFFNESS": "how stiff grips are, as of optimize",
    "--robots N": "how many robots there are from now on; new ones reach every node",
    "--missing BRICK ...": "brick that is not there: one that stood is placed again next, one that "
    "was still to come waits until all are placed that do not hang on it",
    "--measured FILE": "where bricks that stand were measured, m: a CSV file (brick, x, y, z), or "
    "an assembly of COMPAS",
    "--to PLAN:STEP|STATE|N": "where the build ends, as of optimize",
}
OF_HOLDS = "--friction, --tilt and --curing go with --stands."
ASKED = ("aim", "criteria", "limit", "rule", "stands", "friction", "tilt")


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``replan``."""
    basic = question(command, "Which plan, and where does it stand?")
    declare(basic, PLACE)
    about = "number of the last step that was done (default: %(default)s)"
    declare(basic, {"--at STEP": about}, default="1")
    declare(question(command, "What has changed?"), CHANGES)
    declare(question(command, MOVES), RULE | DURATIONS)
    declare(question(command, BEST, "As before, where nothing is said."), AIM)
    criterion_options(command)
    declare(question(command, HOLDS, OF_HOLDS), LIMIT | STANDING | CURING)
    declare(question(command, PROVES), TIME | POSTURES)
    engine_options(command)
    declare(question(command, WRITTEN), {"--out DIR": "folder to write the new plan to"})
    form_options(command, strict=True, builds=True)


def run(options: argparse.Namespace) -> Answer:
    """Plan the rest of a build, and say what changes."""
    base, found = find(options)
    with found.proving():
        return answered(options, base, found)


def find(options: argparse.Namespace) -> tuple[argparse.Namespace, optimize.Found]:
    """Plan the rest of a build; with what was asked, as words of ``optimize``."""
    options.plan = plan_folder(options, options.plan, free=True)
    scene_file = options.plan / "scene.json"
    scene = load_scene(scene_file)
    for name in ("at", "robots"):
        if not (getattr(options, name) or "0").isdecimal():
            raise StepError(f"--{name} {getattr(options, name)}: give a number")
    base = _as_optimize(options, scene_file)
    try:
        return base, optimize.find(base)
    except InfeasibleError as error:
        asked = int(options.robots or 0)
        raise InfeasibleError(f"{error}{_with_another(base, scene, asked)}") from None


def answered(
    options: argparse.Namespace, base: argparse.Namespace, found: optimize.Found
) -> Answer:
    """Write the new plan, and say what it changes."""
    scene = load_scene(options.plan / "scene.json")
    steps = read_plan(scene, options.plan / "plan.csv")
    old = [step for step in steps if step.number > int(options.at)]

    def differs() -> dict[str, object]:
        off = {} if options.measured is None else _off(scene, found.plan)
        return compared(found.plan, old) | off

    facts = found.clock.spare("what the new plan changes", differs, None)
    answer = optimize.answered(base, found)
    if facts is None:
        return answer
    return replace(
        answer,
        facts={**answer.facts, "replanned": facts},
        text="\n".join([*map(wrapped, _in_words(facts)), answer.text]),
    )


def _off(scene: Scene, plan: Plan) -> dict[str, object]:
    """Return how far bricks are off at most, m, and how far grips of the rest may be."""
    planned = {brick.name: brick.position for brick in scene.bricks}
    built = plan.engine.network.scene.bricks
    off, brick = max((math.dist(each.position, planned[each.name]), each.name) for each in built)
    left = plan.tolerances()["tolerance_mm"].min() / 1000
    return {"off_m": off, "off_brick": brick, "tolerance_left_m": float(left)}


def _as_optimize(options: argparse.Namespace, scene_file: Path) -> argparse.Namespace:
    """Return what is asked, as words of ``optimize`` that go on from the step."""
    words = ["optimize", str(scene_file), "--schedule", FREE]
    base = parser("optimize").parse_args(words)
    told = _told(options.plan, lost=bool(options.lost))
    for name, value in vars(options).items():
        usual = told.get(name) if name in ASKED and not value else None
        setattr(base, name, usual or value)
    base.rule = [*told.get("rule", []), *options.rule] if options.rule else base.rule
    base.command, base.scene, base.schedule = "optimize", str(scene_file), FREE
    base.robots = options.robots or ""
    setattr(base, "from", f"{options.plan}:{options.at}")
    base.change = partial(_changed, options)
    base.direction = told.get("direction")
    if base.direction and options.missing:
        raise StepError("--missing: bricks are missing in a build; a take-down removes them anyway")
    return base


def _told(folder: Path, *, lost: bool = False) -> dict[str, Any]:
    """Return what was asked of a plan, as words, as far as words say it.

    ``lost``: whether fewer robots take part from now on, for which the default is another one.
    """
    try:
        told = parse_json(read_text(folder / "summary.json"), "summary")
    except FileError:
        return {}
    if not isinstance(told, dict) or told.get("schedule") != FREE:
        return {}
    rules, limits = (_texts(told.get(name)) for name in ("rules", "limits"))
    if lost and rules.get("least_grips") == _usual_of(told.get("rules")):
        del rules["least_grips"]
    names = ("least_grips", "newest", "payload", "regrips", "ending", "candidates")
    criterion, aims = told.get("criterion"), told.get("aims")
    return {
        "direction": rules.get("direction"),
        "aim": ",".join(map(str, aims if isinstance(aims, list) else ())),
        "criteria": criterion if isinstance(criterion, str) and criterion in CRITERIA else None,
        "rule": [f"{name}={rules[name]}" for name in names if name in rules],
        "limit": [
            f"{TOLERANCE if is_tolerance(name) else name}={value}"  # beside which limits follows
            for name, value in limits.items()
            if name != PROP_EXCESS  # which the scene says
        ],
    }


def _usual_of(rules: object) -> str:
    """Return how many nodes as many robots as took part hold at least by default."""
    team = rules.get("robots") if isinstance(rules, dict) else None
    return str(_usual_grips(len(team))) if isinstance(team, list) else ""


def _texts(told: object) -> dict[str, str]:
    """Return the words and numbers of an object, by name; nothing of what is none."""
    pairs = told.items() if isinstance(told, dict) else ()
    return {name: str(value) for name, value in pairs if isinstance(value, str | int | float)}


def _changed(options: argparse.Namespace, scene: Scene, begin: Place) -> tuple[Scene, Place, str]:
    """Return scene and place after what has changed, and the robots that take part, by name."""
    assert begin.site is not None
    bricks = [_brick(text) for text in options.missing]
    if options.measured is not None:
        scene = _built(scene, begin.site.bricks, options.measured)
    scene, site = without(scene, begin.site, options.lost, bricks)
    left = [robot.name for robot in scene.robots if robot.name not in options.lost]
    return scene, Place(site, None), ",".join(left) if options.lost else ""


def _built(scene: Scene, bricks: int, path: Path) -> Scene:
    """Return a scene whose bricks stand where they were measured."""
    found, stand = read_measured(scene, path), scene.build_order[:bricks]
    early = [name for name in found if name in scene.build_order and name not in stand]
    if early:
        raise StepError(f"--measured {path}: brick {early[0]} does not stand yet; leave it out")
    return as_built(scene, found)


def _brick(text: str) -> int:
    if not text.isdecimal():
        raise StepError(f"--missing {text}: give the number of a brick")
    return int(text)


def _with_another(base: argparse.Namespace, scene: Scene, asked: int) -> str:
    """Return whether one more robot opens a way, as the end of a line."""
    count = max(len(scene.robots), asked) + 1
    try:
        with_robots(scene, count)
        base.robots = str(count)
        found = optimize.find(base)
    except (InfeasibleError, NothingFoundError, StepError):
        return ""
    return f"; or with one more robot that reaches every node: {found.plan.result}"


def _in_words(facts: Mapping[str, Any]) -> Sequence[str]:
    """Return what a new plan changes, in lines."""
    was = facts["as_planned"]
    if was is None:
        line = f"as planned the build cannot go on: {facts['broken']}"
    else:
        values = ", ".join(f"{name} {value_text(name, value)}" for name, value in was.items())
        line = f"as planned the rest takes: {values}"
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
