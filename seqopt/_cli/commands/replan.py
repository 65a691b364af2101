"""The command ``replan``: the rest of a build, after something has changed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from seqopt._cli.answer import Answer, Result
from seqopt._cli.commands import optimize
from seqopt._cli.commands.optimize import Found
from seqopt._cli.inputs import plan_folder
from seqopt._cli.outputs import ALWAYS, Output
from seqopt._cli.signatures import Call, door
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Bricks, BuiltFrom, Changed, Folder, Timed, Words, listed, shown
from seqopt._files import parse_json, read_text
from seqopt.contact.mortar import Mortar
from seqopt.errors import FileError, InfeasibleError, NothingFoundError, StepError
from seqopt.exchange.exports import read_folder
from seqopt.exchange.imports import read_measured
from seqopt.plan.plan import Plan
from seqopt.plan.replan import compared, without
from seqopt.problem.requirements import Criterion, Limit
from seqopt.problem.standing import Standing
from seqopt.responses._tolerance import is_tolerance, values_text
from seqopt.responses.quantities import PROP_EXCESS, TOLERANCE, length_text
from seqopt.scene.scenarios import SAME, as_built
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.rules import FREE, FreeRules, _usual_grips, with_robots
from seqopt.study.published import CRITERIA
from seqopt.work.progress import Tell
from seqopt.workflow import Part, Search, _find_start, _Place
from seqopt.workflow import optimize as plan_build

NOTHING, USUAL = Changed(), Search()


@door
def replan(  # noqa: PLR0913  # every option is a parameter
    plan: Annotated[BuiltFrom, ("value", "PLAN_DIR|SCENE")] = "arch25",
    *,
    criterion: Criterion | str | None = None,
    aim: Words | None = None,
    limits: Sequence[Limit | str] | Limit | str = (),
    rules: FreeRules | Words = (),
    stands: Standing | Mortar | str | None = None,
    engine: str | None = None,
    mortar: Mortar | str | None = None,
    stability: bool = True,
    search: Search = USUAL,
    progress: Tell = shown,
    at: int | str = 1,
    lost: Words = (),
    missing: Bricks = (),
    changed: Changed = NOTHING,
    to: _Place | int | str | None = None,
    robots: Annotated[int | str | None, ("value", "N"), ("parse", str)] = None,
    out: Folder | None = None,
) -> Result[Plan]:
    """Plan the rest of a build from one of its steps, after something has changed.

    A robot is lost, carries less or is new, a brick is missing. Any robot may release, hold or
    place next; aims, criterion and rules are by default those of the plan.

    Parameters
    ----------
    plan : pathlib.Path, Plan, Scene or str, optional
        Folder that optimize wrote: its plan, scene and summary; in place of it a scene, for which
        the best free schedule is planned first.
    criterion, aim, limits, rules, stands, engine, mortar, stability, search, progress : optional
        As of `optimize`; criterion, aims, limits and rules are by default those of the plan.
    at : int, optional
        Number of the last step that was done (default: {default}).
    lost : str or sequence of str, optional
        Robot that lets go and takes no further part.
    missing : int or sequence of int, optional
        Brick that is not there: one that stood is placed again next, one that was still to come
        waits until all are placed that do not hang on it.
    changed : Changed, optional
        What else is other than planned: ``payload``, ``grips``, ``durations``, ``measured``, which
        may be given in its place.
    to : int or str, optional
        Where the build ends, as of optimize.
    robots : int, optional
        How many robots there are from now on; new ones reach every node.
    out : pathlib.Path or str, optional
        Folder to write the new plan to.

    Returns
    -------
    Plan
        The plan of the rest.

    Examples
    --------
    >>> import seqopt
    >>> plan = seqopt.optimize("wall:columns=2,courses=2", "free")
    >>> replan(plan, at=2, lost=["rob3"], rules="least_grips=1").steps[0].number
    3

    $ seqopt replan free --at 12 --lost rob3 --rule least_grips=1
    $ seqopt replan free --at 12 --payload rob1=250 --out weaker
    $ seqopt replan free --at 12 --robots 4 --missing 9
    """
    for name, text in (("at", at), ("robots", robots or "0")):
        if not str(text).isdecimal():
            raise StepError(f"--{name} {text}: give a number")
    Output(out).require(*ALWAYS)
    folder, notes = plan_folder(plan, search.cache, progress, free=True)
    measured = None if changed.measured is None else Path(changed.measured)
    change = Change([*lost], listed(missing), measured, int(at))
    told = _told(folder, lost=bool(lost))
    if told.get("direction") and missing:
        raise StepError("--missing: bricks are missing in a build; a take-down removes them anyway")
    words: dict[str, Any] = {"engine": engine, "mortar": mortar, "stands": stands, "search": search}
    words |= {"aim": aim or told.get("aim"), "criterion": criterion or told.get("criterion")}
    words |= {"limits": limits or told.get("limits", ())}
    words |= {
        "rules": rules if isinstance(rules, FreeRules) else (*told.get("rules", ()), *[*rules])
    }

    other: dict[str, Any] = {**vars(changed)}
    del other["measured"]
    built = Timed(scene=folder / "scene.json", **other)

    def find(count: int | str | None) -> Found:
        def start() -> dict[str, Any]:
            found, begin, left = change.start(folder, built.read(count), stands)
            part = Part(schedule=FREE, begin=begin, to=to, direction=told.get("direction"))
            return {"scene": found, "schedule": part, "robots": left or None}

        call = Call(plan_build, words)
        return optimize.find(call, progress, stability=stability, out=out, more=start)

    new = _find_or_say(find, robots, folder)

    def answer() -> Answer[Plan]:
        found = _answer(folder, change, new)
        return replace(found, notes=(*notes, *found.notes))

    return Result(new.plan, answer)


def _find_or_say(
    find: Callable[[int | str | None], Found], robots: int | str | None, folder: Path
) -> Found:
    """Return the rest of a build; if there is none, say whether one more robot finds it."""
    try:
        return find(robots)
    except InfeasibleError as error:
        more, scene = "", load_scene(folder / "scene.json")
        count = max(len(scene.robots), int(robots or 0)) + 1
        with suppress(InfeasibleError, NothingFoundError, StepError):
            with_robots(scene, count)
            another = find(count).plan
            more = f"; or with one more robot that reaches every node: {another.result}"
        raise InfeasibleError(f"{error}{more}") from None


@dataclass(frozen=True)
class Change:
    """What changed when a build had come to a step."""

    lost: Sequence[str]
    missing: Sequence[str | int]
    measured: Path | None
    at: int

    def start(
        self, folder: Path, scene: Scene, stands: Standing | Mortar | str | None
    ) -> tuple[Scene, _Place, tuple[str, ...]]:
        """Return scene and place after the changes, and the names of participating robots."""
        scene, begin = _find_start(scene, f"{folder}:{self.at}", stands)
        assert begin.site is not None
        if wrong := [text for text in self.missing if not str(text).isdecimal()]:
            raise StepError(f"--missing {wrong[0]}: give the number of a brick")
        if self.measured is not None:
            found = read_measured(scene, self.measured)
            stand = scene.build_order[: begin.site.bricks]
            if early := [name for name in found if name in scene.build_order and name not in stand]:
                why = f"brick {early[0]} does not stand yet; leave it out"
                raise StepError(f"--measured {self.measured}: {why}")
            scene = as_built(scene, found)
        scene, site = without(scene, begin.site, self.lost, [*map(int, self.missing)])
        left = tuple(robot.name for robot in scene.robots if robot.name not in self.lost)
        return scene, _Place(site), left if self.lost else ()


def _answer(folder: Path, change: Change, new: Found) -> Answer[Plan]:
    """Write the new plan, and return its changes."""
    scene, steps = read_folder(folder)
    old = [step for step in steps if step.number > change.at]

    def differs() -> dict[str, object]:
        changes = compared(new.plan, old)
        if change.measured is None:
            return changes
        planned = {brick.name: brick.position for brick in scene.bricks}
        built = new.plan.engine.network.scene.bricks
        off, brick = max((math.dist(b.position, planned[b.name]), b.name) for b in built)
        left = float(new.plan.tolerances()["tolerance_mm"].min() / 1000)
        return changes | {"off_m": off, "off_brick": brick, "tolerance_left_m": left}

    facts = new.clock.spare("what the new plan changes", differs, None)
    answer = optimize.answered(new)
    if facts is None:
        return answer
    return replace(
        answer,
        facts={**answer.facts, "replanned": facts},
        text="\n".join([*map(wrapped, _in_words(facts)), answer.text]),
    )


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
