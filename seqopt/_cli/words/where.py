"""Where a build begins and ends, in words: a step of a plan, a state in a file, a brick count."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from seqopt._cli.options import Posed
from seqopt._files import read_text
from seqopt.errors import SeqoptError, StepError
from seqopt.scene.scene import Scene, _parse_order
from seqopt.sequence._parts import _standing, read_site, what_is_left
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.schedule_file import read_plan
from seqopt.sequence.site import Site
from seqopt.sequence.steps import Step

FORMS = "PLAN:STEP (a plan's folder or CSV file), a STATE.json, or a number of bricks"


@dataclass(frozen=True, eq=False, repr=False)
class Place:
    """Where a build begins or ends, and the steps that led there, where they are known."""

    site: Site | None = None
    done: tuple[Step, ...] | None = ()


def asked_place(text: str | None, name: str, scene: Scene) -> tuple[Scene, Place]:
    """Return where an option, ``from`` or ``to``, says that a build begins or ends.

    The scene is returned in an order that begins with the bricks that stand.
    """
    if text is None:
        return scene, Place()
    try:
        return read_place(scene, text, bare=name == "from")
    except StepError as error:
        raise StepError(f"--{name} {text}: {error}") from None


def kept_place(asked: Posed, keep: str, scene: Scene, begin: Place) -> tuple[Scene, Place]:
    """Return where a take-down ends: with the bricks that are to be kept.

    The scene is returned in an order that begins with these.
    """
    where = f"--keep {keep}"
    if asked.to is not None:
        raise StepError(f"{where}: --to {asked.to} says already what stays; leave one out")
    try:
        names = [*_parse_order(scene, keep)]
    except SeqoptError as error:
        raise StepError(f"{where}: {error}") from None
    found, count = _standing(scene, names, where)
    stands = len(scene.placed) if begin.site is None else begin.site.bricks
    if {*found.build_order[:stands]} != {*scene.build_order[:stands]}:
        raise StepError(f"{where}: not all of these stand where it begins; keep what stands")
    return found, Place(Site(count))


def read_place(scene: Scene, text: str, *, bare: bool = True) -> tuple[Scene, Place]:
    """Return a place from words, and the scene in an order that begins with its bricks.

    ``bare``: whether a number of bricks stands for these with nobody holding any.
    """
    if text.isdecimal():
        grips = (None,) * len(scene.robots) if bare else None
        site = Site(int(text), grips)
        site.holds(scene)
        return scene, Place(site, None if site.bricks else ())
    file, _, step = text.rpartition(":")
    if file and step.isdecimal():
        return scene, _of_plan(scene, Path(file), int(step))
    if not text.endswith(".json"):
        raise StepError(f"give {FORMS}")
    found, site = read_site(scene, Path(text))
    return found, Place(site, None)


def _of_plan(scene: Scene, path: Path, step: int) -> Place:
    """Return where a plan stands after a step; robots that it does not know hold nothing."""
    file = path / "plan.csv" if path.is_dir() else path
    columns = read_text(file).partition("\n")[0].split(",")
    known = [robot for robot in scene.robots if f"{robot.name}_node" in columns]
    steps = read_plan(scene.with_robots(*known) if known else scene, file)
    where = [known.index(robot) if robot in known else None for robot in scene.robots]
    if known != [*scene.robots]:
        steps = tuple(
            replace(s, grips=tuple(None if k is None else s.grips[k] for k in where)) for s in steps
        )
    site = Site.after(steps, step)
    done = tuple(each for each in steps if each.number <= step)
    return Place(site, done if steps[0].number == 1 else None)


def between(moves: Schedule | FreeRules, begin: Place, end: Place) -> Schedule | FreeRules:
    """Return the moves that are left between two places."""
    if begin.site is None and end.site is None:
        return moves
    if isinstance(moves, FreeRules):
        return replace(moves, begin=begin.site, finish=end.site)
    if begin.done is None or end.done is None:
        raise StepError(
            f"schedule {moves.method}: it goes on, and ends, at a step of a plan of its own; give "
            "PLAN:STEP, or --schedule free"
        )
    return what_is_left(moves, begin.done, end.site)
