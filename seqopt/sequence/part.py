"""The part of a build that is asked: between which states, after which changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from seqopt._registry import required
from seqopt.errors import StepError, did_you_mean
from seqopt.network.network import Network
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene, in_order
from seqopt.sequence.methods import SCHEDULES, robot_loop
from seqopt.sequence.rules import FREE
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Site, Step

MOST = 3  # robots that take part where nobody says who: as many as in the loop of Bruun et al.


@dataclass(frozen=True, eq=False, repr=False)
class _Place:
    """Where a build begins or ends, and the steps that led there, if known."""

    site: Site | None = None
    done: tuple[Step, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Part:
    """Which steps a build may have, between which states, after which changes.

    Parameters
    ----------
    schedule : Schedule, pathlib.Path or str, optional
        free: any robot may release, hold or place next, or a sequence with open grips, by name (of
        all robots), or a CSV file of steps; open grips are marked ? in it (default: the loop of
        three robots, or of two where there is no third).
    begin : Site, int or str, optional
        Where the build begins: after a step of a plan (its folder or CSV file, of one step too);
        or with so many bricks that nobody holds.
    to : Site, int or str, optional
        Where it ends, said in the same ways; a number of bricks, of a take-down those that stay,
        leaves grips to the rule ending.
    direction : str, optional
        Of a free schedule: take-down removes bricks, the newest first, from the whole structure to
        the empty site, if nothing else is said.
    lost : sequence of str, optional
        Robot that lets go where the build begins, and takes no further part.
    missing : sequence of int, optional
        Brick that is not there: one that stood is placed again next, one that was still to come
        waits until all are placed that do not hang on it.

    Examples
    --------
    >>> import seqopt
    >>> seqopt.optimize("chain:bricks=7", Part(schedule="free", to=4)).steps[-1].bricks
    4
    """

    schedule: Schedule | Path | str | None = None
    begin: Site | _Place | int | str | None = None
    to: Site | _Place | int | str | None = None
    direction: str | None = None
    lost: Sequence[str] = ()
    missing: Sequence[int | str] = ()

    def find_begin(self, scene: Scene) -> _Place:
        """Return where it begins; changes need a build that goes on."""
        begin = _find_place(self.begin, "begin", scene)
        if alone := [each for each in (self.lost, self.missing) if isinstance(each, str | int)]:
            raise StepError(f"lost or missing {alone[0]}: give a list, as [{alone[0]!r}]")
        if wrong := [name for name in self.missing if not str(name).isdecimal()]:
            raise StepError(f"missing {wrong[0]}: give the number of a brick")
        changes = (*(("lost", n) for n in self.lost), *(("missing", n) for n in self.missing))
        if changes and begin.site is None:
            text = "a build that goes on has changed; say where it begins"
            raise StepError("{} {}: {}".format(*changes[0], text))
        return begin


def _find_place(given: Site | _Place | int | str | None, name: str, scene: Scene) -> _Place:
    """Return where a build begins or ends; ``name``: what of a part says it, for messages."""
    text = str(given)
    try:
        if given is None or isinstance(given, Site | _Place):
            return _Place(given) if isinstance(given, Site) else given or _Place()
        if text.isdecimal():
            site = Site(int(text), (None,) * len(scene.robots) if name == "begin" else None)
            site.holds(scene)
            return _Place(site)
        file, _, step = text.rpartition(":")
        if file and step.isdecimal():
            steps = required("_read_listed")(scene, Path(file))
            site = Site.after(steps, int(step))
            whole = steps[0].number == 1
            return _Place(site, tuple(s for s in steps if s.number <= site.step) if whole else ())
        raise StepError("give PLAN:STEP (a plan's folder or CSV file), or a number of bricks")
    except StepError as error:
        raise StepError(f"{name} {text}: {error}") from None


def find_schedule(
    network: Network, schedule: Schedule | Path | str | None = None, robots: Sequence[str] = ()
) -> Schedule:
    """Return a schedule by name, from a file, or unchanged; by default the loop of all robots."""
    if schedule is None:
        return robot_loop(network, robots or min(len(network.scene.robots), MOST))
    if isinstance(schedule, str) and schedule in SCHEDULES:
        return SCHEDULES[schedule](network, robots)
    if robots:
        raise StepError(
            f"robots {', '.join(robots)}: only a schedule by name takes them "
            f"({', '.join(SCHEDULES)}); one of your own says itself who holds; leave them out"
        )
    if isinstance(schedule, Schedule):
        if schedule.scene != network.scene:
            raise StepError(
                f"schedule {schedule.method}: it is of scene {schedule.scene.name}, not of this "
                f"{network.scene.name}; make it from the network of this scene"
            )
        return schedule
    known = f"{', '.join(SCHEDULES)}, or a CSV file, or {FREE}"
    if not isinstance(schedule, str | Path):
        raise StepError(f"schedule {short(schedule)}: give a Schedule, or one of {known}")
    path = Path(schedule)
    if isinstance(schedule, str) and not path.suffix and not path.exists():
        raise StepError(
            f"schedule {schedule!r} does not exist{did_you_mean(schedule, (*SCHEDULES, FREE))}; "
            f"give one of {known}"
        )
    opened: Schedule = required("read_schedule")(network, path)
    return opened


def without(
    scene: Scene, site: Site, lost: Sequence[str] = (), missing: Sequence[int] = ()
) -> tuple[Scene, Site]:
    """Return scene and site without robots that are lost, and without bricks that are missing.

    A lost robot releases its node and is not used again. A missing brick that stood is placed
    again next; a later one waits for all bricks that are not connected through it. Grips on
    missing bricks are released.
    """
    names = [robot.name for robot in scene.robots]
    for name in lost:
        if name not in names:
            raise StepError(f"robot {name} does not exist; give some of {', '.join(names)}")
    for brick in missing:
        if brick not in scene.build_order:
            raise StepError(f"brick {brick} does not exist; name a brick of scene {scene.name}")
    stood, later = scene.build_order[: site.bricks], scene.build_order[site.bricks :]
    stands = tuple(name for name in stood if name not in missing)
    again = tuple(name for name in stood if name in missing)
    last = tuple(name for name in later if name in missing)
    rest = tuple(name for name in later if name not in missing)
    held = tuple(
        None if name in lost or (node and scene.brick_of_node[node].name in again) else node
        for name, node in zip(names, site.holds(scene), strict=True)
    )
    before, after = _while_missing(scene, {*stands, *again}, rest)
    order = (*stands, *again, *before, *last, *after)
    made = scene if order == scene.build_order else in_order(scene, order)
    ages = tuple(a for n, a in zip(stood, site.ages, strict=False) if n not in missing)
    return made, replace(site, bricks=len(stands), grips=held, ages=ages)


def _while_missing(
    scene: Scene, stand: set[int], rest: Sequence[int]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return bricks tied to the standing part or the ground, and those that wait."""
    beside: dict[int, set[int]] = {name: set() for name in scene.build_order}
    for first, second in (joint.bricks for joint in scene.joints):
        beside[first].add(second)
        beside[second].add(first)
    grounded = {ground.brick for ground in scene.grounds if ground.closes_with is None}
    placed, waiting = list[int](), list(rest)
    while True:
        tied = next((b for b in waiting if b in grounded or beside[b] & {*stand, *placed}), None)
        if tied is None:
            return tuple(placed), tuple(waiting)
        placed.append(tied)
        waiting.remove(tied)
