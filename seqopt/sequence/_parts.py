"""Parts of builds: the state of a site from a file, and the rest of a schedule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from seqopt._files import parse_json, read_text
from seqopt.errors import SceneError, StepError, did_you_mean
from seqopt.scene._checks import LARGEST_NUMBER, as_float, short
from seqopt.scene.scenarios import as_built
from seqopt.scene.scene import Scene, in_order
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.sequence.site import Site
from seqopt.sequence.steps import Step

SAME = 1e-9  # m; closer than this a brick is where it was planned
KEYS = ("bricks", "grips", "last", "regrips", "step", "measured", "ages")


def read_site(scene: Scene, path: Path) -> tuple[Scene, Site]:
    """Return a site from a JSON file, and the scene in an order that begins with its bricks."""
    where = f"state {path}"
    told = parse_json(read_text(path), where, StepError)
    if not isinstance(told, dict) or "bricks" not in told:
        raise StepError(f"{where}: give an object with bricks, and grips by robot")
    for key in told:
        if key not in KEYS:
            hint = did_you_mean(key, KEYS)
            raise StepError(f"{where}: {key} is not known{hint}; give {', '.join(KEYS)}")
    scene, count = _standing(scene, told["bricks"], where)
    scene = _measured(scene, told.get("measured", {}), where)
    grips = _by_robot(scene, told.get("grips"), f"{where}, grips")
    last = _by_robot(scene, told.get("last", {}), f"{where}, last") or ()
    more = {key: told[key] for key in ("regrips", "step") if key in told}
    if any(not isinstance(value, int) or value < 0 for value in more.values()):
        raise StepError(f"{where}: {short(more)}; give whole numbers from 0")
    ages, names = told.get("ages", {}), [str(brick.name) for brick in scene.placed[:count]]
    try:
        if not isinstance(ages, Mapping) or any(name not in names for name in ages):
            raise StepError(f"ages {short(ages)}; give seconds by brick, of those that stand")
        seconds = tuple(ages.get(name, 0.0) for name in names) if ages else ()
        site = Site(count, grips, last, **more, ages=seconds)
        site.holds(scene)
    except (SceneError, StepError) as error:
        raise StepError(f"{where}: {error}") from None
    return scene, site


def _measured(scene: Scene, told: object, where: str) -> Scene:
    """Return a scene with bricks at measured positions, m."""
    points: Mapping[str, Any] = told if isinstance(told, Mapping) else {"": told}
    for name, point in points.items():
        right = isinstance(point, list) and len(point) == 3 and _are_near(point)
        if not (name.isdecimal() and right):
            raise StepError(f"{where}: measured {short(told)}; give x, y, z by brick, m")
    return as_built(scene, {int(n): tuple(map(as_float, at)) for n, at in points.items()})


def _are_near(values: Sequence[object]) -> bool:
    """Return whether coordinates are within `LARGEST_NUMBER`: larger products lose precision."""
    return all(abs(as_float(value)) <= LARGEST_NUMBER for value in values)


def _standing(scene: Scene, told: object, where: str) -> tuple[Scene, int]:
    """Return a scene in an order that begins with the standing bricks, and their number."""
    if isinstance(told, int) and not isinstance(told, bool):
        return scene, told
    known = scene.build_order
    if not isinstance(told, list) or any(name not in known for name in told):
        raise StepError(f"{where}: bricks {short(told)}; give their number, or names of the scene")
    if len({*told}) < len(told):
        raise StepError(f"{where}: a brick of {short(told)} stands there twice; name it once")
    if {*told} == {*known[: len(told)]}:
        return scene, len(told)
    return in_order(scene, (*told, *(name for name in known if name not in told))), len(told)


def _by_robot(scene: Scene, told: object, where: str) -> tuple[int | None, ...] | None:
    """Return the node of each robot; None if none are given."""
    if told is None:
        return None
    names = [robot.name for robot in scene.robots]
    if not isinstance(told, Mapping) or any(name not in names for name in told):
        raise StepError(f"{where}: {short(told)}; give nodes by robot, of {', '.join(names)}")
    return tuple(told.get(name) for name in names)


def what_is_left(schedule: Schedule, done: Sequence[Step], to: Site | None = None) -> Schedule:
    """Return the rest of a schedule after completed steps, whose grips are fixed.

    ``to``: an end before its last step; grips held there are fixed. Raises `StepError` if the
    completed steps do not follow the schedule, or nothing is left.
    """
    last = len(schedule.steps) if to is None else to.step
    if not len(done) < last <= len(schedule.steps):
        raise StepError(
            f"schedule {schedule.method} has {len(schedule.steps)} steps: none is left from "
            f"step {len(done)} to {last}"
        )
    _require_done(schedule, done)
    given = _held(schedule, len(done), done[-1].grips) if done else {}
    if to is not None and to.grips is not None:
        given |= _held(schedule, last, to.grips)
    rest = schedule.steps[len(done) : last]
    left = sorted({move for step in rest for move in step.moves} - {*given})
    number = {move: k for k, move in enumerate(left)}

    def known(grip: object) -> int | OpenGrip | None:
        if isinstance(grip, OpenGrip):
            return given[grip.move] if grip.move in given else OpenGrip(number[grip.move])
        return grip  # type: ignore[return-value]

    steps = tuple(replace(step, grips=tuple(map(known, step.grips))) for step in rest)
    held = [{g for s in steps if k in s.moves for g in s.grips} for k in range(len(left))]
    moves = []
    for k, move in enumerate(schedule.moves[move] for move in left):
        free = tuple(node for node in move.candidates if node not in held[k])
        if not free:
            raise StepError(f"step {move.step}: others hold every node that {move.robot} may hold")
        moves.append(replace(move, candidates=free))
    begin = Site.after(done, done[-1].number) if done else None
    return replace(schedule, steps=steps, moves=tuple(moves), begin=begin)


def _held(schedule: Schedule, count: int, grips: Sequence[int | None]) -> dict[int, int | None]:
    """Return the nodes of moves that are held after a number of steps."""
    planned = schedule.steps[count - 1].grips
    pairs = zip(planned, grips, strict=True)
    return {grip.move: node for grip, node in pairs if isinstance(grip, OpenGrip)}


def _require_done(schedule: Schedule, done: Sequence[Step]) -> None:
    for step, planned in zip(done, schedule.steps, strict=False):
        same = replace(planned, grips=()) == OpenStep(step.number, step.kind, step.bricks, ())
        for node, grip in zip(step.grips, planned.grips, strict=True):
            open_ = isinstance(grip, OpenGrip) and node in schedule.moves[grip.move].candidates
            same &= open_ or node == grip
        if not same:
            raise StepError(
                f"step {step.number} of what was done is none of schedule {schedule.method}; go "
                "on with the free schedule"
            )
